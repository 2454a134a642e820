"""Two elements of a moment that a way drives: Maxwell's, which relaxes, and Dahl's, which rubs.

**Maxwell element**, a spring and a dashpot in series. A way a (an angle, a curvature) drives its
moment T against a modulus G; the moment falls to 1/e within a length l of what passes by,

    dT = G da - T ds/l.

For a viscoelastic element it is time that passes by, s = t. If the way is passed at a constant
rate, the exact step is

    T <- e T + G l (1 - e) Δa/Δs,  e = exp(-Δs/l),

a mean of the moment before and that of a steady way: no size of a step makes it grow.

**Dahl's friction** is the Maxwell element for which the way itself passes by, s = |a|. Along a way
in the sense s = sign Δa its moment comes to a limit T_y within a length l,

    dT/da = (T_y - s T)/l = G (1 - s T/T_y),   G = T_y/l.

No rate is in it, and a step of any size is exact. The element stores T²/(2 G). What a step that
does not turn round loses is the work of the exact course less what is stored more,

    T_y |Δa| - s l ΔT - Δ(T²)/(2 G),

that is T²/T_y |da| along the way, never negative. A loop between ±A loses 4 T_y A - 4 T_y l
tanh(A/l): that of dry friction less what the presliding gives back.

Sources: the exponential update, Simo and Hughes, "Computational Inelasticity", chapter 10. Dahl, "A
solid friction model" (1968), with the exponent 1. For the bending of textile preforms: Ghafour,
Colmars, Boisse, Frontiers in Materials 8 (2021), doi 10.3389/fmats.2021.728485; for cloth: Miguel
et al., ACM Transactions on Graphics 32 (2013).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.jit import equation
from lcmchain.materials.features.elementary import exponential

# Steps of more relaxation times than this leave nothing of a moment.
MOST_TIMES = 600.0
# Below this part of a relaxation time (1 - exp(-x))/x is taken by its series.
SHORT = 1e-3
# Divisor in place of a modulus of 0, of what has no friction: its moment is 0.
LEAST_MODULUS = 1e-300


#: One number, or an array; those of one call broadcast.
Values = float | np.ndarray


class Relaxation(NamedTuple):
    """A Maxwell element: its modulus [Pa] and relaxation time [s]."""

    modulus: float
    time: float


def moment_after(
    moment: Values, modulus: float, length: float, way: Values, passed: ArrayLike
) -> Values:
    """Return the moment after a way during which a time (or a way) has passed, in NumPy."""
    x = np.asarray(passed, dtype=float) / length
    safe = np.where(x > 0.0, x, 1.0)
    mean = np.where(x > 0.0, -np.expm1(-safe) / safe, 1.0)
    return np.exp(-x) * moment + modulus * mean * way


class Friction(NamedTuple):
    """Friction after Dahl: the limit of its moment, and the length of way in which it comes up."""

    limit: float
    length: float

    @property
    def modulus(self) -> float:
        """Stiffness G at rest; twice that where the way turns round at the limit."""
        return self.limit / self.length

    def after(self, moment: Values, way: Values) -> Values:
        """Return the moment after a way, in NumPy."""
        return moment_after(moment, self.modulus, self.length, way, np.abs(way))

    def lost(self, before: Values, after: Values, way: Values) -> Values:
        """Return the energy lost over a way between two moments."""
        stored = (after**2 - before**2) / (2.0 * self.modulus)
        return self.limit * np.abs(way) - self.length * np.sign(way) * (after - before) - stored

    def loop_loss(self, amplitude: float) -> float:
        """Return the energy lost in a steady loop between two ways ± an amplitude."""
        gives_back = self.length * math.tanh(amplitude / self.length)
        return 4.0 * self.limit * (amplitude - gives_back)


# --- compiled -------------------------------------------------------------------------------------


@equation
def maxwell_moment(moment, modulus, time, turn, size):
    """Return the moment of a Maxwell element after a step that turns the fibres by Δγ."""
    x = size / time
    series = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x / 24.0))
    left = exponential(-min(x, MOST_TIMES))
    mean = series if x < SHORT else (1.0 - left) / x
    return left * moment + modulus * mean * turn


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
