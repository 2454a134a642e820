"""What the filling asks of the resin while it flows: fluidity of the cells, cure, temperature."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.medium import Medium
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.errors import InputError


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
        self.resin = _Newtonian(float(resin)) if np.isscalar(resin) else resin
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

    def gelled(self, state: FillingState) -> np.ndarray:
        """Whether the resin in each control volume has gelled, (N,)."""
        if not np.isfinite(self.resin.gel_cure):
            return np.zeros(len(state.cure), dtype=bool)
        return (state.cure >= self.resin.gel_cure) & (state.resin_volume > 0.0)

    def rest(self, medium: Medium, state: FillingState, step: float) -> None:
        """Let temperature and cure go on where the resin is, over a step [s] from the state's."""
        thickness = medium.network.node_mean(state.thickness)
        start = state.temperature
        end = start
        if self.temperature is not None:
            end = self.temperature.advance(start, thickness, state.time, step)
        if self.resin.reacts:
            wet = state.resin_volume > 0.0
            aged = self.resin.advance_cure(state.cure[wet], start[wet], step, end[wet])
            state.cure = state.cure.copy()
            state.cure[wet] = np.clip(aged, 0.0, 1.0)
        state.temperature = end
