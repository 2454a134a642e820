"""Where resin enters and air leaves: gates, vents, their schedules, and race tracks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

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
        """Value at a time [s]."""
        return float(np.interp(time, self.times, self.values))


def value_at(quantity: float | TimeTable, time: float) -> float:
    """Value of a constant or of a table at a time [s]."""
    return quantity.at(time) if isinstance(quantity, TimeTable) else float(quantity)


@dataclass(frozen=True)
class Schedule:
    """When a gate or vent is open.

    Parameters
    ----------
    opens, closes : from and to this time [s].
    opens_on_arrival, closes_on_arrival : rows of nodes; open only after, and closed after, the
        front has reached one of them. Empty: no such condition.
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
        """Whether it is open at a time [s], given when the front reached the nodes (nan: not)."""
        if not self.opens <= time < self.closes:
            return False
        if len(self.opens_on_arrival) and not np.any(fill_time[self.opens_on_arrival] <= time):
            return False
        return not np.any(fill_time[self.closes_on_arrival] <= time)

    def is_apart_from(self, other: Schedule) -> bool:
        """Whether the clock never has both open."""
        return self.closes <= other.opens or other.closes <= self.opens

    def next_switch(self, time: float) -> float:
        """The next time [s] at which the clock opens or closes it; inf if there is none."""
        return min((t for t in (self.opens, self.closes) if t > time), default=np.inf)


@dataclass(frozen=True)
class Gate:
    """Nodes where resin enters, at a pressure or at a flow rate; all have one pressure.

    Parameters
    ----------
    name : for messages and files.
    nodes : rows, shape (K,).
    pressure : [Pa], or a table; the only one given, or the largest that a rate gate may need.
    flow_rate : [m3/s] of all nodes together, or a table; None for a pressure gate.
    schedule : when it is open.
    radius : of the round hole [m] that the nodes stand for, those that lie in it, or the one
        next to it. Without it the nodes act as a hole of their own size: one alone has an
        effective radius of about a fifth of the mesh's edges.
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


@dataclass(frozen=True)
class RaceTrack:
    """Edges along which resin runs ahead in a channel, as at the rim of a cut preform.

    Parameters
    ----------
    name : for messages.
    edges : node rows of the sides of cells, shape (K, 2).
    conductance : permeability times cross-section of the channel [m4], one number or (K,): a gap
        of width w and height h has about w h³ / 12 or w³ h / 12 with the smaller side cubed.
    section : cross-section [m2] that the resin fills in addition, one number or (K,).
    """

    name: str
    edges: np.ndarray
    conductance: float | np.ndarray
    section: float | np.ndarray = 0.0

    def __post_init__(self) -> None:
        edges = np.asarray(self.edges, dtype=np.int64).reshape(-1, 2)
        object.__setattr__(self, "edges", edges)
        if not len(edges):
            raise InputError(f'the race track "{self.name}" has no edges')
        if not np.all(np.asarray(self.conductance) > 0.0) or np.any(np.asarray(self.section) < 0):
            raise InputError(
                f'the race track "{self.name}" needs a positive conductance and a section >= 0'
            )


def _nodes(name: str, kind: str, nodes: np.ndarray) -> np.ndarray:
    given = np.atleast_1d(np.asarray(nodes))
    if given.size and given.dtype.kind not in "iu":
        raise InputError(
            f'the {kind} "{name}" takes rows of nodes, whole numbers, not {given.dtype} values; '
            "numpy.flatnonzero makes rows of a mask"
        )
    rows = np.unique(given.astype(np.int64))
    if not len(rows):
        raise InputError(f'the {kind} "{name}" has no nodes; it lies outside the mesh')
    return rows


def _require_number(what: str, quantity: float | TimeTable | None) -> None:
    # A table has seen to its values itself.
    if not (quantity is None or isinstance(quantity, TimeTable) or np.isfinite(quantity)):
        raise InputError(f"the {what} is {quantity}, not a finite number")


def _least(quantity: float | TimeTable | None) -> float:
    if quantity is None:
        return 0.0
    return float(np.min(quantity.values)) if isinstance(quantity, TimeTable) else float(quantity)
