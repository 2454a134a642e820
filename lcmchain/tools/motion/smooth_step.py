"""Smooth way from rest to rest, for strokes and for loads that come on."""

from __future__ import annotations

from lcmchain.jit import equation


@equation
def smooth_step(s):
    """Quintic smoothstep 10 s^3 - 15 s^4 + 6 s^5 and its derivative, 0 <= s <= 1.

    Velocity and acceleration vanish at both ends, so that a stroke starts and stops without a jerk.
    """
    value = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    slope = 30.0 * s * s * (1.0 - s) * (1.0 - s)
    return value, slope
