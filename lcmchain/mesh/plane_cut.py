"""Where a plane, or any level of a function on nodes, cuts the edges of polygons."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class CutEdges(NamedTuple):
    """Polygons that are cut, and the ends of their cuts.

    polygons : (P,) numbers of the polygons that are crossed twice.
    ends : (P, 2) numbers of the two ends of each cut; polygons that share a cut edge share one.
    nodes : (n, 2) the nodes of the edge that each end lies on. share : (n,) its way along it, 0 at
        the first node.
    """

    polygons: np.ndarray
    ends: np.ndarray
    nodes: np.ndarray
    share: np.ndarray

    def places(self, points: np.ndarray) -> np.ndarray:
        """Return the ends (n, 3) between nodes at some points."""
        first, second = points[self.nodes[:, 0]], points[self.nodes[:, 1]]
        return first + self.share[:, None] * (second - first)


def cut_edges(polygons: np.ndarray, height: np.ndarray) -> CutEdges:
    """Cut polygons where a height over nodes changes its sign; 0 counts as above.

    Parameters
    ----------
    polygons : (P, k) nodes in order; one with fewer repeats its last. height : of the nodes.
    """
    sides = np.stack([polygons, np.roll(polygons, -1, axis=1)], axis=2)
    above = height >= 0.0
    crossed = above[sides[..., 0]] != above[sides[..., 1]]
    cut = np.flatnonzero(crossed.sum(axis=1) == 2)
    edges = np.sort(sides[cut][crossed[cut]], axis=1)
    nodes, number = np.unique(edges, axis=0, return_inverse=True)
    share = height[nodes[:, 0]] / (height[nodes[:, 0]] - height[nodes[:, 1]])
    return CutEdges(cut, number.reshape(-1, 2), nodes, share)
