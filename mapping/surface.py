"""Geometry of a faceted sheet: triangles, face areas and normals, and where its edge runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

# Nodes closer than this fraction of the mesh's size are the same place: files written face by
# face (STL) repeat their nodes, and every edge would look like an edge of the sheet.
COINCIDENCE = 1e-9


@dataclass(frozen=True)
class Surface:
    """Sheet of triangles and quadrilaterals in space.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    faces : node numbers, shape (F, 4); -1 in the last column marks a triangle.
    """

    points: np.ndarray
    faces: np.ndarray

    @property
    def face_count(self) -> int:
        return len(self.faces)

    @cached_property
    def is_quadrilateral(self) -> np.ndarray:
        """Whether a face has four different nodes, shape (F,)."""
        f = self.faces
        return (f[:, 3] >= 0) & (f[:, 3] != f[:, 2])

    @cached_property
    def corners(self) -> np.ndarray:
        """Corner positions [m], shape (F, 4, 3); a triangle repeats its last corner."""
        closed = np.where(self.faces[:, 3:] < 0, self.faces[:, 2:3], self.faces[:, 3:])
        return self.points[np.concatenate([self.faces[:, :3], closed], axis=1)]

    @cached_property
    def area_vectors(self) -> np.ndarray:
        """Half the cross product of the diagonals [m2], shape (F, 3).

        Its length is the area at the centre of a warped quadrilateral, the measure in which the
        forming result conserves the fibre mass.
        """
        c = self.corners
        return 0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1])

    @cached_property
    def areas(self) -> np.ndarray:
        """Face areas [m2], shape (F,)."""
        return np.linalg.norm(self.area_vectors, axis=1)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals, shape (F, 3); zero where a face has no area."""
        return self.area_vectors / np.where(self.areas > 0.0, self.areas, 1.0)[:, None]

    @cached_property
    def centroids(self) -> np.ndarray:
        """Means of the corners [m], shape (F, 3)."""
        four = self.corners.mean(axis=1)
        three = self.corners[:, :3].mean(axis=1)
        return np.where(self.is_quadrilateral[:, None], four, three)

    @cached_property
    def triangles(self) -> np.ndarray:
        """Node numbers of the triangles, shape (T, 3); a quadrilateral gives two, one after the
        other, cut along its diagonal 0-2."""
        f, quad = self.faces, self.is_quadrilateral
        first = np.concatenate([[0], np.cumsum(1 + quad)])
        triangles = np.empty((first[-1], 3), dtype=np.int64)
        triangles[first[:-1]] = f[:, :3]
        triangles[first[1:][quad] - 1] = f[quad][:, [0, 2, 3]]
        return triangles

    @cached_property
    def first_triangle(self) -> np.ndarray:
        """First triangle of each face, and the number of triangles, shape (F + 1,)."""
        return np.concatenate([[0], np.cumsum(1 + self.is_quadrilateral)]).astype(np.int64)

    @cached_property
    def triangle_face(self) -> np.ndarray:
        """Face of each triangle, shape (T,)."""
        return np.repeat(np.arange(self.face_count), 1 + self.is_quadrilateral)

    @cached_property
    def triangle_corners(self) -> np.ndarray:
        """Corner positions of the triangles [m], shape (T, 3, 3)."""
        return np.ascontiguousarray(self.points[self.triangles])

    @cached_property
    def triangle_radius(self) -> float:
        """Largest distance from a triangle's centroid to its corners [m]."""
        corners = self.triangle_corners
        return float(np.linalg.norm(corners - corners.mean(axis=1)[:, None], axis=2).max())

    @cached_property
    def face_radii(self) -> np.ndarray:
        """Largest distance from each face's centroid to its corners [m], shape (F,)."""
        return np.linalg.norm(self.corners - self.centroids[:, None], axis=2).max(axis=1)

    @cached_property
    def edge_length(self) -> float:
        """Median length of the face edges [m]."""
        c = self.corners
        lengths = np.linalg.norm(np.roll(c, -1, axis=1) - c, axis=2)
        return float(np.median(lengths[lengths > 0.0]))

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the used nodes [m]."""
        used = self.corners.reshape(-1, 3)
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))

    @cached_property
    def _places(self) -> np.ndarray:
        """Number of the place where each node sits; repeated nodes share one."""
        spacing = max(COINCIDENCE * self.size, np.finfo(float).tiny)
        _, place = np.unique(np.round(self.points / spacing), axis=0, return_inverse=True)
        return place.reshape(-1)

    @cached_property
    def _edge_of_sheet(self) -> tuple[np.ndarray, np.ndarray]:
        """For each triangle: which of its edges, and which of its corners, bound the sheet."""
        place = self._places[self.triangles]
        edges = np.stack([place, np.roll(place, -1, axis=1)], axis=2)  # edge k: corner k to k + 1
        _, edge, count = np.unique(
            np.sort(edges, axis=2).reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
        )
        on_edge = (count[edge.reshape(-1)] == 1).reshape(-1, 3)
        bounding = np.zeros(self._places.max() + 1, dtype=bool)
        bounding[edges[on_edge]] = True
        return on_edge, bounding[place]

    @cached_property
    def edge_bounds_sheet(self) -> np.ndarray:
        """Whether edge k (corner k to k + 1) of a triangle bounds the sheet, shape (T, 3)."""
        return self._edge_of_sheet[0]

    @cached_property
    def corner_bounds_sheet(self) -> np.ndarray:
        """Whether corner k of a triangle lies on the edge of the sheet, shape (T, 3)."""
        return self._edge_of_sheet[1]

    @cached_property
    def triangle_tree(self) -> cKDTree:
        return cKDTree(self.triangle_corners.mean(axis=1))

    @cached_property
    def face_tree(self) -> cKDTree:
        return cKDTree(self.centroids)
