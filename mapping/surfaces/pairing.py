"""Which faces a cell takes from, in what shares: by overlap or by the closest place.

Overlaps are found by :mod:`lcmchain.mapping.surfaces.intersection`. Where several layers of the
sheet lie over a cell, one is chosen. The shares of the faces' contents are evened out among the
cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.jit import routine
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.surfaces.intersection import Overlaps, coverage_of_planes, overlaps
from lcmchain.mapping.surfaces.search import closest_points
from lcmchain.mapping.surfaces.surface import Surface, Winding
from lcmchain.mapping.target import CellPolygons, TargetMesh
from lcmchain.mapping.weights import (
    COVERED,
    TILED,
    MappingWeights,
    Status,
    default_maximum_distance,
    half_thickness,
    mesh_key,
)

# A face whose nodes all lie over the target is taken as wholly covered when the overlaps found at
# least this share of it; the rest fell into the wedges between neighbouring cells at a sharp bend.
WEDGE = 0.5

# Cells without an edge of the sheet over them are covered if the area seen from the faces differs
# by no more than this: facets of 5 mm on a radius of 10 mm make a few per cent.
CURVED = 0.1


def surface_weights(
    sheet: Sheet, target: TargetMesh, *, method: str, order: int, maximum_distance: float | None
) -> MappingWeights:
    """Compute the weights of one ply; arguments as of :func:`lcmchain.mapping.compute_weights`.

    Solid cells take from the closest place of the sheet here, without areas.

    Raises
    ------
    InputError : a distance that is not positive.
    """
    if maximum_distance is None:
        maximum_distance = default_maximum_distance(sheet, target)
    if not (np.isfinite(maximum_distance) and maximum_distance > 0.0):
        raise InputError(f"maximum_distance has to be positive, not {maximum_distance} m")
    pair = _by_overlap if method == "overlap" else _by_closest
    pairing = pair(sheet.surface, target, float(maximum_distance))
    return MappingWeights(
        cell=pairing.cell,
        face=pairing.face,
        average=pairing.average,
        content=pairing.content,
        place=pairing.place,
        status=_status(sheet, pairing),
        coverage=pairing.coverage,
        distance=pairing.distance,
        cell_area=pairing.cell_area,
        face_coverage=pairing.face_coverage,
        missed=pairing.missed,
        wedge_correction=pairing.wedge_correction,
        moved=pairing.moved,
        method=method,
        order=order,
        maximum_distance=float(maximum_distance),
        conservative=method == "overlap" and not target.is_solid,
        source_key=mesh_key(sheet.surface.points, sheet.surface.faces),
        target_key=mesh_key(target.points, target.corners),
    )


def _status(sheet: Sheet, pairing: Pairing) -> np.ndarray:
    """Status of each cell, shape (C,)."""
    mapped = np.zeros(len(pairing.coverage), dtype=bool)
    mapped[pairing.cell] = True
    status = np.where(mapped, Status.EXTRAPOLATED, Status.UNMAPPED).astype(np.int8)
    covered = mapped & (pairing.coverage >= COVERED)
    status[covered] = Status.PROJECTED
    within = pairing.distance <= half_thickness(sheet)[pairing.nearest_face]
    status[covered & within] = Status.INSIDE
    status[mapped & pairing.ambiguous] = Status.AMBIGUOUS
    return status


class Pairing(NamedTuple):
    """Faces and shares of all cells, by cell, then face; see ``MappingWeights`` for the entries.

    nearest_face : a face close to the cell's centroid, shape (C,); 0 where there is none.
    ambiguous : whether a second layer of the sheet could as well be the cell's, shape (C,).
    missed : whether a face lies over the target and no cell takes from it, shape (F,).
    """

    cell: np.ndarray
    face: np.ndarray
    average: np.ndarray
    place: np.ndarray
    content: np.ndarray
    coverage: np.ndarray
    distance: np.ndarray
    cell_area: np.ndarray
    nearest_face: np.ndarray
    ambiguous: np.ndarray
    face_coverage: np.ndarray
    missed: np.ndarray
    wedge_correction: float
    moved: float


def _by_overlap(surface: Surface, target: TargetMesh, maximum_distance: float) -> Pairing:
    """Pair cells of a surface with what lies over them of the layer that they belong to.

    Cells without an overlap take the closest place of the right side, if one is near.
    """
    count = target.cell_count
    cells = target.polygons(np.empty((0, 3)))
    overlap = overlaps(surface, cells, maximum_distance)
    choice = choose_layers(overlap, target.surface.winding, cells.areas, maximum_distance)
    if not choice.taken.all():
        overlap = Overlaps(*(values[choice.taken] for values in overlap))
    covered = np.bincount(overlap.cell, overlap.area, minlength=count)
    nearest, distance = _over_centroid(overlap, count, maximum_distance)
    unsure = np.flatnonzero(~np.isfinite(distance) | (covered == 0.0))
    if len(unsure):
        sides = cells.normals[unsure] * choice.side[unsure, None]
        closest = closest_points(surface, cells.centroids[unsure], maximum_distance, sides)
        distance[unsure], nearest[unsure] = closest.distance, closest.face
        _distance_of_overlaps(overlap, covered, distance, nearest)
    alone = np.flatnonzero((covered == 0.0) & (nearest >= 0))
    distance[(covered == 0.0) & (nearest < 0)] = np.nan

    face_coverage, missed, content, correction = _face_coverage(
        surface, target, cells, overlap, maximum_distance
    )
    coverage = _coverage(surface, cells, overlap, covered)
    content, moved = _even_shares(overlap, content, surface.areas, coverage * cells.areas)
    average = overlap.area / np.where(covered > 0.0, covered, 1.0)[overlap.cell]
    weights: tuple[np.ndarray, ...] = (
        overlap.cell, overlap.face, average, overlap.place, content,
    )  # fmt: skip
    if len(alone):
        foot = closest.foot[np.isin(unsure, alone)]
        place = surface.in_frames(nearest[alone], foot)
        one, nothing = np.ones(len(alone)), np.zeros(len(alone))
        weights = _merged(weights, (alone, nearest[alone], one, place, nothing))
    cell, face, average, place, content = weights
    return Pairing(
        cell=cell,
        face=face,
        average=average,
        place=place,
        content=content,
        coverage=coverage,
        distance=distance,
        cell_area=cells.areas,
        nearest_face=np.maximum(nearest, 0),
        ambiguous=choice.ambiguous,
        face_coverage=face_coverage,
        missed=missed,
        wedge_correction=correction,
        moved=moved,
    )


def _by_closest(surface: Surface, target: TargetMesh, maximum_distance: float) -> Pairing:
    """Pair cells with the place of the sheet that is closest to their centroid.

    Such weights have no areas: a face is covered by the share of its corners over the target.
    """
    places = target.centroids if target.is_solid else target.surface.centroids
    closest = closest_points(surface, places, maximum_distance)
    cells = target.polygons(surface.normals[np.maximum(closest.face, 0)])
    cell = np.flatnonzero(closest.face >= 0)
    face = closest.face[cell]
    corner = np.where(surface.faces < 0, surface.faces[:, 2:3], surface.faces)
    nodes = np.arange(len(surface.points))
    over = _nodes_over_target(surface, nodes, target, cells, maximum_distance)
    return Pairing(
        cell=cell,
        face=face,
        average=np.ones(len(cell)),
        place=surface.in_frames(face, closest.foot[cell]),
        content=np.zeros(len(cell)),
        coverage=np.where(closest.beside, 0.0, 1.0),
        distance=np.where(closest.face >= 0, closest.distance, np.nan),
        cell_area=cells.areas,
        nearest_face=np.maximum(closest.face, 0),
        ambiguous=np.zeros(target.cell_count, dtype=bool),
        face_coverage=over[corner].mean(axis=1),
        missed=np.zeros(surface.face_count, dtype=bool),
        wedge_correction=0.0,
        moved=0.0,
    )


def _merged(table: tuple[np.ndarray, ...], more: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Columns of a table of weights with rows of further cells, by cell: the first column."""
    at = np.searchsorted(table[0], more[0])
    return tuple(np.insert(old, at, new, axis=0) for old, new in zip(table, more, strict=True))


def _over_centroid(
    overlap: Overlaps, count: int, maximum_distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Face over the centroid of each cell, and its distance [m]; -1 and infinite without one.

    A face that is steep to the cell may be near on average and too far off over the centroid.
    """
    face, distance = np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
    _least(overlap.cell, overlap.face, overlap.centre, maximum_distance, face, distance)
    return face, distance


@routine
def _least(cell, face, centre, maximum_distance, nearest, distance):
    for k in range(len(cell)):
        if centre[k] <= maximum_distance and centre[k] < distance[cell[k]]:
            nearest[cell[k]], distance[cell[k]] = face[k], centre[k]


def _distance_of_overlaps(
    overlap: Overlaps, covered: np.ndarray, distance: np.ndarray, nearest: np.ndarray
) -> None:
    """Give covered cells whose centroid is near no face the distance of what lies over them."""
    lost = (covered > 0.0) & (nearest < 0)
    if not lost.any():
        return
    moment = np.bincount(
        overlap.cell, overlap.area * np.abs(overlap.height), minlength=len(covered)
    )
    distance[lost] = moment[lost] / covered[lost]
    nearest[overlap.cell[lost[overlap.cell]]] = overlap.face[lost[overlap.cell]]


def _coverage(
    surface: Surface, cells: CellPolygons, overlap: Overlaps, covered: np.ndarray
) -> np.ndarray:
    """Covered share of each cell, from the covered areas [m2] (C,).

    Areas seen from curved faces do not quite add up to that of a cell which they cover. Cells away
    from the edge of the sheet are covered wholly if little is missing; of all others the faces are
    laid onto the tangent plane, which they tile.
    """
    coverage = covered / np.where(cells.areas > 0.0, cells.areas, 1.0)
    at_edge = np.zeros(len(coverage), dtype=bool)
    bounding = np.asarray(surface.winding.bounds.any(axis=1))
    at_edge[overlap.cell[bounding[overlap.face]]] = True
    curved = np.abs(coverage - 1.0) > CURVED
    doubtful: np.ndarray = (coverage > 0.0) & (at_edge | curved)
    tiled = coverage_of_planes(surface, cells, overlap, np.flatnonzero(doubtful))
    whole: np.ndarray = (coverage > 0.0) & ~doubtful
    whole[doubtful] = tiled >= COVERED
    return np.where(whole, 1.0, np.minimum(coverage, 1.0))


def _face_coverage(
    surface: Surface,
    target: TargetMesh,
    cells: CellPolygons,
    overlap: Overlaps,
    maximum_distance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Covered share of each face; faces missed; shares of contents; largest correction of these.

    The cells over a face tile it, except where the target bends more sharply than the sheet. There
    the cells on either side of the bend leave or share a wedge of the face. Their shares are scaled
    until they sum to one, so that no fibre is lost or made.
    """
    part = overlap.part
    tiled = np.bincount(overlap.face, part, minlength=surface.face_count)
    open_faces = np.flatnonzero(np.abs(tiled - 1.0) > TILED)
    over_target = np.zeros(surface.face_count, dtype=bool)
    if len(open_faces):
        nodes = np.unique(surface.faces[open_faces])
        nodes = nodes[nodes >= 0]
        over = _nodes_over_target(surface, nodes, target, cells, maximum_distance)
        corner = np.where(surface.faces < 0, surface.faces[:, 2:3], surface.faces)[open_faces]
        over_target[open_faces] = over[corner].all(axis=1)
    whole = over_target & (tiled >= WEDGE)
    tiles = np.abs(tiled - 1.0) <= TILED
    face_coverage = np.where(whole, 1.0, np.where(tiles, tiled, np.minimum(tiled, 1.0)))
    scale = face_coverage / np.where(tiled > 0.0, tiled, 1.0)
    correction = float(np.abs(scale[tiled > 0.0] - 1.0).max(initial=0.0))
    missed = over_target & ~whole
    return face_coverage, missed, part * scale[overlap.face], correction


def _nodes_over_target(
    surface: Surface,
    nodes: np.ndarray,
    target: TargetMesh,
    cells: CellPolygons,
    maximum_distance: float,
) -> np.ndarray:
    """Whether some nodes of the sheet project onto the target, shape (N,); False of the others."""
    over = np.zeros(len(surface.points), dtype=bool)
    skin = target.surface if not target.is_solid else _surface_of_sections(cells)
    if skin.face_count == 0:
        return over
    closest = closest_points(skin, surface.points[nodes], maximum_distance)
    # Sections of neighbouring solids share no nodes: every edge would count as the part's.
    over[nodes] = (closest.face >= 0) & (target.is_solid | ~closest.beside)
    return over


def _surface_of_sections(cells: CellPolygons) -> Surface:
    triangles = [
        (first, first + k, first + k + 1, -1)
        for first, end in zip(cells.start[:-1], cells.start[1:], strict=True)
        for k in range(1, end - first - 1)
    ]
    return Surface(cells.corners, np.array(triangles, dtype=np.int64).reshape(-1, 4))


# --- which layer of the sheet a cell belongs to, where several lie over it ------------------------
# Two walls, two folds or two plies may be closer to each other than an edge of a mesh. A cell takes
# from one layer only: of those that show it the right side, the nearest. Which side is right is a
# matter of a whole connected piece of the target: the one by which its cells lie nearer to the
# sheet, in the mean of the squares. A U that was moved across its gap by any amount still knows its
# walls: the other sides would bring one wall as much nearer as the other one farther, and the
# squares grow.

# A piece of the target knows its side when the mean square distance to what shows it the other side
# is this many times larger.
CLEARLY_FARTHER = 1.25

# Where no layer shows a side, the next one may be anywhere beyond the distance that was searched.
BEYOND = 2.0

# A layer is taken only if the next one is this many times farther away: in between, facets that
# cut the corners of a curved part may decide.
DECISIVE = 1.5

# The same where the side is not known, and the other layer shows another side than the nearest.
DECISIVE_OF_SIDES = 3.0

# Layers that tile a cell between them lie beside each other, not over each other; a step of the
# sheet has steep faces between its halves, which belong to no layer.
TILING = 1.001

# Neighbours of a cell's faces may touch it in a line or corner; rounding gives this an area, of
# 1e-11 of the cell. Layers smaller than this part of the largest one over the cell are no rivals.
TOUCHING = 1e-6


class Choice(NamedTuple):
    """Which pairs count, and what could not be decided.

    taken : whether a pair is of the layer that its cell belongs to, shape (K,).
    ambiguous : whether a second layer could as well be the one, shape (C,).
    side : side that each cell has to see, 1 or -1 as in ``Overlaps.side``; 0 unknown, shape (C,).
    """

    taken: np.ndarray
    ambiguous: np.ndarray
    side: np.ndarray


def choose_layers(
    overlap: Overlaps, winding: Winding, areas: np.ndarray, maximum_distance: float
) -> Choice:
    """Choose the layer of each cell.

    Parameters
    ----------
    winding : of the target.
    areas : of the cells [m2], shape (C,).
    maximum_distance : up to which layers were looked for [m].
    """
    count = len(areas)
    layer_count = int(overlap.layer.max(initial=-1)) + 1
    area = np.bincount(overlap.layer, overlap.area, minlength=layer_count)
    moment = np.bincount(
        overlap.layer, overlap.area * np.abs(overlap.height), minlength=layer_count
    )
    distance = np.where(area > 0.0, moment / np.where(area > 0.0, area, 1.0), np.inf)
    cell, side = np.zeros(layer_count, dtype=np.int64), np.zeros(layer_count, dtype=np.int64)
    cell[overlap.layer], side[overlap.layer] = overlap.cell, overlap.side
    first = np.searchsorted(cell, np.arange(count + 1))
    wanted = _side_of_cells(first, side, distance, areas, winding, maximum_distance)
    chosen, ambiguous = _choose(first, side, area, distance, wanted, areas)
    taken = chosen[overlap.layer]
    return Choice(taken, ambiguous, wanted)


def _side_of_cells(
    first: np.ndarray,
    side: np.ndarray,
    distance: np.ndarray,
    areas: np.ndarray,
    winding: Winding,
    maximum_distance: float,
) -> np.ndarray:
    """Side that each cell has to see, as its connected piece of the target tells it."""
    squares = np.zeros((len(areas), 2))
    _squares_of_distances(first, side, distance, maximum_distance, squares)
    turned = winding.side < 0
    squares[turned] = squares[turned, ::-1]
    upper, lower = (
        np.bincount(winding.piece, areas * of_side, minlength=len(winding.two_sided))
        for of_side in squares.T
    )
    known = winding.two_sided & (
        np.maximum(upper, lower) > CLEARLY_FARTHER * np.minimum(upper, lower)
    )
    of_piece = np.where(known, np.where(upper < lower, 1, -1), 0)
    return of_piece[winding.piece] * winding.side


@routine
def _squares_of_distances(first, side, distance, farthest, squares):
    """Write the squares of the distances to the nearest layers of side 1 and -1, shape (C, 2).

    Cells without any layer count for neither side.
    """
    for c in range(len(first) - 1):
        upper, lower = BEYOND * farthest, BEYOND * farthest
        for layer in range(first[c], first[c + 1]):
            if side[layer] > 0:
                upper = min(upper, distance[layer])
            else:
                lower = min(lower, distance[layer])
        if first[c + 1] > first[c]:
            squares[c, 0], squares[c, 1] = upper * upper, lower * lower


@routine
def _choose(first, side, area, distance, wanted, areas):
    """Return whether each layer is taken, and whether each cell could not decide."""
    chosen = np.zeros(len(side), dtype=np.bool_)
    ambiguous = np.zeros(len(areas), dtype=np.bool_)
    for c in range(len(areas)):
        nearest, largest = -1, 0.0
        for layer in range(first[c], first[c + 1]):
            if wanted[c] == 0 or side[layer] == wanted[c]:
                largest = max(largest, area[layer])
        for layer in range(first[c], first[c + 1]):
            if wanted[c] != 0 and side[layer] != wanted[c]:
                continue
            if area[layer] < TOUCHING * largest:
                continue
            if nearest < 0 or distance[layer] < distance[nearest]:
                nearest = layer
        if nearest < 0 or distance[nearest] == np.inf:
            continue
        chosen[nearest] = True
        covered = area[nearest]
        for layer in range(first[c], first[c + 1]):
            if layer == nearest or distance[layer] == np.inf:
                continue
            if wanted[c] != 0 and side[layer] != wanted[c]:
                continue
            if side[layer] == side[nearest] and covered + area[layer] <= TILING * areas[c]:
                chosen[layer] = True
                covered += area[layer]
                continue
            if area[layer] < TOUCHING * largest:
                continue
            decisive = DECISIVE if side[layer] == side[nearest] else DECISIVE_OF_SIDES
            if distance[layer] < decisive * distance[nearest]:
                ambiguous[c] = True
    return chosen, ambiguous


# --- shares of the faces' contents, evened out among the cells over the same faces ----------------
# Cells tile every triangle of the sheet, so that its content goes to them wholly. But over an edge
# between two triangles that lean to each other the cells are seen from two sides: by turns one gets
# a strip twice and another gets it not at all. On a coarse mesh of a sharp bend single cells then
# hold a tenth more or less fibre than lies over them. Here the shares are scaled by turns, those of
# a cell to the area of the cell, those of a face to what it had: mass moves between neighbours and
# none is lost or made.
#
# Source: R. Sinkhorn, "Diagonal equivalence to matrices with prescribed row and column sums",
# American Mathematical Monthly 74 (1967) 402. It is stopped early: evening out goes as far as
# neighbours of neighbours, and leaves folds and stretched regions their content.

# Turns of scaling cells, then faces.
SWEEPS = 10


def _even_shares(
    overlap: Overlaps, content: np.ndarray, face_areas: np.ndarray, covered_areas: np.ndarray
) -> tuple[np.ndarray, float]:
    """Even out the shares of the faces' contents; return them, and the share that was moved.

    Parameters
    ----------
    content : share of each face that goes to the cell of each pair, shape (K,).
    face_areas : [m2], shape (F,).
    covered_areas : of the cells [m2], shape (C,).
    """
    even = content.copy()
    _sweep(overlap.cell, overlap.face, even, face_areas, covered_areas, SWEEPS)
    moved = np.abs(even - content) @ face_areas[overlap.face]
    total = content @ face_areas[overlap.face]
    return even, float(0.5 * moved / total) if total > 0.0 else 0.0


@routine
def _sweep(cell, face, content, face_areas, wanted, sweeps):
    """Scale the shares of all cells, then those of all faces, by turns."""
    given = np.zeros(len(face_areas))
    for k in range(len(face)):
        given[face[k]] += content[k]
    of_cell, of_face = np.empty(len(wanted)), np.empty(len(face_areas))
    for _ in range(sweeps):
        of_cell[:] = 0.0
        for k in range(len(face)):
            of_cell[cell[k]] += content[k] * face_areas[face[k]]
        for c in range(len(wanted)):
            of_cell[c] = wanted[c] / of_cell[c] if of_cell[c] > 0.0 and wanted[c] > 0.0 else 1.0
        of_face[:] = 0.0
        for k in range(len(face)):
            content[k] *= of_cell[cell[k]]
            of_face[face[k]] += content[k]
        for f in range(len(of_face)):
            of_face[f] = given[f] / of_face[f] if of_face[f] > 0.0 else 1.0
        for k in range(len(face)):
            content[k] *= of_face[face[k]]
