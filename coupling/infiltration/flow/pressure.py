"""Pressure in the filled region: assembly, solution, and the flows that follow from it.

The unknown is the potential u = p - ρ g·x of the full nodes. Each of them is in balance,
Σ_j T_ij (u_i - u_j) + Σ_k q_ik = b_i, with the flow q_ik into control volumes k with the front
(:mod:`lcmchain.coupling.infiltration.flow.front`) and a source b_i. The matrix is symmetric, except
for cells at the hole of a gate that their resin thickens: they take the pressure of the hole.

Where all T_ik of a front volume are positive and the front has not passed its node (s_k < 1), every
full neighbour feeds it alone, q_ik = T_ik (u_i - u_v) / s_k. The total is the same for a straight
front, and the matrix has no positive off-diagonals. With T >= 0 everywhere (isotropic cells without
obtuse angles) the pressure is then between the least and the largest boundary pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU, splu

from lcmchain.coupling.infiltration.flow.flow_medium import SOLUTIONS, Columns, Sinking
from lcmchain.coupling.infiltration.flow.front import Front, find_front
from lcmchain.coupling.infiltration.flow.network import Conductances, Network
from lcmchain.errors import SimulationError


@dataclass(frozen=True)
class Lift:
    """Cells that the pressure of their resin thickens: Q = A s (p - reference) [m3/s] into a cell.

    p is the mean over the corners weighted by their areas. Corners that are not full have the
    pressure of the air, corners in the hole of a gate that of the hole.

    Parameters
    ----------
    cells : rows, (L,).
    nodes : of their corners, (L, 4), -1 for none.
    weights : of the corners in the mean, (L, 4).
    conductance : A s, (L,) [m³/(s Pa)].
    reference : (L,) [Pa].
    """

    cells: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    conductance: np.ndarray
    reference: np.ndarray

    def pressure(self, of_nodes: np.ndarray) -> np.ndarray:
        """Return the mean pressures of the cells (L,) [Pa] from those of the nodes (N,) [Pa]."""
        return (self.weights * of_nodes[self.nodes]).sum(axis=1)

    def into_nodes(self, rate: np.ndarray, count: int) -> np.ndarray:
        """Return rates of the cells (L,) distributed to their corners, (N,)."""
        own = self.weights * rate[:, None]
        there = self.nodes >= 0
        return np.bincount(self.nodes[there], own[there], minlength=count)


@dataclass(frozen=True)
class Boundary:
    """Boundary conditions of the flow at one time.

    Parameters
    ----------
    fixed : prescribed pressure of nodes (N,) [Pa], nan elsewhere.
    source : flow that enters each node (N,) [m³/s].
    tied : gates at a flow rate: rows of their nodes, and the rate of all together [m³/s].
    contact : conductance of nodes to a pressure ``outside`` (N,) [m³/(Pa s)].
    outside : (N,) [Pa].
    air : pressure at the front in each control volume (N,) [Pa].
    height : ρ g·x (N,) [Pa].
    pocket : number of the pocket of compressed air of a dry control volume, -1 where the pressure
        of the air is prescribed, (N,).
    hole : pressure that cells take from nodes in the hole of a gate at a pressure (N,) [Pa], nan
        elsewhere. See :attr:`.filling.Filling.pressure`.
    in_hole : pressure of the hole less that of its nodes, where the gate has a rate (N,) [Pa].
    compliance : of each pocket, volume per pressure and time step [m³/(Pa s)].
    lift : cells that the pressure thickens.
    room : pore volume over the time step in which the front should come to rest (N,) [m³/s]; None
        for a front at its present position. See :meth:`_System._close_front`.
    wider : factors on the conductances of the edges (E,); None where all are 1. See
        :func:`.holes.widening`.
    sinking : columns that are filled through the thickness, where there is a flow medium.
    """

    fixed: np.ndarray
    source: np.ndarray
    tied: tuple[tuple[np.ndarray, float], ...]
    contact: np.ndarray
    outside: np.ndarray
    air: np.ndarray
    height: np.ndarray
    pocket: np.ndarray
    hole: np.ndarray
    in_hole: np.ndarray
    compliance: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lift: Lift | None = None
    room: np.ndarray | None = None
    wider: np.ndarray | None = None
    sinking: Sinking | None = None

    def of_cells(self, full: np.ndarray, resin: np.ndarray) -> np.ndarray:
        """Return the pressures (N,) [Pa] that cells take from their corners.

        resin : pressures of full nodes (N,) [Pa].
        """
        filled = np.where(np.isnan(self.hole), resin + self.in_hole, self.hole)
        return np.where(full, filled, self.air)


class Flow(NamedTuple):
    """Pressure and flows at one time.

    Parameters
    ----------
    potential : u (N,) [Pa]; at front volumes that of their closure, nan at dry nodes.
    pressure : (N,) [Pa], at the front not below that of the air, at dry nodes that of the air.
    front : with its feeding edges.
    feed : flow along the feeding edges (P,) [m³/s].
    along : flow from the first to the second end of every edge, feeding ones included (E,) [m³/s].
    net : flow from full nodes beyond their source (N,) [m³/s]: that of gates and vents at their
        nodes, round-off at others.
    lifted : mean pressure of the cells that it lifts (L,) [Pa].
    columns : that are filled through the thickness, None where there are none.
    sunk : flow into each of them (P,) [m³/s].
    """

    potential: np.ndarray
    pressure: np.ndarray
    front: Front
    feed: np.ndarray
    along: np.ndarray
    net: np.ndarray
    lifted: np.ndarray
    columns: Columns | None = None
    sunk: np.ndarray = np.zeros(0)

    @property
    def inflow(self) -> np.ndarray:
        """Flow into each front volume (K,) [m³/s]."""
        return np.bincount(self.front.member, self.feed, minlength=len(self.front.nodes))

    def filling(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of the volumes that are being filled, and the flow into each [m³/s]."""
        if self.columns is None:
            return self.front.nodes, self.inflow
        both = np.concatenate([self.front.nodes, self.columns.target])
        rows, place = np.unique(both, return_inverse=True)
        inflow = np.concatenate([self.inflow, self.sunk])
        return rows, np.bincount(place.reshape(-1), inflow, minlength=len(rows))


def longest_free_step(flow: Flow, pores: np.ndarray, height: np.ndarray) -> float:
    """Return the longest step [s] in which no front volume comes to rest by its resin's weight.

    Parameters
    ----------
    pores : pore volumes (N,) [m³].
    height : ρ g·x (N,) [Pa].
    """
    front = flow.front
    rises = np.maximum(front.mean(height) - height[front.nodes], 0.0)
    rate = front.total * front.ratio * rises / (front.distance * pores[front.nodes])
    return 1.0 / float(rate.max(initial=1e-300))


def solve_flow(
    network: Network,
    conductances: Conductances,
    full: np.ndarray,
    fill: np.ndarray,
    boundary: Boundary,
    held: np.ndarray,
    factors: Factors,
) -> Flow:
    """Return the flow for full nodes (N,) and fill factors (N,).

    held : pressure (N,) [Pa] of full regions without gate and front, which nothing drives.
    """
    front = find_front(network, conductances, full, fill)
    if boundary.wider is not None:
        front = front.conducting(boundary.wider)
    system = _System(network, conductances, full, front, boundary)
    flow = system.solve(held, factors)
    if boundary.sinking is not None:
        for _ in range(SOLUTIONS - 1):
            boundary.sinking.agree(flow.potential)
            flow = system.solve(held, factors)
    return flow


class _System:
    """Entries of the matrix over nodes, then over unknowns."""

    def __init__(
        self,
        network: Network,
        conductances: Conductances,
        full: np.ndarray,
        front: Front,
        boundary: Boundary,
    ) -> None:
        self.full, self.front, self.boundary = full, front, boundary
        self.count = network.node_count
        first, second = network.edges.T
        inner = np.flatnonzero(full[first] & full[second])
        self.inner, self.edge_count = inner, len(first)
        self.edge_first = first
        self.first, self.second = first[inner], second[inner]
        self.flow = conductances.flow[inner]
        if boundary.wider is not None:
            self.flow = self.flow * boundary.wider[inner]
        self._close_front()

    def _close_front(self) -> None:
        """Set the potential of the air at the front, and the resistance of front volumes.

        Resin that rises in a front volume slows down by its weight, at the rate λ. In a time step
        Δt longer than 1/λ the distance to the front counts λ Δt times, so that no step takes the
        front beyond its position of rest. A shorter step does not change.
        """
        front, boundary = self.front, self.boundary
        nodes, distance = front.nodes, front.distance
        below = front.mean(boundary.height)
        self.air_height = below + distance * (boundary.height[nodes] - below)
        self.pocket = boundary.pocket[nodes]
        self.air = boundary.air[nodes] - self.air_height
        # conductances that vanish may have either sign by round-off
        below_zero = front.flow < -1e-9 * front.total[front.member]
        negative = np.bincount(front.member, below_zero, minlength=len(nodes)) > 0
        self.resistance = distance
        if boundary.room is not None:
            rises = np.maximum(below - boundary.height[nodes], 0.0)
            held = front.total * front.ratio * rises / (distance * boundary.room[nodes])
            self.resistance = distance * np.maximum(held, 1.0)
        self.apart = (self.resistance < 1.0) & ~negative

    def solve(self, held: np.ndarray, factors: Factors) -> Flow:
        unknown, known = self._unknowns(held)
        size = unknown.max(initial=-1) + 1
        pockets = np.arange(len(self.boundary.compliance)) + size
        rows, columns, entries, right = self._entries()
        row, column = unknown[rows], unknown[columns]
        right = right - np.bincount(
            rows[column < 0], (entries * known[columns])[column < 0], minlength=self.count
        )
        # tied nodes have one pressure, so that their potentials differ by their height
        shift = np.where(unknown >= 0, known, 0.0)
        right -= np.bincount(rows, entries * shift[columns] * (column >= 0), minlength=self.count)
        kept = (row >= 0) & (column >= 0)
        parts = [(row[kept], column[kept], entries[kept])]
        total = np.bincount(unknown[unknown >= 0], right[unknown >= 0], minlength=size)
        total = np.concatenate([total, np.zeros(len(pockets))])
        if len(pockets):
            self._add_pockets(unknown, known, pockets, parts, total)
        solution = _solve(parts, total, factors)
        potential = np.where(unknown >= 0, solution[np.maximum(unknown, 0)], 0.0) + known
        if len(pockets):
            inside = self.pocket >= 0
            self.air[inside] = solution[pockets[self.pocket[inside]]] - self.air_height[inside]
        return self._flow(np.where(self.full, potential, np.nan))

    def _unknowns(self, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the number of the unknown of each node, -1 for none, and the known addend."""
        boundary = self.boundary
        fixed = self.full & ~np.isnan(boundary.fixed)
        known = np.where(fixed, boundary.fixed - boundary.height, 0.0)
        leader = np.arange(self.count)
        free = self.full & ~fixed
        for nodes, _ in boundary.tied:
            tied = nodes[free[nodes]]
            if len(tied):
                leader[tied] = tied[0]
                known[tied] = boundary.height[tied[0]] - boundary.height[tied]
        for node, value in self._undriven(fixed, leader, held):
            group = np.flatnonzero(free & (leader == node))
            free[group] = False
            known[group] += value
        lead = free & (leader == np.arange(self.count))
        number = np.full(self.count, -1)
        number[lead] = np.arange(np.count_nonzero(lead))
        return np.where(free, number[leader], -1), known

    def _undriven(
        self, fixed: np.ndarray, leader: np.ndarray, held: np.ndarray
    ) -> list[tuple[int, float]]:
        """Return a node of each full region that nothing drives, and its potential [Pa]."""
        following = np.flatnonzero(leader != np.arange(self.count))
        linked = np.abs(self.flow) > 0.0
        rows = np.concatenate([self.first[linked], following])
        columns = np.concatenate([self.second[linked], leader[following]])
        graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(self.count, self.count))
        count, region = connected_components(graph, directed=False)
        driven = np.zeros(count, dtype=bool)
        driven[region[fixed]] = True
        driven[region[self.front.source]] = True
        if self.boundary.sinking is not None:
            driven[region[self.boundary.sinking.columns.source]] = True
        driven[region[self.full & (self.boundary.contact != 0.0)]] = True
        lift = self.boundary.lift
        if lift is not None:
            corners = lift.nodes[lift.nodes >= 0]
            driven[region[corners[self.full[corners]]]] = True
        lost = np.flatnonzero(self.full & ~driven[region])
        gates = [nodes for nodes, _ in self.boundary.tied]
        at_gate = np.isin(lost, np.concatenate(gates)) if gates else np.zeros(len(lost), bool)
        # a node of a gate first, so that the flow of the gate does not enter
        lost = lost[np.argsort(~at_gate, kind="stable")]
        _, first = np.unique(region[lost], return_index=True)
        nodes = leader[lost[first]]
        return [(int(k), float(held[k] - self.boundary.height[k])) for k in nodes]

    def _entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        front, boundary = self.front, self.boundary
        i, j, flow = self.first, self.second, self.flow
        source, member = front.source, front.member
        distance = self.resistance[member]
        apart = self.apart[member]
        to_air = np.where(self.pocket >= 0, -self.air_height, self.air)[member]
        right = boundary.source + boundary.contact * (boundary.outside - boundary.height)
        for nodes, rate in boundary.tied:
            tied = nodes[self.full[nodes]]
            right[tied[:1]] += rate
        right += np.bincount(source, front.flow * to_air / distance, minlength=self.count)
        own = np.where(apart, front.flow / distance, front.flow)
        touched = np.flatnonzero(self.full & (boundary.contact != 0.0))
        weight = np.where(self.apart, 0.0, (1.0 / self.resistance - 1.0) / front.total)
        fed = coo_matrix((front.flow, (member, source)), shape=(len(front.nodes), self.count))
        fed = fed.tocsr()
        shared = (fed.T @ fed.multiply(weight[:, None])).tocoo()
        rows = [i, j, i, j, source, touched, shared.row]
        columns = [i, j, j, i, source, touched, shared.col]
        entries = [flow, flow, -flow, -flow, own, boundary.contact[touched], shared.data]
        if boundary.sinking is not None:
            sinks, air = boundary.sinking.columns, boundary.sinking.air
            rows.append(sinks.source)
            columns.append(sinks.source)
            entries.append(sinks.conductance)
            right += np.bincount(sinks.source, sinks.conductance * air, minlength=self.count)
        if boundary.lift is not None:
            self._add_lift(boundary.lift, rows, columns, entries, right)
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(entries), right

    def _add_lift(
        self,
        lift: Lift,
        rows: list[np.ndarray],
        columns: list[np.ndarray],
        entries: list[np.ndarray],
        right: np.ndarray,
    ) -> None:
        """What cells take in that the pressure of their full corners thickens."""
        boundary = self.boundary
        # Of the full nodes what their height adds to the potential; the air's pressure elsewhere.
        known = boundary.of_cells(self.full, boundary.height)
        right += lift.into_nodes(
            lift.conductance * (lift.reference - lift.pressure(known)), self.count
        )
        full = (lift.nodes >= 0) & self.full[lift.nodes]
        # The pressure of a hole is given: its nodes take resin in, but do not press.
        pressing = full & np.isnan(boundary.hole[lift.nodes])
        for a in range(4):
            for b in range(4):
                both = full[:, a] & pressing[:, b]
                rows.append(lift.nodes[both, a])
                columns.append(lift.nodes[both, b])
                entries.append((lift.conductance * lift.weights[:, a] * lift.weights[:, b])[both])

    def _add_pockets(
        self,
        unknown: np.ndarray,
        known: np.ndarray,
        pockets: np.ndarray,
        parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
        total: np.ndarray,
    ) -> None:
        """Air that is compressed: what flows in over the step lifts its pressure."""
        front, boundary = self.front, self.boundary
        inside = self.pocket[front.member] >= 0
        member, node = front.member[inside], front.source[inside]
        number = pockets[self.pocket[member]]
        share = front.flow[inside] / self.resistance[member]
        row = unknown[node]
        free = row >= 0
        for rows, columns in ((row, number), (number, row)):
            parts.append((rows[free], columns[free], -share[free]))
        parts.append((number, number, share))
        parts.append((pockets, pockets, boundary.compliance))
        size = len(total)
        total += np.bincount(
            number, share * (known[node] + self.air_height[member]), minlength=size
        )
        first = np.full(len(pockets), 0.0)
        dry = boundary.pocket >= 0
        first[boundary.pocket[dry]] = boundary.air[dry]
        total[pockets] += boundary.compliance * first

    def _flow(self, potential: np.ndarray) -> Flow:
        front, boundary = self.front, self.boundary
        nodes, member = front.nodes, front.member
        mean = front.mean(potential)
        potential[nodes] = mean - (mean - self.air) / self.resistance
        upstream = potential[front.source]
        feed = np.where(
            self.apart[member],
            front.flow * (upstream - self.air[member]) / self.resistance[member],
            front.flow * (upstream - potential[nodes][member]),
        )
        between = self.flow * (potential[self.first] - potential[self.second])
        along = np.zeros(self.edge_count)
        along[self.inner] = between
        along[front.edge] = np.where(self.edge_first[front.edge] == front.source, feed, -feed)
        net = (
            np.bincount(self.first, between, minlength=self.count)
            - np.bincount(self.second, between, minlength=self.count)
            + np.bincount(front.source, feed, minlength=self.count)
        )
        columns, sunk = self._sink(potential, along)
        if columns is not None:
            net = net + np.bincount(columns.source, sunk, minlength=self.count)
        taken, lifted = np.zeros(self.count), np.zeros(0)
        if boundary.lift is not None:
            lift = boundary.lift
            own = boundary.of_cells(self.full, potential + boundary.height)
            lifted = lift.pressure(own)
            taken = lift.into_nodes(lift.conductance * (lifted - lift.reference), self.count)
        net = np.where(self.full, net - boundary.source + taken, 0.0)
        wet = ~np.isnan(potential)
        pressure = np.where(wet, potential + boundary.height, boundary.air)
        pressure[nodes] = np.maximum(pressure[nodes], self.air + self.air_height)
        return Flow(potential, pressure, front, feed, along, net, lifted, columns, sunk)

    def _sink(self, potential: np.ndarray, along: np.ndarray) -> tuple[Columns | None, np.ndarray]:
        """Flow through the thickness [m3/s], (P,); writes it into that of all edges (E,)."""
        sinking = self.boundary.sinking
        if sinking is None:
            return None, np.zeros(0)
        columns, sunk = sinking.columns, sinking.flow(potential)
        forth = self.edge_first[columns.edge] == columns.source
        along[columns.edge] = np.where(forth, sunk, -sunk)
        return columns, sunk


def _solve(
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]], right: np.ndarray, factors: Factors
) -> np.ndarray:
    if not len(right):
        return np.zeros(1)
    rows, columns, entries = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not (np.isfinite(entries).all() and np.isfinite(right).all()):
        raise SimulationError(
            "the pressure of the resin has no finite equations: its sources are out of all "
            "measure, as where a thickness changes too fast"
        )
    matrix = csc_matrix(coo_matrix((entries, (rows, columns)), shape=(len(right), len(right))))
    return factors.solve(matrix, right)


# --- factors of the equations, kept while the matrix stays the same -------------------------------
# The same matrix comes back where a saturated part keeps its shape, where only what is injected or
# squeezed differs, and where a coupling iterates over one time step. Equal matrices have equal
# factors, so what is kept changes no bit of the result.


#: Factors of so many matrices are kept.
KEPT = 4
#: Factors with more entries than this in all are not kept for later [1]; 12 bytes each.
MOST_ENTRIES = 60_000_000


@dataclass
class Work:
    """How much solving a filling took: matrices factorised, and systems solved with them."""

    factorisations: int = 0
    solutions: int = 0


class Factors:
    """Factorised matrices of the pressure, the last ones used first."""

    def __init__(self) -> None:
        self.work = Work()
        self._kept: list[tuple[csc_matrix, SuperLU]] = []

    def solve(self, matrix: csc_matrix, right: np.ndarray) -> np.ndarray:
        """Solve a system of symmetric structure, refined once: nodes balance to round-off.

        Raises
        ------
        SimulationError : the matrix is singular.
        """
        factors = self._of(matrix)
        self.work.solutions += 1
        solution = factors.solve(right)
        return solution + factors.solve(right - matrix @ solution)

    def _of(self, matrix: csc_matrix) -> SuperLU:
        for place, (other, factors) in enumerate(self._kept):
            if _same(matrix, other):
                self._kept.insert(0, self._kept.pop(place))
                return factors
        try:
            factors = splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SimulationError(
                f"the equations of the resin's pressure cannot be solved ({error}): some of it is "
                "neither at a gate or vent nor at the front"
            ) from None
        self.work.factorisations += 1
        self._kept.insert(0, (matrix, factors))
        del self._kept[KEPT:]
        while len(self._kept) > 1 and sum(f.nnz for _, f in self._kept) > MOST_ENTRIES:
            self._kept.pop()
        return factors


def _same(one: csc_matrix, other: csc_matrix) -> bool:
    return (
        one.shape == other.shape
        and one.nnz == other.nnz
        and np.array_equal(one.data, other.data)
        and np.array_equal(one.indices, other.indices)
        and np.array_equal(one.indptr, other.indptr)
    )
