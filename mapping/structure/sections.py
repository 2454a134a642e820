"""Material of every cell: two fibre families in resin, in the axes of the cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.first_few import first_few
from lcmchain.mapping.structure.formed import CLOSEST_FAMILIES, FormedCells
from lcmchain.mapping.structure.micromechanics import MODELS
from lcmchain.mapping.structure.stiffness import (
    LaminateStiffness,
    homogenised,
    interleaved,
    laminate,
    ply_stiffness,
    reduced,
    turned,
)
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene.structure import Structure

#: Round fibres cannot be packed closer: pi / (2 sqrt 3).
CLOSEST_PACKING = np.pi / (2.0 * np.sqrt(3.0))

#: Densities of fibres that differ by more than this are of different fibres.
SAME_DENSITY = 0.01


@dataclass(frozen=True)
class Sections:
    """Material of the cells of a target, each in its own axes.

    Parameters
    ----------
    axes : rows 1 (along the first family), 2 and 3 (through the sheet), (C, 3, 3).
    angle : from the first to the second family about axis 3 [rad], (C,).
    fibre_volume_fraction : (C,), of the thickness that the deck has. density : [kg/m3], (C,).
    plies : stiffness of a ply of each family in the axes of the cell [Pa], (C, 6, 6).
    stiffness : of both together [Pa], (C, 6, 6).
    thickness : of the cells in the deck [m], (C,), and node_thickness (N,); None for solids.
    laminate : stiffness of the laminate, None for solids.
    thickness_error : largest relative difference between the cell's thickness and that of the
        deck, and the row of the cell; None for solids.
    warnings : what a user should know.
    """

    axes: np.ndarray
    angle: np.ndarray
    fibre_volume_fraction: np.ndarray
    density: np.ndarray
    plies: tuple[np.ndarray, np.ndarray]
    stiffness: np.ndarray
    thickness: np.ndarray | None = None
    node_thickness: np.ndarray | None = None
    laminate: LaminateStiffness | None = None
    thickness_error: tuple[float, int] | None = None
    warnings: tuple[str, ...] = ()


def build_sections(formed: FormedCells, target: TargetMesh, structure: Structure) -> Sections:
    """Compute the material of every cell.

    CalculiX knows the thickness of shells at nodes without stiffening their joints (one thickness
    per element makes every joint rigid): nodes take the mean of their cells, weighted by area, and
    the fibre volume fraction of a cell is that of its own fibres in the thickness of its nodes, so
    that fibre mass is neither made nor lost.

    Raises
    ------
    InputError : no density of the fibre, families that lie upon each other, or more fibre than
        there is room for.
    """
    warnings: list[str] = []
    fibre_density = _fibre_density(formed, structure, warnings)
    axes, angle = _axes(formed, target)
    v = formed.fibre_volume_fraction
    thickness = node_thickness = error = None
    if not target.is_solid:
        node_thickness = thickness_at_nodes(target, formed.thickness)
        corners = target.corners
        of_corners = np.where(corners >= 0, node_thickness[corners], 0.0)
        thickness = of_corners.sum(axis=1) / (corners >= 0).sum(axis=1)
        v = v * formed.thickness / thickness
        off = np.abs(thickness / formed.thickness - 1.0)
        error = float(off.max()), int(np.argmax(off))
    _require_room(v, target, warnings)
    ply = ply_stiffness(MODELS[structure.micromechanics](structure.fibre, structure.resin, v))
    plies = ply, turned(ply, angle)
    shares = [structure.family_1_share, 1.0 - structure.family_1_share]
    stiffness = homogenised(list(plies), shares)
    return Sections(
        axes=axes,
        angle=angle,
        fibre_volume_fraction=v,
        density=v * fibre_density + (1.0 - v) * structure.resin.density,
        plies=plies,
        stiffness=stiffness,
        thickness=thickness,
        node_thickness=node_thickness,
        laminate=None if thickness is None else _laminate(plies, stiffness, thickness, structure),
        thickness_error=error,
        warnings=tuple(warnings),
    )


def layers_of(structure: Structure) -> list[tuple[int, float]]:
    """Family (0 or 1) and share of the thickness of each layer from the lowest to the highest."""
    first = structure.family_1_share
    if structure.lay_up == "symmetric":
        return [(0, 0.5 * first), (1, 1.0 - first), (0, 0.5 * first)]
    return [(0, first), (1, 1.0 - first)]


def thickness_at_nodes(target: TargetMesh, thickness: np.ndarray) -> np.ndarray:
    """Mean thickness of the cells around every corner node [m], (N,), weighted by their areas."""
    corners, areas = target.corners, target.surface.areas
    used = corners >= 0
    nodes = corners[used]
    area = np.broadcast_to(areas[:, None], corners.shape)[used]
    content = np.broadcast_to((areas * thickness)[:, None], corners.shape)[used]
    total = np.bincount(nodes, area, minlength=len(target.points))
    mean = np.bincount(nodes, content, minlength=len(target.points))
    return mean / np.where(total > 0.0, total, np.nan)


def _laminate(
    plies: tuple[np.ndarray, np.ndarray],
    stiffness: np.ndarray,
    thickness: np.ndarray,
    structure: Structure,
) -> LaminateStiffness:
    if structure.lay_up == "interleaved":
        return interleaved(reduced(stiffness), thickness)
    layers = [(plies[family], share) for family, share in layers_of(structure) if share > 0.0]
    return laminate(layers, thickness)


def _axes(formed: FormedCells, target: TargetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Axes of the cells (C, 3, 3), and the angle to the second family [rad], within +-90 deg."""
    first, second = formed.direction_1, formed.direction_2
    if target.is_solid:
        normal = np.cross(first, second)
        lying = np.linalg.norm(normal, axis=1) < np.sin(CLOSEST_FAMILIES)
        third = normal / np.where(lying, 1.0, np.linalg.norm(normal, axis=1))[:, None]
    else:
        third = target.surface.normals
        first = _unit(first - np.einsum("ci,ci->c", first, third)[:, None] * third)
        lying = np.zeros(len(first), dtype=bool)
    across = np.cross(third, first)
    along = np.einsum("ci,ci->c", second, first)
    sideways = np.einsum("ci,ci->c", second, across)
    lying |= np.abs(sideways) < np.sin(CLOSEST_FAMILIES)
    if lying.any():
        cells = target.cell_ids[np.flatnonzero(lying)]
        raise InputError(
            f"both fibre families run in the same direction in {len(cells)} cells "
            f"({first_few(cells)}); the textile has no such state, look at the forming result",
            file=target.file,
        )
    # A family has no sense: the angle is taken between -90 and 90 degrees, or 90.
    sign = np.where(sideways < 0.0, -1.0, 1.0)
    return np.stack([first, across, third], axis=1), np.arctan2(sign * sideways, sign * along)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def _fibre_density(formed: FormedCells, structure: Structure, warnings: list[str]) -> float:
    """Density of the fibres whose volume fraction was mapped [kg/m3]."""
    own = structure.fibre.density
    if formed.fibre_density is None and own is None:
        raise InputError(
            "is missing, and the forming result does not tell it either; give it as in "
            'density = "1760 kg/m^3"',
            key="fibre.density",
        )
    if formed.fibre_density is None:
        return float(own)  # type: ignore[arg-type]
    if own is not None and abs(own / formed.fibre_density - 1.0) > SAME_DENSITY:
        warnings.append(
            f"the fibre has {own:g} kg/m3, but the mapped fibre volume fraction belongs to fibres "
            f"of {formed.fibre_density:g} kg/m3, whose mass the deck has; give the same fibre in "
            "both stages"
        )
    return formed.fibre_density


def _require_room(v: np.ndarray, target: TargetMesh, warnings: list[str]) -> None:
    wrong = np.flatnonzero((v <= 0.0) | (v >= 1.0))
    if len(wrong):
        worst = wrong[np.argmax(np.abs(v[wrong] - 0.5))]
        raise InputError(
            f"the fibre volume fraction of {len(wrong)} cells is not between 0 and 1 "
            f"({first_few(target.cell_ids[wrong])}; {v[worst]:.3f} in {target.cell_ids[worst]}); "
            "no composite is made of these, look at thickness and fibre mass there",
            file=target.file,
        )
    close = np.flatnonzero(v > CLOSEST_PACKING)
    if len(close):
        warnings.append(
            f"{len(close)} cells hold more fibre than round ones can be packed (fibre volume "
            f"fraction above {CLOSEST_PACKING:.3f}: {first_few(target.cell_ids[close])}); their "
            "stiffness is no prediction"
        )
