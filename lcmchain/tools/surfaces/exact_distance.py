"""Exact signed distance to the triangles of a surface, for what the grid of its field rounds."""

from __future__ import annotations

import numpy as np

from lcmchain.tools.surfaces.closest import closest_places, triangle_tree
from lcmchain.tools.surfaces.narrow_band import feature_normals
from lcmchain.tools.surfaces.surface import Surface


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
