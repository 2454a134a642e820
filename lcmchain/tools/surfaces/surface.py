"""Triangles of a tool's surface and their edges."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

#: Relative distance below which two vertices are one (STL files repeat every vertex).
WELD = 1e-6


class ToolWarning(UserWarning):
    """A tool that can be used, but not quite as it was given."""


@dataclass(frozen=True)
class Orientation:
    """How the normals of a surface came to point into free space.

    Parameters
    ----------
    closed, open : number of connected parts of either kind.
    reasons : what decided, in words, one for each way in which parts were decided.
    against_neighbours : triangles that were turned to agree with their neighbours.
    with_part : triangles that were turned with the whole of their part.
    united : number of solids whose union the surface is, 0 where none were united.
    """

    closed: int
    open: int
    reasons: tuple[str, ...]
    against_neighbours: int
    with_part: int
    united: int = 0


@dataclass(frozen=True)
class Surface:
    """Welded, consistently oriented triangles of a tool; normals point into free space.

    Parameters
    ----------
    points : vertices [m], shape [vertex_count, 3].
    triangles : vertex indices, shape [triangle_count, 3].
    edges : the edges of each triangle (0-1, 1-2, 2-0) as indices, shape [triangle_count, 3].
    edge_use : number of triangles at each edge, shape [edge_count].
    file : where it was read from.
    orientation : how the normals came to point into free space.
    """

    points: np.ndarray
    triangles: np.ndarray
    edges: np.ndarray
    edge_use: np.ndarray
    file: Path
    orientation: Orientation

    @property
    def normals(self) -> np.ndarray:
        """Unit normals of the triangles, shape [triangle_count, 3]."""
        a, b, c = (self.points[self.triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Connected part of each triangle, shape [triangle_count], and whether each is closed.

        Triangles are connected by the edges that two of them share.
        """
        order = np.argsort(self.edges.ravel(), kind="stable")
        order = order[self.edge_use[self.edges.ravel()[order]] == 2].reshape(-1, 2) // 3
        graph = coo_array((np.ones(len(order)), order.T), shape=(len(self.triangles),) * 2)
        count, part = connected_components(graph, directed=False)
        closed = np.ones(count, dtype=bool)
        closed[part[(self.edge_use[self.edges] != 2).any(axis=1)]] = False
        return part, closed


def edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edge index and direction (True: from the lower vertex) per triangle, and uses per edge."""
    directed = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    forward = directed[:, 0] < directed[:, 1]
    _, edges, use = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return edges.reshape(-1, 3), forward.reshape(-1, 3), use


def edge_middle(surface: Surface, edge: int) -> np.ndarray:
    t, i = np.argwhere(surface.edges == edge)[0]
    return surface.points[surface.triangles[t, [i, (i + 1) % 3]]].mean(axis=0)


def warn(file: Path, message: str) -> None:
    warnings.warn(ToolWarning(f"{file}: {message}"), stacklevel=3)


def in_metres(point: np.ndarray) -> str:
    return "({:.4g}, {:.4g}, {:.4g}) m".format(*point)
