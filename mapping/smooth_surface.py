"""The curved surface behind the facets of a sheet: normals and heights between its nodes."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from lcmchain.mapping.surface import Surface


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
