"""Solid cells as tetrahedra, such that neighbours fit and no numbering matters, and their clipping.

A side with four corners that do not lie in a plane can be cut along either diagonal. Here a cell
is the mean of both: half of the tetrahedra with one set of diagonals and half of those with the
other. Every side is then shared by its two cells in the same way, whatever their numbering, and
the volume of a cell is that of its trilinear shape functions, which a finite element program
integrates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation

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
QUADS: tuple[list[list[int]], ...] = (
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


# --- tetrahedra and triangles clipped by a tetrahedron: exact volumes, areas and centroids --------

#: Most corners of a tetrahedron that six planes have cut, with those that a cut removes.
MOST_CORNERS = 64


@strict_equation
def tetrahedron_planes(a, b, c, d, planes):
    """Write the inward half spaces n·x + k >= 0 of a tetrahedron, rows (n, k), shape (4, 4).

    Returns the sign of its volume, 0 if it has none. Normals have no unit length.
    """
    volume = det(
        b[0] - a[0], b[1] - a[1], b[2] - a[2],
        c[0] - a[0], c[1] - a[1], c[2] - a[2],
        d[0] - a[0], d[1] - a[1], d[2] - a[2],
    )  # fmt: skip
    if volume == 0.0:
        return 0.0
    sign = 1.0 if volume > 0.0 else -1.0
    _plane(a, c, b, sign, planes[3])
    _plane(a, b, d, sign, planes[2])
    _plane(a, d, c, sign, planes[1])
    _plane(b, c, d, sign, planes[0])
    return sign


@strict_equation
def _plane(a, b, c, sign, plane):
    """Half space on the inner side of the outward triangle (a, b, c)."""
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    fx, fy, fz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    plane[0] = -sign * (ey * fz - ez * fy)
    plane[1] = -sign * (ez * fx - ex * fz)
    plane[2] = -sign * (ex * fy - ey * fx)
    plane[3] = -(plane[0] * a[0] + plane[1] * a[1] + plane[2] * a[2])


@strict_equation
def det(ax, ay, az, bx, by, bz, cx, cy, cz):
    """Determinant of the matrix with the rows a, b, c."""
    return (ay * bz - az * by) * cx + (az * bx - ax * bz) * cy + (ax * by - ay * bx) * cz


@strict_equation
def outside(corners, planes):
    """Whether a tetrahedron lies wholly beyond one of the first four half spaces."""
    for p in range(4):
        highest = -np.inf
        for v in range(4):
            height = (
                planes[p, 0] * corners[v, 0]
                + planes[p, 1] * corners[v, 1]
                + planes[p, 2] * corners[v, 2]
                + planes[p, 3]
            )
            highest = max(highest, height)
        if highest <= 0.0:
            return True
    return False


@strict_equation
def clip_tetrahedron(corners, planes, plane_count, place, next_to, height, moved, moments):
    """Write volume and first moment of a tetrahedron inside half spaces.

    A convex body is kept as corners with three neighbours each, in the order in which they appear
    from outside; a plane cuts edges and links the new corners around each side.
    Source: Powell and Abel, Journal of Computational Physics 297 (2015) 340, section 3.

    Parameters
    ----------
    corners : of the tetrahedron, of positive volume, shape (4, 3).
    planes : rows (n, k) of the half spaces n·x + k >= 0, of which the first plane_count count.
    place, next_to, height, moved : work space for :data:`MOST_CORNERS` corners.
    moments : volume and three first moments about the origin, shape (4,); written.
    """
    moments[:] = 0.0
    for v in range(4):
        for axis in range(3):
            place[v, axis] = corners[v, axis]
    next_to[0, 0], next_to[0, 1], next_to[0, 2] = 1, 3, 2
    next_to[1, 0], next_to[1, 1], next_to[1, 2] = 2, 3, 0
    next_to[2, 0], next_to[2, 1], next_to[2, 2] = 0, 3, 1
    next_to[3, 0], next_to[3, 1], next_to[3, 2] = 1, 2, 0
    count = 4
    for p in range(plane_count):
        count = _cut(planes[p], count, place, next_to, height, moved)
        if count < 4:
            return
    _measure(count, place, next_to, moved, moments)


@strict_equation
def _cut(plane, count, place, next_to, height, moved):
    """Cut a convex body by a half space; return the number of its corners."""
    lowest, highest = np.inf, -np.inf
    for v in range(count):
        h = plane[0] * place[v, 0] + plane[1] * place[v, 1] + plane[2] * place[v, 2] + plane[3]
        height[v] = h
        lowest, highest = min(lowest, h), max(highest, h)
    if lowest >= 0.0:
        return count
    if highest <= 0.0:
        return 0
    before = count
    for v in range(before):
        if height[v] < 0.0:
            continue
        for k in range(3):
            w = next_to[v, k]
            if w >= before or height[w] >= 0.0:
                continue
            share = height[v] / (height[v] - height[w])
            for axis in range(3):
                place[count, axis] = place[v, axis] + share * (place[w, axis] - place[v, axis])
            next_to[count, 0] = v
            next_to[v, k] = count
            height[count] = 0.0
            count += 1
    # Around the side that starts at each new corner, the next new corner is its neighbour.
    for first in range(before, count):
        here = first
        to = next_to[first, 0]
        while True:
            slot = _slot(next_to, to, here)
            here = to
            to = next_to[here, (slot + 1) % 3]
            if here >= before:
                break
        next_to[first, 2] = here
        next_to[here, 1] = first
    kept = 0
    for v in range(count):
        if height[v] >= 0.0:
            for axis in range(3):
                place[kept, axis] = place[v, axis]
                next_to[kept, axis] = next_to[v, axis]
            moved[v] = kept
            kept += 1
    for v in range(kept):
        for k in range(3):
            next_to[v, k] = moved[next_to[v, k]]
    return kept


@strict_equation
def _slot(next_to, here, neighbour):
    """Which neighbour of a corner another one is."""
    if next_to[here, 0] == neighbour:
        return 0
    return 1 if next_to[here, 1] == neighbour else 2


@strict_equation
def _measure(count, place, next_to, walked, moments):
    """Volume and first moments of a convex body: fans over its sides, cones to its first corner."""
    ox, oy, oz = place[0, 0], place[0, 1], place[0, 2]
    for v in range(count):
        walked[v] = 0
    for first in range(count):
        for start in range(3):
            if walked[first] & (1 << start):
                continue
            walked[first] |= 1 << start
            ax, ay, az = place[first, 0] - ox, place[first, 1] - oy, place[first, 2] - oz
            here = first
            to = next_to[first, start]
            slot = (_slot(next_to, to, here) + 1) % 3
            here = to
            walked[here] |= 1 << slot
            to = next_to[here, slot]
            while to != first:
                bx, by, bz = place[here, 0] - ox, place[here, 1] - oy, place[here, 2] - oz
                cx, cy, cz = place[to, 0] - ox, place[to, 1] - oy, place[to, 2] - oz
                volume = det(ax, ay, az, cx, cy, cz, bx, by, bz) / 6.0
                moments[0] += volume
                moments[1] += 0.25 * volume * (ax + bx + cx)
                moments[2] += 0.25 * volume * (ay + by + cy)
                moments[3] += 0.25 * volume * (az + bz + cz)
                slot = (_slot(next_to, to, here) + 1) % 3
                here = to
                walked[here] |= 1 << slot
                to = next_to[here, slot]
    moments[1] += moments[0] * ox
    moments[2] += moments[0] * oy
    moments[3] += moments[0] * oz


@strict_equation
def clip_triangle(corners, planes, work, height, centroid):
    """Area [m2] of a triangle inside four half spaces; writes the centroid of that part.

    Source: Sutherland and Hodgman, Communications of the ACM 17 (1974) 32.

    Parameters
    ----------
    corners : of the triangle, shape (3, 3).
    work, height : work space, shapes (2, 16, 3) and (16,).
    """
    count = 3
    for k in range(3):
        for axis in range(3):
            work[0, k, axis] = corners[k, axis]
    now = 0
    for p in range(4):
        for k in range(count):
            height[k] = (
                planes[p, 0] * work[now, k, 0]
                + planes[p, 1] * work[now, k, 1]
                + planes[p, 2] * work[now, k, 2]
                + planes[p, 3]
            )
        kept = 0
        for k in range(count):
            w = (k + 1) % count
            if height[k] >= 0.0:
                for axis in range(3):
                    work[1 - now, kept, axis] = work[now, k, axis]
                kept += 1
            if (height[k] > 0.0 and height[w] < 0.0) or (height[k] < 0.0 and height[w] > 0.0):
                share = height[k] / (height[k] - height[w])
                for axis in range(3):
                    a, b = work[now, k, axis], work[now, w, axis]
                    work[1 - now, kept, axis] = a + share * (b - a)
                kept += 1
        now, count = 1 - now, kept
        if count < 3:
            return 0.0
    return _polygon_area(work[now], count, centroid)


@strict_equation
def _polygon_area(polygon, count, centroid):
    """Area of a plane convex polygon in space; writes its centroid."""
    area = 0.0
    centroid[:] = 0.0
    for k in range(1, count - 1):
        ox, oy, oz = polygon[0, 0], polygon[0, 1], polygon[0, 2]
        ex, ey, ez = polygon[k, 0] - ox, polygon[k, 1] - oy, polygon[k, 2] - oz
        fx, fy, fz = polygon[k + 1, 0] - ox, polygon[k + 1, 1] - oy, polygon[k + 1, 2] - oz
        x, y, z = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
        part = 0.5 * np.sqrt(x * x + y * y + z * z)
        area += part
        for axis in range(3):
            middle = (polygon[0, axis] + polygon[k, axis] + polygon[k + 1, axis]) / 3.0
            centroid[axis] += part * middle
    if area > 0.0:
        for axis in range(3):
            centroid[axis] /= area
    return area
