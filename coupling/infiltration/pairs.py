"""Which nodes conduct to each other, and how well: finite elements read as a network.

Conductances that are not negative keep the pressure between those of gates and front, and let
resin flow into a control volume from where the pressure is higher. Quadrilaterals have them by
their hourglass share (:mod:`lcmchain.coupling.infiltration.bilinear`), triangles by flipping
edges (:mod:`lcmchain.coupling.infiltration.delaunay`); quadrilaterals too oblique to their
material, or beside a negative edge, are cut into triangles. Cells of isotropic material without
obtuse angles stay as they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.bilinear import raised
from lcmchain.coupling.infiltration.delaunay import ROUND_OFF, Triangles, cut, flip

_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
# Quadrilaterals beside negative edges are cut, which may give others; what is left then stays.
_ROUNDS = 8


class Pairs(NamedTuple):
    """Pairs of nodes that conduct.

    ends (P, 2) : node rows, the smaller first. cell (P,) : whose material it is.
    flow (P,) : conductance per unit of h/µ [m2].
    between (P, 2, 2) : vectors from the other end to this one, in its plane [m], for both ends.
    span (P,) : d·K⁻¹d with the vector d between them and the permeability K of the cell [1].
    """

    ends: np.ndarray
    cell: np.ndarray
    flow: np.ndarray
    between: np.ndarray
    span: np.ndarray


class Sheet(NamedTuple):
    """Cells in their own planes.

    cells (C, 4) : node rows, -1 for none. flat (C, 4, 2) : corners [m].
    turns (C, 4, 2, 2) : from the cell's plane into those of its nodes.
    tensor (C, 2, 2) : permeability [m2].
    matrix (C, 4, 4) : conductances of the exact integral; mean (C, 4, 4) : of the mean gradient.
    """

    cells: np.ndarray
    flat: np.ndarray
    turns: np.ndarray
    tensor: np.ndarray
    matrix: np.ndarray
    mean: np.ndarray


def conducting_pairs(sheet: Sheet, kept: np.ndarray, gates: np.ndarray) -> Pairs:
    """Return the pairs of nodes of a sheet, with as few negative conductances as possible.

    kept : node rows (K, 2) of edges that no flip may take away.
    gates : rows of nodes at which resin enters or leaves.
    """
    matrix = sheet.matrix.copy()
    split = np.zeros(len(matrix), dtype=np.int64)
    quads = np.flatnonzero(sheet.cells[:, 3] >= 0)
    if len(quads):
        at_gate = np.asarray(np.isin(sheet.cells[quads], gates).any(axis=1))
        own = raised(sheet.flat[quads], matrix[quads], sheet.mean[quads], at_gate)
        matrix[quads], split[quads] = own
    for _ in range(_ROUNDS):
        chosen = np.flatnonzero((sheet.cells[:, 3] < 0) | (split > 0))
        whole = np.setdiff1d(np.arange(len(split)), chosen)
        triangles = cut(sheet.cells, sheet.flat, sheet.turns, sheet.tensor, chosen, split)
        flip(triangles, kept)
        pairs = _joined(_of_cells(sheet, matrix, whole), _of_triangles(triangles))
        beside = _beside_negative(pairs, whole, sheet.cells)
        if not len(beside):
            break
        split[beside] = 1 + (_diagonals(matrix[beside]).argmax(axis=1))
    return pairs


def _diagonals(matrix: np.ndarray) -> np.ndarray:
    return np.stack([matrix[:, 0, 2], matrix[:, 1, 3]], axis=1)


def _of_cells(sheet: Sheet, matrix: np.ndarray, rows: np.ndarray) -> Pairs:
    owner, low, high = [], [], []
    for one, other in _PAIRS:
        have = rows[(sheet.cells[rows, one] >= 0) & (sheet.cells[rows, other] >= 0)]
        swap = sheet.cells[have, one] > sheet.cells[have, other]
        owner.append(have)
        low.append(np.where(swap, other, one))
        high.append(np.where(swap, one, other))
    c, a, b = (np.concatenate(parts) for parts in (owner, low, high))
    away = sheet.flat[c, a] - sheet.flat[c, b]
    return Pairs(
        np.stack([sheet.cells[c, a], sheet.cells[c, b]], axis=1),
        c,
        matrix[c, a, b],
        _both_ways(sheet.turns[c, a], sheet.turns[c, b], away),
        _span(sheet.tensor[c][:, (0, 1, 0), (0, 1, 1)], away),
    )


def _of_triangles(triangles: Triangles) -> Pairs:
    parts = []
    flat = triangles.flat
    twice = _cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
    row, place = np.nonzero(triangles.cell >= 0)
    tensor = triangles.tensor[row, place]
    xx, yy, xy = tensor.T
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        swap = triangles.nodes[:, a] > triangles.nodes[:, b]
        first, second = np.where(swap, b, a), np.where(swap, a, b)
        every = np.arange(len(flat))
        # Gradients of two corners times twice the area: the sides opposite to them, turned.
        one, other = flat[:, c] - flat[:, b], flat[:, a] - flat[:, c]
        p, q = one[row], other[row]
        flow = -(yy * p[:, 0] * q[:, 0] + xx * p[:, 1] * q[:, 1]) / (2.0 * twice[row])
        flow += xy * (p[:, 0] * q[:, 1] + p[:, 1] * q[:, 0]) / (2.0 * twice[row])
        ends = np.stack([triangles.nodes[every, first], triangles.nodes[every, second]], axis=1)
        away = flat[every, first] - flat[every, second]
        between = _both_ways(triangles.turns[every, first], triangles.turns[every, second], away)
        span = _span(tensor, away[row])
        parts.append(Pairs(ends[row], triangles.cell[row, place], flow, between[row], span))
    return _joined(*parts)


def _span(tensor: np.ndarray, away: np.ndarray) -> np.ndarray:
    """d·K⁻¹d of vectors (P, 2) and tensors (P, 3), components 11, 22, 12."""
    xx, yy, xy = tensor.T
    x, y = away.T
    return (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)


def _both_ways(first: np.ndarray, second: np.ndarray, away: np.ndarray) -> np.ndarray:
    return np.stack(
        [np.einsum("kij,kj->ki", first, away), np.einsum("kij,kj->ki", second, -away)], axis=1
    )


def _joined(*pairs: Pairs) -> Pairs:
    return Pairs(*(np.concatenate(column) for column in zip(*pairs, strict=True)))


def _beside_negative(pairs: Pairs, whole: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Whole quadrilaterals at edges whose conductance is negative."""
    if not len(whole):
        return whole
    count = int(pairs.ends.max()) + 1
    number, edge = np.unique(pairs.ends[:, 0] * count + pairs.ends[:, 1], return_inverse=True)
    edge = edge.reshape(-1)
    flow = np.bincount(edge, pairs.flow)
    size = np.bincount(edge, np.abs(pairs.flow))
    cell_count = np.bincount(edge)
    negative = (flow < -ROUND_OFF * size.max()) & (cell_count > 1)
    ends = np.stack([cells[whole], np.roll(cells[whole], -1, axis=1)], axis=2)
    ends.sort(axis=2)
    sides = ends[..., 0] * count + ends[..., 1]
    return whole[np.isin(sides, number[negative]).any(axis=1)]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
