"""How far a sheet's own region reaches on both sides: half way to its next wall."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.solids.boxes import touching, tree_of
from lcmchain.mesh.search import closest_point_of_triangle

#: Relative change of a ball's radius below which it has come to rest, and steps that it may take.
AT_REST = 1e-12
STEPS = 200

#: Share of the length at which a column would turn over that is used.
UPRIGHT = 0.9


def own_reach(
    points: np.ndarray,
    normals: np.ndarray,
    faces: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Distance from the sheet to its medial surface along each node's normal [m], shape (N, 2).

    It is the radius of the largest ball on either side (below, above) that touches the sheet at
    the node and holds no other part of it; of parallel walls that is half of their distance, in
    a bend its radius.
    Source: Ma, Bae and Choi, The Visual Computer 28 (2012) 7.

    Parameters
    ----------
    points, normals : nodes [m] and unit normals, shape (N, 3).
    faces : node numbers, shape (F, 4), a triangle repeats its last node; those around a node do
        not bound its ball.
    reach : largest radius [m].
    """
    corners, face = _fans(points, faces)
    tree = tree_of(corners.min(axis=1), corners.max(axis=1))
    start, near = touching(tree, points - 2.0 * reach, points + 2.0 * reach)
    return _largest_balls(points, normals, faces, corners, face, start, near, reach)


def _fans(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of triangles around the middle of each face, shape (T, 3, 3), and their faces (T,).

    A triangle stays as it is.
    """
    triangle = faces[:, 3] == faces[:, 2]
    quads, whole = np.flatnonzero(~triangle), np.flatnonzero(triangle)
    x = points[faces[quads]]
    middle = x.mean(axis=1)
    parts = [np.stack([x[:, k], x[:, (k + 1) % 4], middle], axis=1) for k in range(4)]
    corners = np.concatenate([points[faces[whole, :3]], *parts])
    return corners, np.concatenate([whole, np.tile(quads, 4)])


@strict_equation
def _largest_balls(points, normals, faces, corners, face, start, near, reach):
    radii = np.full((len(points), 2), reach)
    for i in range(len(points)):
        for side in range(2):
            sign = 2.0 * side - 1.0
            nx, ny, nz = sign * normals[i, 0], sign * normals[i, 1], sign * normals[i, 2]
            radius = reach
            for _ in range(STEPS):
                x, y, z = points[i, 0], points[i, 1], points[i, 2]
                cx, cy, cz = x + radius * nx, y + radius * ny, z + radius * nz
                smaller = radius
                for k in range(start[i], start[i + 1]):
                    t = near[k]
                    around = faces[face[t]]
                    if i == around[0] or i == around[1] or i == around[2] or i == around[3]:
                        continue
                    qx, qy, qz, _ = closest_point_of_triangle(corners[t], cx, cy, cz)
                    square = (qx - cx) ** 2 + (qy - cy) ** 2 + (qz - cz) ** 2
                    if square >= radius * radius:
                        continue
                    dx, dy, dz = qx - x, qy - y, qz - z
                    along = dx * nx + dy * ny + dz * nz
                    if along > 0.0:
                        ball = (dx * dx + dy * dy + dz * dz) / (2.0 * along)
                        smaller = min(smaller, ball)
                if smaller >= radius * (1.0 - AT_REST):
                    break
                radius = smaller
            radii[i, side] = radius
    return radii


def upright_reach(
    points: np.ndarray, normals: np.ndarray, faces: np.ndarray, reach: np.ndarray
) -> np.ndarray:
    """Shorten the reach of the nodes of a face until its column turns over nowhere [m], (N, 2).

    Parameters
    ----------
    faces : node numbers, shape (F, 4); a triangle repeats its last node.
    reach : below and above the sheet [m], shape (N, 2).
    """
    shortened = reach.copy()
    x, m = points[faces], normals[faces]
    across = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    for k in range(4):
        before, after = (k - 1) % 4, (k + 1) % 4
        e, f = x[:, after] - x[:, k], x[:, before] - x[:, k]
        de, df = m[:, after] - m[:, k], m[:, before] - m[:, k]
        # (e + s de) x (f + s df) along the normal of the face, as a polynomial in s
        terms = [np.cross(e, f), np.cross(e, df) + np.cross(de, f), np.cross(de, df)]
        c, b, a = (np.einsum("fi,fi->f", term, across) for term in terms)
        corner = c > 0.0  # the repeated corner of a triangle encloses nothing
        below, above = _first_roots(a[corner], b[corner], c[corner])
        own = faces[corner].ravel()
        np.minimum.at(shortened[:, 0], own, np.repeat(UPRIGHT * below, 4))
        np.minimum.at(shortened[:, 1], own, np.repeat(UPRIGHT * above, 4))
    return shortened


def _first_roots(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the first root of a s² + b s + c below and above s = 0 (c > 0), else infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4.0 * a * c)
        # without cancellation: 2c / (-b -+ root)
        both = np.stack([2.0 * c / (-b - root), 2.0 * c / (-b + root)])
    both = np.where(np.isfinite(both), both, np.inf)
    above = np.where(both > 0.0, both, np.inf).min(axis=0)
    below = np.where(both < 0.0, -both, np.inf).min(axis=0)
    return below, above
