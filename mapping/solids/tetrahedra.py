"""Solid cells as tetrahedra, such that neighbours fit and no numbering matters.

A side with four corners that do not lie in a plane can be cut along either diagonal. Here a cell
is the mean of both: half of the tetrahedra with one set of diagonals and half of those with the
other. Every side is then shared by its two cells in the same way, whatever their numbering, and
the volume of a cell is that of its trilinear shape functions, which a finite element program
integrates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

TETRA, PYRAMID, WEDGE, HEXAHEDRON = range(4)
SHAPE_OF_CORNERS = {4: TETRA, 5: PYRAMID, 6: WEDGE, 8: HEXAHEDRON}

#: A cell whose sides are planar to this share of its volume needs one set of diagonals only.
PLANAR = 1e-12

# Corner numbers in the order of VTK, positive volumes; first one set of diagonals, then the other.
_DECOMPOSITIONS: tuple[tuple[list[list[int]], list[list[int]]], ...] = (
    ([[0, 1, 2, 3]], []),
    ([[0, 1, 2, 4], [0, 2, 3, 4]], [[0, 1, 3, 4], [1, 2, 3, 4]]),
    (
        [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]],
        [[0, 1, 2, 3], [1, 2, 3, 4], [2, 4, 5, 3]],
    ),
    (
        [[0, 2, 7, 5], [0, 1, 2, 5], [0, 2, 3, 7], [0, 5, 7, 4], [2, 7, 5, 6]],
        [[1, 3, 4, 6], [0, 1, 3, 4], [1, 2, 3, 6], [1, 6, 4, 5], [3, 4, 6, 7]],
    ),
)

#: Quadrilateral sides of each shape.
QUADS = (
    [],
    [[0, 1, 2, 3]],
    [[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
)

#: Tetrahedra of each shape, shape (4, 10, 4); how many there are with one and with both sets of
#: diagonals, shape (4, 2).
TABLE = np.zeros((4, 10, 4), dtype=np.int64)
COUNTS = np.zeros((4, 2), dtype=np.int64)
for _shape, (_one, _other) in enumerate(_DECOMPOSITIONS):
    TABLE[_shape, : len(_one) + len(_other)] = _one + _other
    COUNTS[_shape] = len(_one), len(_one) + len(_other)


class Solids(NamedTuple):
    """Solid cells as tetrahedra.

    corners : [m], shape (C, 8, 3).
    shape : row of :data:`TABLE` of each cell, shape (C,).
    counts : tetrahedra of each cell, of one set of diagonals or of both, shape (C,).
    weight : of each of these tetrahedra, 1 or 1/2; negative where the numbering of the cell
        turns it inside out, shape (C,).
    volumes : [m3], shape (C,).
    """

    corners: np.ndarray
    shape: np.ndarray
    counts: np.ndarray
    weight: np.ndarray
    volumes: np.ndarray

    @property
    def low(self) -> np.ndarray:
        """Lowest coordinates of each cell [m], shape (C, 3)."""
        return self.corners.min(axis=1)

    @property
    def high(self) -> np.ndarray:
        """Highest coordinates of each cell [m], shape (C, 3)."""
        return self.corners.max(axis=1)


def solids(corners: np.ndarray, shape: np.ndarray) -> Solids:
    """Split cells into tetrahedra.

    Parameters
    ----------
    corners : in the order of VTK [m], shape (C, 8, 3); unused ones repeat a used corner.
    shape : ``TETRA`` to ``HEXAHEDRON``, shape (C,).
    """
    volumes = np.zeros(len(corners))
    warp = np.zeros(len(corners))
    for number, (one, other) in enumerate(_DECOMPOSITIONS):
        chosen = shape == number
        if not chosen.any():
            continue
        own = corners[chosen]
        found = [sum(_six_volumes(own, tetra) for tetra in half) / 6.0 for half in (one, other)]
        volumes[chosen] = found[0] if number == TETRA else 0.5 * (found[0] + found[1])
        for quad in QUADS[number]:
            warp[chosen] = np.maximum(warp[chosen], np.abs(_six_volumes(own, quad)))
    planar = warp <= PLANAR * np.abs(volumes)
    counts = COUNTS[shape, np.where(planar, 0, 1)]
    weight = np.where(planar | (shape == TETRA), 1.0, 0.5) * np.where(volumes < 0.0, -1.0, 1.0)
    return Solids(np.ascontiguousarray(corners), shape, counts, weight, np.abs(volumes))


def solids_of_cells(points: np.ndarray, corners: np.ndarray) -> Solids:
    """Split the cells of a target; ``corners`` are node numbers, shape (C, 8), filled with -1."""
    count = (corners >= 0).sum(axis=1)
    shape = np.array([SHAPE_OF_CORNERS.get(n, -1) for n in range(9)])[count]
    filled = np.where(corners >= 0, corners, corners[:, :1])
    return solids(points[filled], shape)


def _six_volumes(corners: np.ndarray, four: list[int]) -> np.ndarray:
    """Six times the signed volume of the tetrahedron of four corners [m3], shape (C,)."""
    a, b, c, d = (corners[:, k] for k in four)
    return np.einsum("ci,ci->c", np.cross(b - a, c - a), d - a)
