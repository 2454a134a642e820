"""Gates and vents while the filling runs: which are open, what they prescribe, their first resin.

A gate's nodes pass resin on when their control volumes are full. The resin enters from the gate's
line: while the front is inside the gate's own control volumes their fill follows the closed
solution of one-dimensional flow (F² grows linearly), or of radial flow around a hole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lcmchain.coupling.infiltration.boundaries import Gate, TimeTable, Vent, value_at
from lcmchain.coupling.infiltration.holes import (
    hole_conductance,
    mean_conductance,
    radial_time,
    while_filling,
)
from lcmchain.coupling.infiltration.network import Conductances, Network
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.errors import InputError

#: Of the time in which a volume's pores would flow through it: what a gate floods takes this long.
AT_ONCE = 1e-6


@dataclass(frozen=True)
class OpenGate:
    """A gate that is open: its number, present pressure or rate, and whether it passes resin on.

    ``contact`` is the conductance from the gate's hole to its nodes, nan without a radius; it is
    negative where the hole is larger than the effective radius of the nodes.
    """

    number: int
    gate: Gate
    pressure: float | None
    rate: float | None
    ready: bool
    contact: float


class HasFillTime(Protocol):
    """What schedules look at: a state, or what stands for it before anything flows."""

    fill_time: np.ndarray


class Supply:
    """Gates and vents of a filling, and the pressure on its film where that is a table."""

    def __init__(
        self,
        gates: Sequence[Gate],
        vents: Sequence[Vent],
        node_count: int,
        on_film: float | TimeTable = 0.0,
    ) -> None:
        self.gates, self.vents, self.on_film = tuple(gates), tuple(vents), on_film
        owner: dict[int, str] = {}
        for place in self._places:
            kind = "gate" if isinstance(place, Gate) else "vent"
            arrival = np.concatenate(
                [place.schedule.opens_on_arrival, place.schedule.closes_on_arrival]
            )
            for nodes in (place.nodes, arrival):
                if len(nodes) and (nodes.min() < 0 or nodes.max() >= node_count):
                    raise InputError(
                        f'the {kind} "{place.name}" names node rows outside the mesh, which has '
                        f"{node_count} nodes"
                    )
            for node in place.nodes.tolist():
                if node in owner and not self._may_share(owner[node], place):
                    raise InputError(
                        f'node {node} belongs to "{owner[node]}" and to "{place.name}"; a node '
                        "is part of one gate or vent"
                    )
                owner[node] = place.name

    @property
    def gate_nodes(self) -> np.ndarray:
        """Nodes of all gates, whether open or not."""
        return np.unique(np.concatenate([np.empty(0, int), *(gate.nodes for gate in self.gates)]))

    @property
    def _places(self) -> tuple[Gate | Vent, ...]:
        return (*self.gates, *self.vents)

    def _may_share(self, name: str, place: Gate | Vent) -> bool:
        """A place may be a gate for some time and a vent for another."""
        other = next(p for p in self._places if p.name == name)
        return other.schedule.is_apart_from(place.schedule)

    def open_gates(
        self, time: float, state: FillingState, network: Network, conductances: Conductances
    ) -> list[OpenGate]:
        """Return the gates that are open at a time [s]."""
        found = []
        for number, gate in enumerate(self.gates):
            if not gate.schedule.is_open(time, state.fill_time):
                continue
            rate = None if gate.flow_rate is None else value_at(gate.flow_rate, time)
            limit = None if gate.pressure is None else value_at(gate.pressure, time)
            contact = np.nan
            if gate.radius is not None:
                contact = hole_conductance(network, conductances, gate.nodes, gate.radius)
                contact = while_filling(
                    network, conductances, gate.nodes, contact, state.full, state.fill
                )
            ready = bool(state.full[gate.nodes].all())
            found.append(OpenGate(number, gate, limit, rate, ready, contact))
        return found

    def at_time(self, gates: list[OpenGate], time: float) -> list[OpenGate]:
        """Return the same gates with their pressure and rate at another time [s]."""
        return [
            replace(
                opened,
                pressure=None if opened.gate.pressure is None
                else value_at(opened.gate.pressure, time),
                rate=None if opened.gate.flow_rate is None
                else value_at(opened.gate.flow_rate, time),
            )
            for opened in gates
        ]  # fmt: skip

    def open_vents(self, time: float, state: HasFillTime) -> list[tuple[int, Vent, float]]:
        """Return number, vent and pressure [Pa] of the vents that are open at a time [s]."""
        return [
            (number, vent, value_at(vent.pressure, time))
            for number, vent in enumerate(self.vents)
            if vent.schedule.is_open(time, state.fill_time)
        ]

    def bleeding(self, time: float, state: FillingState) -> np.ndarray:
        """True at nodes of open vents that let resin out, shape (N,)."""
        bleeds = np.zeros(len(state.full), dtype=bool)
        for _, vent, _ in self.open_vents(time, state):
            bleeds[vent.nodes] |= not vent.closes_when_wet
        return bleeds

    @property
    def watched(self) -> np.ndarray:
        """Nodes whose arrival opens or closes something."""
        places = self._places
        rows = [place.schedule.opens_on_arrival for place in places]
        rows += [place.schedule.closes_on_arrival for place in places]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *rows]))

    @property
    def _tables(self) -> list[TimeTable]:
        quantities = [gate.pressure for gate in self.gates]
        quantities += [gate.flow_rate for gate in self.gates]
        quantities += [*(vent.pressure for vent in self.vents), self.on_film]
        return [quantity for quantity in quantities if isinstance(quantity, TimeTable)]

    def next_switch(self, time: float) -> float:
        """The next time [s] at which the clock opens or closes something, or a table bends."""
        places = self._places
        bends = [t for table in self._tables for t in table.times.tolist() if t > time]
        return min(*(place.schedule.next_switch(time) for place in places), *bends, np.inf, np.inf)

    def waits_for_clock(self, time: float) -> bool:
        """Whether a gate will open later by the clock, or a table still changes."""
        changing = any(table.times[-1] > time for table in self._tables)
        return changing or any(gate.schedule.opens > time for gate in self.gates)

    def longest_step(self, time: float) -> float:
        """Longest step [s] over which the pressure on the film may be taken as constant."""
        table = self.on_film
        if not isinstance(table, TimeTable):
            return np.inf
        end = int(np.searchsorted(table.times, time, side="right"))
        if not 0 < end < len(table.times) or table.values[end] == table.values[end - 1]:
            return np.inf
        return float(table.times[end] - table.times[end - 1]) / 200.0

    def next_look(self, time: float) -> float:
        """When to look again [s] while nothing moves: tables are followed in small steps."""
        switch = self.next_switch(time)
        knots = [
            float(table.times[np.searchsorted(table.times, time, side="right") - 1])
            for table in self._tables
            if table.times[0] <= time < table.times[-1]
        ]
        # Shares of the whole piece of a table: of what is left of it, they would never end.
        return min(switch, time + (switch - max(knots)) / 200.0) if knots else switch


@dataclass(frozen=True)
class Priming:
    """First filling of a gate's own control volumes, by the closed solution.

    nodes : rows that are not full yet; missing [m3] : what they lack, together.
    duration : time to fill them from dry [s]; 0 for those that the gate floods at once.
    squared : whether the fill grows with the root of time, or linearly.
    """

    number: int
    nodes: np.ndarray
    room: np.ndarray
    filled: float
    duration: float
    squared: bool

    @property
    def left(self) -> float:
        """Time until the nodes are full [s]."""
        return self.duration * (1.0 - (self.filled**2 if self.squared else self.filled))

    def volumes(self, step: float, growth: np.ndarray) -> np.ndarray:
        """What enters each of the nodes in a time step [m3]; their growth comes in the next one."""
        if step >= self.left * (1.0 - 1e-12):
            return self.room
        if self.squared:
            reached = np.sqrt(self.filled**2 + step / self.duration)
        else:
            reached = self.filled + step / self.duration
        return self.room * ((reached - self.filled) / (1.0 - self.filled))


def prime(
    opened: OpenGate,
    network: Network,
    conductances: Conductances,
    pores: np.ndarray,
    state: FillingState,
) -> Priming:
    """Return how a gate that is open, but not ready, fills its own control volumes."""
    nodes = opened.gate.nodes[~state.full[opened.gate.nodes]]
    room = np.maximum(pores - state.resin_volume, 0.0)[nodes]
    whole = pores[nodes].sum()
    filled = float(np.clip(1.0 - room.sum() / whole, 0.0, 1.0))
    if opened.rate is not None:
        duration = whole / opened.rate if opened.rate > 0.0 else np.inf
        return Priming(opened.number, nodes, room, filled, duration, False)
    assert opened.pressure is not None
    drive = opened.pressure - float(np.max(state.air_pressure[nodes]))
    if drive <= 0.0:
        return Priming(opened.number, nodes, room, filled, np.inf, False)
    least = AT_ONCE * whole / (mean_conductance(network, conductances, nodes) * drive)
    if opened.gate.radius is not None:
        duration = radial_time(network, conductances, opened.gate, pores, drive)
        return Priming(opened.number, nodes, room, filled, max(duration, least), False)
    inside = np.zeros(network.node_count, dtype=bool)
    inside[opened.gate.nodes] = True
    first, second = network.edges[: network.in_plane_count].T
    leaving = np.flatnonzero(inside[first] != inside[second])
    outward = max(float(conductances.flow[leaving].sum()), 0.0)
    beyond = _share_beyond(network, inside)
    volume = float((beyond * pores)[nodes].sum())
    duration = volume / (4.0 * outward * drive) if outward > 0.0 else 0.0
    return Priming(opened.number, nodes, room, filled, max(duration, least), True)


def _share_beyond(network: Network, inside: np.ndarray) -> np.ndarray:
    """Share of each control volume in cells that are not covered by the gate, (N,)."""
    cells = network.cells
    covered = (inside[cells] | (cells < 0)).all(axis=1)
    outer = network.corner_sum(network.corner_areas * ~covered[:, None])
    return outer / network.node_areas()
