"""Search for the closest point of a sheet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.surface import Surface
from lcmchain.mesh.search import STACK, closest_point_of_triangle, distance2_to_box

# A foot point that lies on the edge of the sheet belongs to a point beside it once the tangential
# offset exceeds this fraction of the face radius; below, the point is over the sheet.
BESIDE = 1e-3

# Faces that turn their other side are not looked at where a point knows the side that it belongs
# to; steep ones are, as the normal of a sliver of a cell says little.
LEAST_COSINE = -0.5


class ClosestPoints(NamedTuple):
    """Closest projections of P points onto a sheet.

    ``face`` is -1 and ``beside`` True where nothing lies within the searched distance; ``distance``
    is then the searched one.
    """

    face: np.ndarray  # (P,) int64
    foot: np.ndarray  # (P, 3) [m]
    distance: np.ndarray  # (P,) [m]
    beside: np.ndarray  # (P,) bool: the foot lies on the edge of the sheet, the point beyond it


def closest_points(
    surface: Surface,
    points: np.ndarray,
    maximum_distance: float,
    sides: np.ndarray | None = None,
) -> ClosestPoints:
    """Project points [m], shape (P, 3), onto the closest place of the sheet.

    Quadrilaterals count as two triangles. Of several places at the same distance the one on the
    triangle with the lowest number is taken, so that the answer does not depend on the search.

    sides : direction (P, 3) in which the normals of the faces have to point roughly; a row of zeros
        asks nothing.
    """
    points = np.ascontiguousarray(points, dtype=float)
    if sides is None:
        sides = np.zeros((len(points), 3))
    triangle, foot, square, on_edge = _closest(
        surface.face_tree,
        surface.first_triangle,
        surface.triangle_corners,
        surface.normals * surface.winding.side[:, None],
        surface.edge_bounds_sheet,
        surface.corner_bounds_sheet,
        points,
        np.ascontiguousarray(sides),
        maximum_distance,
    )
    within = triangle >= 0
    face = np.where(within, surface.triangle_face[triangle], -1)
    normal = surface.normals[face]
    offset = points - foot
    tangential = offset - np.einsum("pi,pi->p", offset, normal)[:, None] * normal
    far = np.linalg.norm(tangential, axis=1) > BESIDE * surface.face_radii[face]
    foot[~within] = np.nan
    distance = np.where(within, np.sqrt(square), maximum_distance)
    return ClosestPoints(face, foot, distance, (on_edge & far) | ~within)


@routine
def _closest(
    tree,
    first_triangle,
    corners,
    normals,
    edge_bounds,
    corner_bounds,
    points,
    sides,
    maximum_distance,
):
    count, leaf_count = len(points), len(tree.first) - 1
    triangle = np.full(count, -1, dtype=np.int64)
    foot = np.zeros((count, 3))
    square = np.zeros(count)
    on_edge = np.zeros(count, dtype=np.bool_)
    stack = np.empty(STACK, dtype=np.int64)
    # What lies at the distance itself counts, whatever the rounding.
    reach = maximum_distance * maximum_distance * (1.0 + 1e-12)
    for p in range(count):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        best = reach
        stack[0], height = 1, 1
        asked = sides[p, 0] != 0.0 or sides[p, 1] != 0.0 or sides[p, 2] != 0.0
        while height > 0:
            height -= 1
            node = stack[height]
            if distance2_to_box(tree.boxes[node], x, y, z) > best:
                continue
            if node < leaf_count:
                near, far = 2 * node, 2 * node + 1
                if distance2_to_box(tree.boxes[far], x, y, z) < distance2_to_box(
                    tree.boxes[near], x, y, z
                ):
                    near, far = far, near
                stack[height], stack[height + 1] = far, near
                height += 2
                continue
            for k in range(tree.first[node - leaf_count], tree.first[node - leaf_count + 1]):
                face = tree.order[k]
                if asked:
                    cosine = (
                        sides[p, 0] * normals[face, 0]
                        + sides[p, 1] * normals[face, 1]
                        + sides[p, 2] * normals[face, 2]
                    )
                    if cosine < LEAST_COSINE:
                        continue
                for t in range(first_triangle[face], first_triangle[face + 1]):
                    a, b, c, feature = closest_point_of_triangle(corners[t], x, y, z)
                    new = (a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2
                    if new < best or (new == best and (t < triangle[p] or triangle[p] < 0)):
                        best, triangle[p] = new, t
                        foot[p, 0], foot[p, 1], foot[p, 2] = a, b, c
                        if feature == 0:
                            on_edge[p] = False
                        elif feature <= 3:
                            on_edge[p] = corner_bounds[t, feature - 1]
                        else:
                            on_edge[p] = edge_bounds[t, feature - 4]
        square[p] = best
    return triangle, foot, square, on_edge
