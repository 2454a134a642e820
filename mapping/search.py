"""Search: the closest point of a sheet, and which faces may lie over a cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.jit import strict_equation
from lcmchain.mapping.surface import Surface
from lcmchain.mesh.closest_point import closest_point_of_triangle

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
