"""Orders of convergence from runs on finer and finer meshes, and what they leave to the limit.

Of a quantity f(h) = f0 + C h^p the differences between successive meshes tell p and the distance
from the limit f0, no run needs to be exact (Roache, "Perspective: a method for uniform reporting of
grid refinement studies", J. Fluids Eng. 116 (1994), with unequal ratios). Norms of differences of
fields are taken in place of differences of numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

#: Orders that are looked for; outside of them three meshes show no order.
LEAST_ORDER, MOST_ORDER = 0.2, 6.0


@dataclass(frozen=True)
class Convergence:
    """How a quantity depends on a size h: error(h) = factor h^order.

    Parameters
    ----------
    order : observed, not a number where the runs show none.
    factor : of the error.
    """

    order: float
    factor: float

    def error(self, size: float) -> float:
        """Return the expected distance from the limit at a size."""
        return self.factor * size**self.order

    def size(self, error: float) -> float:
        """Return the size at which the error is to be expected."""
        return float((error / self.factor) ** (1.0 / self.order))


NO_ORDER = Convergence(math.nan, math.nan)


def observed(sizes: tuple[float, float, float], steps: tuple[float, float]) -> Convergence:
    """Return the order from three sizes, the coarsest first, and the differences between them.

    Parameters
    ----------
    steps : sizes of the differences between the first and second, and second and third run.
    """
    h1, h2, h3 = sizes
    if not (min(steps) > 0.0 and np.isfinite(steps).all()):
        return NO_ORDER
    ratio = steps[0] / steps[1]

    def excess(p: float) -> float:
        return (h1**p - h2**p) / (h2**p - h3**p) - ratio

    if excess(LEAST_ORDER) * excess(MOST_ORDER) > 0.0:
        return NO_ORDER
    order = float(brentq(excess, LEAST_ORDER, MOST_ORDER))
    return with_order(order, (h2, h3), steps[1])


def with_order(order: float, sizes: tuple[float, float], step: float) -> Convergence:
    """Return the error law of a given order from the difference between two sizes."""
    coarse, fine = sizes
    return Convergence(order, step / (coarse**order - fine**order))


def progress(sizes: tuple[float, float, float], steps: tuple[float, float]) -> float:
    """Return by which factor the second difference is smaller than the first, at equal refinement.

    Arguments as for :func:`observed`. Both are taken per logarithm of the sizes; 1 means that finer
    meshes change the result by as much as coarse ones.
    """
    h1, h2, h3 = sizes
    first, second = steps[0] / math.log(h1 / h2), steps[1] / math.log(h2 / h3)
    return first / second
