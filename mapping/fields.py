"""Fields of one ply on the target: means for states, conservation for contents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.sheet import (
    HEIGHT,
    ORDER,
    PERMEABILITIES,
    PERMEABILITY_AXES,
    SHARE,
    Sheet,
)
from lcmchain.mapping.surfaces.averages import (
    MappedDirections,
    contents_of_cells,
    contents_of_faces,
    map_directions,
    map_permeability,
    mean_over_cells,
)
from lcmchain.mapping.surfaces.search import closest_points
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import MappingWeights, Status
from lcmchain.quantities.fields import ANGLE_ABOUT_NORMAL, FIELDS, TOTAL

# Faces agree on the density of the fibres when they differ by no more than storing them does.
ONE_DENSITY = 1e-4

# Fields that count something per area; its total over the covered area is kept.
CONTENTS = tuple(name for name, field in FIELDS.items() if field.mapped == TOTAL)

# Ending of the name of the error that the mapping adds to a field.
ERROR = "_mapping_error"

# The permeability has one error, that of its tensor.
PERMEABILITY = "permeability"

# Angles between axes, counted about the normal: seen from the other side they change their sign.
ABOUT_NORMAL = frozenset(
    name for name, field in FIELDS.items() if field.mapped == ANGLE_ABOUT_NORMAL
)


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


def carried(
    sheet: Sheet, weights: MappingWeights, planes: tuple[np.ndarray, np.ndarray] | None
) -> MappedFields:
    """Carry every field of one ply to the cells, or to the nodes, that weights are for.

    A sheet that is itself a mapped stack has fields of its plies beside its own; they are carried
    as those of a ply are.

    planes : centres [m] and unit normals of the cells, (C, 3) each; None for solids.
    """
    whole = _carried(sheet, weights, None if planes is None else planes[1])
    names = [name.removeprefix(SHARE) for name in sheet.scalars if name.startswith(SHARE)]
    if not names:
        return whole
    scalars = dict(whole.scalars)
    if planes is None:  # solids have the plies inside of them
        for name in (ORDER, *(f"{HEIGHT}{ply}" for ply in names)):
            scalars.pop(name, None)
        return replace(whole, scalars=scalars)
    for ply in sorted(names, key=len):  # a ply's name may begin with that of another
        begin = f"{ply}_"
        own = {n.removeprefix(begin): v for n, v in sheet.scalars.items() if n.startswith(begin)}
        alone = replace(sheet, scalars=own, directions={}, permeability=None)
        found = _carried(alone, weights, planes[1]).scalars
        scalars |= {f"{begin}{name}": values for name, values in found.items() if name in own}
    side, off = facing(sheet, weights, planes[1]), heights(sheet, weights, *planes)
    for name in (f"{HEIGHT}{ply}" for ply in names):
        if name in scalars:
            scalars[name] = side * scalars[name] + off
    if ORDER in scalars:
        scalars[ORDER] = side * np.where(np.isnan(off), np.nan, np.sign(scalars[ORDER]))
    return replace(whole, scalars=scalars)


def heights(
    sheet: Sheet, weights: MappingWeights, centres: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Distance of the mid-surface from places along their normals [m], shape (C,)."""
    places = [mean_over_cells(sheet.surface, weights, x) for x in sheet.surface.centroids.T]
    return np.einsum("ci,ci->c", np.stack(places, axis=1) - centres, normals)


def _carried(sheet: Sheet, weights: MappingWeights, normals: np.ndarray | None) -> MappedFields:
    scalars = {
        name: (
            _transfer_content(sheet, weights, values)
            if name in CONTENTS and weights.conservative
            else transfer_average(sheet, weights, values)
        )
        for name, values in sheet.scalars.items()
    }
    if len(weights.solid_thickness):
        scalars |= _solid_scalars(sheet, weights, scalars, fibre_density(sheet))
    else:
        scalars |= _fibre_volume_fraction(sheet, scalars, weights.solid_thickness)
    if normals is not None:
        for name in ABOUT_NORMAL & scalars.keys():
            scalars[name] = facing(sheet, weights, normals) * scalars[name]
    directions = {
        name: map_directions(
            sheet.surface, weights, values, normals if _lies_in(sheet, values) else None
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
    return mapped.scalars["areal_fibre_mass"] * _content_areas(weights)


def with_fibre_mass(
    sheet: Sheet, weights: MappingWeights, mapped: MappedFields, mass: np.ndarray
) -> MappedFields:
    """Give cells a fibre mass [kg], shape (C,), and the volume fraction that follows from it."""
    areas = _content_areas(weights)
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


def _lies_in(sheet: Sheet, directions: np.ndarray) -> bool:
    """Whether a family runs along the sheet, as fibres do, rather than through its thickness."""
    out_of_plane = np.einsum("fi,fi->f", directions, sheet.surface.normals)
    return bool(np.median(np.abs(out_of_plane)) < np.sqrt(0.5))


def transfer_average(sheet: Sheet, weights: MappingWeights, values: np.ndarray) -> np.ndarray:
    """Mean of a face field, shape (F,), over the part of the sheet over each cell, shape (C,)."""
    return mean_over_cells(sheet.surface, weights, values)


def _transfer_content(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> np.ndarray:
    """Content per area of a cell's covered part, such that the total content is kept.

    The sum over cells of value times covered area equals the content of the covered part of the
    sheet. Cells beyond its edge take the value of the closest face and add nothing.
    """
    content = contents_of_cells(sheet.surface, weights, per_area)
    covered_area = covered_areas(weights)
    nearest = transfer_average(sheet, weights, per_area)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(covered_area > 0.0, content / covered_area, nearest)


def _content_areas(weights: MappingWeights) -> np.ndarray:
    """Area of each cell that its areal mass belongs to [m2], shape (C,).

    For a surface it is what the sheet covers. A solid that the sheet covers in part has its mass
    spread over all of its volume.
    """
    return weights.cell_area if len(weights.solid_thickness) else covered_areas(weights)


def covered_areas(weights: MappingWeights) -> np.ndarray:
    """Area of each cell that the sheet covers [m2], shape (C,)."""
    return np.minimum(weights.coverage, 1.0) * weights.cell_area


def content_of_cells(weights: MappingWeights, per_area: np.ndarray) -> float:
    """Content of all cells."""
    covered = _content_areas(weights)
    return float(np.nansum(np.where(covered > 0.0, per_area * covered, 0.0)))


def content_of_sheet(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> float:
    """Content of the covered part of the sheet."""
    if not weights.conservative:
        return float(np.sum(per_area * sheet.surface.areas * weights.face_coverage))
    return float(contents_of_faces(sheet.surface, weights, per_area).sum())


# --- solid cells, whose own thickness counts ------------------------------------------------------

#: Attributes of the fields that a mapping onto solids adds.
ATTRIBUTES: dict[str, dict[str, Any]] = {
    "solid_thickness": {
        "units": "m",
        "long_name": "thickness of the solid mesh itself",
        "comment": "volume by area along the normals of the sheet, through all cells of a column",
    },
    "thickness_difference": {
        "units": "1",
        "long_name": "thickness of the solid mesh over that of the formed textile, minus one",
    },
}


def _solid_scalars(
    sheet: Sheet,
    weights: MappingWeights,
    averages: Mapping[str, np.ndarray],
    density: float | None,
) -> dict[str, np.ndarray]:
    """Fields of solid cells in which the thickness of the solid counts, each of shape (C,).

    The fibre mass of a cell is what its part of the columns holds; by the cell's volume it is the
    fibre volume fraction, and times the thickness of the solid the areal mass. Both therefore
    sum to the mass of the covered sheet over the volume, or the area, of all cells. A cell that
    reaches beyond the sheet holds less, one that lies beyond it nothing.

    Parameters
    ----------
    averages : means of the fields over the cells; names that are not among them are not made.
    density : of the fibres [kg/m3]; where the faces do not agree on one, the fibre volume of each
        is that of its thickness and fibre volume fraction.
    """
    solid = np.where(weights.mapped, weights.solid_thickness, np.nan)
    fields = {}
    if "thickness" in averages:
        formed = np.where(weights.mapped, averages["thickness"], np.nan)
        fields = {
            "thickness": formed,
            "solid_thickness": solid,
            "thickness_difference": solid / formed - 1.0,
        }
    if "areal_fibre_mass" not in averages:
        return fields
    mass = _contents(sheet, weights, sheet.scalars["areal_fibre_mass"])
    with np.errstate(invalid="ignore", divide="ignore"):  # of a cell without the ply
        fields["areal_fibre_mass"] = mass / weights.cell_area
        if density is not None:
            fields["fibre_volume_fraction"] = mass / (density * weights.cell_area * solid)
        elif {"fibre_volume_fraction", "thickness"} <= averages.keys():
            per_area = sheet.scalars["thickness"] * sheet.scalars["fibre_volume_fraction"]
            volume = _contents(sheet, weights, per_area)
            fields["fibre_volume_fraction"] = volume / (weights.cell_area * solid)
    return fields


def require_thickness(target: TargetMesh, fields: Mapping[str, np.ndarray], limit: float) -> None:
    """Refuse a solid that is thicker or thinner than the formed textile.

    Parameters
    ----------
    fields : mapped scalars, each of shape (C,).
    limit : largest relative difference of the thicknesses, 1.

    Raises
    ------
    InputError : names the worst cell, both thicknesses and what to do.
    """
    if "thickness_difference" not in fields:
        return
    formed, solid = fields["thickness"], fields["solid_thickness"]
    difference = np.abs(fields["thickness_difference"])
    difference = np.where(np.isfinite(difference), difference, 0.0)
    beyond = int(np.sum(difference > limit))
    if not beyond:
        return
    worst = int(np.argmax(difference))
    more = "thicker" if solid[worst] > formed[worst] else "thinner"
    own, wanted = (f"{1e3 * values[worst]:.3g} mm" for values in (solid, formed))
    raise InputError(
        f"the solid mesh is up to {100.0 * difference[worst]:.3g} % {more} than the formed textile "
        f"(cell {worst}: {own} against {wanted}; {beyond} of {target.cell_count} cells differ by "
        f"more than {100.0 * limit:.3g} %). Mesh the part with the formed thickness, {wanted} "
        "there, or raise thickness_limit on purpose: the fibre volume fraction is then that of the "
        "formed fibre mass in the thickness of the solid",
        file=target.file,
    )


def _contents(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> np.ndarray:
    """Content of each cell, from one per area of the faces, shape (C,); nan where unmapped."""
    return np.where(weights.mapped, contents_of_cells(sheet.surface, weights, per_area), np.nan)


# --- nodes of the target: values of the sheet at the place closest to each ------------------------


def transfer_to_nodes(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry every field of the sheet to the nodes of the target, shape (N,) each.

    Values are those of the sheet at the closest place of the layer that the cells around the node
    take from; beyond the edge of the sheet those at its edge. Contents are not kept: nodes have no
    area. Not a number where no cell around a node is mapped.

    weights : of the cells of the target.

    Raises
    ------
    InputError : the sheet is a stack, whose plies lie at other places than its fields.
    """
    if sheet.is_stack:
        raise InputError(
            "is a stack of plies, whose values at nodes are not written; leave nodes out "
            "(--nodes), the values of the cells are written",
            file=sheet.name,
        )
    planes = None
    if not target.is_solid:
        planes = target.points, _around_nodes(target, target.surface.normals)
    return carried(sheet, _node_weights(sheet, target, weights), planes)


def _node_weights(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappingWeights:
    """One weight for each node near the sheet: the face with the closest place on it."""
    surface = sheet.surface
    sides = weights.average_matrix @ (surface.normals * surface.winding.side[:, None])
    mapped = np.where(weights.mapped, 1.0, 0.0)
    reached = _around_nodes(target, np.repeat(mapped[:, None], 3, axis=1))[:, 0] > 0.0
    nodes = np.flatnonzero(reached)
    # Nodes of a mapped cell may lie a little farther off than its centroid.
    farthest = weights.maximum_distance + 2.0 * target.cell_radius
    directions = _around_nodes(target, sides)[nodes]
    closest = closest_points(surface, target.points[nodes], farthest, directions)
    near = closest.face >= 0
    node, face = nodes[near], closest.face[near]
    status = np.full(len(target.points), Status.UNMAPPED, dtype=np.int8)
    status[node] = np.where(closest.beside[near], Status.EXTRAPOLATED, Status.PROJECTED)
    distance = np.full(len(target.points), np.nan)
    distance[node] = closest.distance[near]
    return replace(
        weights,
        cell=node,
        face=face,
        average=np.ones(len(node)),
        content=np.zeros(len(node)),
        place=surface.in_frames(face, closest.foot[near]),
        status=status,
        coverage=(status == Status.PROJECTED).astype(float),
        distance=distance,
        cell_area=np.zeros(len(target.points)),
        conservative=False,
        solid_thickness=np.zeros(0),
        formed_thickness=np.zeros(0),
    )


def _around_nodes(target: TargetMesh, vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 3) along the sum of those (C, 3) of the cells around each node, else 0."""
    used = target.corners >= 0
    cell, _ = np.nonzero(used)
    node = target.corners[used]
    summed = np.stack(
        [np.bincount(node, vectors[cell, i], minlength=len(target.points)) for i in range(3)],
        axis=1,
    )
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return summed / np.where(length > 0.0, length, 1.0)
