"""Gates, where resin enters, and vents, where air leaves: their entries, and their state in a flow.

Resin flows on from a gate when the control volumes of its nodes are full. Before, while the front
is inside these volumes, their fill follows the closed solution of one-dimensional flow from the
line of the gate (F² grows linearly), or of radial flow around a hole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lcmchain.coupling.infiltration.flow.holes import (
    hole_conductance,
    mean_conductance,
    radial_time,
    while_filling,
)
from lcmchain.coupling.infiltration.flow.network import Conductances, Network
from lcmchain.coupling.infiltration.flow.state import FillingState
from lcmchain.errors import InputError


@dataclass(frozen=True)
class TimeTable:
    """A quantity over time: linear between the given times, constant before and after.

    Parameters
    ----------
    times : ascending [s], shape (K,).
    values : shape (K,).
    """

    times: np.ndarray
    values: np.ndarray

    def __post_init__(self) -> None:
        times, values = (np.atleast_1d(np.array(v, dtype=float)) for v in (self.times, self.values))
        if times.shape != values.shape or times.ndim != 1 or not len(times):
            raise InputError("a table over time needs as many values as times")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise InputError("a table over time holds a value that is not a number")
        if np.any(np.diff(times) <= 0.0):
            raise InputError("the times of a table have to ascend")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    def at(self, time: float) -> float:
        """Return the value at a time [s]."""
        return float(np.interp(time, self.times, self.values))


def value_at(quantity: float | TimeTable, time: float) -> float:
    """Return the value of a constant or of a table at a time [s]."""
    return quantity.at(time) if isinstance(quantity, TimeTable) else float(quantity)


def largest_until(quantity: float | TimeTable, end: float) -> float:
    """Return the largest value of a constant or of a table between the start and a time [s]."""
    if not isinstance(quantity, TimeTable):
        return float(quantity)
    return float(max([quantity.at(end), quantity.at(0.0), *quantity.values[quantity.times < end]]))


@dataclass(frozen=True)
class Schedule:
    """When a gate or vent is open.

    Parameters
    ----------
    opens, closes : begin and end [s].
    opens_on_arrival : rows of nodes; it is closed until the front reaches one of them. Empty: no
        such condition.
    closes_on_arrival : rows of nodes; it closes when the front reaches one of them.
    """

    opens: float = 0.0
    closes: float = np.inf
    opens_on_arrival: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    closes_on_arrival: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __post_init__(self) -> None:
        if not self.closes > self.opens:
            raise InputError(f"closes at {self.closes:g} s, before it opens at {self.opens:g} s")
        for name in ("opens_on_arrival", "closes_on_arrival"):
            object.__setattr__(self, name, np.atleast_1d(np.asarray(getattr(self, name), np.int64)))

    def is_open(self, time: float, fill_time: np.ndarray) -> bool:
        """Whether it is open at a time [s].

        fill_time : when the front reached the nodes [s], nan where it has not, (N,).
        """
        if not self.opens <= time < self.closes:
            return False
        if len(self.opens_on_arrival) and not np.any(fill_time[self.opens_on_arrival] <= time):
            return False
        return not np.any(fill_time[self.closes_on_arrival] <= time)

    def is_apart_from(self, other: Schedule) -> bool:
        """Whether both are never open at the same time, by the clock."""
        return self.closes <= other.opens or other.closes <= self.opens

    def next_switch(self, time: float) -> float:
        """Return the next time [s] at which it opens or closes by the clock; inf without one."""
        return min((t for t in (self.opens, self.closes) if t > time), default=np.inf)


@dataclass(frozen=True)
class Gate:
    """Nodes where resin enters, at a pressure or at a flow rate; all have one pressure.

    Parameters
    ----------
    name : for messages and files.
    nodes : rows, shape (K,).
    pressure : [Pa], or a table; with a flow rate the largest pressure, None for no limit.
    flow_rate : of all nodes together [m³/s], or a table; None for a pressure gate.
    schedule : when it is open.
    radius : of the round hole [m] that the nodes represent: all nodes in it, or the one next to it.
        Without it the effective hole depends on the mesh: a single node has a radius of about a
        fifth of the edges.
    """

    name: str
    nodes: np.ndarray
    pressure: float | TimeTable | None = None
    flow_rate: float | TimeTable | None = None
    schedule: Schedule = field(default_factory=Schedule)
    radius: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", _nodes(self.name, "gate", self.nodes))
        if self.pressure is None and self.flow_rate is None:
            raise InputError(f'the gate "{self.name}" needs a pressure or a flow rate')
        least = _least(self.flow_rate)
        if self.flow_rate is not None and not least >= 0.0:
            raise InputError(f'the flow rate of the gate "{self.name}" is negative ({least:g})')
        if self.radius is not None and not self.radius > 0.0:
            raise InputError(f'the radius of the gate "{self.name}" has to be positive')
        _require_number(f'flow rate of the gate "{self.name}"', self.flow_rate)
        _require_number(f'pressure of the gate "{self.name}"', self.pressure)


@dataclass(frozen=True)
class Vent:
    """Nodes where air leaves, at a pressure.

    Parameters
    ----------
    name : for messages and files.
    nodes : rows, shape (K,).
    pressure : [Pa], or a table.
    schedule : when it is open.
    closes_when_wet : each node closes when the front arrives; otherwise resin bleeds out there.
    """

    name: str
    nodes: np.ndarray
    pressure: float | TimeTable = 0.0
    schedule: Schedule = field(default_factory=Schedule)
    closes_when_wet: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", _nodes(self.name, "vent", self.nodes))
        _require_number(f'pressure of the vent "{self.name}"', self.pressure)


def _nodes(name: str, kind: str, nodes: np.ndarray) -> np.ndarray:
    rows = np.atleast_1d(np.asarray(nodes))
    if rows.size and rows.dtype.kind not in "iu":
        raise InputError(
            f'the {kind} "{name}" takes rows of nodes, whole numbers, not {rows.dtype} values; '
            "numpy.flatnonzero makes rows of a mask"
        )
    rows = np.unique(rows.astype(np.int64))
    if not len(rows):
        raise InputError(f'the {kind} "{name}" has no nodes; it lies outside the mesh')
    return rows


def _require_number(what: str, quantity: float | TimeTable | None) -> None:
    # a table checks its values itself
    if not (quantity is None or isinstance(quantity, TimeTable) or np.isfinite(quantity)):
        raise InputError(f"the {what} is {quantity}, not a finite number")


def _least(quantity: float | TimeTable | None) -> float:
    if quantity is None:
        return 0.0
    return float(np.min(quantity.values)) if isinstance(quantity, TimeTable) else float(quantity)


# --- while resin flows ----------------------------------------------------------------------------


#: Time in which a gate floods a volume, over the time in which its pores would flow through it.
AT_ONCE = 1e-6


@dataclass(frozen=True)
class OpenGate:
    """A gate that is open at present.

    Parameters
    ----------
    number : of the gate.
    pressure, rate : at present [Pa], [m³/s].
    ready : whether its control volumes are full, so that resin flows on.
    contact : conductance from the gate's hole to its nodes [m³/(Pa s)], nan without a radius;
        negative where the hole is larger than the effective radius of the nodes.
    """

    number: int
    gate: Gate
    pressure: float | None
    rate: float | None
    ready: bool
    contact: float


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
        """Whether a node may be in both: as a gate for some time, as a vent for another."""
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

    def open_vents(self, time: float, fill_time: np.ndarray) -> list[tuple[int, Vent, float]]:
        """Return number, vent and pressure [Pa] of the vents that are open at a time [s].

        fill_time : when the front reached the nodes [s], nan where it has not, (N,).
        """
        return [
            (number, vent, value_at(vent.pressure, time))
            for number, vent in enumerate(self.vents)
            if vent.schedule.is_open(time, fill_time)
        ]

    @property
    def watched(self) -> np.ndarray:
        """Nodes at which the arrival of the front opens or closes a gate or vent."""
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
        """Return the next time [s] at which a gate or vent opens or closes, or a table bends."""
        places = self._places
        bends = [t for table in self._tables for t in table.times.tolist() if t > time]
        return min(*(place.schedule.next_switch(time) for place in places), *bends, np.inf, np.inf)

    def waits_for_clock(self, time: float) -> bool:
        """Whether a gate will open later by the clock, or a table still changes."""
        changing = any(table.times[-1] > time for table in self._tables)
        return changing or any(gate.schedule.opens > time for gate in self.gates)

    def longest_step(self, time: float) -> float:
        """Return the longest step [s] over which the pressure on the film counts as constant."""
        table = self.on_film
        if not isinstance(table, TimeTable):
            return np.inf
        end = int(np.searchsorted(table.times, time, side="right"))
        if not 0 < end < len(table.times) or table.values[end] == table.values[end - 1]:
            return np.inf
        return float(table.times[end] - table.times[end - 1]) / 200.0

    def next_look(self, time: float) -> float:
        """Return the next time [s] to check while nothing moves: small steps along tables."""
        switch = self.next_switch(time)
        knots = [
            float(table.times[np.searchsorted(table.times, time, side="right") - 1])
            for table in self._tables
            if table.times[0] <= time < table.times[-1]
        ]
        # steps relative to the whole piece of a table; relative to its rest they would never end
        return min(switch, time + (switch - max(knots)) / 200.0) if knots else switch


@dataclass(frozen=True)
class Priming:
    """First filling of a gate's own control volumes, by the closed solution.

    Parameters
    ----------
    number : of the gate.
    nodes : rows that are not full yet (K,).
    room : volume that they lack (K,) [m³].
    filled : share of the gate's pores that is filled.
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
        """Return the volume that enters each node in a time step [m³], without their growth."""
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
    """Return the priming of a gate that is open, but not ready."""
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
        duration = radial_time(
            network, conductances, opened.gate.nodes, opened.gate.radius, pores, drive
        )
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
    """Return the share of each control volume in cells that the gate does not cover, (N,)."""
    cells = network.cells
    covered = (inside[cells] | (cells < 0)).all(axis=1)
    outer = network.corner_sum(network.corner_areas * ~covered[:, None])
    return outer / network.node_areas()
