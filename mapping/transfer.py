"""Transfer of face fields to target cells: averages for states, conservation for contents."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lcmchain.mapping.averages import contents_of_cells, contents_of_faces, mean_over_cells
from lcmchain.mapping.orientation import MappedDirections, map_directions
from lcmchain.mapping.permeability import map_permeability
from lcmchain.mapping.sheet import PERMEABILITIES, PERMEABILITY_AXES, Sheet
from lcmchain.mapping.solids.fields import solid_scalars
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import MappingWeights

# Faces agree on the density of the fibres when they differ by no more than storing them does.
ONE_DENSITY = 1e-4

# Fields that count something per area; its total over the covered area is kept.
CONTENTS = ("areal_fibre_mass",)

# What the error that the mapping adds to a field is called, after the name of the field.
ERROR = "_mapping_error"

# The permeability has one error, that of its tensor.
PERMEABILITY = "permeability"

# Angles between axes, counted about the normal: seen from the other side they change their sign.
ABOUT_NORMAL = frozenset({"shear_angle", "shear_angle_23", "shear_angle_31"})


@dataclass(frozen=True)
class MappedFields:
    """Fields on the target: scalars (C,), directions (C, 3); not a number where unmapped.

    axes : principal axes (C, 3), which are unit vectors without a sense.
    about_sheet : whether signed angles are about the normal of the sheet, as in solid cells, rather
        than about that of the cell.
    errors : that the mapping adds to fields, by their names, shape (C,); where it was verified.
    at_nodes : the same fields at the nodes (N,) of the target, where that was asked for.
    """

    scalars: dict[str, np.ndarray]
    directions: dict[str, MappedDirections]
    axes: dict[str, np.ndarray] = field(default_factory=dict)
    about_sheet: bool = False
    errors: dict[str, np.ndarray] = field(default_factory=dict)
    at_nodes: MappedFields | None = None

    @property
    def vectors(self) -> dict[str, np.ndarray]:
        """Every vector field (C, 3) by name."""
        return {name: found.direction for name, found in self.directions.items()} | self.axes


def transfer(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry every field of the sheet to the target.

    The fibre volume fraction is that of the mapped fibre mass in the mapped thickness.
    """
    if sheet.is_stack:
        from lcmchain.mapping.plies import transfer_plies

        return transfer_plies(sheet, target, weights)
    return carried(sheet, weights, None if target.is_solid else target.surface.normals)


def carried(sheet: Sheet, weights: MappingWeights, normals: np.ndarray | None) -> MappedFields:
    """Carry every field of one ply to the cells, or to the nodes, that weights are for.

    normals : unit normals of the cells (C, 3); None for solids, which have none.
    """
    scalars = {
        name: (
            transfer_content(sheet, weights, values)
            if name in CONTENTS and weights.conservative
            else transfer_average(sheet, weights, values)
        )
        for name, values in sheet.scalars.items()
    }
    if len(weights.solid_thickness):
        scalars |= solid_scalars(sheet, weights, scalars, fibre_density(sheet))
    else:
        scalars |= _fibre_volume_fraction(sheet, scalars, weights.solid_thickness)
    if normals is not None:
        for name in ABOUT_NORMAL & scalars.keys():
            scalars[name] = facing(sheet, weights, normals) * scalars[name]
    directions = {
        name: map_directions(
            sheet.surface, weights, values, normals if lies_in(sheet, values) else None
        )
        for name, values in sheet.directions.items()
    }
    axes = {}
    if sheet.permeability is not None:
        found = map_permeability(sheet.surface, weights, sheet.permeability, normals)
        scalars |= dict(zip(PERMEABILITIES, found.values.T.copy(), strict=True))
        axes = {name: found.axes[:, row].copy() for row, name in enumerate(PERMEABILITY_AXES)}
    return MappedFields(scalars, directions, axes, about_sheet=normals is None)


def facing(sheet: Sheet, weights: MappingWeights, normals: np.ndarray) -> np.ndarray:
    """Whether cells show the upper side of the sheet (1.0) or the lower one (-1.0), shape (C,).

    normals : unit normals of the cells, shape (C, 3).
    """
    of_sheet = weights.average_matrix @ sheet.surface.normals
    return np.where(np.einsum("ci,ci->c", of_sheet, normals) < 0.0, -1.0, 1.0)


def turned(mapped: MappedFields, rotation: np.ndarray) -> MappedFields:
    """Turn directions and axes by a rotation matrix, shape (3, 3)."""
    return replace(
        mapped,
        directions={
            name: found._replace(direction=found.direction @ rotation.T)
            for name, found in mapped.directions.items()
        },
        axes={name: vectors @ rotation.T for name, vectors in mapped.axes.items()},
        at_nodes=None if mapped.at_nodes is None else turned(mapped.at_nodes, rotation),
    )


def fibre_mass(weights: MappingWeights, mapped: MappedFields) -> np.ndarray | None:
    """Fibre mass of each cell [kg], shape (C,); None where the mapping does not keep it."""
    if "areal_fibre_mass" not in mapped.scalars or not weights.conservative:
        return None
    return mapped.scalars["areal_fibre_mass"] * content_areas(weights)


def with_fibre_mass(
    sheet: Sheet, weights: MappingWeights, mapped: MappedFields, mass: np.ndarray
) -> MappedFields:
    """Give cells a fibre mass [kg], shape (C,), and the volume fraction that follows from it."""
    areas = content_areas(weights)
    there = areas > 0.0
    areal = mapped.scalars["areal_fibre_mass"].copy()
    areal[there] = mass[there] / areas[there]
    scalars = {**mapped.scalars, "areal_fibre_mass": areal}
    fraction = _fibre_volume_fraction(sheet, scalars, weights.solid_thickness)
    return replace(mapped, scalars=scalars | fraction)


def _fibre_volume_fraction(
    sheet: Sheet, scalars: dict[str, np.ndarray], solid_thickness: np.ndarray
) -> dict[str, np.ndarray]:
    """Volume fraction of the mapped fibre mass in the thickness, if the density is known.

    solid_thickness : of solid cells themselves [m], shape (C,); empty for surfaces, which have the
        mapped one.
    """
    density = fibre_density(sheet)
    if density is None:
        return {}
    thickness = solid_thickness if len(solid_thickness) else scalars["thickness"]
    fraction = scalars["areal_fibre_mass"] / (density * thickness)
    return {"fibre_volume_fraction": fraction}


def fibre_density(sheet: Sheet) -> float | None:
    """Density of the fibres [kg/m3], as mass, thickness and fibre volume fraction of faces tell it.

    None where one of these fields is absent, or the faces do not agree, as for several textiles.
    """
    if not {"areal_fibre_mass", "thickness", "fibre_volume_fraction"} <= sheet.scalars.keys():
        return None
    mass, thickness, fraction = (
        sheet.scalars[name] for name in ("areal_fibre_mass", "thickness", "fibre_volume_fraction")
    )
    volume = thickness * fraction
    told = np.flatnonzero((volume > 0.0) & (mass > 0.0))
    if len(told) == 0 or np.any((volume > 0.0) != (mass > 0.0)):
        return None
    densities = mass[told] / volume[told]
    density = float(np.median(densities))
    return density if np.all(np.abs(densities / density - 1.0) < ONE_DENSITY) else None


def lies_in(sheet: Sheet, directions: np.ndarray) -> bool:
    """Whether a family runs along the sheet, as fibres do, rather than through its thickness."""
    out_of_plane = np.einsum("fi,fi->f", directions, sheet.surface.normals)
    return bool(np.median(np.abs(out_of_plane)) < np.sqrt(0.5))


def transfer_average(sheet: Sheet, weights: MappingWeights, values: np.ndarray) -> np.ndarray:
    """Mean of a face field, shape (F,), over the part of the sheet over each cell, shape (C,)."""
    return mean_over_cells(sheet.surface, weights, values)


def transfer_content(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> np.ndarray:
    """Content per area of a cell's covered part, such that the total content is kept.

    The sum over cells of value times covered area equals the content of the covered part of the
    sheet. Cells beyond its edge take the value of the closest face and add nothing.
    """
    content = contents_of_cells(sheet.surface, weights, per_area)
    covered_area = covered_areas(weights)
    nearest = transfer_average(sheet, weights, per_area)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(covered_area > 0.0, content / covered_area, nearest)


def content_areas(weights: MappingWeights) -> np.ndarray:
    """Area of each cell that its areal mass belongs to [m2], shape (C,).

    Of a surface it is what the sheet covers; a solid that the sheet covers in part has its mass
    spread over all of its volume.
    """
    return weights.cell_area if len(weights.solid_thickness) else covered_areas(weights)


def covered_areas(weights: MappingWeights) -> np.ndarray:
    """Area of each cell that the sheet covers [m2], shape (C,)."""
    return np.minimum(weights.coverage, 1.0) * weights.cell_area


def content_of_cells(weights: MappingWeights, per_area: np.ndarray) -> float:
    """Content of all cells."""
    covered = content_areas(weights)
    return float(np.nansum(np.where(covered > 0.0, per_area * covered, 0.0)))


def content_of_sheet(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> float:
    """Content of the covered part of the sheet."""
    if not weights.conservative:
        return float(np.sum(per_area * sheet.surface.areas * weights.face_coverage))
    return float(contents_of_faces(sheet.surface, weights, per_area).sum())
