"""Areas, centroids, normals, frames and radii of faces, in one pass of compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine


class FaceGeometry(NamedTuple):
    """Geometry of F triangles and quadrilaterals.

    corners : positions [m], shape (F, 4, 3); a triangle repeats its last corner.
    area_vectors : half the cross product of the diagonals [m2], shape (F, 3).
    areas : their lengths [m2], shape (F,).
    normals : unit vectors along them, shape (F, 3); zero where a face has no area.
    centroids : of the areas of both triangles of a face [m], shape (F, 3).
    frames : two unit tangents, which the normal completes, shape (F, 2, 3).
    radii : largest distance of a corner from the centroid [m], shape (F,).
    """

    corners: np.ndarray
    area_vectors: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    centroids: np.ndarray
    frames: np.ndarray
    radii: np.ndarray


@routine
def face_geometry(points, faces):
    """Compute the geometry of faces.

    points : node positions [m], shape (N, 3).
    faces : node numbers, shape (F, 4); -1 in the last column marks a triangle.
    """
    count = len(faces)
    corners, frames = np.empty((count, 4, 3)), np.zeros((count, 2, 3))
    vectors, normals = np.empty((count, 3)), np.zeros((count, 3))
    centroids, areas, radii = np.empty((count, 3)), np.empty(count), np.empty(count)
    for f in range(count):
        own = corners[f]
        for k in range(4):
            node = faces[f, k] if faces[f, k] >= 0 else faces[f, 2]
            for axis in range(3):
                own[k, axis] = points[node, axis]
        vectors[f] = 0.5 * cross(own[2] - own[0], own[3] - own[1])
        areas[f] = np.sqrt((vectors[f] ** 2).sum())
        if areas[f] > 0.0:
            normals[f] = vectors[f] / areas[f]
            frames[f] = tangents(normals[f])
        half = np.sqrt((cross(own[1] - own[0], own[2] - own[0]) ** 2).sum())
        other = np.sqrt((cross(own[2] - own[0], own[3] - own[0]) ** 2).sum())
        share = other / (half + other) if half + other > 0.0 else 0.0
        radius = 0.0
        for axis in range(3):
            shared = own[0, axis] + own[2, axis]
            centroids[f, axis] = (
                shared + own[1, axis] + share * (own[3, axis] - own[1, axis])
            ) / 3.0
        for k in range(4):
            radius = max(radius, ((own[k] - centroids[f]) ** 2).sum())
        radii[f] = np.sqrt(radius)
    return FaceGeometry(corners, vectors, areas, normals, centroids, frames, radii)


@routine
def cross(a, b):
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@routine
def tangents(normal):
    """Two unit vectors (2, 3) across a unit normal, from the axis that it is least along."""
    away = np.zeros(3)
    away[np.argmin(np.abs(normal))] = 1.0
    first = cross(normal, away)
    first /= np.sqrt((first**2).sum())
    found = np.empty((2, 3))
    found[0], found[1] = first, cross(normal, first)
    return found
