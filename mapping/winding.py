"""Neighbours across edges, connected pieces, and the side that each face of a mesh shows.

Two faces that share an edge show the same side where they run along it in opposite directions.
Meshes of other programs do not always do so; here the faces of a piece are turned until they do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine


class Winding(NamedTuple):
    """Pieces of a mesh of triangles and quadrilaterals.

    neighbours : face across edge k (corner k to k + 1) of each face, shape (F, 4); -1 where there
        is none, or more than one.
    bounds : whether edge k of a face belongs to no other face, shape (F, 4).
    piece : number of the piece that each face belongs to, shape (F,).
    side : 1, or -1 where the face shows the other side than the first face of its piece, (F,).
    two_sided : whether a piece has two sides; a Möbius strip has not. Shape (pieces,).
    """

    neighbours: np.ndarray
    bounds: np.ndarray
    piece: np.ndarray
    side: np.ndarray
    two_sided: np.ndarray


def winding(faces: np.ndarray) -> Winding:
    """Find neighbours, pieces and sides.

    faces : numbers of places, shape (F, 4); -1 in the last column marks a triangle. Corners that
        lie at the same place have the same number.
    """
    neighbours, bounds, against = _neighbours(faces, int(faces.max(initial=0)) + 1)
    return Winding(neighbours, bounds, *_pieces(neighbours, against))


@routine
def _neighbours(faces, place_count):
    """Faces across edges, edges without one, and whether both faces run along the edge one way.

    The edges are listed by the lower of their two places, where few others are to compare with.
    """
    shape = faces.shape
    neighbours = np.full(shape, -1, dtype=np.int64)
    bounds, against = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    first = np.zeros(place_count + 1, dtype=np.int64)
    for face in range(len(faces)):
        for column in range(4):
            start, end = edge_of(faces, face, column)
            if start != end:
                first[min(start, end) + 1] += 1
    for place in range(place_count):
        first[place + 1] += first[place]
    edges = np.empty((first[place_count], 3), dtype=np.int64)  # higher place, face and column, way
    filled = first[:-1].copy()
    for face in range(len(faces)):
        for column in range(4):
            start, end = edge_of(faces, face, column)
            if start != end:
                row = filled[min(start, end)]
                filled[min(start, end)] += 1
                edges[row, 0], edges[row, 1] = max(start, end), 4 * face + column
                edges[row, 2] = 1 if start < end else -1
    for place in range(place_count):
        for row in range(first[place], first[place + 1]):
            uses, other = 0, -1
            for k in range(first[place], first[place + 1]):
                if edges[k, 0] == edges[row, 0]:
                    uses += 1
                    other = k if k != row else other
            face, column = edges[row, 1] // 4, edges[row, 1] % 4
            bounds[face, column] = uses == 1
            if uses == 2:
                neighbours[face, column] = edges[other, 1] // 4
                against[face, column] = edges[other, 2] == edges[row, 2]
    return neighbours, bounds, against


@equation
def edge_of(faces, face, column):
    """Ends of an edge of a face; twice the same where a triangle has none in this column."""
    count = 4 if faces[face, 3] >= 0 else 3
    if column >= count:
        return faces[face, 0], faces[face, 0]
    return faces[face, column], faces[face, column + 1 if column + 1 < count else 0]


@routine
def _pieces(neighbours, against):
    count = len(neighbours)
    piece = np.full(count, -1, dtype=np.int64)
    side = np.ones(count, dtype=np.int8)
    two_sided = np.ones(count, dtype=np.bool_)
    waiting = np.empty(count, dtype=np.int64)
    pieces = 0
    for seed in range(count):
        if piece[seed] >= 0:
            continue
        piece[seed], waiting[0], height = pieces, seed, 1
        while height > 0:
            height -= 1
            face = waiting[height]
            for k in range(4):
                other = neighbours[face, k]
                if other < 0:
                    continue
                wanted = -side[face] if against[face, k] else side[face]
                if piece[other] < 0:
                    piece[other], side[other] = pieces, wanted
                    waiting[height] = other
                    height += 1
                elif side[other] != wanted:
                    two_sided[pieces] = False
        pieces += 1
    return piece, side, two_sided[:pieces].copy()
