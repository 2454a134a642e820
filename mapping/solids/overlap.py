"""Volumes and centroids of the overlaps of target cells with the columns of a sheet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from lcmchain.jit import kernel, strict_equation
from lcmchain.mapping.solids.columns import Columns, touching
from lcmchain.mapping.solids.tetrahedra import (
    MOST_CORNERS,
    TABLE,
    Solids,
    clip_tetrahedron,
    det,
    outside,
    tetrahedron_planes,
)

#: Overlaps below this share of the cell and of the column are rounding at common sides.
SLIVER = 1e-13

#: Cells that one thread works through before it takes the next ones.
CHUNK = 64


class Overlaps(NamedTuple):
    """Overlaps of target cells with columns, by cell, then face."""

    cell: np.ndarray  # (K,) int64
    face: np.ndarray  # (K,) int64
    volume: np.ndarray  # (K,) [m3]
    centroid: np.ndarray  # (K, 3) [m]

    def only(self, chosen: np.ndarray) -> Overlaps:
        """The overlaps that a mask (K,) names."""
        return Overlaps(*(values[chosen] for values in self))


class Slices(NamedTuple):
    """Part of the target's thickness that the ply of each overlap takes.

    place : of each corner of the cells in the thickness, 0 below and 1 above, shape (C, 8).
    lower, upper : of each overlap, infinite for the outermost plies, shape (K,).
    """

    place: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def nothing(cls, overlap: Overlaps, cell_count: int) -> Slices:
        """Return slices that cut nothing off."""
        whole = np.full(len(overlap.cell), np.inf)
        return cls(np.zeros((cell_count, 8)), -whole, whole)


def overlaps(cells: Solids, columns: Columns) -> Overlaps:
    """Intersect every cell with the columns: tetrahedra clipped by tetrahedra."""
    start, near = touching(columns.tree, cells.low, cells.high)
    cell = np.repeat(np.arange(len(start) - 1), np.diff(start))
    nothing = np.zeros(len(near))
    pairs = Overlaps(cell, near, nothing, np.zeros((0, 3)))
    return _intersect(cells, columns, pairs, Slices.nothing(pairs, len(cells.volumes)))


def sliced(cells: Solids, columns: Columns, overlap: Overlaps, slices: Slices) -> Overlaps:
    """Intersect again, each overlap with the slice of its cell that its ply takes.

    Every overlap stays, with a volume of zero where the ply has nothing of the cell.
    """
    return _intersect(cells, columns, overlap, slices, keep_all=True)


def _intersect(
    cells: Solids, columns: Columns, pairs: Overlaps, slices: Slices, *, keep_all: bool = False
) -> Overlaps:
    cell, face = pairs.cell, pairs.face
    start = np.searchsorted(cell, np.arange(len(cells.volumes) + 1))
    moments = np.zeros((len(cell), 4))
    _clip(start, face, *cells[:4], *columns.solids[:4], TABLE, *slices, moments)
    volume = moments[:, 0]
    least = SLIVER * np.minimum(cells.volumes[cell], columns.solids.volumes[face])
    held = volume > least
    volume = np.where(held, volume, 0.0)
    centroid = cells.corners[cell, 0] + moments[:, 1:] / np.where(held, volume, np.inf)[:, None]
    overlap = Overlaps(cell, face, volume, centroid)
    return overlap if keep_all else overlap.only(held)


@kernel
def _clip(
    start, near, corners, shape, counts, weight,
    column_corners, column_shape, column_counts, column_weight, table,
    place_in_thickness, lower, upper, moments,
):  # fmt: skip
    """Write volume and first moment about the cell's first corner of every pair, (pairs, 4)."""
    cell_count = len(start) - 1
    for chunk in prange((cell_count + CHUNK - 1) // CHUNK):
        own = np.empty((10, 4, 3))
        other = np.empty((4, 3))
        planes = np.empty((6, 4))
        thickness = np.empty((10, 4))
        place = np.empty((MOST_CORNERS, 3))
        next_to = np.empty((MOST_CORNERS, 3), np.int64)
        height = np.empty(MOST_CORNERS)
        moved = np.empty(MOST_CORNERS, np.int64)
        part = np.empty(4)
        sign = np.empty(10)
        own_planes = np.empty((10, 4, 4))
        for c in range(chunk * CHUNK, min((chunk + 1) * CHUNK, cell_count)):
            for t in range(counts[c]):
                four = table[shape[c], t]
                relative(corners[c], four, corners[c, 0], own[t])
                _linear_function(own[t], place_in_thickness[c], four, thickness[t])
                sign[t] = weight[c] * _make_positive(own[t])
                tetrahedron_planes(own[t, 0], own[t, 1], own[t, 2], own[t, 3], own_planes[t])
            for k in range(start[c], start[c + 1]):
                f = near[k]
                for s in range(column_counts[f]):
                    relative(column_corners[f], table[column_shape[f], s], corners[c, 0], other)
                    turned = tetrahedron_planes(other[0], other[1], other[2], other[3], planes)
                    if turned == 0.0:
                        continue
                    for t in range(counts[c]):
                        if sign[t] == 0.0 or _apart(own[t], other):
                            continue
                        if outside(own[t], planes) or outside(other, own_planes[t]):
                            continue
                        plane_count = _slice(thickness[t], lower[k], upper[k], planes)
                        clip_tetrahedron(
                            own[t], planes, plane_count, place, next_to, height, moved, part
                        )
                        share = sign[t] * turned * column_weight[f]
                        for m in range(4):
                            moments[k, m] += share * part[m]


@strict_equation
def _slice(thickness, lower, upper, planes):
    """Append the half spaces of a slice of the thickness; return the number of half spaces."""
    count = 4
    if lower > -np.inf:
        for m in range(4):
            planes[count, m] = thickness[m]
        planes[count, 3] -= lower
        count += 1
    if upper < np.inf:
        for m in range(4):
            planes[count, m] = -thickness[m]
        planes[count, 3] += upper
        count += 1
    return count


@strict_equation
def _linear_function(t, values, numbers, function):
    """Write gradient and constant of the linear function with given values at four corners."""
    ex, ey, ez = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    fx, fy, fz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    gx, gy, gz = t[3, 0] - t[0, 0], t[3, 1] - t[0, 1], t[3, 2] - t[0, 2]
    volume = det(ex, ey, ez, fx, fy, fz, gx, gy, gz)
    first = values[numbers[0]]
    a, b, c = (
        values[numbers[1]] - first,
        values[numbers[2]] - first,
        values[numbers[3]] - first,
    )
    if volume == 0.0:
        function[:] = 0.0
        return
    function[0] = (
        a * (fy * gz - fz * gy) + b * (gy * ez - gz * ey) + c * (ey * fz - ez * fy)
    ) / volume
    function[1] = (
        a * (fz * gx - fx * gz) + b * (gz * ex - gx * ez) + c * (ez * fx - ex * fz)
    ) / volume
    function[2] = (
        a * (fx * gy - fy * gx) + b * (gx * ey - gy * ex) + c * (ex * fy - ey * fx)
    ) / volume
    function[3] = first - (function[0] * t[0, 0] + function[1] * t[0, 1] + function[2] * t[0, 2])


@strict_equation
def relative(corners, numbers, origin, tetrahedron):
    """Write four corners of a cell relative to an origin."""
    for k in range(4):
        for axis in range(3):
            tetrahedron[k, axis] = corners[numbers[k], axis] - origin[axis]


@strict_equation
def _make_positive(t):
    """Swap two corners of a tetrahedron of negative volume; return the sign that it had."""
    ex, ey, ez = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    fx, fy, fz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    gx, gy, gz = t[3, 0] - t[0, 0], t[3, 1] - t[0, 1], t[3, 2] - t[0, 2]
    volume = (
        (ey * fz - ez * fy) * gx + (ez * fx - ex * fz) * gy + (ex * fy - ey * fx) * gz
    )  # fmt: skip
    if volume >= 0.0:
        return 1.0 if volume > 0.0 else 0.0
    for axis in range(3):
        kept = t[0, axis]
        t[0, axis] = t[1, axis]
        t[1, axis] = kept
    return -1.0


@strict_equation
def _apart(a, b):
    """Whether the boxes around two tetrahedra have no point in common."""
    for axis in range(3):
        low = min(min(a[0, axis], a[1, axis]), min(a[2, axis], a[3, axis]))
        high = max(max(a[0, axis], a[1, axis]), max(a[2, axis], a[3, axis]))
        other_low = min(min(b[0, axis], b[1, axis]), min(b[2, axis], b[3, axis]))
        other_high = max(max(b[0, axis], b[1, axis]), max(b[2, axis], b[3, axis]))
        if high <= other_low or low >= other_high:
            return True
    return False


# --- which wall of the sheet a cell belongs to, where two are closer than the cell is large -------

#: A cell that holds at least this part of another wall, as against its own, belongs to neither.
UNDECIDED = 0.5

#: Two pieces of a sheet are walls when they lie over each other rather than beside each other.
OVER = 0.7


class Walls(NamedTuple):
    """Overlaps of cells with their own walls.

    kept : overlaps that belong to the wall of their cell, shape (K,).
    undecided : cells that two walls share, shape (C,).
    """

    kept: np.ndarray
    undecided: np.ndarray


def own_walls(overlap: Overlaps, columns: Columns, body: np.ndarray, cell_count: int) -> Walls:
    """Keep of each cell's overlaps those with the wall that it holds most of, ply by ply.

    Faces over a cell that are connected through common nodes are one wall; pieces that are not
    connected, such as both sides of a cut, are different walls if they lie over each other.

    Parameters
    ----------
    body : ply of each face, shape (F,).
    """
    start = np.searchsorted(overlap.cell, np.arange(cell_count + 1))
    piece = _pieces(start, overlap.face, columns.faces, len(columns.points))
    kept = np.ones(len(piece), dtype=bool)
    undecided = np.zeros(cell_count, dtype=bool)
    height = np.einsum(
        "ki,ki->k",
        overlap.centroid - columns.centroids[overlap.face],
        columns.face_normals[overlap.face],
    )
    foot = overlap.centroid - height[:, None] * columns.face_normals[overlap.face]
    ply = body[overlap.face]
    first = piece == np.arange(len(piece))
    pairs, count = np.unique(
        np.stack([overlap.cell, ply], axis=1)[first], axis=0, return_counts=True
    )
    for cell, own_ply in pairs[count > 1]:
        entries = np.arange(start[cell], start[cell + 1])
        own = entries[ply[entries] == own_ply]
        dropped, open_question = _other_walls(own, piece, overlap, foot, columns.face_normals)
        kept[dropped] = False
        undecided[cell] |= open_question
    return Walls(kept, undecided)


def _other_walls(
    entries: np.ndarray, piece: np.ndarray, overlap: Overlaps, foot: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Entries of a cell that belong to another wall than its largest, and whether that is open."""
    pieces, which = np.unique(piece[entries], return_inverse=True)
    volume = np.bincount(which, weights=overlap.volume[entries])
    largest = int(np.argmax(volume))

    def mean(values: np.ndarray, number: int) -> np.ndarray:
        own = entries[which == number]
        return np.average(values[own], axis=0, weights=overlap.volume[own])

    place = mean(foot, largest)
    normal = mean(normals[overlap.face], largest)
    dropped = np.zeros(len(entries), dtype=bool)
    undecided = False
    for number in range(len(pieces)):
        apart = mean(foot, number) - place
        if number == largest or abs(apart @ normal) < OVER * np.linalg.norm(apart):
            continue
        dropped |= which == number
        undecided |= bool(volume[number] > UNDECIDED * volume[largest])
    return entries[dropped], undecided


@strict_equation
def _pieces(start, face, faces, node_count):
    """First entry of the connected piece that each entry belongs to, shape (K,)."""
    parent = np.arange(len(face))
    seen_in = np.full(node_count, -1, np.int64)
    seen_by = np.zeros(node_count, np.int64)
    for c in range(len(start) - 1):
        for k in range(start[c], start[c + 1]):
            for corner in range(4):
                node = faces[face[k], corner]
                if seen_in[node] != c:
                    seen_in[node] = c
                    seen_by[node] = k
                    continue
                a, b = k, seen_by[node]
                while parent[a] != a:
                    a = parent[a]
                while parent[b] != b:
                    b = parent[b]
                parent[max(a, b)] = min(a, b)
    for k in range(len(face)):
        a = k
        while parent[a] != a:
            a = parent[a]
        parent[k] = a
    return parent
