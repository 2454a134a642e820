"""Where lines along the normals of a sheet cross triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.solids.boxes import touching, tree_of

#: A line that passes an edge within this share of a triangle crosses the triangle.
AT_EDGE = 1e-9


class Crossings(NamedTuple):
    """Crossings of L lines with triangles, by line, then by triangle.

    line : number of the line, shape (K,).
    triangle : shape (K,).
    place : along the line from its origin [m], shape (K,).
    """

    line: np.ndarray
    triangle: np.ndarray
    place: np.ndarray


def crossings(
    points: np.ndarray,
    directions: np.ndarray,
    reach: np.ndarray,
    corners: np.ndarray,
    margin: float = AT_EDGE,
) -> Crossings:
    """Find where lines cross triangles.

    Parameters
    ----------
    points, directions : origin [m] and unit direction of each line, shape (L, 3).
    reach : how far each line goes against and along its direction [m], positive, shape (L, 2).
    corners : of the triangles [m], shape (T, 3, 3).
    margin : share of a triangle by which a line may pass beside it.
    """
    corners = np.ascontiguousarray(corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = (high - low).max(axis=1, keepdims=True)
    tree = tree_of(low - 2.0 * margin * size, high + 2.0 * margin * size)
    ends = np.stack([points - reach[:, :1] * directions, points + reach[:, 1:] * directions])
    start, near = touching(tree, ends.min(axis=0), ends.max(axis=0))
    place = _cross(start, near, points, directions, corners, margin)
    line = np.repeat(np.arange(len(points)), np.diff(start))
    with np.errstate(invalid="ignore"):
        hit = (place >= -reach[line, 0]) & (place <= reach[line, 1])
    return Crossings(line[hit], near[hit], place[hit])


@strict_equation
def _cross(start, near, points, directions, corners, margin):
    """Place along the line of each pair; not a number where the line passes by.

    Source: Möller and Trumbore, Journal of Graphics Tools 2 (1997) 21.
    """
    place = np.full(len(near), np.nan)
    for i in range(len(points)):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        for k in range(start[i], start[i + 1]):
            a, b, c = corners[near[k], 0], corners[near[k], 1], corners[near[k], 2]
            ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            fx, fy, fz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            px, py, pz = dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx
            along = ex * px + ey * py + ez * pz
            if along == 0.0:
                continue
            tx, ty, tz = points[i, 0] - a[0], points[i, 1] - a[1], points[i, 2] - a[2]
            u = (tx * px + ty * py + tz * pz) / along
            qx, qy, qz = ty * ez - tz * ey, tz * ex - tx * ez, tx * ey - ty * ex
            v = (dx * qx + dy * qy + dz * qz) / along
            if u < -margin or v < -margin or u + v > 1.0 + margin:
                continue
            place[k] = (fx * qx + fy * qy + fz * qz) / along
    return place
