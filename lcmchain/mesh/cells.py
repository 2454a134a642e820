"""Cells of a flat mesh: heights, angles, pieces that hang together, and what they make of the step.

How much shorter cut cells make the stable time step than whole ones is told from their shape alone.
The stiff fibres govern the step. With the gradients g of the shape functions at a cell's centre
and positive numbers d of the nodes, Cauchy's inequality bounds the energy of the fibre strains by a
sum over the nodes, so that with lumped masses (a quarter of a cell to each corner, half of a
triangle to its repeated one)

    ω²/c² <= max over nodes n and fibres f of
             Σ_cells A (Σ_j |g_jf| d_j) |g_nf| / (d_n Σ_cells A s_n),

c the speed of the fibre wave. For squares of the edge length l along the fibres it is 4/l², which
is exact. The numbers d that make the bound small are found by a few power iterations.
Parallelograms along the fibres that touch no cut cell need no such bound and take no part.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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


def cell_areas(corner: np.ndarray) -> np.ndarray:
    """Areas of cells [m²], shape (cells,), of their corners (cells, 4, 2); negative if inverted."""
    return 0.5 * cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])


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


# --- stable time step -----------------------------------------------------------------------------


# Relative to the pitch: cells whose opposite edges differ by more are no parallelograms.
PARALLELOGRAM = 1e-6
# Sweeps of the power iteration, and the least weight of a node relative to the largest.
SWEEPS = 8
LEAST_WEIGHT = 1e-3


class CutNodes(NamedTuple):
    """Nodes of cut cells and their neighbours.

    ratio : step of whole cells over that of these, node by node (node_count,); 0 for other nodes.
    weight : the numbers d (node_count,); 1 for other nodes.
    cells : whether a cell takes part (cell_count,).
    """

    ratio: np.ndarray
    weight: np.ndarray
    cells: np.ndarray


def cut_nodes(corner: np.ndarray, faces: np.ndarray, pitch: float) -> CutNodes:
    """Return the nodes that may shorten the step, and by how much.

    Parameters
    ----------
    corner : corners of the cells in fibre coordinates [m], shape (cell_count, 4, 2).
    faces : cells, shape (cell_count, 4), triangles repeat the last node.
    pitch : edge length of whole cells [m].
    """
    node_count = int(faces.max(initial=-1)) + 1
    weight, ratio = np.ones(node_count), np.zeros(node_count)
    taper = corner[:, 0] - corner[:, 1] + corner[:, 2] - corner[:, 3]
    is_cut = np.hypot(*taper.T) > PARALLELOGRAM * pitch
    near = np.zeros(node_count, dtype=bool)
    near[faces[is_cut]] = True
    cells = near[faces].any(axis=1)
    if not is_cut.any():
        return CutNodes(ratio, weight, cells)

    faces, is_triangle = faces[cells], faces[cells, 2] == faces[cells, 3]
    bound, near_weight = nodal_bound(faces, *_shape(corner[cells], is_triangle))
    ratio[: len(bound)] = 0.5 * pitch * np.sqrt(bound)
    weight[: len(bound)] = near_weight
    return CutNodes(ratio, weight, cells)


def nodal_bound(
    faces: np.ndarray,
    gradient: np.ndarray,
    share: np.ndarray,
    area: np.ndarray,
    sweeps: int = SWEEPS,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bound of ω²/c² by each node [1/m²], and the weights d that make it small.

    Parameters
    ----------
    faces : nodes of the cells (cells, n). gradient : |gradients| of their shape functions along
        the fibres (cells, n, 2) [1/m]. share : of a cell's mass at its nodes (cells, n).
    area : of the cells [m²]. sweeps : of the power iteration; the first has all weights 1.
    """
    nodes = faces.ravel()
    mass = np.bincount(nodes, (share * area[:, None]).ravel())
    there = mass > 0.0
    trial = np.ones(len(mass))
    bound, weight = np.full(len(mass), np.inf), trial
    for _ in range(sweeps):
        total = (gradient * trial[faces][:, :, None]).sum(axis=1)
        stiffness = area[:, None, None] * total[:, None] * gradient
        of_fibre = [np.bincount(nodes, stiffness[..., f].ravel()) for f in (0, 1)]
        present = np.zeros(len(mass))
        present[there] = np.max(of_fibre, axis=0)[there] / (mass * trial)[there]
        largest = present.max()
        if largest < bound.max():
            bound, weight = present, trial
        trial = np.where(there, np.maximum(trial * np.sqrt(present / largest), LEAST_WEIGHT), 1.0)
    return bound, weight


def step_ratio(positions: np.ndarray, faces: np.ndarray, pitch: float) -> float:
    """Return the stable step of whole cells over that of the mesh, at least 1.

    Infinite where a cell is inverted.
    """
    corner = positions[faces]
    if not (cell_heights(corner) > 0.0).all():
        return math.inf
    return max(1.0, float(cut_nodes(corner, faces, pitch).ratio.max(initial=0.0)))


def _shape(
    corner: np.ndarray, is_triangle: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return |gradients| at the centre (cells, 4, 2), shares of the mass (cells, 4), and areas."""
    first, second = corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]
    area = cell_areas(corner)
    gradient = np.stack([-second, first, second, -first], axis=1)[:, :, ::-1] * [-1.0, 1.0]
    gradient = gradient / (2.0 * np.maximum(area, np.finfo(float).tiny))[:, None, None]
    share = np.full(corner.shape[:2], 0.25)
    gradient[is_triangle, 2] += gradient[is_triangle, 3]
    gradient[is_triangle, 3] = 0.0
    share[is_triangle, 2:] = 0.5, 0.0
    return np.abs(gradient), share, area
