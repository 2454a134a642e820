"""Joining of vertices, so that triangles make one surface.

trimesh and libigl join by rounding the coordinates, which leaves pairs on either side of a rounding
limit apart.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.surface import warn

#: Relative distance below which two vertices are one (STL files repeat every vertex).
WELD = 1e-6


def weld(points: np.ndarray, triangles: np.ndarray, file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices at the same place; drop triangles without area and repeated ones."""
    used, triangles = np.unique(triangles, return_inverse=True)
    points = points[used]
    points, index = np.unique(points, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles.reshape(-1, 3)]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if size == 0.0:
        raise InputError("all vertices lie at one point; export the surface again", file=file)
    tolerance = WELD * size
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        points, triangles = points[first], label[triangles].astype(np.int64)

    a, b, c = (points[triangles[:, i]] for i in range(3))
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    has_area = doubled_area > tolerance * longest
    if not has_area.any():
        raise InputError("no triangle has an area; export the tool's surface again", file=file)
    turned = np.argmin(triangles, axis=1)[:, None]
    canonical = np.take_along_axis(triangles, (turned + np.arange(3)) % 3, axis=1)
    first = np.zeros(len(triangles), dtype=bool)
    first[np.unique(canonical, axis=0, return_index=True)[1]] = True
    kept = has_area & first
    if not kept.all():
        warn(
            file,
            f"{np.count_nonzero(~has_area)} triangles without area and "
            f"{np.count_nonzero(has_area & ~first)} repeated triangles were left out",
        )
    return points, np.ascontiguousarray(triangles[kept])
