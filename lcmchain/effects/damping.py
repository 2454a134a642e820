"""Mass-proportional damping of the nodes, and gravity: the external terms of the node's motion.

Adds: a force -α m v (``process.mass_damping``, 0 switches it off) and the weight
(``process.gravity``). Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2.
Stability limit: none, since the damping is averaged over the step.
"""

from __future__ import annotations

from lcmchain.jit import equation


@equation
def damped_velocity(velocity, acceleration, damping, interval):
    """Return v(n+½) from v(n-½), with the damping force at the mean of both."""
    half = 0.5 * damping * interval
    return ((1.0 - half) * velocity + interval * acceleration) / (1.0 + half)
