"""Distance of points to the triangles of a surface, and the side on which they lie.

The closest triangle is found by a tree of boxes. Triangles of STL files differ in size by orders of
magnitude, which a tree of their centres (scipy) does not bear; trimesh and libigl would do, but
bring more than the forty lines that this takes.

The side is that of the angle-weighted pseudonormal of the closest face, edge or vertex (Baerentzen
& Aanaes, IEEE Trans. Vis. Comput. Graph. 11, 2005), which needs no closed surface: skins are as
good as solids. At the cracks of a skin the second closest edge counts too, which the closest-point
searches of trimesh and libigl do not give.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mesh.search import closest_point_of_triangle
from lcmchain.tools.surfaces.surface import Surface

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
    """Closest places of P points: triangle, feature, foot [m], distance [m].

    feature : as :func:`lcmchain.mesh.search.closest_point_of_triangle` numbers them.
    """

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
    taken = np.minimum(np.arange(leaf_count * LEAF) * count // (leaf_count * LEAF), count - 1)
    order = np.argsort(code, kind="stable")[taken]
    sorted_corners = np.ascontiguousarray(corners[order], dtype=float)
    low = np.zeros((2 * leaf_count, 3))
    high = np.zeros((2 * leaf_count, 3))
    of_leaf = sorted_corners.reshape(leaf_count, LEAF * 3, 3)
    low[leaf_count:], high[leaf_count:] = of_leaf.min(axis=1), of_leaf.max(axis=1)
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
    closest = Closest(
        np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros((count, 3)), np.zeros(count)
    )
    _search(*tree, points, *closest)
    return closest


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


#: Largest difference of distances, in spacings, at which two open edges count as equally close.
CRACK = 0.05


def feature_normals(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Pseudonormals of the face, vertices and edges (0-1, 1-2, 2-0) of each triangle.

    Returns unit vectors, shape [triangle_count, 7, 3], and whether the feature lies on an open
    edge, shape [triangle_count, 7].
    """
    triangles, edges = surface.triangles, surface.edges
    face = surface.normals
    corners = surface.points[triangles]
    ahead = np.roll(corners, -1, axis=1) - corners
    ahead /= np.linalg.norm(ahead, axis=2, keepdims=True)
    back = -np.roll(ahead, 1, axis=1)
    angle = np.arccos(np.clip(np.einsum("tij,tij->ti", ahead, back), -1.0, 1.0))

    edge_sum = np.zeros((len(surface.edge_use), 3))
    vertex_sum = np.zeros_like(surface.points)
    for i in range(3):
        np.add.at(edge_sum, edges[:, i], face)
        np.add.at(vertex_sum, triangles[:, i], angle[:, i, None] * face)
    normals = np.concatenate((face[:, None], vertex_sum[triangles], edge_sum[edges]), axis=1)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)

    open_edge = (surface.edge_use == 1)[edges]
    open_vertex = np.zeros(len(surface.points), dtype=bool)
    open_vertex[triangles[open_edge]] = True
    open_vertex[np.roll(triangles, -1, axis=1)[open_edge]] = True
    is_open = np.concatenate(
        (np.zeros((len(triangles), 1), bool), open_vertex[triangles], open_edge), axis=1
    )
    return normals, is_open


@strict_equation
def narrow_band(corners, normals, is_open, origin, h, band, overhang, distance, side, alignment):
    """Fill distance and side (+1, -1; 0 behind an open edge) of the nodes near the surface.

    The pseudonormal of an open edge knows one of its sides only. Where two such edges are as close,
    as at a crack, the one tells the side whose normal is best aligned with the way to it.
    `alignment` is scratch: this cosine; -1 where an edge or vertex with all its triangles, of which
    the closest always tells the side, is the closest.
    """
    tie = CRACK * h
    for t in range(corners.shape[0]):
        a = (corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2])
        b = (corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2])
        c = (corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2])
        low_x = int(math.ceil((min(a[0], b[0], c[0]) - band - origin[0]) / h))
        low_y = int(math.ceil((min(a[1], b[1], c[1]) - band - origin[1]) / h))
        low_z = int(math.ceil((min(a[2], b[2], c[2]) - band - origin[2]) / h))
        high_x = int(math.floor((max(a[0], b[0], c[0]) + band - origin[0]) / h))
        high_y = int(math.floor((max(a[1], b[1], c[1]) + band - origin[1]) / h))
        high_z = int(math.floor((max(a[2], b[2], c[2]) + band - origin[2]) / h))
        for i in range(low_x, high_x + 1):
            x = origin[0] + i * h
            for j in range(low_y, high_y + 1):
                y = origin[1] + j * h
                for k in range(low_z, high_z + 1):
                    z = origin[2] + k * h
                    height = (
                        (x - a[0]) * normals[t, 0, 0]
                        + (y - a[1]) * normals[t, 0, 1]
                        + (z - a[2]) * normals[t, 0, 2]
                    )
                    closest = distance[i, j, k]
                    if abs(height) > min(closest + tie, band):
                        continue
                    qx, qy, qz, feature = closest_point_of_triangle(corners[t], x, y, z)
                    dx, dy, dz = x - qx, y - qy, z - qz
                    d = math.sqrt(dx * dx + dy * dy + dz * dz)
                    if d > min(closest + tie, band):
                        continue
                    along = (
                        dx * normals[t, feature, 0]
                        + dy * normals[t, feature, 1]
                        + dz * normals[t, feature, 2]
                    )
                    cosine = -1.0
                    if feature == 0 or d == 0.0:
                        cosine = 1.0
                    elif is_open[t, feature]:
                        cosine = abs(along) / d
                    comparable = cosine >= 0.0 and alignment[i, j, k] >= 0.0
                    if comparable and d > closest - tie:
                        preferred = cosine > alignment[i, j, k]
                    else:
                        preferred = d < closest
                    distance[i, j, k] = min(d, closest)
                    if not preferred:
                        continue
                    alignment[i, j, k] = cosine
                    if along >= 0.0:
                        side[i, j, k] = 1
                    elif is_open[t, feature] and d * d - along * along > overhang * overhang:
                        side[i, j, k] = 0
                    else:
                        side[i, j, k] = -1


class ExactDistance:
    """Distance to a surface and its side, by the pseudonormal of the closest place."""

    def __init__(self, surface: Surface) -> None:
        self.vertices = surface.points
        self._tree = triangle_tree(surface.points[surface.triangles])
        self._normals, self._is_open = feature_normals(surface)

    def __call__(self, points: np.ndarray, field: np.ndarray, spacing: float) -> np.ndarray:
        """Return signed distances [m] of points [m], shape [point_count, 3].

        Parameters
        ----------
        field : values of the distance field there [m], which knows where the back of an open skin
            ends and what closes its cracks; it tells the side beyond a spacing [m] and at rims.
        """
        found = closest_places(self._tree, points)
        normal = self._normals[found.triangle, found.feature]
        in_front = np.einsum("pi,pi->p", points - found.foot, normal) >= 0.0
        by_field = (found.distance > spacing) | self._is_open[found.triangle, found.feature]
        return np.where(np.where(by_field, field >= 0.0, in_front), 1.0, -1.0) * found.distance
