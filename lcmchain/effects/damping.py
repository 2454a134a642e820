"""Mass-proportional damping of the nodes.

Adds: a force -α m v.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2.
Stability limit: none, since the damping is averaged over the step.
Scene: ``process.mass_damping`` (0 switches it off).
Fields: ``energy_damping`` (history).
"""

from __future__ import annotations

from typing import Any

from lcmchain.effects.effect import Effect
from lcmchain.jit import equation


@equation
def damped_velocity(velocity, acceleration, damping, interval):
    """Return v(n+½) from v(n-½), with the damping force at the mean of both."""
    half = 0.5 * damping * interval
    return ((1.0 - half) * velocity + interval * acceleration) / (1.0 + half)


def active(model: Any) -> list[Effect]:
    rate = model.environment.mass_damping
    return [Effect("mass damping", rate > 0.0, f"{rate:g} 1/s")]
