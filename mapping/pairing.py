"""Which faces a target cell takes from, in what shares: by overlap or by the closest place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.intersection import Overlaps, overlaps
from lcmchain.mapping.layers import choose_layers
from lcmchain.mapping.search import closest_points
from lcmchain.mapping.sharing import even_shares
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import CellPolygons, TargetMesh
from lcmchain.mapping.tiling import coverage_of_planes

# A cell counts as covered from this share on: tangent planes and facets of two meshes of the same
# curved surface disagree by about (cell size / radius of curvature)^2.
COVERED = 0.99

# A face whose nodes all lie over the target is taken as wholly covered when the overlaps found at
# least this share of it; the rest fell into the wedges between neighbouring cells at a sharp bend.
WEDGE = 0.5

# Cells without an edge of the sheet over them are covered if the area seen from the faces differs
# by no more than this: facets of 5 mm on a radius of 10 mm make a few per cent.
CURVED = 0.1

# A face is tiled by the cells over it if their shares leave no more than rounding.
TILED = 1e-9


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


def by_overlap(surface: Surface, target: TargetMesh, maximum_distance: float) -> Pairing:
    """Pair cells of a surface with what lies over them of the layer that they belong to.

    Cells without an overlap take the closest place of the right side, if one is near.
    """
    count = target.cell_count
    cells = target.polygons(np.empty((0, 3)))
    found = overlaps(surface, cells, maximum_distance)
    choice = choose_layers(found, target.surface.winding, cells.areas, maximum_distance)
    if not choice.taken.all():
        found = Overlaps(*(values[choice.taken] for values in found))
    covered = np.bincount(found.cell, found.area, minlength=count)
    nearest, distance = _over_centroid(found, count, maximum_distance)
    unsure = np.flatnonzero(~np.isfinite(distance) | (covered == 0.0))
    if len(unsure):
        sides = cells.normals[unsure] * choice.side[unsure, None]
        closest = closest_points(surface, cells.centroids[unsure], maximum_distance, sides)
        distance[unsure], nearest[unsure] = closest.distance, closest.face
        _distance_of_overlaps(found, covered, distance, nearest)
    alone = np.flatnonzero((covered == 0.0) & (nearest >= 0))
    distance[(covered == 0.0) & (nearest < 0)] = np.nan

    face_coverage, missed, content, correction = _face_coverage(
        surface, target, cells, found, maximum_distance
    )
    coverage = _coverage(surface, cells, found, covered)
    content, moved = even_shares(found, content, surface.areas, coverage * cells.areas)
    average = found.area / np.where(covered > 0.0, covered, 1.0)[found.cell]
    weights: tuple[np.ndarray, ...] = (
        found.cell, found.face, average, found.place, content,
    )  # fmt: skip
    if len(alone):
        foot = closest.foot[np.isin(unsure, alone)]
        place = _in_frames(surface, nearest[alone], foot)
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


def _merged(table: tuple[np.ndarray, ...], more: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Columns of a table of weights with rows of further cells, by cell: the first column."""
    at = np.searchsorted(table[0], more[0])
    return tuple(np.insert(old, at, new, axis=0) for old, new in zip(table, more, strict=True))


def by_closest(surface: Surface, target: TargetMesh, maximum_distance: float) -> Pairing:
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
        place=_in_frames(surface, face, closest.foot[cell]),
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


def _over_centroid(
    found: Overlaps, count: int, maximum_distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Face over the centroid of each cell, and its distance [m]; -1 and infinite without one.

    A face that is steep to the cell may be near on average and too far off over the centroid.
    """
    face, distance = np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
    _least(found.cell, found.face, found.centre, maximum_distance, face, distance)
    return face, distance


@routine
def _least(cell, face, centre, maximum_distance, nearest, distance):
    for k in range(len(cell)):
        if centre[k] <= maximum_distance and centre[k] < distance[cell[k]]:
            nearest[cell[k]], distance[cell[k]] = face[k], centre[k]


def _distance_of_overlaps(
    found: Overlaps, covered: np.ndarray, distance: np.ndarray, nearest: np.ndarray
) -> None:
    """Give covered cells whose centroid is near no face the distance of what lies over them."""
    lost = (covered > 0.0) & (nearest < 0)
    if not lost.any():
        return
    moment = np.bincount(found.cell, found.area * np.abs(found.height), minlength=len(covered))
    distance[lost] = moment[lost] / covered[lost]
    nearest[found.cell[lost[found.cell]]] = found.face[lost[found.cell]]


def _coverage(
    surface: Surface, cells: CellPolygons, found: Overlaps, covered: np.ndarray
) -> np.ndarray:
    """Covered share of each cell, from the covered areas [m2] (C,).

    Areas seen from curved faces do not quite add up to that of a cell which they cover. Cells away
    from the edge of the sheet are covered wholly if little is missing; of all others the faces are
    laid onto the tangent plane, which they tile.
    """
    coverage = covered / np.where(cells.areas > 0.0, cells.areas, 1.0)
    at_edge = np.zeros(len(coverage), dtype=bool)
    bounding = np.asarray(surface.winding.bounds.any(axis=1))
    at_edge[found.cell[bounding[found.face]]] = True
    curved = np.abs(coverage - 1.0) > CURVED
    doubtful: np.ndarray = (coverage > 0.0) & (at_edge | curved)
    tiled = coverage_of_planes(surface, cells, found, np.flatnonzero(doubtful))
    whole: np.ndarray = (coverage > 0.0) & ~doubtful
    whole[doubtful] = tiled >= COVERED
    return np.where(whole, 1.0, np.minimum(coverage, 1.0))


def _in_frames(surface: Surface, face: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points [m] (P, 3) in the frames of their faces, from the centroids, shape (P, 2)."""
    return np.einsum("pui,pi->pu", surface.frames[face], points - surface.centroids[face])


def _face_coverage(
    surface: Surface,
    target: TargetMesh,
    cells: CellPolygons,
    found: Overlaps,
    maximum_distance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Covered share of each face; faces missed; shares of contents; largest correction of these.

    The cells over a face tile it. Only where the target bends more sharply than the sheet, cells on
    either side of the bend leave or share a wedge of it; the shares are then scaled until they sum
    to one: no fibre is lost or made.
    """
    part = found.part
    tiled = np.bincount(found.face, part, minlength=surface.face_count)
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
    return face_coverage, missed, part * scale[found.face], correction


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
