"""What changes while resin flows, every array once, and what a filling leaves behind."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

#: Fill factor from which a control volume counts as full. What it lacks then it never gets.
FULL = 1.0 - 1e-8


@dataclass(frozen=True)
class DrySpot:
    """A pocket of air that lost its way to the vents.

    Parameters
    ----------
    time : when the front closed around it [s].
    place : centre of its dry pore volume [m], shape (3,).
    area : of the sheet that was dry in it then [m2].
    volume : of the pores that were dry in it then [m3].
    nodes : rows of its nodes then.
    """

    time: float
    place: np.ndarray
    area: float
    volume: float
    nodes: np.ndarray


@dataclass
class FillingState:
    """State of a filling; a copy is a checkpoint.

    All arrays are per node (N,) unless said otherwise.

    Parameters
    ----------
    time : [s].
    step_count : time steps so far.
    next_step : size of the last time step [s] that the front asked for; 0 in the beginning.
    resin_volume : [m3] in each control volume.
    full : whether it is full, and passes on what it receives.
    fill : fill factor 0 to 1: resin over pore volume.
    pressure : [Pa]; that of the air where no resin is.
    air_pressure : [Pa] of the air in each control volume.
    fill_time : when the front passed the node [s]; nan where it is dry.
    cure : degree of cure; temperature [K] of the resin.
    film : thickness of the resin film that lies on the sheet [m].
    impregnated : depth to which the film's resin has entered [m].
    thickness, thickness_rate : of the cells, (C,) [m], [m/s].
    lift, lift_reference : rate of the thickness per pressure above a reference, of the cells, (C,)
        [m/(s Pa)], [Pa].
    points : node positions [m], (N, 3).
    injected : volume [m3] that entered through each gate, (G,); vented: that left through each
        vent, (V,).
    gate_pressure, gate_rate : [Pa], [m3/s] of each gate in the last step, (G,); nan if closed.
    started_volume : resin in the sheet at the start [m3]; from_film: entered from the film.
    film_cure : cure of the film.
    enclosed : whether the node is in a pocket of air that no open vent reaches.
    dry_spots : in the order of their closing.
    """

    time: float
    step_count: int
    next_step: float
    resin_volume: np.ndarray
    full: np.ndarray
    fill: np.ndarray
    pressure: np.ndarray
    air_pressure: np.ndarray
    fill_time: np.ndarray
    cure: np.ndarray
    temperature: np.ndarray
    film: np.ndarray
    impregnated: np.ndarray
    thickness: np.ndarray
    thickness_rate: np.ndarray
    lift: np.ndarray
    lift_reference: np.ndarray
    points: np.ndarray
    injected: np.ndarray
    vented: np.ndarray
    gate_pressure: np.ndarray
    gate_rate: np.ndarray
    started_volume: float
    from_film: float = 0.0
    film_cure: float = 0.0
    enclosed: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    dry_spots: tuple[DrySpot, ...] = ()

    def copy(self) -> FillingState:
        """Return a state that shares no array with this one."""
        values: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                values[name] = value.copy()
        return FillingState(**values)

    @property
    def stored(self) -> float:
        """Resin in the sheet [m3]."""
        return float(self.resin_volume.sum())

    @property
    def balance_error(self) -> float:
        """What entered and did not leave, less what is stored [m3]."""
        entered = self.started_volume + self.injected.sum() + self.from_film
        return float(entered - self.vented.sum() - self.stored)


@dataclass(frozen=True)
class FillingFrame:
    """Fields at one time: nodes (N,), velocity of the cells (C, 3) [m/s] (Darcy's, K/µ grad p)."""

    time: float
    fill: np.ndarray
    pressure: np.ndarray
    cure: np.ndarray
    temperature: np.ndarray
    film: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class FillingResult:
    """What a filling leaves behind.

    Parameters
    ----------
    frames : saved states in the order of time.
    state : the last one.
    outcome : ``"filled"`` (no pore is dry), ``"reached"`` (the time that was asked for),
        ``"gelled"``, ``"no_source"`` (all gates are closed), ``"trapped"`` (what is dry cannot be
        reached or holds air), with ``message`` in words.
    """

    frames: tuple[FillingFrame, ...]
    state: FillingState
    outcome: str
    message: str
