"""Closest place of a surface for many points, by a tree of boxes around its triangles.

Triangles of STL files differ in size by orders of magnitude, which a tree of their centres (scipy)
does not bear; trimesh and libigl would do, but bring more than the forty lines that this takes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mesh.search import closest_point_of_triangle

#: Triangles per leaf of the tree, and bits per axis of the curve that they are sorted along.
LEAF = 8
BITS = 20
#: Depth of the tree, and so of the stack of a search, that no surface reaches.
DEEPEST = 64


class TriangleTree(NamedTuple):
    """Complete binary tree of boxes: the children of node i are 2i and 2i + 1, the root is 1.

    low, high : corners of the boxes [m], shape [2 leaf_count, 3].
    corners : of the triangles in the order of the leaves [m], shape [leaf_count LEAF, 3, 3].
    triangle : their numbers in the surface, shape [leaf_count LEAF].
    """

    low: np.ndarray
    high: np.ndarray
    corners: np.ndarray
    triangle: np.ndarray


class Closest(NamedTuple):
    """Closest places of P points: triangle, feature (see ``closest_point``), distance [m]."""

    triangle: np.ndarray
    feature: np.ndarray
    foot: np.ndarray
    distance: np.ndarray


def triangle_tree(corners: np.ndarray) -> TriangleTree:
    """Build the tree of triangles with these corners [m], shape [triangle_count, 3, 3].

    Neighbours along a Z-order curve share a leaf.
    Source: Lauterbach et al., "Fast BVH construction on GPUs", Computer Graphics Forum 28 (2009).
    """
    count = len(corners)
    centres = corners.mean(axis=1)
    size = max(float(np.ptp(centres, axis=0).max()), np.finfo(float).tiny)
    cell = ((centres - centres.min(axis=0)) / size * (2**BITS - 1)).astype(np.int64)
    code = np.zeros(count, dtype=np.int64)
    for bit in range(BITS):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    leaf_count = 1
    while leaf_count * LEAF < count:
        leaf_count *= 2
    # spread evenly over the leaves; the rest of each repeats its last triangle
    place = np.minimum(np.arange(leaf_count * LEAF) * count // (leaf_count * LEAF), count - 1)
    order = np.argsort(code, kind="stable")[place]
    sorted_corners = np.ascontiguousarray(corners[order], dtype=float)
    low = np.zeros((2 * leaf_count, 3))
    high = np.zeros((2 * leaf_count, 3))
    own = sorted_corners.reshape(leaf_count, LEAF * 3, 3)
    low[leaf_count:], high[leaf_count:] = own.min(axis=1), own.max(axis=1)
    first = leaf_count
    while first > 1:
        children = slice(first, 2 * first)
        first //= 2
        low[first : 2 * first] = low[children].reshape(first, 2, 3).min(axis=1)
        high[first : 2 * first] = high[children].reshape(first, 2, 3).max(axis=1)
    return TriangleTree(low, high, sorted_corners, order)


def closest_places(tree: TriangleTree, points: np.ndarray) -> Closest:
    """Find the closest place of the surface for points [m], shape [point_count, 3]."""
    points = np.ascontiguousarray(points, dtype=float)
    count = len(points)
    found = Closest(
        np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros((count, 3)), np.zeros(count)
    )
    _search(*tree, points, *found)
    return found


@strict_equation
def _box_distance2(low, high, x, y, z):
    """Square of the distance of a point to a box [m²]."""
    dx = max(low[0] - x, 0.0, x - high[0])
    dy = max(low[1] - y, 0.0, y - high[1])
    dz = max(low[2] - z, 0.0, z - high[2])
    return dx * dx + dy * dy + dz * dz


@strict_equation
def _search(low, high, corners, triangle, points, found, feature, foot, distance):
    leaf_count = low.shape[0] // 2
    stack = np.zeros(DEEPEST, np.int64)
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        best = np.inf
        stack[0] = 1
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if _box_distance2(low[node], high[node], x, y, z) >= best:
                continue
            if node < leaf_count:
                near, far = 2 * node, 2 * node + 1
                if _box_distance2(low[far], high[far], x, y, z) < _box_distance2(
                    low[near], high[near], x, y, z
                ):
                    near, far = far, near
                stack[waiting] = far
                stack[waiting + 1] = near
                waiting += 2
                continue
            first = (node - leaf_count) * LEAF
            for t in range(first, first + LEAF):
                qx, qy, qz, lies_on = closest_point_of_triangle(corners[t], x, y, z)
                square = (x - qx) ** 2 + (y - qy) ** 2 + (z - qz) ** 2
                if square < best:
                    best = square
                    found[p], feature[p] = triangle[t], lies_on
                    foot[p, 0], foot[p, 1], foot[p, 2] = qx, qy, qz
        distance[p] = np.sqrt(best)
