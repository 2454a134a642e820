"""Closest places of a surface, and the curved surface behind its facets."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.surfaces.surface import Surface
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
    # a place at the very distance counts, whatever the rounding
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


class SmoothSurface:
    """Facets with the normals of their nodes interpolated, and bulged to meet these.

    The height over a facet is half of what the tangent planes at its corners say, which is exact
    over the middle of a circular arc. Source: Boubekeur and Alexa, ACM Transactions on Graphics 27
    (2008) 141, Phong tessellation.
    """

    def __init__(self, surface: Surface) -> None:
        self.surface = surface

    @cached_property
    def node_normals(self) -> np.ndarray:
        """Mean normals of the faces around each node, by their areas, shape (N, 3)."""
        surface = self.surface
        there = surface.faces >= 0
        place = surface.places[surface.faces[there]]  # nodes may be repeated face by face
        summed = np.zeros((len(surface.points), 3))
        for axis in range(3):
            values = np.broadcast_to(surface.area_vectors[:, axis, None], there.shape)[there]
            summed[:, axis] = np.bincount(place, weights=values, minlength=len(summed))
        return _unit(summed)[surface.places]

    @cached_property
    def blur(self) -> float:
        """Mean square of the angle [rad] between the facets and the normals of their nodes."""
        corners = self.node_normals[self.surface.triangles]
        facet = self.surface.normals[self.surface.triangle_face]
        angles = np.linalg.norm(corners - facet[:, None], axis=2)
        return float(np.mean(angles**2)) / 3.0  # at the corners it is largest

    def at(self, face: np.ndarray, foot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normals (K, 3) and heights [m] (K,) of the surface over places on its faces.

        Parameters
        ----------
        face : of each place, shape (K,). foot : the places on the facets [m], shape (K, 3).
        """
        triangle, shares = self.triangles_at(face, foot)
        _, normal, height = self.over(self.surface.triangles[triangle], shares)
        return normal, height

    def over(
        self, nodes: np.ndarray, shares: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places (K, 3) [m], normals (K, 3) and heights [m] (K,) of the surface over them.

        Parameters
        ----------
        nodes : corners of the triangle that holds each place, shape (K, 3).
        shares : its barycentric coordinates there, shape (K, 3).
        """
        corners, normals = self.surface.points[nodes], self.node_normals[nodes]
        place = np.einsum("kc,kci->ki", shares, corners)
        normal = _unit(np.einsum("kc,kci->ki", shares, normals))
        rise = np.einsum("kci,kci->kc", normals, corners - place[:, None])
        height = 0.5 * np.einsum("kc,kc,kci,ki->k", shares, rise, normals, normal)
        return place, normal, height

    def triangles_at(self, face: np.ndarray, foot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangle of the face that holds each place, and the place's shares of its corners."""
        first = self.surface.first_triangle
        one, other = first[face], first[face + 1] - 1
        shares_of_one, shares_of_other = self._shares(one, foot), self._shares(other, foot)
        better = shares_of_other.min(axis=1) > shares_of_one.min(axis=1)
        return (
            np.where(better, other, one),
            np.where(better[:, None], shares_of_other, shares_of_one),
        )

    def _shares(self, triangle: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Barycentric coordinates of places on triangles, shape (K, 3)."""
        a, b, c = np.moveaxis(self.surface.triangle_corners[triangle], 1, 0)
        normal = np.cross(b - a, c - a)
        square = np.einsum("ki,ki->k", normal, normal)
        square = np.where(square > 0.0, square, 1.0)
        of_a = np.einsum("ki,ki->k", np.cross(c - b, place - b), normal) / square
        of_b = np.einsum("ki,ki->k", np.cross(a - c, place - c), normal) / square
        return np.stack([of_a, of_b, 1.0 - of_a - of_b], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
