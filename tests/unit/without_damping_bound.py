"""What a step does whose bound leaves out what resists the rate, for tests of that bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lcmchain.model import build_model
from lcmchain.solver.simulation import Simulation


def require_blows_up(scene: Any, velocity: np.ndarray) -> None:
    """Require that steps bounded by the highest frequency alone blow up from velocities [m/s]."""
    unbound = Simulation(build_model(scene))
    unbound.set_velocity(velocity)
    unbound.prepare_steps()
    omega = math.sqrt(unbound._highest_frequency()[0])
    with np.errstate(all="ignore"):
        unbound._advance(400, 0.9 * 2.0 / omega)
    assert not np.abs(unbound.state.velocity).max() < 1e3
