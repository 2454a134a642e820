"""Material of every cell: two fibre families in resin, in the axes of the cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.mapping.structure.formed import CLOSEST_FAMILIES, FormedCells, FormedPly
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

#: Right angles that differ by less [rad] are the same one, whatever their sign.
RIGHT = 1e-9

#: Densities of fibres that differ by more than this are of different fibres.
SAME_DENSITY = 0.01


class Layer(NamedTuple):
    """One fibre family of one ply in its resin.

    stiffness : in the axes of the cell [Pa], (C, 6, 6). share : of the thickness, (C,).
    angle : about axis 3 from axis 1 [rad], (C,). fibre_volume_fraction : (C,).
    """

    stiffness: np.ndarray
    share: np.ndarray
    angle: np.ndarray
    fibre_volume_fraction: np.ndarray


@dataclass(frozen=True)
class Sections:
    """Material of the cells of a target, each in its own axes.

    Parameters
    ----------
    axes : rows 1 (along the first family of the leading ply), 2 and 3 (through the sheet),
        (C, 3, 3).
    angle : from the first to the second family of the leading ply about axis 3 [rad], (C,).
    fibre_volume_fraction : (C,), of the thickness that the deck has. density : [kg/m3], (C,).
    layers : both families of every ply.
    stiffness : of all together [Pa], (C, 6, 6).
    second_family_error : largest angle of a second family from perpendicular [rad].
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
    layers: tuple[Layer, ...]
    stiffness: np.ndarray
    second_family_error: float
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
    InputError : no density of the fibre, families that lie upon each other, more fibre than there
        is room for, or several plies with a lay-up of one.
    """
    warnings: list[str] = []
    fibre_density = _fibre_density(formed, structure, warnings)
    _require_one_ply(formed, target, structure, warnings)
    axes = _axes(formed.leading, target)
    thickness = node_thickness = error = None
    fuller = np.ones(target.cell_count)
    if not target.is_solid:
        node_thickness = thickness_at_nodes(target, formed.thickness)
        corners = target.corners
        of_corners = np.where(corners >= 0, node_thickness[corners], 0.0)
        thickness = of_corners.sum(axis=1) / (corners >= 0).sum(axis=1)
        fuller = formed.thickness / thickness
        off = np.abs(1.0 / fuller - 1.0)
        error = float(off.max()), int(np.argmax(off))
    layers: list[Layer] = []
    second_family_error = 0.0
    v = np.zeros(target.cell_count)
    for ply in formed.plies:
        own = ply.fibre_volume_fraction * fuller
        v += ply.share * own
        of_families = _layers(ply, own, axes, target, structure)
        between = np.abs(of_families[1].angle - of_families[0].angle)
        off = np.abs(0.5 * np.pi - between % np.pi)
        second_family_error = max(second_family_error, float(off.max()))
        layers += of_families
    _require_room(v, target, warnings)
    stiffness = homogenised([each.stiffness for each in layers], [each.share for each in layers])
    return Sections(
        axes=axes,
        angle=_angle(formed.leading.direction_2, axes, target),
        fibre_volume_fraction=v,
        density=v * fibre_density + (1.0 - v) * structure.resin.density,
        layers=tuple(layers),
        stiffness=stiffness,
        second_family_error=second_family_error,
        thickness=thickness,
        node_thickness=node_thickness,
        laminate=None if thickness is None else _laminate(layers, stiffness, thickness, structure),
        thickness_error=error,
        warnings=tuple(warnings),
    )


def _layers(
    ply: FormedPly, v: np.ndarray, axes: np.ndarray, target: TargetMesh, structure: Structure
) -> list[Layer]:
    """Both families of a ply."""
    _require_room(np.where(ply.share > 0.0, v, 0.5), target, [])
    first = _angle(ply.direction_1, axes, target, apart=False)
    second = _angle(ply.direction_2, axes, target, apart=False)
    _require_apart(second - first, target)
    plain = ply_stiffness(MODELS[structure.micromechanics](structure.fibre, structure.resin, v))
    share = structure.family_1_share
    return [
        Layer(turned(plain, angle), part * ply.share, angle, v)
        for angle, part in ((first, share), (second, 1.0 - share))
    ]


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
    layers: list[Layer], stiffness: np.ndarray, thickness: np.ndarray, structure: Structure
) -> LaminateStiffness:
    if structure.lay_up == "interleaved":
        return interleaved(reduced(stiffness), thickness)
    stacked = [(layers[family].stiffness, share) for family, share in layers_of(structure)]
    return laminate([layer for layer in stacked if layer[1] > 0.0], thickness)


def _axes(leading: FormedPly, target: TargetMesh) -> np.ndarray:
    """Axes of the cells (C, 3, 3): 1 along the first family, 3 through the sheet."""
    first, second = leading.direction_1, leading.direction_2
    if target.is_solid:
        normal = np.cross(first, second)
        length = np.linalg.norm(normal, axis=1)
        _require_apart(np.arcsin(np.minimum(length, 1.0)), target)
        third = normal / length[:, None]
    else:
        third = target.surface.normals
        first = _unit(first - np.einsum("ci,ci->c", first, third)[:, None] * third)
    return np.stack([first, np.cross(third, first), third], axis=1)


def _angle(
    direction: np.ndarray, axes: np.ndarray, target: TargetMesh, *, apart: bool = True
) -> np.ndarray:
    """Angle of a family from axis 1 about axis 3 [rad], above -90 and up to 90 degrees, (C,).

    apart : whether it has to differ from axis 1.
    """
    along = np.einsum("ci,ci->c", direction, axes[:, 0])
    sideways = np.einsum("ci,ci->c", direction, axes[:, 1])
    # A family has no sense: the one that goes along axis 1 is taken.
    sign = np.where(along < 0.0, -1.0, 1.0)
    angle = np.arctan2(sign * sideways, sign * along)
    angle = np.where(angle < -0.5 * np.pi + RIGHT, angle + np.pi, angle)
    if apart:
        _require_apart(angle, target)
    return angle


def _require_apart(angle: np.ndarray, target: TargetMesh) -> None:
    """Refuse families that run in the same direction, by the angle between them [rad]."""
    lying = np.flatnonzero(np.abs(np.sin(angle)) < np.sin(CLOSEST_FAMILIES))
    if len(lying):
        raise InputError(
            f"both fibre families run in the same direction in {len(lying)} cells "
            f"({first_few(target.cell_ids[lying])}); the textile has no such state, look at the "
            "forming result",
            file=target.file,
        )


def _require_one_ply(
    formed: FormedCells, target: TargetMesh, structure: Structure, warnings: list[str]
) -> None:
    if len(formed.plies) == 1:
        return
    if structure.lay_up != "interleaved":
        raise InputError(
            f'is "{structure.lay_up}", but the part has {len(formed.plies)} plies; write '
            '"interleaved", or map each ply onto cells of its own',
            key="lay_up",
        )
    if not target.is_solid:
        warnings.append(
            f"the {len(formed.plies)} plies are taken as mixed over the thickness: in bending a "
            "laminate whose plies differ has another stiffness; a solid mesh with cells for each "
            "ply has theirs"
        )


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
