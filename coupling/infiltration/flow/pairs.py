"""Which nodes conduct to each other, and how well: finite elements read as a network.

Conductances that are not negative keep the pressure between those of gates and front, and let
resin flow into a control volume from where the pressure is higher. _Quadrilaterals have them by
their hourglass share, triangles by flipping edges; quadrilaterals too oblique to their material,
or beside a negative edge, are cut into triangles. Cells of isotropic material without obtuse
angles stay as they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine

_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
# _Quadrilaterals beside negative edges are cut, which may give others; what is left then stays.
_ROUNDS = 8
# Of the largest entry, or of the tensors' size: less is round-off, and an edge may lie either way.
ROUND_OFF = 1e-9


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
        own = _raised(sheet.flat[quads], matrix[quads], sheet.mean[quads], at_gate)
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


# --- within quadrilaterals ------------------------------------------------------------------------
# The matrix of a bilinear quadrilateral is that of its mean gradient, which alone is right for
# every linear pressure, and a multiple of g gᵀ, with the one vector g that no linear pressure has a
# part of (D. P. Flanagan, T. Belytschko, International Journal for Numerical Methods in Engineering
# 17 (1981) 679). With that of the exact integral the conductance across a long cell, or across the
# fibres, is negative. Consistency leaves the multiple free: the more the cell's material differs
# from an isotropic one in a square, the more of it is taken, up to where the smaller of the two
# diagonals no longer conducts. No conductance is then negative, and few are small.


_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
_DIAGONALS = ((0, 2), (1, 3))
#: The exact integral is kept where this many times its least conductance is its largest.
ENOUGH = 4.0


class _Quadrilaterals(NamedTuple):
    """matrix (Q, 4, 4) : conductances T_ij of every pair of corners off the diagonal.

    split (Q,) : 1 or 2 where none are positive but those of two triangles, cut along the diagonal
        between corners 0 and 2, or 1 and 3; 0 elsewhere.
    """

    matrix: np.ndarray
    split: np.ndarray


def _raised(
    flat: np.ndarray, matrix: np.ndarray, mean: np.ndarray, at_gate: np.ndarray
) -> _Quadrilaterals:
    """Return conductances of quadrilaterals that are as little negative as possible.

    Parameters
    ----------
    flat : corners in the plane [m], (Q, 4, 2).
    matrix : T_ij of the exact integral, mean : of the mean gradient, both (Q, 4, 4).
    at_gate : cells (Q,) that keep the exact integral as far as it is not negative: the flow
        around a gate is singular there, and any more conducts too well.
    """
    g = _without_linear_part(flat)
    product = g[:, :, None] * g[:, None, :]
    convex = (g * np.array([1.0, -1.0, 1.0, -1.0]) > 0.0).all(axis=1)
    safe = np.where(convex[:, None, None], product, 1.0)
    exact = ((mean - matrix) / safe)[:, 0, 2]
    least = np.max([(mean / safe)[:, a, b] for a, b in _SIDES], axis=0)
    across = np.stack([(mean / safe)[:, a, b] for a, b in _DIAGONALS], axis=1)
    most = across.min(axis=1)
    size = np.abs(mean).max(axis=(1, 2))
    infeasible = convex & (most < least - ROUND_OFF * size)
    most = np.maximum(most, least)
    pairs = np.stack([matrix[:, a, b] for a, b in (*_SIDES, *_DIAGONALS)], axis=1)
    margin = np.clip(ENOUGH * pairs.min(axis=1) / pairs.max(axis=1), 0.0, 1.0)
    share = most + margin * (exact - most)
    share = np.where(at_gate, np.clip(exact, least, most), share)
    found = np.where(convex[:, None, None], mean - share[:, None, None] * product, matrix)
    return _Quadrilaterals(found, np.where(infeasible, 1 + across.argmax(axis=1), 0))


def _without_linear_part(flat: np.ndarray) -> np.ndarray:
    """Vectors (Q, 4) whose sum, and whose moment about every line, is zero; about 1."""
    g = np.empty(flat.shape[:2])
    for k in range(4):
        a, b, c = (flat[:, m] for m in range(4) if m != k)
        g[:, k] = (-1.0) ** k * _cross(b - a, c - a)
    return g / np.abs(g).max(axis=1)[:, None]


# --- between triangles ----------------------------------------------------------------------------
# The conductance of an edge between two triangles is negative where the sheet conducts across it so
# much better than along it that the triangles are, as the pressure sees them, too obtuse. The other
# diagonal of the two then has a positive one. Flipping such edges until none is left gives, for
# one tensor all over, the Delaunay triangulation in the metric of K⁻¹ (S. Rippa, Computer Aided
# Geometric Design 7 (1990) 489), here on the curved sheet itself, as two triangles are laid into
# one plane (A. I. Bobenko, B. A. Springborn, Discrete and Computational Geometry 38 (2007) 740).
# The nodes, and what volume belongs to them, stay.
#
# A flipped triangle lies in two cells: it has the mean of their tensors by area. Edges between very
# different materials stay, and so do those that are asked for.


#: A triangle keeps so many cells that it lies in; more are joined to them.
CELLS = 8
# Edges between cells whose permeabilities differ by more than this factor in some direction stay.
ALIKE = 4.0
# Triangles with less of the area of both are not made.
THIN = 1e-4
# Times the number of triangles; beyond, edges are left as they are.
MOST_FLIPS = 40


class Triangles(NamedTuple):
    """Triangles, each in a plane of its own, counter-clockwise.

    nodes (T, 3) : rows. flat (T, 3, 2) : corners [m].
    turns (T, 3, 2, 2) : from the triangle's plane into those of its nodes.
    cell (T, CELLS) : the cells it lies in, -1 for none; share (T, CELLS) of its area in each.
    tensor (T, CELLS, 3) : those shares of the cells' permeabilities, components 11, 22, 12.
    """

    nodes: np.ndarray
    flat: np.ndarray
    turns: np.ndarray
    cell: np.ndarray
    share: np.ndarray
    tensor: np.ndarray


def cut(
    cells: np.ndarray,
    flat: np.ndarray,
    turns: np.ndarray,
    tensor: np.ndarray,
    chosen: np.ndarray,
    split: np.ndarray,
) -> Triangles:
    """Return the triangles of the chosen cells (K,), quadrilaterals cut as ``split`` (C,) says.

    cells (C, 4), flat (C, 4, 2), turns (C, 4, 2, 2), tensor (C, 2, 2).
    """
    quads = chosen[cells[chosen, 3] >= 0]
    parts = [(chosen[cells[chosen, 3] < 0], (0, 1, 2))]
    for number, corners in ((1, (0, 1, 2)), (1, (0, 2, 3)), (2, (0, 1, 3)), (2, (1, 2, 3))):
        parts.append((quads[split[quads] == number], corners))
    cell = np.concatenate([rows for rows, _ in parts])
    corner = np.concatenate([np.tile(corners, (len(rows), 1)) for rows, corners in parts])
    there = cell[:, None]
    kept = np.full((len(cell), CELLS), -1)
    kept[:, 0] = cell
    share = np.zeros((len(cell), CELLS))
    share[:, 0] = 1.0
    own = np.zeros((len(cell), CELLS, 3))
    own[:, 0] = tensor[cell][:, (0, 1, 0), (0, 1, 1)]
    return Triangles(
        cells[there, corner], flat[there, corner], turns[there, corner], kept, share, own
    )


def flip(triangles: Triangles, kept: np.ndarray) -> int:
    """Flip edges, in place, until none has a negative conductance; return how many flips.

    kept : node rows of edges that stay, (K, 2).
    """
    nodes = triangles.nodes
    if not len(nodes):
        return 0
    return int(_flip(*triangles, _beside(nodes, kept)))


def _beside(nodes: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The side 3 t + k that each side k of triangle t shares an edge with, -1 for none, (T, 3)."""
    ends = np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2)
    ends.sort(axis=1)
    size = int(nodes.max()) + 1
    number = ends[:, 0] * size + ends[:, 1]
    order = np.argsort(number, kind="stable")
    _, start, count = np.unique(number[order], return_index=True, return_counts=True)
    first = start[count == 2]
    beside = np.full(len(number), -1)
    one, other = order[first], order[first + 1]
    beside[one], beside[other] = other, one
    kept = np.sort(np.asarray(kept, dtype=np.int64).reshape(-1, 2), axis=1)
    beside[np.isin(number, kept[:, 0] * size + kept[:, 1])] = -1
    return beside.reshape(-1, 3)


@routine
def _conductance(flat, xx, yy, xy, t, a):
    """Conductance of side a of triangle t."""
    b, c = (a + 1) % 3, (a + 2) % 3
    # The gradients times twice the area: sides opposite to the corners, turned.
    ax, ay = -(flat[t, c, 1] - flat[t, b, 1]), flat[t, c, 0] - flat[t, b, 0]
    bx, by = -(flat[t, a, 1] - flat[t, c, 1]), flat[t, a, 0] - flat[t, c, 0]
    twice = _twice(flat, t)
    return -(ax * (xx * bx + xy * by) + ay * (xy * bx + yy * by)) / (2.0 * twice)


@routine
def _twice(flat, t):
    return (flat[t, 1, 0] - flat[t, 0, 0]) * (flat[t, 2, 1] - flat[t, 0, 1]) - (
        flat[t, 1, 1] - flat[t, 0, 1]
    ) * (flat[t, 2, 0] - flat[t, 0, 0])


@routine
def _sum(tensor, t):
    xx, yy, xy = 0.0, 0.0, 0.0
    for m in range(tensor.shape[1]):
        xx += tensor[t, m, 0]
        yy += tensor[t, m, 1]
        xy += tensor[t, m, 2]
    return xx, yy, xy


@routine
def _alike(axx, ayy, axy, bxx, byy, bxy):
    """Whether the principal values of A⁻¹ B lie within 1 / ALIKE and ALIKE."""
    det_a, det_b = axx * ayy - axy * axy, bxx * byy - bxy * bxy
    trace = (ayy * bxx + axx * byy - 2.0 * axy * bxy) / det_a
    product = det_b / det_a
    root = np.sqrt(max(0.25 * trace * trace - product, 0.0))
    return 0.5 * trace + root <= ALIKE and 0.5 * trace - root >= 1.0 / ALIKE


@routine
def _flip(nodes, flat, turns, cell, share, tensor, beside):
    waiting, queued = np.empty(nodes.size, dtype=np.int64), np.zeros(nodes.size, dtype=np.bool_)
    size, flips = 0, 0
    for side in range(nodes.size - 1, -1, -1):
        if beside[side // 3, side % 3] >= 0:
            waiting[size], queued[side] = side, True
            size += 1
    while size > 0 and flips < MOST_FLIPS * len(nodes):
        size -= 1
        queued[waiting[size]] = False
        one, k = waiting[size] // 3, waiting[size] % 3
        opposite = beside[one, k]
        if opposite < 0:
            continue
        other, m = opposite // 3, opposite % 3
        same = nodes[other, m] == nodes[one, (k + 1) % 3]
        if not _try(nodes, flat, turns, cell, share, tensor, one, k, other, m, same):
            continue
        flips += 1
        _join(beside, one, k, other, m, same)
        for side in (3 * one, 3 * one + 2, 3 * other, 3 * other + 1):
            if beside[side // 3, side % 3] >= 0 and not queued[side]:
                waiting[size], queued[side] = side, True
                size += 1
    return flips


@routine
def _try(nodes, flat, turns, cell, share, tensor, one, k, other, m, same):
    """Flip side k of one, m of other, if it should be; return whether it was.

    Corners a, b, c of one and a, b, d of the other become a, d, c and d, b, c, both in the plane
    of one. same : whether both run the same way round.
    """
    i, j = (k + 1) % 3, (k + 2) % 3
    first, second = (m + 1) % 3 if same else m, m if same else (m + 1) % 3
    third = (m + 2) % 3
    if nodes[other, third] == nodes[one, j]:
        return False
    axx, ayy, axy = _sum(tensor, one)
    bxx, byy, bxy = _sum(tensor, other)
    now = _conductance(flat, axx, ayy, axy, one, k) + _conductance(flat, bxx, byy, bxy, other, m)
    if not now < -ROUND_OFF * (axx + ayy + bxx + byy):
        return False
    # The plane of the other triangle turns, or is mirrored, so that the edge and its far side fit.
    turn = np.empty((2, 2))
    ux, uy = flat[one, i, 0] - flat[one, k, 0], flat[one, i, 1] - flat[one, k, 1]
    length = np.sqrt(ux * ux + uy * uy)
    ux, uy = ux / length, uy / length
    vx = flat[other, second, 0] - flat[other, first, 0]
    vy = flat[other, second, 1] - flat[other, first, 1]
    there = np.sqrt(vx * vx + vy * vy)
    vx, vy = vx / there, vy / there
    dx = flat[other, third, 0] - flat[other, first, 0]
    dy = flat[other, third, 1] - flat[other, first, 1]
    sign = 1.0 if vx * dy - vy * dx > 0.0 else -1.0
    # Across the edge: (-vy, vx) times the sign goes to (uy, -ux), away from the third corner.
    wx, wy = -sign * vy, sign * vx
    turn[0, 0], turn[0, 1] = ux * vx + uy * wx, ux * vy + uy * wy
    turn[1, 0], turn[1, 1] = uy * vx - ux * wx, uy * vy - ux * wy
    px = flat[one, k, 0] + turn[0, 0] * dx + turn[0, 1] * dy
    py = flat[one, k, 1] + turn[1, 0] * dx + turn[1, 1] * dy
    cx, cy = flat[one, j, 0], flat[one, j, 1]
    left = (px - flat[one, k, 0]) * (cy - flat[one, k, 1])
    left -= (py - flat[one, k, 1]) * (cx - flat[one, k, 0])
    right = (flat[one, i, 0] - px) * (cy - py) - (flat[one, i, 1] - py) * (cx - px)
    here, beyond = _twice(flat, one), _twice(flat, other)
    if min(left, right) < THIN * (here + beyond):
        return False
    a, b = turn[0], turn[1]
    rxx = a[0] * a[0] * bxx + 2.0 * a[0] * a[1] * bxy + a[1] * a[1] * byy
    ryy = b[0] * b[0] * bxx + 2.0 * b[0] * b[1] * bxy + b[1] * b[1] * byy
    rxy = a[0] * b[0] * bxx + (a[0] * b[1] + a[1] * b[0]) * bxy + a[1] * b[1] * byy
    if not _alike(axx, ayy, axy, rxx, ryy, rxy):
        return False
    old = flat[one].copy()
    _mix(cell, share, tensor, one, other, here / (here + beyond), turn)
    own = turns[one].copy()
    far = np.empty((2, 2))
    for p in range(2):
        for q in range(2):
            far[p, q] = turns[other, third, p, 0] * turn[q, 0]
            far[p, q] += turns[other, third, p, 1] * turn[q, 1]
    a, b, c, d = nodes[one, k], nodes[one, i], nodes[one, j], nodes[other, third]
    nodes[one, 0], nodes[one, 1], nodes[one, 2] = a, d, c
    nodes[other, 0], nodes[other, 1], nodes[other, 2] = d, b, c
    flat[one, 0], flat[one, 2], flat[other, 1], flat[other, 2] = old[k], old[j], old[i], old[j]
    flat[one, 1, 0], flat[one, 1, 1] = px, py
    flat[other, 0, 0], flat[other, 0, 1] = px, py
    turns[one, 0], turns[one, 1], turns[one, 2] = own[k], far, own[j]
    turns[other, 0], turns[other, 1], turns[other, 2] = far, own[i], own[j]
    return True


@routine
def _mix(cell, share, tensor, one, other, weight, turn):
    """Give both triangles the mean of what they lie in, in the plane of the first."""
    count = 0
    cells = np.empty(2 * CELLS, dtype=np.int64)
    shares, tensors = np.zeros(2 * CELLS), np.zeros((2 * CELLS, 3))
    a, b = turn[0], turn[1]
    for t in (one, other):
        part = weight if t == one else 1.0 - weight
        for m in range(CELLS):
            if cell[t, m] < 0:
                break
            xx, yy, xy = tensor[t, m, 0], tensor[t, m, 1], tensor[t, m, 2]
            if t == other:
                xx, yy, xy = (
                    a[0] * a[0] * xx + 2.0 * a[0] * a[1] * xy + a[1] * a[1] * yy,
                    b[0] * b[0] * xx + 2.0 * b[0] * b[1] * xy + b[1] * b[1] * yy,
                    a[0] * b[0] * xx + (a[0] * b[1] + a[1] * b[0]) * xy + a[1] * b[1] * yy,
                )
            at = 0
            while at < count and cells[at] != cell[t, m]:
                at += 1
            if at == count:
                cells[at] = cell[t, m]
                count += 1
            shares[at] += part * share[t, m]
            tensors[at, 0] += part * xx
            tensors[at, 1] += part * yy
            tensors[at, 2] += part * xy
    while count > CELLS:
        # The cell with the least share joins the one with the largest.
        least, most = np.argmin(shares[:count]), np.argmax(shares[:count])
        shares[most] += shares[least]
        tensors[most] += tensors[least]
        count -= 1
        cells[least], shares[least] = cells[count], shares[count]
        tensors[least] = tensors[count]
    for t in (one, other):
        for m in range(CELLS):
            cell[t, m] = cells[m] if m < count else -1
            share[t, m] = shares[m] if m < count else 0.0
            for axis in range(3):
                tensor[t, m, axis] = tensors[m, axis] if m < count else 0.0


@routine
def _join(beside, one, k, other, m, same):
    """What the sides of both triangles lie beside after their edge was flipped."""
    bc, ca = beside[one, (k + 1) % 3], beside[one, (k + 2) % 3]
    ad, db = beside[other, (m + 1) % 3], beside[other, (m + 2) % 3]
    if not same:
        ad, db = db, ad
    beside[one, 0], beside[one, 1], beside[one, 2] = ad, 3 * other + 2, ca
    beside[other, 0], beside[other, 1], beside[other, 2] = db, bc, 3 * one + 1
    for side, opposite in ((3 * one, ad), (3 * one + 2, ca), (3 * other, db), (3 * other + 1, bc)):
        if opposite >= 0:
            beside[opposite // 3, opposite % 3] = side
