"""Bending of the fibres within the plane of the sheet.

Adds: a stiffness D of each family of fibres against their curvature κ within the sheet (geodesic
curvature), W = ½ D κ² per area. A continuum of fibres that only shears has none: fibres may kink
from one element to the next, and where the shear law softens, shear gathers in bands as narrow as
the mesh allows. With D the bands have a width of about sqrt(D / (C12 t)), whatever the mesh. D is a
regularisation: no test gives its size.
Curvature: x₋, x, x₊ are the mid-surface nodes before, at and after a node along a fibre, l₋ and l₊
their distances in the reference, h the mean of both. Then w = ((x₊ - x)/l₊ - (x - x₋)/l₋) / h and
κ = w·p/|p|. Here p is the part of the other fibre's tangent t₂ (the difference of its two
neighbours) that is normal to this fibre's tangent t₁.
Folds: where fibres come to lie on themselves or on each other, as in a fold as sharp as the mesh,
the sheet has no plane and p no direction. Below a tenth of the reference's area |t₁ × t₂| the
energy fades out with the area, W s (2 - s) with s the square of the area over that tenth. Forces
are the exact derivative.
Source: second-gradient models of fabrics, Ferretti, Madeo, dell'Isola, Boisse: Z. angew. Math.
Phys. 65 (2014) 587-612; the discrete form: own.
Stability limit: its ω², bounded by Cauchy's inequality, is added to that of the elements.
Scene: ``material.bending.in_plane`` (0 switches it off).
Fields: ``energy_internal`` (history) holds its energy; it shows as ``shear_angle``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from lcmchain.effects.effect import Effect, EffectModel, range_in_words, switch_of_materials
from lcmchain.elements.blocks import LANES, find_runs, in_blocks, in_shared_blocks, vector_of_lanes
from lcmchain.elements.family import Body
from lcmchain.elements.vectors import combination2, cross, dot, plus, scaled
from lcmchain.jit import entry, equation, kernel, span_routine
from lcmchain.mesh.lines import fibre_lines
from lcmchain.mesh.sheet_mesh import NO_NODE
from lcmchain.packs import PACK, load, load_three, store_three

# Rows of a node in a block of 16: constants; indices; its position; the forces that it sends along
# and against fibre 1, then fibre 2; the force on it.
CONSTANT_ROWS = 10
AREA_ROW = 8
SHARE_ROW = 9
INDEX_ROWS = 10
MIDDLE_ROWS = 3
VECTOR_ROWS = 12
FORCE_ROWS = 3
# Columns of the constants that have the same unit, one group behind the other.
CONSTANT_GROUPS = (4, 2, 2, 1, 1)
# Packs of nodes in a block.
HALVES = LANES // PACK
# Blocks that a thread takes at a time.
PIECE = 8
# Part of the area between the two fibres below which a sheet counts as folded on itself. Shear
# takes it there at 84°, beyond every locking angle.
FOLDED = 0.1
# Keeps divisors at the ends of lines from being zero. All others are far larger.
TINY = 1e-300


class FibreBendingData(NamedTuple):
    """Constants of the kernel, flat arrays in blocks of 16 nodes (``elements/blocks.py``).

    constants : weights before and after along fibre 1, then 2; stiffness 1, 2; rest 1, 2; what
        makes s of |t₁ × t₂|²; share of the force on a node of the model. start : where each block
        has them (``SharedBlocks``).
    indices : nodes of the model below and above; then of the neighbours before and after along
        fibre 1, then 2, where their middles begin, and where what they send to the node does.
    runs : of the indices of each row (``elements/blocks.py``).
    place : (block_count,) where the middles, vectors and forces of a block lie, in blocks.
    first_force : where the forces of all sheets begin in the corner forces.
    """

    constants: np.ndarray
    start: np.ndarray
    indices: np.ndarray
    runs: np.ndarray
    place: np.ndarray
    first_force: int


class FibreBending(NamedTuple):
    """Constants of the fibres' bending at the mid-surface nodes of all sheets that have it.

    below, above : (mid_count,) int32, nodes of the model whose middle the mid-surface node is; the
        same twice where a sheet has one layer of nodes.
    before, after : (2, mid_count) int32, mid-surface nodes along fibre 1 and 2; the node itself
        where there is none.
    weight_before, weight_after : (2, mid_count) of their positions in the curvature [1/m²].
    stiffness : (2, mid_count) D times the node's area [N m³]; 0 where a line ends.
    rest : (2, mid_count) curvature of the reference [1/m].
    per_area2 : (mid_count,) what makes s of |t₁ × t₂|² [1/m⁴].
    body : (mid_count,) number of the sheet among the bodies of the model.
    data : the same for the kernel; each sheet begins with a block of its own.
    """

    below: np.ndarray
    above: np.ndarray
    before: np.ndarray
    after: np.ndarray
    weight_before: np.ndarray
    weight_after: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    per_area2: np.ndarray
    body: np.ndarray
    data: FibreBendingData | None

    @property
    def mid_count(self) -> int:
        return self.below.size

    @property
    def padded_count(self) -> int:
        """Number of mid-surface nodes in full blocks."""
        return LANES * int(self.block_counts.sum())

    @property
    def block_counts(self) -> np.ndarray:
        """Blocks of each sheet, by its number among the bodies; up to the last one that bends."""
        return -(-np.bincount(self.body) // LANES)

    @property
    def lane(self) -> np.ndarray:
        """Where each mid-surface node stands among the lanes of all blocks (mid_count,)."""
        count = np.bincount(self.body)
        shift = LANES * np.cumsum(self.block_counts) - np.cumsum(count)
        shift = np.concatenate([[0], shift[:-1]])
        return np.arange(self.mid_count) + shift[self.body]

    def force_slots(self) -> np.ndarray:
        """Return where the force on each mid-surface node begins (mid_count,)."""
        assert self.data is not None
        return self.data.first_force + _place(self.lane, FORCE_ROWS)


def build_fibre_bending(bodies: Sequence[Body], first_force: int) -> FibreBending | None:
    """Return the table of all bodies whose fibres resist bending within the plane, or None.

    Parameters
    ----------
    bodies : see :class:`lcmchain.elements.family.Body`.
    first_force : where its forces may begin in the array of corner forces.
    """
    parts, first_mid = [], 0
    for number, body in enumerate(bodies):
        if max(body.material.fibre_bending) > 0.0:
            part = _of_body(body, number, first_mid)
            if part.stiffness.any():
                parts.append(part)
                first_mid += part.mid_count
    if not parts:
        return None
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in FibreBending._fields
        if name != "data"
    }
    table = FibreBending(**columns, data=None)
    return table._replace(data=_in_blocks(table, first_force))


def _in_blocks(table: FibreBending, first_force: int) -> FibreBendingData:
    node, lane = np.arange(table.mid_count, dtype=np.int32), table.lane
    along = [
        rows[family] for family in (0, 1) for rows in (table.weight_before, table.weight_after)
    ]
    share = np.where(table.below == table.above, 1.0, 0.5)
    constants = np.column_stack([*along, *table.stiffness, *table.rest, table.per_area2, share])
    ends = [rows[family] for family in (0, 1) for rows in (table.before, table.after)]
    # The node before sends along the fibre, the one after against it. Where a line ends the node is
    # its own neighbour, and what it sends there comes back.
    rows = np.array([0, 3, 6, 9])
    back = rows[[1, 0, 3, 2]]
    source = [
        _place(lane[end], VECTOR_ROWS) + LANES * np.where(end == node, back[k], rows[k])
        for k, end in enumerate(ends)
    ]
    middles = [_place(lane[end], MIDDLE_ROWS) for end in ends]
    indices = np.column_stack([table.below, table.above, *middles, *source])
    largest = np.abs(constants).max(axis=0)
    first = np.cumsum((0, *CONSTANT_GROUPS[:-1]))
    scale = np.maximum(np.maximum.reduceat(largest, first), TINY)
    # lanes without a node repeat the last one of their sheet, and nobody reads what they write
    filled = np.searchsorted(lane, np.arange(table.padded_count), side="right") - 1
    shared = in_shared_blocks(constants[filled], np.repeat(scale, CONSTANT_GROUPS))
    data = FibreBendingData(
        constants=shared.values,
        start=shared.start,
        indices=in_blocks(indices[filled].astype(np.int32)),
        runs=np.zeros(0, dtype=np.int32),
        place=np.zeros(0, dtype=np.int32),
        first_force=first_force,
    )
    return at_places(data, np.arange(shared.start.size, dtype=np.int32))


def at_places(data: FibreBendingData, place: np.ndarray) -> FibreBendingData:
    """Return the constants of blocks in their own order for other places of what they write.

    Parameters
    ----------
    place : (block_count,) int32, see :class:`FibreBendingData`.
    """
    indices = data.indices.reshape(-1, INDEX_ROWS, LANES).copy()
    for rows, size in ((slice(2, 6), MIDDLE_ROWS * LANES), (slice(6, 10), VECTOR_ROWS * LANES)):
        block, within = np.divmod(indices[:, rows], size)
        indices[:, rows] = place[block] * size + within
    # rows of one kind are places in one array
    kinds = (indices[:, :2], indices[:, 2:6], indices[:, 6:])
    runs = np.concatenate([find_runs(kind) for kind in kinds], axis=1)
    return data._replace(indices=indices.ravel(), runs=runs.ravel(), place=place)


def _place(node: np.ndarray, row_count: int) -> np.ndarray:
    """Return where nodes have their first row in blocks of ``row_count`` rows."""
    block, lane = np.divmod(node, LANES)
    return block * row_count * LANES + lane


def _of_body(body: Body, number: int, first_mid: int) -> FibreBending:
    """Return the table of a body; its first mid-surface node gets the number ``first_mid``."""
    mesh = body.mesh
    nodes = np.arange(mesh.node_count, dtype=np.int32)
    sides = [nodes[side] for side in mesh.sides().values()]
    X = mesh.mid_surface(mesh.node_positions)
    lines = fibre_lines(mesh)
    node = np.arange(len(X), dtype=np.int32)
    before = np.where(lines.before == NO_NODE, node, lines.before)
    after = np.where(lines.after == NO_NODE, node, lines.after)
    inner = (before != node) & (after != node)
    # the direction across a fibre is that of the other one
    inner &= ((before != node) | (after != node))[::-1]
    lengths = [
        np.where(inner, np.linalg.norm(X[ends] - X, axis=-1), 1.0) for ends in (before, after)
    ]
    mean = 0.5 * (lengths[0] + lengths[1])
    D = np.array(body.material.fibre_bending)[:, None]
    table = FibreBending(
        below=sides[0] + np.int32(body.first_node),
        above=sides[-1] + np.int32(body.first_node),
        before=before,
        after=after,
        weight_before=np.where(inner, 1.0 / (lengths[0] * mean), 0.0),
        weight_after=np.where(inner, 1.0 / (lengths[1] * mean), 0.0),
        stiffness=np.where(inner, D * body.node_area[sides[0]], 0.0),
        rest=np.zeros((2, len(X))),
        per_area2=np.zeros(len(X)),
        body=np.full(len(X), number),
        data=None,
    )
    shift = np.int32(first_mid)
    flat, bent = FOLDED**2 * _areas2(table, X), table.stiffness.any(axis=0)
    return table._replace(
        rest=curvatures(table, X),
        per_area2=np.divide(1.0, flat, where=bent, out=np.zeros(len(X))),
        before=table.before + shift,
        after=table.after + shift,
    )


def mid_positions(table: FibreBending, position: np.ndarray) -> np.ndarray:
    """Return the mid-surface nodes (mid_count, 3) of node positions (3, node_count)."""
    return 0.5 * (position[:, table.below] + position[:, table.above]).T


def curvatures(table: FibreBending, x: np.ndarray) -> np.ndarray:
    """Return κ - κ of the reference (2, mid_count) [1/m] at mid-surface nodes x (mid_count, 3).

    Plain NumPy, written apart from the compiled forces and energy so that each checks the others.
    """
    tangent = x[table.after] - x[table.before]
    result = np.zeros(table.stiffness.shape)
    for family, other in ((0, 1), (1, 0)):
        m, p = table.weight_before[family, :, None], table.weight_after[family, :, None]
        w = m * x[table.before[family]] + p * x[table.after[family]] - (m + p) * x
        t, across = tangent[family], tangent[other]
        squared = np.einsum("nd,nd->n", t, t)
        bent = (table.stiffness[family] > 0.0) & (squared > 0.0)
        t, across, squared = t[bent], across[bent], squared[bent]
        normal_to_t = across - (np.einsum("nd,nd->n", across, t) / squared)[:, None] * t
        size = np.linalg.norm(normal_to_t, axis=1)
        # fibres that lie on each other have no direction across; the compiled forces leave them out
        along = np.einsum("nd,nd->n", w[bent], normal_to_t)
        with np.errstate(invalid="ignore"):  # guards tell of what has no bounds any more
            result[family, bent] = np.divide(
                along, size, where=size != 0.0, out=np.zeros(len(size))
            )
    return result - table.rest


def _areas2(table: FibreBending, x: np.ndarray) -> np.ndarray:
    """Return |t₁ × t₂|² (mid_count,) [m⁴]."""
    first, second = x[table.after] - x[table.before]
    return (np.cross(first, second) ** 2).sum(axis=-1)


def stored_energy(table: FibreBending, position: np.ndarray) -> float:
    """Return the energy [J] at node positions (3, node_count) [m]."""
    energy = 0.0
    for family, other in ((0, 1), (1, 0)):
        energy += _energy_of_family(
            mid_positions(table, position),
            table.before[family],
            table.after[family],
            table.before[other],
            table.after[other],
            table.weight_before[family],
            table.weight_after[family],
            table.stiffness[family],
            table.rest[family],
            table.per_area2,
        )
    return energy


@entry
def _energy_of_family(x, before, after, before2, after2, m, p, stiffness, rest, per_area2):
    """Return the energy [J] of one family of fibres at mid-surface nodes x (mid_count, 3)."""
    energy = 0.0
    for n in range(stiffness.size):
        ends, across_ends = (before[n], after[n]), (before2[n], after2[n])
        w_across, tt, across_t, across2, w_t = 0.0, 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            t = x[ends[1], d] - x[ends[0], d]
            across = x[across_ends[1], d] - x[across_ends[0], d]
            w = m[n] * (x[ends[0], d] - x[n, d]) + p[n] * (x[ends[1], d] - x[n, d])
            w_across += w * across
            w_t += w * t
            tt += t * t
            across_t += across * t
            across2 += across * across
        # |p|² of the part of the other tangent that is normal to the own one
        normal2 = across2 - across_t * across_t / tt
        if stiffness[n] > 0.0 and normal2 > 0.0:
            curvature = (w_across - across_t / tt * w_t) / math.sqrt(normal2)
            s = min(per_area2[n] * tt * normal2, 1.0)
            energy += 0.5 * stiffness[n] * (curvature - rest[n]) ** 2 * s * (2.0 - s)
    return energy


def frequency_bound(table: FibreBending, mass: np.ndarray) -> float:
    """Return a bound of the highest ω² [1/s²]; mass (node_count,) [kg].

    A curvature is a sum of three nodes' motions; by Cauchy's inequality its square is at most that
    of its weights times theirs, which adds up to a diagonal stiffness.
    """
    m, p = table.weight_before, table.weight_after
    share = table.stiffness * (m**2 + p**2 + (m + p) ** 2)
    diagonal = share.sum(axis=0)
    for family in (0, 1):
        for ends in (table.before, table.after):
            np.add.at(diagonal, ends[family], share[family])
    one_layer = table.below == table.above
    mid_mass = mass[table.below] + np.where(one_layer, 0.0, mass[table.above])
    return float((diagonal / mid_mass).max())


@kernel
def fibre_bending_forces(data, first, last, position, corner_force, middle, vector):
    """Write the internal forces of the fibres' bending behind those of the elements.

    Parameters
    ----------
    data : :class:`FibreBendingData`. first, last : the blocks of the sheets that are meant.
    position : (3, node_count) [m]. corner_force : written from ``data.first_force`` on; a node of
        either face finds half of the force on the middle [N], the only one of a layer all of it.
    middle, vector : scratch in blocks, (padded_count * MIDDLE_ROWS,) and
        (padded_count * VECTOR_ROWS,).
    """
    pieces = -(-(last - first) // PIECE)
    for piece in prange(pieces):
        for block in range(first + piece * PIECE, min(first + (piece + 1) * PIECE, last)):
            find_middle(data, position, middle, block)
    for piece in prange(pieces):
        for block in range(first + piece * PIECE, min(first + (piece + 1) * PIECE, last)):
            find_vectors(data, middle, vector, block)
    for piece in prange(pieces):
        for block in range(first + piece * PIECE, min(first + (piece + 1) * PIECE, last)):
            add_vectors(data, vector, corner_force, block)


@span_routine
def find_middle(data, position, middle, block):
    """Write the positions of the mid-surface nodes of a block."""
    own = data.place[block] * MIDDLE_ROWS * LANES
    for half in range(HALVES):
        below = neighbour(data, position, position.shape[1], block, 0, half)
        above = neighbour(data, position, position.shape[1], block, 1, half)
        store_three(middle, LANES, own + half * PACK, scaled(0.5, plus(1.0, below, above)))


@span_routine
def find_vectors(data, middle, vector, block):
    """Write the forces that the nodes of a block send to their neighbours along the fibres."""
    here = data.place[block] * MIDDLE_ROWS * LANES
    own = data.place[block] * VECTOR_ROWS * LANES
    for half in range(HALVES):
        shift = half * PACK
        before1 = neighbour(data, middle, LANES, block, 2, half)
        after1 = neighbour(data, middle, LANES, block, 3, half)
        before2 = neighbour(data, middle, LANES, block, 4, half)
        after2 = neighbour(data, middle, LANES, block, 5, half)
        x, constants = load_three(middle, LANES, here + shift), data.start[block] + shift
        after, before, across_after, across_before = bend(
            data.constants, constants, x, before1, after1, before2, after2
        )
        store_three(vector, LANES, own + shift, after)
        store_three(vector, LANES, own + 3 * LANES + shift, before)
        store_three(vector, LANES, own + 6 * LANES + shift, across_after)
        store_three(vector, LANES, own + 9 * LANES + shift, across_before)


@span_routine
def add_vectors(data, vector, corner_force, block):
    """Write the forces on the nodes of a block: the sum of those received, less those sent."""
    own = data.place[block] * VECTOR_ROWS * LANES
    first = data.first_force + data.place[block] * FORCE_ROWS * LANES
    for half in range(HALVES):
        shift = half * PACK
        total = neighbour(data, vector, LANES, block, 6, half)
        for row in range(7, 10):
            total = plus(1.0, neighbour(data, vector, LANES, block, row, half), total)
        sent = load_three(vector, LANES, own + shift)
        for k in range(1, 4):
            sent = plus(1.0, load_three(vector, LANES, own + 3 * k * LANES + shift), sent)
        share = load(data.constants, data.start[block] + SHARE_ROW * LANES + shift)
        store_three(corner_force, LANES, first + shift, scaled(share, plus(-1.0, sent, total)))


@equation
def neighbour(data, values, step, block, row, half):
    """Return what half of a block has at the indices of a row, as three packs."""
    k = block * INDEX_ROWS + row
    return vector_of_lanes(values, step, data.indices, k * LANES, data.runs, k, half)


@equation
def bend(constants, at, x, before1, after1, before2, after2):
    """Return the forces that nodes send along and against their fibres, gradients of their energy.

    With n = t₁ × t₂ and p the part of the other tangent that is normal to the own one,
    |p| = |n|/|t|: with w = κ p̂ + τ t̂ + ν n̂ and c = t·t₂/|t|², ∂κ/∂w = p̂, ∂κ/∂t₂ = ν n̂/|p| and
    ∂κ/∂t = -c ν n̂/|p| - τ p̂/|t|. Of s, ∂|n|²/∂t₁ = 2 t₂ × n. One division serves all that is
    divided by.

    Parameters
    ----------
    constants, at : rows of the constants, and where the first begins. x, before1, ... : positions
        of the nodes and of their neighbours along fibre 1 and 2 [m].
    """
    m1, p1 = load(constants, at), load(constants, at + LANES)
    m2, p2 = load(constants, at + 2 * LANES), load(constants, at + 3 * LANES)
    stiffness1, stiffness2 = load(constants, at + 4 * LANES), load(constants, at + 5 * LANES)
    rest1, rest2 = load(constants, at + 6 * LANES), load(constants, at + 7 * LANES)
    t1, t2 = plus(-1.0, before1, after1), plus(-1.0, before2, after2)
    w1 = curvature_vector(m1, p1, before1, x, after1)
    w2 = curvature_vector(m2, p2, before2, x, after2)
    n = cross(t1, t2)
    t11, t22, nn = dot(t1, t1), dot(t2, t2), dot(n, n)
    inverse = 1.0 / (t11 * t22 * nn + TINY)
    per_t11, per_t22, per_nn = inverse * t22 * nn, inverse * t11 * nn, inverse * t11 * t22
    t12 = dot(t1, t2)
    per_area2 = load(constants, at + AREA_ROW * LANES)
    s = min(per_area2 * nn, 1.0)
    kept = s * (2.0 - s)
    c1, q1, u1, lift1, slide1, twice1 = bending_of(
        stiffness1, rest1, w1, t1, t2, t12, t11, per_t11, n, per_nn, kept
    )
    c2, q2, u2, lift2, slide2, twice2 = bending_of(
        stiffness2, rest2, w2, t2, t1, t12, t22, per_t22, n, per_nn, kept
    )
    fade = 2.0 * per_area2 * (1.0 - s) * (twice1 + twice2)
    # the tangent of one fibre is where the other's p comes from
    v1 = combination2(lift2 - c1 * lift1, n, -slide1, q1)
    v2 = combination2(lift1 - c2 * lift2, n, -slide2, q2)
    v1 = plus(fade, combination2(t22, t1, -t12, t2), v1)
    v2 = plus(fade, combination2(t11, t2, -t12, t1), v2)
    return (
        combination2(p1, u1, 1.0, v1),
        combination2(m1, u1, -1.0, v1),
        combination2(p2, u2, 1.0, v2),
        combination2(m2, u2, -1.0, v2),
    )


@equation
def curvature_vector(m, p, before, x, after):
    """Return w: its part within the sheet is the curvature."""
    return plus(-m - p, x, combination2(m, before, p, after))


@equation
def bending_of(stiffness, rest, w, t, across, t12, tt, per_tt, n, per_nn, kept):
    """Return c, p̂; of the moment D A (κ - rest): times p̂, ν/(|p| |n|), τ/|t|; and 2 W A.

    ``kept`` is the part of the moment that is left where the sheet is folded on itself.
    """
    c = t12 * per_tt
    per_p = math.sqrt(tt * per_nn)
    q = scaled(per_p, plus(-c, t, across))
    change = dot(w, q) - rest
    twice = stiffness * change * change
    moment = kept * stiffness * change
    lift = per_p * per_nn * dot(w, n) * moment
    slide = per_tt * dot(w, t) * moment
    return c, q, scaled(moment, q), lift, slide, twice


SWITCH = switch_of_materials(
    "bends_in_plane",
    "without_in_plane_bending",
    entry="material.bending.in_plane",
    without="what gives bands of shear their width",
    why_not_on=(
        "the material has no stiffness against it; give material.bending.in_plane > 0 (law = "
        '"fabric")'
    ),
)


def active(model: EffectModel) -> list[Effect]:
    table = model.fibre_bending
    name = "in-plane bending of fibres"
    if table is not None:
        D = [1e3 * D for body in model.bodies for D in body.material.fibre_bending if D > 0.0]
        return [Effect(name, True, f"D = {range_in_words(D)} N mm along lines of the mesh")]
    if any(max(body.material.fibre_bending) > 0.0 for body in model.bodies):
        return [Effect(name, False, "no edges of the mesh lie along the fibres")]
    return [Effect(name, False, "the material has no stiffness against it")]
