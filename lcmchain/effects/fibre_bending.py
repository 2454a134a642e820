"""Bending of the fibres within the plane of the sheet.

Adds: a stiffness D of each family of fibres against their curvature κ within the sheet (geodesic
curvature), W = ½ D κ² per area. A continuum of fibres that only shears has none: fibres may kink
from one element to the next, and where the shear law softens, shear gathers in bands as narrow as
the mesh lets them be. With D they have a width of about sqrt(D / (C12 t)), whatever the mesh.
With x the mid-surface nodes before, at and after a node along a fibre, l₋ and l₊ their distances in
the reference and h their mean, w = ((x₊ - x)/l₊ - (x - x₋)/l₋) / h and κ = w·p/|p|, where p is the
part of the other fibre's tangent t₂ (difference over its own two neighbours) that is normal to this
fibre's tangent t₁. Forces are the exact derivative.
Source: second-gradient models of fabrics, Ferretti, Madeo, dell'Isola, Boisse: Z. angew. Math.
Phys. 65 (2014) 587-612; the discrete form: own.
Stability limit: its ω², bounded by Gershgorin's theorem, is added to that of the elements.
Scene: ``material.bending.in_plane`` (0 switches it off).
Fields: ``energy_internal`` (history) holds its energy; it shows as ``shear_angle``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from lcmchain.effects.effect import Effect
from lcmchain.elements.blocks import LANES
from lcmchain.elements.vectors import cross, dot, plus, scaled
from lcmchain.jit import equation, kernel, routine
from lcmchain.mesh.fibre_lines import fibre_lines
from lcmchain.mesh.sheet_mesh import NO_NODE

# Rows of the nodal vectors that the forces are made of: what a node sends to its neighbours after
# and before it along fibre 1, then along fibre 2.
VECTOR_ROWS = 12
ROWS_OF_FORCE = 3
# Loop over nodes in pieces of this size.
PIECE = 128


class FibreBending(NamedTuple):
    """Constants of the fibres' bending at the mid-surface nodes of all sheets that have it.

    below, above : (mid_count,) int32, nodes of the model whose middle the mid-surface node is; the
        same twice where a sheet has one layer of nodes.
    before, after : (2, mid_count) int32, mid-surface nodes along fibre 1 and 2; the node itself
        where there is none.
    weight_before, weight_after : (2, mid_count) of their positions in the curvature [1/m²].
    stiffness : (2, mid_count) D times the node's area [N m³]; 0 where a line ends.
    rest : (2, mid_count) curvature of the reference [1/m].
    first_force : where the forces lie in the corner forces, in blocks of 16 nodes.
    """

    below: np.ndarray
    above: np.ndarray
    before: np.ndarray
    after: np.ndarray
    weight_before: np.ndarray
    weight_after: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    first_force: int

    @property
    def mid_count(self) -> int:
        return self.below.size

    @property
    def force_size(self) -> int:
        """Numbers that the forces take, in blocks."""
        return -(-self.mid_count // LANES) * LANES * ROWS_OF_FORCE

    def force_slots(self) -> np.ndarray:
        """Return where the force on each mid-surface node begins (mid_count,)."""
        block, lane = np.divmod(np.arange(self.mid_count), LANES)
        return self.first_force + block * ROWS_OF_FORCE * LANES + lane


def build_fibre_bending(bodies: Sequence[Any], first_force: int) -> FibreBending | None:
    """Return the table of all bodies whose fibres resist bending within the plane, or None.

    Parameters
    ----------
    bodies : see :class:`lcmchain.elements.family.Body`.
    first_force : where its forces may begin in the array of corner forces.
    """
    parts, first_mid = [], 0
    for body in bodies:
        if max(body.material.fibre_bending) > 0.0:
            part = _of_body(body, first_mid)
            if part.stiffness.any():
                parts.append(part)
                first_mid += part.mid_count
    if not parts:
        return None
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in FibreBending._fields
        if name != "first_force"
    }
    return FibreBending(**columns, first_force=first_force)


def _of_body(body: Any, first_mid: int) -> FibreBending:
    """Return the table of one body whose first mid-surface node gets the number ``first_mid``."""
    mesh = body.mesh
    nodes = np.arange(mesh.node_count, dtype=np.int32)
    sides = [nodes[side] for side in mesh.sides().values()]
    X = mesh.mid_surface(mesh.node_positions)
    lines = fibre_lines(mesh)
    own = np.arange(len(X), dtype=np.int32)
    before = np.where(lines.before == NO_NODE, own, lines.before)
    after = np.where(lines.after == NO_NODE, own, lines.after)
    inner = (before != own) & (after != own)
    # the direction across a fibre is that of the other one
    inner &= ((before != own) | (after != own))[::-1]
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
        first_force=0,
    )
    shift = np.int32(first_mid)
    return table._replace(
        rest=curvatures(table, X), before=table.before + shift, after=table.after + shift
    )


def mid_positions(table: FibreBending, position: np.ndarray) -> np.ndarray:
    """Return the mid-surface nodes (mid_count, 3) of node positions (3, node_count)."""
    return 0.5 * (position[:, table.below] + position[:, table.above]).T


def curvatures(table: FibreBending, x: np.ndarray) -> np.ndarray:
    """Return κ - κ of the reference (2, mid_count) [1/m] at mid-surface nodes x (mid_count, 3).

    Plain NumPy, written apart from the compiled forces so that each checks the other.
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
        result[family, bent] = np.einsum("nd,nd->n", w[bent], normal_to_t) / size
    return result - table.rest


def stored_energy(table: FibreBending, position: np.ndarray) -> float:
    """Return the energy [J] at node positions (3, node_count) [m]."""
    return float(
        0.5 * (table.stiffness * curvatures(table, mid_positions(table, position)) ** 2).sum()
    )


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
def fibre_bending_forces(table, position, corner_force, mid, vector):
    """Write the internal forces of the fibres' bending behind those of the elements.

    Parameters
    ----------
    table : :class:`FibreBending`.
    position : (3, node_count) [m]. corner_force : written from ``table.first_force`` on; a node of
        either face finds half of the force on the middle [N], the only one of a layer all of it.
    mid, vector : scratch, (3, mid_count) and (VECTOR_ROWS, mid_count).
    """
    count = table.below.size
    pieces = -(-count // PIECE)
    for piece in prange(pieces):
        find_middle(table, position, mid, piece * PIECE, min((piece + 1) * PIECE, count))
    for piece in prange(pieces):
        find_vectors(table, mid, vector, piece * PIECE, min((piece + 1) * PIECE, count))
    for piece in prange(pieces):
        add_vectors(table, vector, corner_force, piece * PIECE, min((piece + 1) * PIECE, count))


@routine
def find_middle(table, position, mid, first, last):
    for node in range(first, last):
        a, b = table.below[node], table.above[node]
        for d in range(3):
            mid[d, node] = 0.5 * (position[d, a] + position[d, b])


@routine
def find_vectors(table, mid, vector, first, last):
    """Write what the nodes send to their neighbours along the fibres."""
    for node in range(first, last):
        x = at(mid, node)
        before1, after1 = at(mid, table.before[0, node]), at(mid, table.after[0, node])
        before2, after2 = at(mid, table.before[1, node]), at(mid, table.after[1, node])
        t1, t2 = plus(-1.0, before1, after1), plus(-1.0, before2, after2)
        u1, v1, g12 = bending_of(table, 0, node, x, before1, after1, t1, t2)
        u2, v2, g21 = bending_of(table, 1, node, x, before2, after2, t2, t1)
        # the tangent of one fibre is where the other's p comes from
        v1, v2 = plus(1.0, v1, g21), plus(1.0, v2, g12)
        p1, m1 = table.weight_after[0, node], table.weight_before[0, node]
        p2, m2 = table.weight_after[1, node], table.weight_before[1, node]
        for d in range(3):
            vector[d, node] = p1 * u1[d] + v1[d]
            vector[3 + d, node] = m1 * u1[d] - v1[d]
            vector[6 + d, node] = p2 * u2[d] + v2[d]
            vector[9 + d, node] = m2 * u2[d] - v2[d]


@routine
def add_vectors(table, vector, corner_force, first, last):
    """Write the forces on the nodes, the sums of what they get less what they send."""
    for node in range(first, last):
        a1, b1 = table.after[0, node], table.before[0, node]
        a2, b2 = table.after[1, node], table.before[1, node]
        share = 1.0 if table.below[node] == table.above[node] else 0.5
        slot = table.first_force + (node // LANES) * LANES * ROWS_OF_FORCE + node % LANES
        for d in range(3):
            sent = vector[d, node] + vector[3 + d, node] + vector[6 + d, node] + vector[9 + d, node]
            # where a line ends the node is its own neighbour: what it sends there comes back
            got = vector[d, b1] if b1 != node else vector[3 + d, node]
            got += vector[3 + d, a1] if a1 != node else vector[d, node]
            got += vector[6 + d, b2] if b2 != node else vector[9 + d, node]
            got += vector[9 + d, a2] if a2 != node else vector[6 + d, node]
            corner_force[slot + d * LANES] = share * (got - sent)


@routine
def bending_of(table, family, node, x, before, after, t, across):
    """Return the moment D A κ times ∂κ/∂w, ∂κ/∂t of the own tangent and of the other fibre's.

    With w = κ p̂ + τ t̂ + ν n and c = t·t₂/|t|²: ∂κ/∂w = p̂, ∂κ/∂t₂ = ν n/|p| and
    ∂κ/∂t = -c ν n/|p| - τ p̂/|t|.
    """
    stiffness = table.stiffness[family, node]
    zero = (0.0, 0.0, 0.0)
    if stiffness == 0.0:
        return zero, zero, zero
    p, m = table.weight_after[family, node], table.weight_before[family, node]
    w = (
        p * after[0] + m * before[0] - (p + m) * x[0],
        p * after[1] + m * before[1] - (p + m) * x[1],
        p * after[2] + m * before[2] - (p + m) * x[2],
    )
    squared = dot(t, t)
    c = dot(t, across) / squared
    q = (across[0] - c * t[0], across[1] - c * t[1], across[2] - c * t[2])
    inverse = 1.0 / np.sqrt(dot(q, q))
    q = scaled(inverse, q)
    n = scaled(1.0 / np.sqrt(squared), cross(t, q))
    kappa = dot(w, q)
    moment = stiffness * (kappa - table.rest[family, node])
    lift = inverse * dot(w, n) * moment
    slide = dot(w, t) / squared * moment
    own = (
        -c * lift * n[0] - slide * q[0],
        -c * lift * n[1] - slide * q[1],
        -c * lift * n[2] - slide * q[2],
    )
    return scaled(moment, q), own, scaled(lift, n)


@equation
def at(array, node):
    return (array[0, node], array[1, node], array[2, node])


def active(model: Any) -> list[Effect]:
    table = model.fibre_bending
    name = "in-plane bending of fibres"
    if table is not None:
        D = [D for body in model.bodies for D in body.material.fibre_bending if D > 0.0]
        values = " to ".join(f"{1e3 * value:.3g}" for value in dict.fromkeys((min(D), max(D))))
        return [Effect(name, True, f"D = {values} N mm along lines of the mesh")]
    if any(max(body.material.fibre_bending) > 0.0 for body in model.bodies):
        return [Effect(name, False, "no edges of the mesh lie along the fibres")]
    return [Effect(name, False, "the material has no stiffness against it")]
