"""Areas, centroids, normals, frames and radii of faces, in one pass of compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine


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
        own, middle = corners[f], centroids[f]
        for k in range(4):
            node = faces[f, k] if faces[f, k] >= 0 else faces[f, 2]
            for axis in range(3):
                own[k, axis] = points[node, axis]
        x, y, z = cross(own, 0, 2, 1, 3)
        doubled = np.sqrt(x * x + y * y + z * z)
        areas[f] = 0.5 * doubled
        vectors[f, 0], vectors[f, 1], vectors[f, 2] = 0.5 * x, 0.5 * y, 0.5 * z
        if doubled > 0.0:
            normals[f, 0], normals[f, 1], normals[f, 2] = x / doubled, y / doubled, z / doubled
            write_tangents(normals[f], frames[f])
        x, y, z = cross(own, 0, 1, 0, 2)
        half = np.sqrt(x * x + y * y + z * z)
        x, y, z = cross(own, 0, 2, 0, 3)
        other = np.sqrt(x * x + y * y + z * z)
        share = other / (half + other) if half + other > 0.0 else 0.0
        for axis in range(3):
            shared = own[0, axis] + own[2, axis]
            middle[axis] = (shared + own[1, axis] + share * (own[3, axis] - own[1, axis])) / 3.0
        radius = 0.0
        for k in range(4):
            x, y, z = own[k, 0] - middle[0], own[k, 1] - middle[1], own[k, 2] - middle[2]
            radius = max(radius, x * x + y * y + z * z)
        radii[f] = np.sqrt(radius)
    return FaceGeometry(corners, vectors, areas, normals, centroids, frames, radii)


@equation
def cross(corners, a, b, c, d):
    """Cross product of the ways from corner a to b and from c to d."""
    ux, uy, uz = (
        corners[b, 0] - corners[a, 0],
        corners[b, 1] - corners[a, 1],
        corners[b, 2] - corners[a, 2],
    )
    vx, vy, vz = (
        corners[d, 0] - corners[c, 0],
        corners[d, 1] - corners[c, 1],
        corners[d, 2] - corners[c, 2],
    )
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@equation
def write_tangents(normal, frame):
    """Write two unit vectors (2, 3) across a unit normal, from the axis that it is least along."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax <= ay and ax <= az:
        length = np.sqrt(ny * ny + nz * nz)
        ux, uy, uz = 0.0, nz / length, -ny / length
    elif ay <= az:
        length = np.sqrt(nx * nx + nz * nz)
        ux, uy, uz = -nz / length, 0.0, nx / length
    else:
        length = np.sqrt(nx * nx + ny * ny)
        ux, uy, uz = ny / length, -nx / length, 0.0
    frame[0, 0], frame[0, 1], frame[0, 2] = ux, uy, uz
    frame[1, 0], frame[1, 1] = ny * uz - nz * uy, nz * ux - nx * uz
    frame[1, 2] = nx * uy - ny * ux
