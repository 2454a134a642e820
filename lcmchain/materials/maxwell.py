"""The Maxwell element: a spring and a dashpot in series, whose moment relaxes.

A moment T that a way a (an angle, a curvature) drives against a modulus G, and that falls to 1/e
within a length l of what passes by,

    dT = G da - T ds/l.

What passes by is time for a viscoelastic element, s = t. Where it is the way itself, s = |a|, the
element is Dahl's friction (:mod:`lcmchain.materials.dahl`). A step takes it on exactly if the way
is passed at a constant rate:

    T <- e T + G l (1 - e) Δa/Δs,  e = exp(-Δs/l),

a mean of the moment before and that of a steady way: no size of a step makes it grow.

Source: the exponential update, Simo and Hughes, "Computational Inelasticity", chapter 10.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lcmchain.jit import equation
from lcmchain.materials.elementary import exponential

# Steps of more relaxation times than this leave nothing of a moment.
MOST_TIMES = 600.0
# Below this part of a relaxation time (1 - exp(-x))/x is taken by its series.
SHORT = 1e-3


class Relaxation(NamedTuple):
    """A Maxwell element: its modulus [Pa] and relaxation time [s]."""

    modulus: float
    time: float


def moment_after(moment: Any, modulus: float, length: float, way: Any, passed: Any) -> Any:
    """Return the moment after a way during which a time (or a way) has passed, in NumPy."""
    x = np.asarray(passed, dtype=float) / length
    safe = np.where(x > 0.0, x, 1.0)
    mean = np.where(x > 0.0, -np.expm1(-safe) / safe, 1.0)
    return np.exp(-x) * moment + modulus * mean * way


@equation
def maxwell_moment(moment, modulus, time, turn, size):
    """Return the moment of a Maxwell element after a step that turns the fibres by Δγ."""
    x = size / time
    series = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x / 24.0))
    left = exponential(-min(x, MOST_TIMES))
    mean = series if x < SHORT else (1.0 - left) / x
    return left * moment + modulus * mean * turn
