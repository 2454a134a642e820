"""Geometry of a faceted sheet: triangles, face areas and normals, and where its edge runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lcmchain.mapping.coincidence import places_of
from lcmchain.mapping.face_geometry import FaceGeometry, face_geometry
from lcmchain.mapping.gradients import GradientStencil, gradient_stencil
from lcmchain.mapping.winding import Winding, winding
from lcmchain.mesh.search import BoxTree, bounding_box, box_tree

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
    def geometry(self) -> FaceGeometry:
        """Areas, normals and the like of all faces."""
        return face_geometry(
            np.ascontiguousarray(self.points, dtype=float), np.ascontiguousarray(self.faces)
        )

    @property
    def corners(self) -> np.ndarray:
        """Corner positions [m], shape (F, 4, 3); a triangle repeats its last corner."""
        return self.geometry.corners

    @property
    def area_vectors(self) -> np.ndarray:
        """Half the cross product of the diagonals [m2], shape (F, 3).

        Its length is the area at the centre of a warped quadrilateral, the measure in which the
        forming result conserves the fibre mass.
        """
        return self.geometry.area_vectors

    @property
    def areas(self) -> np.ndarray:
        """Face areas [m2], shape (F,)."""
        return self.geometry.areas

    @property
    def normals(self) -> np.ndarray:
        """Unit normals, shape (F, 3); zero where a face has no area."""
        return self.geometry.normals

    @property
    def centroids(self) -> np.ndarray:
        """Centroids of the areas of the faces [m], shape (F, 3)."""
        return self.geometry.centroids

    @property
    def frames(self) -> np.ndarray:
        """Two unit tangents of each face, which its normal completes, shape (F, 2, 3)."""
        return self.geometry.frames

    @property
    def face_radii(self) -> np.ndarray:
        """Largest distance from each face's centroid to its corners [m], shape (F,)."""
        return self.geometry.radii

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
    def triangle_area_vectors(self) -> np.ndarray:
        """Area times unit normal of the triangles [m2], shape (T, 3)."""
        c = self.triangle_corners
        return 0.5 * np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])

    @cached_property
    def edge_length(self) -> float:
        """Median length of the face edges [m]."""
        c = self.corners
        lengths = np.linalg.norm(np.roll(c, -1, axis=1) - c, axis=2)
        return float(np.median(lengths[lengths > 0.0]))

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the used nodes [m]."""
        low, high = bounding_box(self.corners.reshape(-1, 3))
        return float(np.linalg.norm(high - low))

    @cached_property
    def places(self) -> np.ndarray:
        """Number of the place where each node sits; repeated nodes share one."""
        return places_of(self.points, max(COINCIDENCE * self.size, np.finfo(float).tiny))

    @cached_property
    def edge_bounds_sheet(self) -> np.ndarray:
        """Whether edge k (corner k to k + 1) of a triangle bounds the sheet, shape (T, 3)."""
        quad, bounds = self.is_quadrilateral, self.winding.bounds
        edges = np.zeros((len(self.triangles), 3), dtype=bool)
        first = self.first_triangle[:-1]
        edges[first, :2] = bounds[:, :2]  # the third is the diagonal of a quadrilateral
        edges[first[~quad], 2] = bounds[~quad, 2]
        edges[first[quad] + 1, 1:] = bounds[quad, 2:]
        return edges

    @cached_property
    def corner_bounds_sheet(self) -> np.ndarray:
        """Whether corner k of a triangle lies on the edge of the sheet, shape (T, 3)."""
        place, edges = self.places[self.triangles], self.edge_bounds_sheet
        bounding = np.zeros(self.places.max() + 1, dtype=bool)
        bounding[place[edges]] = True
        bounding[np.roll(place, -1, axis=1)[edges]] = True
        return bounding[place]

    @cached_property
    def winding(self) -> Winding:
        """Neighbours across edges, pieces and sides of the faces."""
        places = self.places[self.faces]
        places[~self.is_quadrilateral, 3] = -1
        return winding(places)

    @cached_property
    def gradient_stencil(self) -> GradientStencil:
        """Faces around each face, and what they add to the gradient of a field on it."""
        corner = np.where(self.faces < 0, self.faces[:, 2:3], self.faces)
        normals = self.normals * self.winding.side[:, None]
        return gradient_stencil(
            self.places[corner], self.corners, self.centroids, self.frames, normals
        )

    @cached_property
    def face_tree(self) -> BoxTree:
        """Tree of the boxes around the faces."""
        return box_tree(self.corners)
