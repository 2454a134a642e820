"""Parallel projection of facets: what is seen from where, what hides what, and light shading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Direction to the light in screen axes (right, up, towards the viewer).
LIGHT = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
# Share of a colour that light cannot take away; high, since colours carry values.
AMBIENT = 0.68


@dataclass(frozen=True)
class View:
    """Screen axes as unit vectors: right, up, and towards the viewer."""

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray

    def on_screen(self, points: np.ndarray) -> np.ndarray:
        """Return the screen coordinates, shape (..., 2), of points, shape (..., 3)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


FROM_ABOVE = View(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))


def oblique(*, elevation: float = 33.0, azimuth: float = -57.0, from_below: bool = False) -> View:
    """Return an oblique view [degrees], or the same with the scene turned over about x.

    Turned over, a sheet that was drawn downwards stands like a dome; nothing is mirrored.
    """
    e, a = np.radians([elevation, azimuth])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    view = np.stack([right, np.cross(towards, right), towards])
    if from_below:
        view = view * np.array([1.0, -1.0, -1.0])
    return View(*view)


def painting_order(corners: np.ndarray, view: View) -> np.ndarray:
    """Return the order from back to front of facets with corners (F, K, 3)."""
    return np.argsort(corners.mean(axis=1) @ view.towards, kind="stable")


def facet_normals(corners: np.ndarray) -> np.ndarray:
    """Return unit normals (F, 3) of facets (F, K, 3), K = 3 or 4; zero without area."""
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    length = np.linalg.norm(normal, axis=1)
    return normal / np.where(length > 0.0, length, 1.0)[:, None]


def brightness(corners: np.ndarray, view: View) -> np.ndarray:
    """Return factors (F,) for the colours of facets that are bright on both sides."""
    normal = facet_normals(corners)
    local = np.stack([normal @ view.right, normal @ view.up, normal @ view.towards], axis=1)
    local[local[:, 2] < 0.0] *= -1.0
    return AMBIENT + (1.0 - AMBIENT) * np.clip(local @ LIGHT, 0.0, 1.0)


def boundary_edges(faces: np.ndarray) -> np.ndarray:
    """Return the edges (B, 2) that belong to one face only; repeated nodes make no edge."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, first, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    return edges[first[count == 1]]


def fronts_and_backs(points: np.ndarray, triangles: np.ndarray, view: View) -> list[np.ndarray]:
    """Return the screen corners (F, 3, 2) of the parts that face the viewer, and of the others.

    Within a part all triangles have the same sense of rotation: as one path with the non-zero
    rule, overlaps are filled once.
    """
    corners = view.on_screen(points[triangles])
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return [corners[turn > 0.0], corners[turn < 0.0]]


def contour_edges(
    points: np.ndarray, triangles: np.ndarray, view: View, *, sharp: float = 25.0
) -> np.ndarray:
    """Return the segments (S, 2, 3) that draw a surface: rims, sharp edges and its contour.

    The contour separates parts that face the viewer from parts that do not; edges are sharp where
    the normal turns by more than ``sharp`` degrees.
    """
    if len(triangles) == 0:
        return np.empty((0, 2, 3))
    # Clipped surfaces repeat points: the same place must have the same number.
    scale = np.ptp(points, axis=0).max() or 1.0
    _, same = np.unique(np.round(points / (1e-7 * scale)), axis=0, return_inverse=True)
    places = same.reshape(-1)[triangles]
    # Slivers that clipping leaves would hide the rim: their edges lie on top of each other.
    whole = (places != np.roll(places, 1, axis=1)).all(axis=1)
    triangles, places = triangles[whole], places[whole]
    normals = facet_normals(points[triangles])
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    keys = np.sort(np.stack([places, np.roll(places, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    _, number = np.unique(keys, axis=0, return_inverse=True)
    number = number.reshape(-1)
    order = np.argsort(number, kind="stable")
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    counts = np.diff(np.append(starts, len(order)))
    drawn = [edges[order[starts[counts == 1]]]]
    pairs = starts[counts == 2]
    first, second = order[pairs], order[pairs + 1]
    n, m = normals[owner[first]], normals[owner[second]]
    turned = np.einsum("ei,ei->e", n, m) < np.cos(np.radians(sharp))
    facing = (n @ view.towards > 1e-6) != (m @ view.towards > 1e-6)
    drawn.append(edges[first[turned | facing]])
    return points[np.concatenate(drawn)]


def section(points: np.ndarray, triangles: np.ndarray, y: float) -> np.ndarray:
    """Cut triangles with the plane of constant ``y``: segments (S, 2, 2) in x and z."""
    corners = points[triangles]
    height = corners[:, :, 1] - y
    cut = (height >= 0.0).any(axis=1) & (height < 0.0).any(axis=1)
    corners, height = corners[cut], height[cut]
    inside = height >= 0.0
    # Turn each triangle until the corner that is alone on its side comes first.
    lone = np.where(inside.sum(axis=1) == 1, np.argmax(inside, axis=1), np.argmax(~inside, axis=1))
    order = (lone[:, None] + np.arange(3)) % 3
    height = np.take_along_axis(height, order, axis=1)[:, :, None]
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    ends = [
        corners[:, 0]
        + (corners[:, i] - corners[:, 0]) * height[:, 0] / (height[:, 0] - height[:, i])
        for i in (1, 2)
    ]
    return np.stack(ends, axis=1)[:, :, [0, 2]]


def joined_outline(points: np.ndarray, edges: np.ndarray) -> list[np.ndarray]:
    """Join edges to closed polylines in the plane: dashes run on over the nodes."""
    following = dict(edges.tolist())
    lines = []
    while following:
        start, node = following.popitem()
        loop = [start, node]
        while node in following:
            node = following.pop(node)
            loop.append(node)
        lines.append(points[loop, :2])
    return lines


def hangs_down(points: np.ndarray, rim: np.ndarray) -> bool:
    """Tell whether the sheet is drawn further below its rim than above it."""
    level = np.median(points[rim.ravel(), 2])
    return level - points[:, 2].min() > points[:, 2].max() - level
