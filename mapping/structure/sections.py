"""Material of every cell: one to three fibre families in resin, in the axes of the cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.mapping.structure.mapped_file import CLOSEST_FAMILIES, FormedCells, FormedPly
from lcmchain.mapping.structure.stiffness import (
    MODELS,
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

#: Layers with a smaller share of the thickness are rounding, and CalculiX has no layer of none.
THINNEST_LAYER = 1e-6

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


class Through(NamedTuple):
    """Layers over each other through the thickness of shells.

    kinds : stiffness of every material that a layer may have, in the axes of the cell [Pa], K of
        (C, 6, 6).
    kind, share : of the layers from the lowest to the highest along the normal of the cell,
        (L, C); the share is that in the thickness, 0 where a cell has less layers.
    """

    kinds: tuple[np.ndarray, ...]
    kind: np.ndarray
    share: np.ndarray


@dataclass(frozen=True)
class Sections:
    """Material of the cells of a target, each in its own axes.

    Parameters
    ----------
    axes : rows 1 (along the first family of the leading ply), 2 and 3 (through the sheet),
        (C, 3, 3).
    angles : from the first to every other family of the leading ply about axis 3 [rad], (C,) each;
        not a number where the leading ply has no such family.
    fibre_volume_fraction : (C,), of the thickness that the deck has. density : [kg/m3], (C,).
    layers : all families of every ply. through : what lies over each other, None where all is
        mixed.
    stiffness : of all together [Pa], (C, 6, 6).
    second_family_error : largest angle of the second of two families from perpendicular [rad].
    thickness : of the cells in the deck [m], (C,), and node_thickness (N,); None for solids.
    laminate : stiffness of the laminate, None for solids.
    thickness_error : largest relative difference between the cell's thickness and that of the
        deck, and the row of the cell; None for solids.
    warnings : what a user should know.
    """

    axes: np.ndarray
    angles: tuple[np.ndarray, ...]
    fibre_volume_fraction: np.ndarray
    density: np.ndarray
    layers: tuple[Layer, ...]
    stiffness: np.ndarray
    second_family_error: float
    through: Through | None = None
    thickness: np.ndarray | None = None
    node_thickness: np.ndarray | None = None
    laminate: LaminateStiffness | None = None
    thickness_error: tuple[float, int] | None = None
    warnings: tuple[str, ...] = ()


def build_sections(formed: FormedCells, target: TargetMesh, structure: Structure) -> Sections:
    """Compute the material of every cell.

    In CalculiX one thickness per element makes every joint of shells rigid; thicknesses at nodes do
    not. So nodes take the mean of their cells, weighted by area. The fibre volume fraction of a
    cell is that of its own fibres in the thickness of its nodes, so that the fibre mass is kept.

    Raises
    ------
    InputError : no density of the fibre, families that lie upon each other, more fibre than there
        is room for, or plies whose order is not known.
    """
    warnings: list[str] = []
    fibre_density = _fibre_density(formed, structure, warnings)
    _warn_of_mixed_plies(formed, target, structure, warnings)
    axes = _axes(formed.leading, target)
    thickness = node_thickness = error = None
    fuller = np.ones(target.cell_count)
    if not target.is_solid:
        node_thickness = _thickness_at_nodes(target, formed.thickness)
        corners = target.corners
        of_corners = np.where(corners >= 0, node_thickness[corners], 0.0)
        thickness = of_corners.sum(axis=1) / (corners >= 0).sum(axis=1)
        fuller = formed.thickness / thickness
        off = np.abs(1.0 / fuller - 1.0)
        error = float(off.max()), int(np.argmax(off))
    of_plies: list[list[Layer]] = []
    second_family_error = 0.0
    v = np.zeros(target.cell_count)
    for ply in formed.plies:
        own = ply.fibre_volume_fraction * fuller
        v += ply.share * own
        of_families = _layers(ply, own, axes, target, structure)
        if len(of_families) == 2:
            between = np.abs(of_families[1].angle - of_families[0].angle)
            off = np.abs(0.5 * np.pi - between % np.pi)
            second_family_error = max(second_family_error, float(off.max()))
        of_plies.append(of_families)
    layers = [layer for own in of_plies for layer in own]
    _require_room(v, target, warnings)
    stiffness = homogenised([each.stiffness for each in layers], [each.share for each in layers])
    through = _through(formed, of_plies, target, structure)
    return Sections(
        axes=axes,
        angles=tuple(_angle(other, axes, target) for other in formed.leading.directions[1:]),
        fibre_volume_fraction=v,
        density=v * fibre_density + (1.0 - v) * structure.resin.density,
        layers=tuple(layers),
        stiffness=stiffness,
        second_family_error=second_family_error,
        through=through,
        thickness=thickness,
        node_thickness=node_thickness,
        laminate=None if thickness is None else _laminate(through, stiffness, thickness),
        thickness_error=error,
        warnings=tuple(warnings),
    )


def _layers(
    ply: FormedPly, v: np.ndarray, axes: np.ndarray, target: TargetMesh, structure: Structure
) -> list[Layer]:
    """All families of a ply."""
    _require_room(np.where(ply.share > 0.0, v, 0.5), target, [])
    angles = [_angle(direction, axes, target, apart=False) for direction in ply.directions]
    for number, angle in enumerate(angles):
        for other in angles[:number]:
            _require_apart(angle - other, target)
    plain = ply_stiffness(MODELS[structure.micromechanics](structure.fibre, structure.resin, v))
    return [
        Layer(turned(plain, angle), part * ply.share, angle, v)
        for angle, part in zip(angles, _shares(len(angles), structure), strict=True)
    ]


def _shares(count: int, structure: Structure) -> tuple[float, ...]:
    """Return the share of each of so many families in the fibres of a ply.

    Raises
    ------
    InputError : a share of the first of two where there are three.
    """
    share = structure.family_1_share
    if count == 1:
        return (1.0,)
    if count == 2:
        return (share, 1.0 - share)
    if share != 0.5:
        raise InputError(
            f"is {share:g}, but the textile has {count} families, which have equal shares; leave "
            "it out",
            key="family_1_share",
        )
    return (1.0 / count,) * count


def _through(
    formed: FormedCells, of_plies: list[list[Layer]], target: TargetMesh, structure: Structure
) -> Through | None:
    """Return what lies over each other in shells, None where all is mixed, and for solids.

    Raises
    ------
    InputError : the order of the plies is not known.
    """
    several = len(formed.plies) > 1
    if target.is_solid or structure.lay_up == "interleaved":
        return None
    if structure.lay_up == "plies" and not several:
        return None
    each = 1 if structure.lay_up == "plies" else max(len(own) for own in of_plies)
    kinds: list[np.ndarray] = []
    # of every ply the families from below and their shares, as many entries in all plies
    through: list[list[tuple[int, float]]] = []
    for own in of_plies:
        stiffness = [layer.stiffness for layer in own]
        parts = _shares(len(own), structure)
        if structure.lay_up == "plies":
            kinds.append(homogenised(stiffness, list(parts)) if len(own) > 1 else stiffness[0])
            through.append([(0, 1.0)])
            continue
        kinds += stiffness + [stiffness[0]] * (each - len(own))
        up = list(enumerate(parts))
        if structure.lay_up == "symmetric":
            halves = [(family, 0.5 * part) for family, part in up[:-1]]
            up = [*halves, up[-1], *reversed(halves)]
        through.append(up)
    most = max(len(up) for up in through)
    of_ply = np.zeros((2, len(through), most))  # family and share
    for number, up in enumerate(through):
        of_ply[:, number, : len(up)] = np.array(up).T
    order, upward = np.zeros((1, target.cell_count), dtype=np.int64), np.ones(target.cell_count)
    if several:
        order, upward = _order_of_plies(formed, target)
    shares = np.stack([ply.share for ply in formed.plies])
    found = []
    for position in order:
        part = np.take_along_axis(shares, position[None], axis=0)[0]
        for entry in range(most):
            place = np.where(upward > 0.0, entry, most - 1 - entry)
            family, of_layer = of_ply[:, position, place]
            found.append((each * position + family.astype(np.int64), part * of_layer))
    return Through(
        tuple(kinds), np.stack([kind for kind, _ in found]), np.stack([part for _, part in found])
    )


def _order_of_plies(formed: FormedCells, target: TargetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the plies of each cell from the lowest along its normal (P, C), and its side (C,).

    The side is -1 where the lowest ply of the stack lies highest: there both families of a ply are
    the other way round, too.
    """
    given = [ply.height for ply in formed.plies]
    if any(height is None for height in given):
        raise InputError(
            "needs the order of the plies in every cell, which this mapped file does not tell; "
            "map the forming result again",
            key="lay_up",
            file=target.file,
        )
    there = np.stack([ply.share for ply in formed.plies]) > 0.0
    height = np.where(there, np.stack([np.asarray(values) for values in given]), np.nan)
    order = np.argsort(height, axis=0, kind="stable")  # what is not there comes last
    place = np.arange(len(given))[:, None] - 0.5 * (len(given) - 1)
    middle = np.nanmean(height, axis=0)
    lean = np.where(there, (height - middle) * place, 0.0).sum(axis=0)
    # A ply that is left alone has none above or below it.
    if formed.order is not None:
        lean = np.where(there.sum(axis=0) == 1, formed.order, lean)
    return order, np.where(lean < 0.0, -1.0, 1.0)


def _thickness_at_nodes(target: TargetMesh, thickness: np.ndarray) -> np.ndarray:
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
    through: Through | None, stiffness: np.ndarray, thickness: np.ndarray
) -> LaminateStiffness:
    if through is None:
        return interleaved(reduced(stiffness), thickness)
    kinds, cells = np.stack(through.kinds), np.arange(len(thickness))
    return laminate(
        [(kinds[kind, cells], share) for kind, share in zip(through.kind, through.share)], thickness
    )


def _axes(leading: FormedPly, target: TargetMesh) -> np.ndarray:
    """Axes of the cells (C, 3, 3): 1 along the first family, 3 through the sheet."""
    first = leading.directions[0]
    if target.is_solid:
        if len(leading.directions) == 1:
            raise InputError(
                "the cells are solids, which take the normal of the sheet from two fibre families, "
                "and the textile has one; use a mesh of triangles or quadrilaterals",
                file=target.file,
            )
        second = leading.directions[1]
        lone = np.flatnonzero(~np.isfinite(second).all(axis=1))
        if len(lone):
            raise InputError(
                "the cells are solids, which take the normal of the sheet from two fibre families, "
                f"and the ply with the largest share has one in {len(lone)} cells "
                f"({first_few(target.cell_ids[lone])}); use a mesh of triangles or quadrilaterals",
                file=target.file,
            )
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


def _warn_of_mixed_plies(
    formed: FormedCells, target: TargetMesh, structure: Structure, warnings: list[str]
) -> None:
    if len(formed.plies) > 1 and structure.lay_up == "interleaved" and not target.is_solid:
        warnings.append(
            f"the {len(formed.plies)} plies are taken as mixed over the thickness: in bending a "
            'laminate whose plies differ has another stiffness; lay_up = "plies", or a solid mesh '
            "with cells for each ply, has theirs"
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
