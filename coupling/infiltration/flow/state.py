"""State of a filling, every array once, and its results."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

#: Fill factor from which a control volume counts as full; the rest is never filled.
FULL = 1.0 - 1e-8


@dataclass(frozen=True)
class DrySpot:
    """A pocket of air that is cut off from the vents.

    Parameters
    ----------
    time : when the front closed around it [s].
    place : centre of its dry pore volume then [m], shape (3,).
    area : of its dry sheet then [m²].
    volume : of its dry pores then [m³].
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

    Arrays are per node (N,) where nothing else is stated.

    Parameters
    ----------
    time : [s].
    step_count : time steps so far.
    next_step : last size of the time step by the front [s]; 0 at the start.
    resin_volume : in each control volume [m³].
    full : whether a control volume is full, so that resin flows through it.
    fill : fill factor 0 to 1: resin over pore volume.
    pressure : [Pa]; without resin that of the air.
    air_pressure : of the air in each control volume [Pa].
    fill_time : when the front passed the node [s]; nan where it is dry.
    cure : degree of cure of the resin.
    temperature : of the resin [K].
    film : thickness of the resin film on the sheet [m].
    impregnated : depth to which resin of the film has entered [m].
    thickness, thickness_rate : of the cells, (C,) [m], [m/s].
    lift, lift_reference : rate of the thickness per pressure above a reference, of the cells, (C,)
        [m/(s Pa)], [Pa].
    points : node positions [m], (N, 3).
    injected : volume that entered through each gate, (G,) [m³].
    vented : volume that left through each vent, (V,) [m³].
    gate_pressure, gate_rate : of each gate in the last step, (G,) [Pa], [m³/s]; nan if closed.
    started_volume : resin in the sheet at the start [m³].
    from_film : resin that entered from the film [m³].
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
        """Resin that entered and did not leave, less the stored resin [m³]."""
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
    """Result of a filling.

    Parameters
    ----------
    frames : saved states in the order of time.
    state : the last one.
    outcome : ``"filled"`` (no pore is dry), ``"reached"`` (the end time), ``"gelled"``,
        ``"no_source"`` (all gates are closed), ``"trapped"`` (dry pores hold air or cannot be
        reached).
    message : the outcome in words.
    """

    frames: tuple[FillingFrame, ...]
    state: FillingState
    outcome: str
    message: str
