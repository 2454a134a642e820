"""Exact distance to a surface, and its side, at the nodes of a grid near it.

The sign is the side of the angle-weighted pseudonormal of the closest face, edge or vertex
(Baerentzen & Aanaes, IEEE Trans. Vis. Comput. Graph. 11, 2005), which needs no closed surface:
skins are as good as solids. At the cracks of a skin the second closest edge counts too, which the
closest-point searches of trimesh and libigl do not give.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mesh.search import closest_point_of_triangle
from lcmchain.tools.surfaces.surface import Surface

#: Largest difference of distances, in spacings, at which two open edges count as equally close.
CRACK = 0.05


def feature_normals(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Pseudonormals of the face, vertices and edges (0-1, 1-2, 2-0) of each triangle.

    Returns unit vectors, shape [triangle_count, 7, 3], and whether the feature lies on an open
    edge, shape [triangle_count, 7].
    """
    triangles, edges = surface.triangles, surface.edges
    face = surface.normals
    corners = surface.points[triangles]
    ahead = np.roll(corners, -1, axis=1) - corners
    ahead /= np.linalg.norm(ahead, axis=2, keepdims=True)
    back = -np.roll(ahead, 1, axis=1)
    angle = np.arccos(np.clip(np.einsum("tij,tij->ti", ahead, back), -1.0, 1.0))

    edge_sum = np.zeros((len(surface.edge_use), 3))
    vertex_sum = np.zeros_like(surface.points)
    for i in range(3):
        np.add.at(edge_sum, edges[:, i], face)
        np.add.at(vertex_sum, triangles[:, i], angle[:, i, None] * face)
    normals = np.concatenate((face[:, None], vertex_sum[triangles], edge_sum[edges]), axis=1)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)

    open_edge = (surface.edge_use == 1)[edges]
    open_vertex = np.zeros(len(surface.points), dtype=bool)
    open_vertex[triangles[open_edge]] = True
    open_vertex[np.roll(triangles, -1, axis=1)[open_edge]] = True
    is_open = np.concatenate(
        (np.zeros((len(triangles), 1), bool), open_vertex[triangles], open_edge), axis=1
    )
    return normals, is_open


@strict_equation
def narrow_band(corners, normals, is_open, origin, h, band, overhang, distance, side, alignment):
    """Fill distance and side (+1, -1; 0 behind an open edge) of the nodes near the surface.

    The pseudonormal of an open edge knows one of its sides only. Where two such edges are as close,
    as at a crack, the one tells the side whose normal is best aligned with the way to it.
    `alignment` is scratch: this cosine; -1 where an edge or vertex with all its triangles, of which
    the closest always tells the side, is the closest.
    """
    tie = CRACK * h
    for t in range(corners.shape[0]):
        a = (corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2])
        b = (corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2])
        c = (corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2])
        low_x = int(math.ceil((min(a[0], b[0], c[0]) - band - origin[0]) / h))
        low_y = int(math.ceil((min(a[1], b[1], c[1]) - band - origin[1]) / h))
        low_z = int(math.ceil((min(a[2], b[2], c[2]) - band - origin[2]) / h))
        high_x = int(math.floor((max(a[0], b[0], c[0]) + band - origin[0]) / h))
        high_y = int(math.floor((max(a[1], b[1], c[1]) + band - origin[1]) / h))
        high_z = int(math.floor((max(a[2], b[2], c[2]) + band - origin[2]) / h))
        for i in range(low_x, high_x + 1):
            x = origin[0] + i * h
            for j in range(low_y, high_y + 1):
                y = origin[1] + j * h
                for k in range(low_z, high_z + 1):
                    z = origin[2] + k * h
                    height = (
                        (x - a[0]) * normals[t, 0, 0]
                        + (y - a[1]) * normals[t, 0, 1]
                        + (z - a[2]) * normals[t, 0, 2]
                    )
                    closest = distance[i, j, k]
                    if abs(height) > min(closest + tie, band):
                        continue
                    qx, qy, qz, feature = closest_point_of_triangle(corners[t], x, y, z)
                    dx, dy, dz = x - qx, y - qy, z - qz
                    d = math.sqrt(dx * dx + dy * dy + dz * dz)
                    if d > min(closest + tie, band):
                        continue
                    along = (
                        dx * normals[t, feature, 0]
                        + dy * normals[t, feature, 1]
                        + dz * normals[t, feature, 2]
                    )
                    cosine = -1.0
                    if feature == 0 or d == 0.0:
                        cosine = 1.0
                    elif is_open[t, feature]:
                        cosine = abs(along) / d
                    comparable = cosine >= 0.0 and alignment[i, j, k] >= 0.0
                    if comparable and d > closest - tie:
                        preferred = cosine > alignment[i, j, k]
                    else:
                        preferred = d < closest
                    distance[i, j, k] = min(d, closest)
                    if not preferred:
                        continue
                    alignment[i, j, k] = cosine
                    if along >= 0.0:
                        side[i, j, k] = 1
                    elif is_open[t, feature] and d * d - along * along > overhang * overhang:
                        side[i, j, k] = 0
                    else:
                        side[i, j, k] = -1
