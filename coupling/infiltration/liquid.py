"""What the filling asks of the resin while it flows: fluidity of the cells, cure, temperature."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.medium import Medium
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.errors import InputError

# A time step is at most as long as the logarithm of the viscosity needs to grow by this, but at
# least this share of the time since the start: close to the gel point the first goes to zero.
_THICKENING, _LEAST_SHARE = 0.2, 5e-4
_LITTLE_CURE = 1e-4


class _Newtonian:
    """A resin of constant viscosity [Pa s], where only a number was given."""

    density = 0.0
    gel_cure = np.inf
    initial_cure = 0.0
    reacts = False
    depends_on_temperature = False

    def __init__(self, value: float) -> None:
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"the viscosity has to be positive, not {value}", key="resin")
        self.value = value

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        return np.full(np.shape(cure), self.value)


class Liquid:
    """A resin and its temperature in a filling."""

    def __init__(self, resin: Any, temperature: Any | None) -> None:
        self.resin: Any = _Newtonian(float(resin)) if isinstance(resin, (int, float)) else resin
        self.temperature = temperature
        if self.resin.depends_on_temperature and temperature is None:
            raise InputError(
                "the resin's viscosity or cure depends on its temperature; give one",
                key="resin.temperature",
            )
        #: Whether viscosity or cure change while the resin flows.
        self.changes = bool(self.resin.reacts or self.resin.depends_on_temperature)
        self._kept: tuple[int, np.ndarray] | None = None

    def inlet_temperature(self, time: float) -> float:
        """Temperature [K] of the resin that enters; 293.15 where none is needed."""
        return 293.15 if self.temperature is None else float(self.temperature.inlet(time))

    def fluidity(self, medium: Medium, state: FillingState) -> np.ndarray:
        """1/viscosity [1/(Pa s)] of the cells, (C,): the mean viscosity of their wet nodes.

        A cell with gelled resin conducts nothing.
        """
        count = medium.mesh.cell_count
        inlet = np.array([self.resin.initial_cure])
        entering = np.array([self.inlet_temperature(state.time)])
        fresh = float(self.resin.viscosity(entering, inlet)[0])
        if not self.changes:
            if self._kept is None or self._kept[0] != count:
                self._kept = (count, np.full(count, 1.0 / fresh))
            return self._kept[1]
        wet = state.resin_volume > 0.0
        viscosity = np.asarray(self.resin.viscosity(state.temperature, state.cure), dtype=float)
        mean = medium.network.cell_mean(np.where(wet, viscosity, np.nan))
        return 1.0 / np.where(np.isnan(mean), fresh, mean)

    def node_viscosity(self, state: FillingState) -> np.ndarray:
        """Viscosity [Pa s] at the nodes, (N,): of the resin there, or of the film that enters."""
        wet = state.resin_volume > 0.0
        cure = np.where(wet, np.maximum(state.cure, state.film_cure), state.film_cure)
        return np.asarray(self.resin.viscosity(state.temperature, cure), dtype=float)

    def longest_step(self, state: FillingState) -> float:
        """Time step [s] in which curing resin thickens by a fifth at most, or little time passes.

        Resin that only warms or cools has no such limit: a step takes the mean of its ends.
        """
        wet = state.resin_volume > 0.0
        flowing = wet & (state.cure < self.resin.gel_cure)
        if not self.resin.reacts or not flowing.any():
            return np.inf
        temperature, cure = state.temperature[flowing], state.cure[flowing]
        rate = self.resin.cure_rate(temperature, cure)
        viscosity = self.resin.viscosity(temperature, cure)
        # The slope of the logarithm grows towards the gel point: look ahead by a little cure.
        ahead = self.resin.viscosity(temperature, np.minimum(cure + _LITTLE_CURE, 1.0))
        with np.errstate(invalid="ignore"):
            slope = rate * (np.log(ahead) - np.log(viscosity)) / _LITTLE_CURE
        fastest = float(np.max(slope, initial=0.0))
        least = _LEAST_SHARE * state.time
        return max(_THICKENING / fastest, least) if fastest > 0.0 else np.inf

    def gelled(self, state: FillingState) -> np.ndarray:
        """Whether the resin in each control volume has gelled, (N,)."""
        if not np.isfinite(self.resin.gel_cure):
            return np.zeros(len(state.cure), dtype=bool)
        return (state.cure >= self.resin.gel_cure) & (state.resin_volume > 0.0)

    def rest(self, medium: Medium, state: FillingState, wet: np.ndarray, step: float) -> None:
        """Let temperature and cure go on where the resin is, over a step [s] from the state's.

        The film stays at the temperature of the resin that enters.
        """
        thickness = medium.network.node_mean(state.thickness)
        start = state.temperature
        end = start
        if self.temperature is not None:
            end = self.temperature.advance(start, thickness, state.time, step)
        if self.resin.reacts:
            aged = self.resin.advance_cure(state.cure[wet], start[wet], step, end[wet])
            state.cure = state.cure.copy()
            state.cure[wet] = np.clip(aged, 0.0, 1.0)
            before, after = (
                np.array([self.inlet_temperature(time)]) for time in (state.time, state.time + step)
            )
            lying = self.resin.advance_cure(np.array([state.film_cure]), before, step, after)
            state.film_cure = float(lying[0])
        state.temperature = end
