"""Joining of vertices and turning of triangles, so that they make one oriented surface.

trimesh and libigl join by rounding the coordinates, which leaves pairs on either side of a rounding
limit apart, and orient without telling a surface that has one side only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.surface import edges, place_text, warn

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


def oriented(points: np.ndarray, triangles: np.ndarray, file: Path) -> np.ndarray:
    """Turn triangles so that all that share an edge agree, keeping the side of the larger area."""
    edge, forward, use = edges(triangles)
    order = np.argsort(edge.ravel(), kind="stable")
    order = order[use[edge.ravel()[order]] == 2].reshape(-1, 2)
    first, second = order[:, 0] // 3, order[:, 1] // 3
    clash = forward.ravel()[order[:, 0]] == forward.ravel()[order[:, 1]]
    if not clash.any():
        return triangles

    # Each triangle stands for two nodes, as given (t) and turned (t + count): neighbours that agree
    # join equal nodes, those that clash unequal ones.
    count = len(triangles)
    other = second + np.where(clash, count, 0)
    rows = np.concatenate((first, first + count))
    columns = np.concatenate((other, (other + count) % (2 * count)))
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    _, label = connected_components(graph, directed=False)
    as_given, turned = label[:count], label[count:]
    if (as_given == turned).any():
        worst = points[triangles[int(np.argmax(as_given == turned))]].mean(axis=0)
        raise InputError(
            f"the surface has only one side (like a Moebius strip) near {place_text(worst)}, so "
            "that inside and outside cannot be told; repair the mesh",
            file=file,
        )
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area_as_given = np.bincount(as_given, weights=area, minlength=label.max() + 1)
    flip = area_as_given[as_given] < area_as_given[turned]
    # Where both sides weigh the same, the first triangle decides.
    tie = area_as_given[as_given] == area_as_given[turned]
    flip |= tie & (as_given > turned)
    warn(
        file,
        f"{np.count_nonzero(flip)} of {count} triangles were turned against their neighbours and "
        "have been turned back; check that the normals of the rest point away from the solid",
    )
    result = triangles.copy()
    result[flip] = result[flip][:, ::-1]
    return result
