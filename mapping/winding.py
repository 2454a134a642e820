"""Neighbours across edges, connected pieces, and the side that each face of a mesh shows.

Two faces that share an edge show the same side where they run along it in opposite directions.
Meshes of other programs do not always do so; here the faces of a piece are turned until they do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine


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
    corner_count = np.where(faces[:, 3] >= 0, 4, 3)
    columns = np.arange(4)
    following = np.where(columns + 1 < corner_count[:, None], columns + 1, 0)
    ends = np.take_along_axis(faces, following, axis=1)
    real = (columns < corner_count[:, None]) & (faces != ends)
    owner, column = np.nonzero(real)
    start, end = faces[real], ends[real]
    low, high = np.minimum(start, end).astype(np.int64), np.maximum(start, end)
    key = low * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    uses = np.diff(first, append=len(order))
    bounds = np.zeros(faces.shape, dtype=bool)
    once = order[first[uses == 1]]
    bounds[owner[once], column[once]] = True
    twice = first[uses == 2]
    one, other = order[twice], order[twice + 1]
    neighbours = np.full(faces.shape, -1, dtype=np.int64)
    against = np.zeros(faces.shape, dtype=bool)
    turned = start[one] == start[other]  # both run along the edge the same way
    for here, there in ((one, other), (other, one)):
        neighbours[owner[here], column[here]] = owner[there]
        against[owner[here], column[here]] = turned
    return Winding(neighbours, bounds, *_pieces(neighbours, against))


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
