"""Shape of the cells of a flat mesh: heights, angles, and the pieces that hang together."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.mesh.outline import cross


def _corner_products(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cross product and lengths of the two edges at every corner, shape (cells, 4) each."""
    after = np.roll(corner, -1, axis=1) - corner
    before = corner - np.roll(corner, 1, axis=1)
    return cross(before, after), np.hypot(*before.T).T, np.hypot(*after.T).T


def corner_sines(corner: np.ndarray) -> np.ndarray:
    """Sine of the turn at every corner, shape (cells, 4); one where an edge has no length."""
    products, before, after = _corner_products(corner)
    lengths = before * after
    return np.divide(products, lengths, out=np.ones_like(lengths), where=lengths > 0.0)


def cell_heights(corner: np.ndarray) -> np.ndarray:
    """Smallest height of cells [m], negative when inverted, shape (cells,).

    Quadrilateral: smallest corner area over the longer of the two edges there. Triangle: twice
    the area over the longest edge.
    """
    products, before, after = _corner_products(corner)
    longer = np.maximum(before, after)
    quadrilateral = np.divide(products, longer, out=np.zeros_like(longer), where=longer > 0.0)
    is_triangle = (corner[:, 2] == corner[:, 3]).all(axis=1)
    longest = np.maximum(longer.max(axis=1), np.finfo(float).tiny)
    return np.where(is_triangle, products[:, 1] / longest, quadrilateral.min(axis=1))


def piece_count(faces: np.ndarray) -> int:
    """Number of pieces of the mesh that hang together over common edges."""
    if len(faces) == 0:
        return 0
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    face = np.repeat(np.arange(len(faces)), 4)
    real = edges[:, 0] != edges[:, 1]
    edges, face = np.sort(edges[real], axis=1), face[real]
    number = np.unique(edges[:, 0] * (faces.max() + 1) + edges[:, 1], return_inverse=True)[1]
    size = len(faces)
    graph = coo_array(
        (np.ones(len(face), dtype=np.int8), (face, size + number)),
        shape=(size + number.max() + 1,) * 2,
    )
    return int(connected_components(graph, directed=False, return_labels=False))


def by_node(node: np.ndarray, value: np.ndarray, node_count: int, missing: int) -> np.ndarray:
    """Return what every node has, in the given order, (most, node_count) int32.

    Parameters
    ----------
    node, value : (n,) pairs. missing : stands where a node has fewer.
    """
    order = np.argsort(node, kind="stable")
    node, value = node[order], value[order]
    rank = np.arange(node.size) - np.searchsorted(node, node)
    table = np.full((int(rank.max(initial=0)) + 1, node_count), missing, dtype=np.int32)
    table[rank, node] = value
    return table


def boundary_edges(faces: np.ndarray) -> np.ndarray:
    """Edges of a single cell, shape (edges, 2)."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges = np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return edges[count == 1]
