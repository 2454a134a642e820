"""A flat disc of an incompressible membrane, clamped at its rim and inflated: shooting by scipy.

Independent of the program: a membrane of revolution by its meridian. With the stretches λ1 along
the meridian and λ2 = r/R around, the slope φ, the forces per length T1 = H w_1/λ2, T2 = H w_2/λ1 of
an energy w(λ1, λ2) and a pressure p(R) that follows,

    (w_1 R)' = w_2 cos φ,   (λ2 R)' = λ1 cos φ,   φ' = λ1 (p - T2 sin φ / r) / T1.

Source: Adkins and Rivlin, Phil. Trans. A 244 (1952) 505.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

LARGEST_STRETCH = 1.9


class Inflated(NamedTuple):
    """The solution: ``pole`` stretch; ``at(R)`` gives λ1, λ2, φ and the depth below the pole."""

    pole: float
    at: Callable[[np.ndarray], np.ndarray]
    height: float


def neo_hooke(shear):
    """Return w_1, w_2, w_11 and w_12 of µ/2 (λ1² + λ2² + 1/(λ1 λ2)² - 3)."""

    def slopes(a, b):
        i = 1.0 / (a * b) ** 2
        return (
            shear * (a - i / a),
            shear * (b - i / b),
            shear * (1.0 + 3.0 * i / a**2),
            2.0 * shear * i / (a * b),
        )

    return slopes


def inflated_disc(slopes, thickness, pressure, radius):
    """Return the branch with the smallest stretch.

    pressure : p(R) [Pa]. thickness, radius : [m].
    """

    def shot(pole):
        def rhs(R, y):
            l1, l2, phi, _ = y
            w1, w2, w11, w12 = slopes(l1, l2)
            T1, T2 = thickness * w1 / l2, thickness * w2 / l1
            d2 = (l1 * np.cos(phi) - l2) / R
            d1 = ((w2 * np.cos(phi) - w1) / R - w12 * d2) / w11
            turn = l1 * (pressure(R) - T2 * np.sin(phi) / (l2 * R)) / T1
            return [d1, d2, turn, -l1 * np.sin(phi)]

        near = 1e-6 * radius
        bend = pole**2 * pressure(0.0) / (2.0 * thickness * slopes(pole, pole)[0])
        return solve_ivp(
            rhs, (near, radius), [pole, pole, bend * near, 0.0],
            rtol=1e-9, atol=1e-12, max_step=radius / 100, dense_output=True,
        )  # fmt: skip

    def lacking(pole):
        return shot(pole).y[1, -1] - 1.0

    tried = np.linspace(1.01, LARGEST_STRETCH, 60)
    values = [lacking(pole) for pole in tried]
    i = next(i for i in range(59) if values[i] * values[i + 1] < 0.0)
    pole = brentq(lacking, tried[i], tried[i + 1], xtol=1e-10)
    found = shot(pole)
    return Inflated(pole, found.sol, -found.y[3, -1])
