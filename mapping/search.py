"""Search: the closest point of a sheet, and which faces may lie over a cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.jit import strict_equation
from lcmchain.mapping.surface import Surface

# A foot point that lies on the edge of the sheet belongs to a point beside it once the tangential
# offset exceeds this fraction of the face radius; below, the point is over the sheet.
BESIDE = 1e-3


class ClosestPoints(NamedTuple):
    """Closest projections of P points onto a sheet.

    ``face`` is -1 and ``beside`` True where nothing lies within the searched distance; ``distance``
    is then a lower bound.
    """

    face: np.ndarray  # (P,) int64
    foot: np.ndarray  # (P, 3) [m]
    distance: np.ndarray  # (P,) [m]
    beside: np.ndarray  # (P,) bool: the foot lies on the edge of the sheet, the point beyond it


def closest_points(surface: Surface, points: np.ndarray, maximum_distance: float) -> ClosestPoints:
    """Project points [m], shape (P, 3), onto the closest place of the sheet.

    Quadrilaterals count as two triangles. Of several places at the same distance the one on the
    triangle with the lowest number is taken, so that the answer does not depend on the search.
    """
    points = np.ascontiguousarray(points, dtype=float)
    radius = surface.triangle_radius
    to_centroid, _ = surface.triangle_tree.query(points)
    near = np.flatnonzero(to_centroid - radius <= maximum_distance)
    face = np.full(len(points), -1, dtype=np.int64)
    foot = np.full((len(points), 3), np.nan)
    distance = np.maximum(to_centroid - radius, maximum_distance)
    beside = np.ones(len(points), dtype=bool)
    if len(near) == 0:
        return ClosestPoints(face, foot, distance, beside)
    # No triangle whose centroid is farther than this can hold the closest place.
    reach = to_centroid[near] * (1.0 + 1e-12) + radius
    start, candidates = balls(surface.triangle_tree, points[near], reach)
    triangle, near_foot, near_distance, on_edge = _closest_of_candidates(
        points[near],
        start,
        candidates,
        surface.triangle_corners,
        surface.edge_bounds_sheet,
        surface.corner_bounds_sheet,
    )
    near_face = surface.triangle_face[triangle]
    normal = surface.normals[near_face]
    offset = points[near] - near_foot
    tangential = offset - np.einsum("pi,pi->p", offset, normal)[:, None] * normal
    far = np.linalg.norm(tangential, axis=1) > BESIDE * surface.face_radii[near_face]
    within = near_distance <= maximum_distance
    face[near] = np.where(within, near_face, -1)
    foot[near] = near_foot
    distance[near] = near_distance
    beside[near] = (on_edge & far) | ~within
    return ClosestPoints(face, foot, distance, beside)


def balls(tree: cKDTree, centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the tree within a radius of each centre, ascending: (start (P + 1,), numbers)."""
    found = tree.query_ball_point(centres, radii, return_sorted=True)
    counts = np.fromiter((len(numbers) for numbers in found), dtype=np.int64, count=len(found))
    start = np.concatenate([[0], np.cumsum(counts)])
    numbers = np.empty(start[-1], dtype=np.int64)
    for k, those in enumerate(found):
        numbers[start[k] : start[k + 1]] = those
    return start, numbers


@strict_equation
def _closest_of_candidates(points, start, candidates, corners, edge_bounds, corner_bounds):
    count = len(points)
    triangle = np.zeros(count, dtype=np.int64)
    foot = np.zeros((count, 3))
    distance = np.zeros(count)
    on_edge = np.zeros(count, dtype=np.bool_)
    for p in range(count):
        best = np.inf
        for k in range(start[p], start[p + 1]):
            t = candidates[k]
            x, y, z, feature = closest_point_of_triangle(
                corners[t], points[p, 0], points[p, 1], points[p, 2]
            )
            square = (x - points[p, 0]) ** 2 + (y - points[p, 1]) ** 2 + (z - points[p, 2]) ** 2
            if square < best:
                best = square
                triangle[p] = t
                foot[p, 0], foot[p, 1], foot[p, 2] = x, y, z
                if feature == 0:
                    on_edge[p] = False
                elif feature <= 3:
                    on_edge[p] = corner_bounds[t, feature - 1]
                else:
                    on_edge[p] = edge_bounds[t, feature - 4]
        distance[p] = np.sqrt(best)
    return triangle, foot, distance, on_edge


@strict_equation
def closest_point_of_triangle(corners, x, y, z):
    """Closest point of a triangle and what it lies on: 0 inside, 1-3 corner, 4-6 edge k to k + 1.

    Source: Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    abx = corners[1, 0] - corners[0, 0]
    aby = corners[1, 1] - corners[0, 1]
    abz = corners[1, 2] - corners[0, 2]
    acx = corners[2, 0] - corners[0, 0]
    acy = corners[2, 1] - corners[0, 1]
    acz = corners[2, 2] - corners[0, 2]
    px, py, pz = x - corners[0, 0], y - corners[0, 1], z - corners[0, 2]
    d1 = abx * px + aby * py + abz * pz
    d2 = acx * px + acy * py + acz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return corners[0, 0], corners[0, 1], corners[0, 2], 1
    px, py, pz = x - corners[1, 0], y - corners[1, 1], z - corners[1, 2]
    d3 = abx * px + aby * py + abz * pz
    d4 = acx * px + acy * py + acz * pz
    if d3 >= 0.0 and d4 <= d3:
        return corners[1, 0], corners[1, 1], corners[1, 2], 2
    px, py, pz = x - corners[2, 0], y - corners[2, 1], z - corners[2, 2]
    d5 = abx * px + aby * py + abz * pz
    d6 = acx * px + acy * py + acz * pz
    if d6 >= 0.0 and d5 <= d6:
        return corners[2, 0], corners[2, 1], corners[2, 2], 3
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w, feature = d1 / (d1 - d3), 0.0, 4
    else:
        vb = d5 * d2 - d1 * d6
        if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            v, w, feature = 0.0, d2 / (d2 - d6), 6
        else:
            va = d3 * d6 - d5 * d4
            if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                v, feature = 1.0 - w, 5
            else:
                v, w, feature = vb / (va + vb + vc), vc / (va + vb + vc), 0
    return (
        corners[0, 0] + v * abx + w * acx,
        corners[0, 1] + v * aby + w * acy,
        corners[0, 2] + v * abz + w * acz,
        feature,
    )
