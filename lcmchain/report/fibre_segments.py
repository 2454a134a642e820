"""Fibre lines of a formed sheet that a picture shows: few, evenly spaced, symmetric.

Fibres along both axes of the ply are edges of the mesh. Those of families at other angles are
straight lines of the undeformed sheet, carried along by its faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.fields.sheet import (
    FROM_PLY_AXIS,
    families_of,
    reference_positions,
    sheet_faces,
    vector,
)
from lcmchain.mesh.lines import lines_along
from lcmchain.mesh.sheet_mesh import NO_NODE

if TYPE_CHECKING:
    import xarray as xr

# Lines of either family in a picture, whatever the mesh.
MOST_LINES = 31
# Lines of the mesh that lie nearer to each other than this part of an edge are one line in two
# pieces; pieces of fewer nodes may lie aside, where a cut edge has moved them.
ONE_LINE, LEAST_NODES = 0.25, 4


# Points of a straight fibre line per edge of the mesh.
POINTS_PER_EDGE = 2
# Length of a piece between two of them, over that of a piece that is not stretched.
LONGEST_PIECE = 2.0


def fibre_lines(
    sheet: xr.Dataset, points: np.ndarray, most: int = MOST_LINES
) -> list[tuple[int, np.ndarray]]:
    """Return the number of each family and pieces (S, 2, 3) of its lines on the formed sheet.

    A film has none.

    Parameters
    ----------
    points : of the formed sheet (n, 3), in the unit of what is returned.
    most : at most so many lines of a family are kept.
    """
    if not families_of(sheet):  # a film
        return []
    if FROM_PLY_AXIS not in sheet["fibre_direction_1_x"].attrs:
        segments = fibre_segments(sheet, most)
        return [(number, points[nodes]) for number, nodes in enumerate(segments, start=1)]
    return [(number, _straight_lines(sheet, points, number, most)) for number in families_of(sheet)]


def _straight_lines(sheet: xr.Dataset, points: np.ndarray, number: int, most: int) -> np.ndarray:
    """Return pieces (S, 2, 3) of lines that were straight in the undeformed, level sheet."""
    reference, faces = reference_positions(sheet)[:, :2], sheet_faces(sheet)
    first, second = faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]
    triangles = np.concatenate([first, second[second[:, 1] != second[:, 2]]])
    along = vector(sheet, f"fibre_direction_{number}", 0)[:, :2].mean(axis=0)
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    edge = float(np.median(np.linalg.norm(reference[faces[:, 1]] - reference[faces[:, 0]], axis=1)))
    way, place = reference @ along, reference @ across
    step = max((np.ptp(place) + edge) / most, edge)
    middle = 0.5 * (place.min() + place.max())
    count = int(0.5 * np.ptp(place) / step)
    levels = middle + step * np.arange(-count, count + 1)
    ways = np.arange(way.min(), way.max() + edge, edge / POINTS_PER_EDGE)
    grid = ways[None, :, None] * along + levels[:, None, None] * across
    formed = _carried(reference, triangles, points, grid.reshape(-1, 2)).reshape(*grid.shape[:2], 3)
    pieces = np.stack([formed[:, :-1], formed[:, 1:]], axis=2).reshape(-1, 2, 3)
    # a line goes on at the other lip of a slit or joint that has opened; fibres hardly stretch
    formed_edge = np.median(np.linalg.norm(points[faces[:, 1]] - points[faces[:, 0]], axis=1))
    length = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1)
    return pieces[length < LONGEST_PIECE * formed_edge / POINTS_PER_EDGE]  # false where no number


def _carried(
    reference: np.ndarray, triangles: np.ndarray, points: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Return where places (P, 2) of the level sheet have come to, (P, 3), NaN beside it.

    The lips of a slit lie on each other in the level sheet, which triangulations for plots refuse.
    """
    tree = shapely.STRtree(shapely.polygons(reference[triangles]))
    place, triangle = tree.query(shapely.points(places), predicate="intersects")
    found = np.full(len(places), -1)
    found[place[::-1]] = triangle[::-1]  # of several the first
    inside = found >= 0
    corners = reference[triangles[found[inside]]]
    sides = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2)
    part = np.linalg.solve(sides, (places[inside] - corners[:, 0])[..., None])[..., 0]
    weights = np.column_stack([1.0 - part.sum(axis=1), part])
    carried = np.full((len(places), 3), np.nan)
    carried[inside] = np.einsum("pk,pki->pi", weights, points[triangles[found[inside]]])
    return carried


def fibre_segments(sheet: xr.Dataset, most: int = MOST_LINES) -> list[np.ndarray]:
    """Return edges (S, 2) of the mesh along evenly spaced fibres, for both families.

    Parameters
    ----------
    most : at most so many lines of a family are kept, symmetric to the middle one.
    """
    reference, faces = reference_positions(sheet), sheet_faces(sheet)
    fibres = tuple(vector(sheet, f"fibre_direction_{number}", 0) for number in (1, 2))
    lines = lines_along(reference, faces, fibres)  # type: ignore[arg-type]
    edge = float(np.median(np.linalg.norm(reference[faces[:, 1]] - reference[faces[:, 0]], axis=1)))
    normal = np.cross(*(fibre.mean(axis=0) for fibre in fibres))
    kept = []
    for fibre, after in zip(fibres, lines.after, strict=True):
        start = np.flatnonzero(after != NO_NODE)
        if not len(start):
            kept.append(np.empty((0, 2), dtype=int))
            continue
        across = reference @ np.cross(normal, fibre.mean(axis=0))
        level, count = _level_of_line(start, after[start], across, edge)
        keep = np.isin(level[start], even_choice(count, most))
        kept.append(np.stack([start, after[start]], axis=1)[keep])
    return kept


def _level_of_line(
    start: np.ndarray, end: np.ndarray, across: np.ndarray, edge: float
) -> tuple[np.ndarray, int]:
    """Return which line from one side of the sheet to the other each node lies on, and how many."""
    count = len(across)
    links = csr_matrix((np.ones(len(start)), (start, end)), shape=(count, count))
    pieces, piece = connected_components(links, directed=False)
    order = np.lexsort((across, piece))
    sizes = np.bincount(piece, minlength=pieces)
    first = np.cumsum(sizes) - sizes
    place = across[order][first + sizes // 2]  # the median, which nodes moved aside leave alone
    whole = np.sort(place[sizes >= min(LEAST_NODES, sizes.max())])
    levels = whole[np.diff(whole, prepend=-np.inf) > ONE_LINE * edge]
    nearest = np.abs(place[:, None] - levels).argmin(axis=1)
    return nearest[piece], len(levels)


def even_choice(count: int, most: int) -> np.ndarray:
    """Return numbers of ``count`` at equal distances and symmetric to the middle."""
    step = max(1, -(-count // most))
    rest = (count - 1) % step
    if rest % 2 and step % 2 == 0:  # no even number can be left out on both sides together
        step += 1
        rest = (count - 1) % step
    if rest % 2:
        rest += step
    return np.arange(rest // 2, count - rest // 2, step)
