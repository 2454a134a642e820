"""How a filling is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class FillingOptions:
    """How a filling is computed.

    Parameters
    ----------
    front_step : control volumes that the front may cross in a time step, of the mean speed.
    largest_step : [s].
    largest_compaction : of the thickness of any cell in a time step.
    largest_excess : share of its pores that a control volume may be over-full where the step closes
        the last air around it; it flows off in the next step. Without, every pocket of air that
        closes ends a step: many, where a whole part is pressed full.
    trapped_air : air that no vent reaches is compressed (ideal gas, isothermal; all pressures
        absolute) instead of leaving at the vent's pressure.
    air_pressure : of the air at the start where no vent is open [Pa].
    stop_when_idle : a filling in which nothing moves any more stops; otherwise its time goes on.
    """

    front_step: float = 0.6
    largest_step: float = np.inf
    largest_compaction: float = 0.02
    largest_excess: float = 0.0
    trapped_air: bool = False
    air_pressure: float = 0.0
    stop_when_idle: bool = True
