"""Heavy strip whose moment over curvature is a curve by points: the inextensible elastica.

It is integrated from its tip, as in :mod:`~lcmchain.coupons.analytic.strip_bending`: with the
distance σ from there θ' = -κ(M) and M' = w σ cos θ, until the strip is level. All quantities in SI
units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lcmchain.coupons.analytic.strip_bending import Elastica

# Slopes of the tip among which shapes are looked for [rad].
SLOPES = (1e-4, 0.5 * math.pi - 1e-4)


class MomentCurve(NamedTuple):
    """Points of a curve from zero: curvature [1/m] and moment per width [N], both increasing."""

    curvature: ArrayLike
    moment: ArrayLike

    @property
    def start_slope(self) -> float:
        """Bending stiffness per width at the start [N m]."""
        return float(np.asarray(self.moment)[0] / np.asarray(self.curvature)[0])

    def curvature_at(self, moment: float) -> float:
        """Return the curvature under a moment that is not negative; the last slope goes on."""
        k, M = np.append(0.0, self.curvature), np.append(0.0, self.moment)
        beyond = max(moment - M[-1], 0.0) * (k[-1] - k[-2]) / (M[-1] - M[-2])
        return float(np.interp(moment, M, k)) + beyond


def curve_elastica(curve: MomentCurve, areal_weight: float, overhang: float) -> Elastica:
    """Return the shape of a strip of a length [m] under its weight per area [N/m²].

    Raises
    ------
    ValueError : the strip would hang down straight.
    """
    low, high = (_overhang(curve, areal_weight, slope) for slope in SLOPES)
    if not low < overhang < high:
        raise ValueError(f"a strip of {overhang:g} m falls by less than 0.01 or more than 89.9 deg")
    slope = brentq(lambda s: _overhang(curve, areal_weight, s) - overhang, *SLOPES, xtol=1e-10)
    return curve_elastica_with_tip_slope(curve, areal_weight, slope)


def overhang_by_curve(curve: MomentCurve, areal_weight: float, angle: float) -> float:
    """Return the length [m] at which the line from clamp to tip falls by an angle [rad]."""
    slope = brentq(
        lambda s: curve_elastica_with_tip_slope(curve, areal_weight, s).chord_angle - angle,
        *SLOPES,
        xtol=1e-10,
    )
    return _overhang(curve, areal_weight, slope)


def _overhang(curve: MomentCurve, areal_weight: float, tip_slope: float) -> float:
    shape = curve_elastica_with_tip_slope(curve, areal_weight, tip_slope)
    return float((shape.load_parameter * curve.start_slope / areal_weight) ** (1.0 / 3.0))


def curve_elastica_with_tip_slope(
    curve: MomentCurve, areal_weight: float, tip_slope: float, point_count: int = 201
) -> Elastica:
    """Return the shape with a slope of the tip [rad]; Λ and M L/D with the slope at the start."""

    def rates(distance, state):
        theta, moment, _, _ = state
        turning = curve.curvature_at(moment)
        return -turning, areal_weight * distance * math.cos(theta), math.cos(theta), math.sin(theta)

    def level(_, state):
        return state[0]

    level.terminal = True  # type: ignore[attr-defined]
    longest = 20.0 * (curve.start_slope / areal_weight) ** (1.0 / 3.0)
    solution = solve_ivp(
        rates, (0.0, longest), (tip_slope, 0.0, 0.0, 0.0), events=level, dense_output=True,
        rtol=1e-9, atol=1e-12, max_step=longest / 400.0,
    )  # fmt: skip
    length = solution.t[-1]
    theta, _, x, y = solution.sol(length * np.linspace(1.0, 0.0, point_count))
    stiffness = curve.start_slope
    return Elastica(
        load_parameter=areal_weight * length**3 / stiffness,
        x=(x[0] - x) / length,
        y=(y[0] - y) / length,
        slope=theta,
        clamp_moment=float(solution.y[1, -1]) * length / stiffness,
    )
