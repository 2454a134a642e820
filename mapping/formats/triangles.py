"""Targets as triangles, for programs that know no other cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.mapping.target import TargetMesh


@dataclass(frozen=True)
class Triangles:
    """Triangles of a surface mesh; quadrilaterals are cut along their shorter diagonal.

    Parameters
    ----------
    nodes : rows of the target's nodes, shape (T, 3).
    cell : row of the cell that each triangle is or is a part of, shape (T,).
    ids : numbers of the triangles, shape (T,): the cell's own, and for second halves the numbers
        that follow the largest of the target.
    """

    nodes: np.ndarray
    cell: np.ndarray
    ids: np.ndarray

    @property
    def halved(self) -> int:
        """Number of quadrilaterals that were cut."""
        return len(self.cell) - len(np.unique(self.cell))


def triangles_of(target: TargetMesh) -> Triangles:
    """Cut a surface mesh into triangles, in the order of its cells."""
    corners = target.corners
    quad = target.surface.is_quadrilateral
    points = target.points
    first = np.linalg.norm(points[corners[:, 2]] - points[corners[:, 0]], axis=1)
    second = np.linalg.norm(points[corners[:, 3]] - points[corners[:, 1]], axis=1)
    turned = quad & (second < first)
    start = np.where(turned[:, None], np.roll(corners, -1, axis=1), corners)
    cell = np.repeat(np.arange(target.cell_count), 1 + quad)
    later = np.append(False, cell[1:] == cell[:-1])
    nodes = np.where(later[:, None], start[cell][:, [0, 2, 3]], start[cell][:, :3])
    ids = target.cell_ids[cell].copy()
    ids[later] = target.cell_ids.max() + 1 + np.arange(int(later.sum()))
    return Triangles(nodes, cell, ids)
