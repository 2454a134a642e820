"""Bending of a strip under its own weight: heavy elastica, overhang and bending stiffness.

All quantities in SI units; the strip is inextensible and its shear deformation negligible. Its
moment over the curvature is a stiffness, or a curve by points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

#: Inclination of the plane that the strip has to touch in the cantilever test (ISO 9073-7).
CANTILEVER_ANGLE = math.radians(41.5)


@dataclass(frozen=True)
class Elastica:
    """Shape of a strip of unit length, clamped level at s = 0, bending down under its weight.

    Attributes
    ----------
    load_parameter : Λ = w L³ / D, weight per area w [N/m²], bending stiffness D [N m].
    x, y : horizontal reach and drop of points along the strip, shape [point_count].
    slope : angle below the horizontal [rad], shape [point_count].
    clamp_moment : M L / D at the clamp.
    """

    load_parameter: float
    x: np.ndarray
    y: np.ndarray
    slope: np.ndarray
    clamp_moment: float

    @property
    def chord_angle(self) -> float:
        """Angle of the line from clamp to tip below the horizontal [rad]."""
        return math.atan2(self.y[-1], self.x[-1])


def elastica_with_tip_slope(tip_slope: float, point_count: int = 201) -> Elastica:
    """Integrate the heavy elastica from its tip, where slope and (zero) moment are known.

    With τ = (w/D)^(1/3) times the distance from the tip, EI θ'' = -w (L - s) cos θ becomes
    θ'' = -τ cos θ with θ'(0) = 0, free of parameters. The clamp is where θ = 0, and Λ = τ³ there:
    one initial-value problem instead of a boundary-value problem.

    Raises
    ------
    ValueError : the tip slope [rad] is not between 0 and 90°.
    """
    if not 0.0 < tip_slope < 0.5 * np.pi:
        raise ValueError("the slope of the tip must lie between 0 and 90 deg")

    def slopes(tau, state):
        theta, turning, _, _ = state
        return turning, -tau * math.cos(theta), math.cos(theta), math.sin(theta)

    def level(_, state):
        return state[0]

    level.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        slopes, (0.0, 1e3), (tip_slope, 0.0, 0.0, 0.0), method="DOP853", events=level,
        dense_output=True, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    length = solution.t[-1]
    theta, _, x, y = solution.sol(length * np.linspace(1.0, 0.0, point_count))
    return Elastica(
        load_parameter=length**3,
        x=(x[0] - x) / length,
        y=(y[0] - y) / length,
        slope=theta,
        clamp_moment=-solution.y[1, -1] * length,
    )


def elastica(load_parameter: float, point_count: int = 201) -> Elastica:
    """Return the heavy elastica of a load parameter Λ = w L³ / D.

    Raises
    ------
    ValueError : Λ is not between 1e-4 and 300.
    """
    if not 1e-4 <= load_parameter <= 300.0:
        raise ValueError("the load parameter must lie between 1e-4 and 300")
    return elastica_with_tip_slope(
        _tip_slope(lambda shape: math.log(shape.load_parameter / load_parameter)), point_count
    )


@lru_cache(maxsize=256)
def load_parameter_at_chord_angle(angle: float) -> float:
    """Return Λ of the strip whose tip is seen from the clamp at this angle [rad] (0.1° to 85°).

    At 41.5°, Λ = 8.0042: the bending length (D/w)^(1/3) is half the overhang to 0.02 %.

    Raises
    ------
    ValueError : the angle lies outside.
    """
    if not math.radians(0.1) <= angle <= math.radians(85.0):
        raise ValueError("the chord angle must lie between 0.1 deg and 85 deg")
    slope = _tip_slope(lambda shape: shape.chord_angle - angle)
    return elastica_with_tip_slope(slope, 2).load_parameter


def _tip_slope(mismatch) -> float:
    """Find the tip slope of the elastica for which a growing mismatch vanishes."""

    # 90 deg is reached exponentially with the length: search in its logarithm.
    def slope(q):
        return -0.5 * np.pi * math.expm1(-q)

    root = brentq(lambda q: mismatch(elastica_with_tip_slope(slope(q), 2)), 1e-6, 20.0, xtol=1e-13)
    return slope(root)


def bending_stiffness_from_overhang(
    overhang: ArrayLike, areal_weight: float, angle: ArrayLike = CANTILEVER_ANGLE
) -> np.ndarray:
    """Return the bending stiffness per width D = w L³ / Λ [N m] of a cantilever test.

    Parameters
    ----------
    overhang : free length along the strip [m].
    areal_weight : weight per area w [N/m²].
    angle : chord angle at that overhang [rad].
    """
    factor = np.vectorize(load_parameter_at_chord_angle, otypes=[float])(angle)
    return areal_weight * np.asarray(overhang) ** 3 / factor


def overhang_at_angle(
    bending_stiffness: ArrayLike, areal_weight: float, angle: ArrayLike = CANTILEVER_ANGLE
) -> np.ndarray:
    """Return the overhang [m] at which the tip is seen at this chord angle [rad]."""
    factor = np.vectorize(load_parameter_at_chord_angle, otypes=[float])(angle)
    return np.cbrt(factor * np.asarray(bending_stiffness) / areal_weight)


def strip_stiffness(
    C11: float, C22: float, C12: float, orientation: ArrayLike, assumption: str
) -> np.ndarray:
    """Return the stiffness [Pa] against bending along a strip cut at an angle to fibre 1.

    The bending stiffness per width is this times t³/12. C12 acts on the engineering twist, as
    C^B of Eq. (25) does.

    Parameters
    ----------
    C11, C22, C12 : entries of C^B [Pa].
    orientation : angle from fibre direction 1 to the strip [rad].
    assumption : ``"free-strip"``: a narrow strip, free to twist and to curve across (no moments
        but the bending moment); ``"cylindrical"``: a wide one, held to curve along only.
    """
    c2, s2 = np.cos(orientation) ** 2, np.sin(orientation) ** 2
    if assumption == "cylindrical":
        return c2**2 * C11 + s2**2 * C22 + 4.0 * s2 * c2 * C12
    if assumption == "free-strip":
        return 1.0 / (c2**2 / C11 + s2**2 / C22 + s2 * c2 / C12)
    raise ValueError(f'"{assumption}" must be free-strip or cylindrical')


# --- curves of moments ----------------------------------------------------------------------------


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
    """Return the shape with a slope of the tip [rad]; Λ and M L/D with the slope at the start.

    It is integrated from the tip: with the distance σ from there θ' = -κ(M) and M' = w σ cos θ,
    until the strip is level.
    """

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
