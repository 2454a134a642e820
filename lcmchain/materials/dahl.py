"""Dahl's friction: a moment that a way drives to a limit, and that a way back takes down again.

Along a way a (an angle, a curvature) in the sense s = sign Δa the moment T comes to its limit T_y,

    dT/da = (T_y - s T)/l = G (1 - s T/T_y),   G = T_y/l,

within a length l. It is a Maxwell element for which the way itself passes by
(:mod:`lcmchain.materials.maxwell`): no rate is in it, and a step of any size is exact. The element
stores T²/(2 G). What is lost in a step that does not turn round is the work of the exact course
less what is stored more,

    T_y |Δa| - s l ΔT - Δ(T²)/(2 G),   that is T²/T_y |da| of each piece: never less than nothing.

A loop between ±A loses 4 T_y A - 4 T_y l tanh(A/l): that of dry friction less what the presliding
gives back.

Source: Dahl, "A solid friction model" (1968), with the exponent 1. For the bending of textile
preforms: Ghafour, Colmars, Boisse, Frontiers in Materials 8 (2021), doi 10.3389/fmats.2021.728485;
for cloth: Miguel et al., ACM Transactions on Graphics 32 (2013).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lcmchain.jit import equation
from lcmchain.materials.maxwell import maxwell_moment, moment_after

# Divisor in place of a modulus of 0, of what has no friction: its moment is 0.
LEAST_MODULUS = 1e-300


class Friction(NamedTuple):
    """Friction after Dahl: the limit of its moment, and the length of way in which it comes up."""

    limit: float
    length: float

    @property
    def modulus(self) -> float:
        """Stiffness G at rest; twice that where the way turns round at the limit."""
        return self.limit / self.length

    def after(self, moment: Any, way: Any) -> Any:
        """Return the moment after a way, in NumPy."""
        return moment_after(moment, self.modulus, self.length, way, np.abs(way))

    def lost(self, before: Any, after: Any, way: Any) -> Any:
        """Return the energy lost over a way between two moments."""
        stored = (after**2 - before**2) / (2.0 * self.modulus)
        return self.limit * np.abs(way) - self.length * np.sign(way) * (after - before) - stored

    def loop_loss(self, amplitude: float) -> float:
        """Return the energy lost in a steady loop between two ways ± an amplitude."""
        gives_back = self.length * math.tanh(amplitude / self.length)
        return 4.0 * self.limit * (amplitude - gives_back)


@equation
def dahl_moment(moment, modulus, length, way):
    """Return the moment of friction after a way."""
    return maxwell_moment(moment, modulus, length, way, abs(way))


@equation
def dahl_loss(before, after, modulus, length, way):
    """Return the energy lost over a way between two moments."""
    more = after - before if way >= 0.0 else before - after
    stored = (after * after - before * before) / (2.0 * max(modulus, LEAST_MODULUS))
    return length * (modulus * abs(way) - more) - stored
