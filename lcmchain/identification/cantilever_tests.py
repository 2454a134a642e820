"""Cantilever tests under own weight in the forms in which they are measured, brought to one.

A test tells an overhang, a length and a chord angle, or the shape of the strip. A shape gives the
bending stiffness of the strip by the elastica that fits it, and shows whether the strip has one
stiffness: the ratio of moment and curvature from place to place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import elastica_with_tip_slope, overhang_at_angle
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.quantities.units import ANGLE, LENGTH

# --- the shape of a strip -------------------------------------------------------------------------


# Pieces of a strip along which its curvature is linear, and points that each needs.
_MOST_PIECES, _POINTS_PER_PIECE = 6, 6
# A place whose curvature is known no better than this tells no stiffness.
_KNOWN = 0.3
# Stiffnesses that differ from that of the whole strip by more than this factor matter, and by more
# than this many standard errors are no scatter.
_SAME_STIFFNESS, _STANDARD_ERRORS = 1.25, 4.0


@dataclass(frozen=True)
class StripStiffness:
    """Ratio of moment and curvature at places along a strip, from the clamp towards the tip.

    Attributes
    ----------
    stiffness : M / kappa [N m], not-a-number where the curvature is not known, shape [place_count].
    error : its relative standard error, shape [place_count].
    curvature : [1/m], shape [place_count].
    arc : arc length of the places from the clamp [m], shape [place_count].
    differs : whether the strip is there softer or stiffer than its one stiffness by more than
        scatter, and by an amount that matters, shape [place_count].
    """

    stiffness: np.ndarray
    error: np.ndarray
    curvature: np.ndarray
    arc: np.ndarray
    differs: np.ndarray

    @property
    def one_stiffness(self) -> bool:
        """Whether one stiffness describes the strip."""
        return not bool(self.differs.any())

    def span(self) -> tuple[float, float]:
        """Return the least and the largest stiffness [N m] that the strip shows."""
        known = self.stiffness[np.isfinite(self.stiffness)]
        return (float(known.min()), float(known.max())) if len(known) else (0.0, math.inf)


def stiffness_along_strip(
    x: np.ndarray, y: np.ndarray, stiffness: float, curve: tuple[np.ndarray, np.ndarray]
) -> StripStiffness:
    """Return the bending stiffness along a strip, and whether it is one.

    A curve of piecewise linear curvature, none at the tip, is fitted to the points, and in the same
    way to the elastica at the same places, whose stiffness is known: what the pieces round off,
    they round off in both.

    Parameters
    ----------
    x, y : reach and drop from the clamp [m], the last point the tip, shape [point_count].
    stiffness : of the fitted elastica [N m].
    curve : x and y of the fitted elastica [m], each of shape [any].
    """
    count = int(np.clip(len(x) // _POINTS_PER_PIECE, 2, _MOST_PIECES))
    measured = _PiecewiseCurvature(x, y, count)
    along = np.cumsum(np.hypot(np.diff(x, prepend=0.0), np.diff(y, prepend=0.0)))
    step = np.hypot(*np.diff(curve, axis=1))
    share_of_curve = np.append(0.0, np.cumsum(step)) / np.sum(step)
    share = along / along[-1]
    ideal = _PiecewiseCurvature(
        np.interp(share, share_of_curve, curve[0]),
        np.interp(share, share_of_curve, curve[1]),
        count,
    )
    ratio = (measured.moment / measured.curvature) / (ideal.moment / ideal.curvature)
    error = measured.error / np.maximum(np.abs(measured.curvature), 1e-300)
    # Against the curvature that one stiffness asks for, so that a part that hardly bends counts.
    asked = ideal.curvature * measured.moment / ideal.moment
    apart = np.abs(measured.curvature - asked) > _STANDARD_ERRORS * measured.error
    low, high = asked / _SAME_STIFFNESS, asked * _SAME_STIFFNESS
    matters = (measured.curvature < low) | (measured.curvature > high)
    differs = apart & matters
    known = ((error < _KNOWN) | differs) & (measured.curvature > 0.0)
    found = np.where(known, stiffness * ratio, np.nan)
    return StripStiffness(found, error, measured.curvature, measured.arc, differs)


class _PiecewiseCurvature:
    """Curve from a horizontal clamp to a free tip, curvature linear in each of equal pieces.

    Where the pieces begin, at ``arc`` [m]: ``curvature`` and its standard ``error`` [1/m], and
    ``moment``, the first moment of the length beyond [m²], which times the weight per area is the
    bending moment per width; each of shape [piece_count].
    """

    def __init__(self, x: np.ndarray, y: np.ndarray, count: int):
        length = length_of_line(x, y)
        scale = math.hypot(x[-1], y[-1])
        per_piece = 40
        middles = (np.arange(count * per_piece) + 0.5) / per_piece

        def shape(theta):
            step = length * theta[-1] / (count * per_piece)
            bend = np.interp(middles, np.arange(count + 1), np.append(theta[:-1], 0.0))
            slope = np.append(0.0, np.cumsum(bend) / (count * per_piece))
            middle = 0.5 * (slope[1:] + slope[:-1])
            steps = step * np.stack([np.cos(middle), np.sin(middle)])
            return np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1), slope

        def residuals(theta):
            curve, slope = shape(theta)
            end = np.array([np.cos(slope[-1]), np.sin(slope[-1])])
            beyond = end @ (np.array([x[-1], y[-1]]) - curve[:, -1])
            return np.append(distance_below(np.stack([x, y]), curve), beyond) / scale

        turn = min(2.0 * math.atan2(y[-1], x[-1]), 1.5)
        start = np.append(np.full(count, turn), 1.0)
        solution = least_squares(residuals, start, xtol=1e-10, ftol=1e-10, gtol=1e-10)
        curve, _ = shape(solution.x)
        length *= solution.x[-1]
        freedom = max(np.count_nonzero(np.hypot(x, y) > 0.0) + 1 - len(solution.x), 1)
        covariance = 2.0 * solution.cost / freedom * np.linalg.pinv(solution.jac.T @ solution.jac)
        self.curvature = solution.x[:-1] / length
        self.error = np.sqrt(np.diag(covariance)[:-1]) / length
        self.arc = np.linspace(0.0, length, count + 1)[:-1]
        step = length / (count * per_piece)
        middle_x = 0.5 * (curve[0, 1:] + curve[0, :-1])
        beyond = np.cumsum(middle_x[::-1])[::-1] * step  # of x over the length beyond
        left = step * np.arange(count * per_piece, 0, -1)
        moment = beyond - left * curve[0, :-1]
        self.moment = moment.reshape(count, per_piece)[:, 0]


def fit_deflection_curve(
    x: np.ndarray, y: np.ndarray, areal_weight: float
) -> tuple[float, float, tuple[np.ndarray, np.ndarray]]:
    """Fit the heavy elastica to points of a deflection curve whose last point is the tip.

    The distance of the points from the curve is least (total least squares: x and y carry
    errors alike); the tip also counts along the curve, which fixes the length.

    Parameters
    ----------
    x, y : reach and drop from the clamp [m], shape [point_count].
    areal_weight : weight per area [N/m²].

    Returns
    -------
    stiffness : bending stiffness per width [N m].
    relative_error : its relative standard error.
    curve : x and y of the fitted shape [m].
    """

    def shape(theta):
        slope = -0.5 * np.pi * np.expm1(-np.exp(theta[0]))
        solved = elastica_with_tip_slope(float(slope), 401)
        return solved, np.exp(theta[1]) * np.stack([solved.x, solved.y])

    def residuals(theta):
        solved, curve = shape(theta)
        distance = distance_below(np.stack([x, y]), curve)
        along = np.array([np.cos(solved.slope[-1]), np.sin(solved.slope[-1])])
        return np.append(distance, along @ (np.array([x[-1], y[-1]]) - curve[:, -1])) / scale

    scale = math.hypot(x[-1], y[-1])
    length = length_of_line(x, y)
    # Small-deflection start: the tip slope is 4/3 of the chord angle.
    slope = min(4.0 / 3.0 * math.atan2(y[-1], x[-1]), 1.45)
    start = [math.log(-math.log1p(-slope / (0.5 * np.pi))), math.log(length)]
    solution = least_squares(residuals, start, jac="3-point", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    q, ln_length = solution.x

    def ln_load(q):
        return math.log(shape((q, 0.0))[0].load_parameter)

    step = 1e-4
    gradient = np.array([-(ln_load(q + step) - ln_load(q - step)) / (2.0 * step), 3.0])
    # Every point but the clamp carries an error, the tip two; two parameters are fitted.
    error_count = np.count_nonzero(np.hypot(x, y) > 0.0) + 1
    variance = 2.0 * solution.cost / max(error_count - 2, 1)
    covariance = variance * np.linalg.inv(solution.jac.T @ solution.jac)
    stiffness = areal_weight * math.exp(3.0 * ln_length - ln_load(q))
    return stiffness, math.sqrt(gradient @ covariance @ gradient), tuple(shape(solution.x)[1])


def length_of_line(x: np.ndarray, y: np.ndarray) -> float:
    """Return the length [m] of the line from the clamp through points (n,)."""
    return float(np.sum(np.hypot(np.diff(x, prepend=0.0), np.diff(y, prepend=0.0))))


def distance_below(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Distance of points from a polyline, positive below it; shapes [2, n] and [2, m]."""
    start, step = curve[:, :-1], np.diff(curve, axis=1)
    to_point = points[:, :, None] - start[:, None, :]
    along = np.einsum("kns,ks->ns", to_point, step) / np.sum(step**2, axis=0)
    foot = np.clip(along, 0.0, 1.0)
    foot[:, -1] = np.maximum(along[:, -1], 0.0)  # past the tip the tangent goes on
    offset = to_point - foot * step[:, None, :]
    nearest = np.argmin(np.sum(offset**2, axis=0), axis=1)
    rows = np.arange(points.shape[1])
    normal = step[:, nearest] / np.linalg.norm(step[:, nearest], axis=0)
    return normal[0] * offset[1, rows, nearest] - normal[1] * offset[0, rows, nearest]


# --- tests ----------------------------------------------------------------------------------------


_ORIENTATION = Column("orientation", ANGLE)
COLUMNS = (
    (_ORIENTATION, Column("overhang", LENGTH)),
    (_ORIENTATION, Column("length", LENGTH), Column("angle", ANGLE)),
    (_ORIENTATION, Column("x", LENGTH, loading=1), Column("y", LENGTH)),
)
_FEWEST_CURVE_POINTS = 5
# Strips within this angle of a fibre direction are taken as cut along it.
ALONG_FIBRE = math.radians(2.0)


@dataclass(frozen=True)
class Cantilever:
    """Cantilever tests brought to one form: overhang and the chord angle reached.

    Attributes
    ----------
    orientation : from fibre 1 to the strip, folded to 0 ... 90° [rad], shape [test_count].
    overhang : [m], shape [test_count].
    angle : chord angle at that overhang [rad], shape [test_count].
    error : relative standard error of the overhang where a deflection curve tells it, else nan.
    curves : (x, y, fitted x, fitted y, orientation) of each deflection curve [m].
    along : stiffness along the strip of each deflection curve; empty without curves.
    lines : first line of each test in the file, shape [test_count].
    """

    orientation: np.ndarray
    overhang: np.ndarray
    angle: np.ndarray
    error: np.ndarray
    lines: np.ndarray
    curves: tuple = ()
    along: tuple[StripStiffness, ...] = ()


def cantilever_tests(data: CouponData, areal_weight: float, angle: float) -> Cantilever:
    """Bring overhangs, length-angle pairs or deflection curves to one form."""
    orientation = np.abs(data["orientation"]) % np.pi
    orientation = np.minimum(orientation, np.pi - orientation)
    if "overhang" in data:
        _require_positive(data, "overhang")
        unknown = np.full(len(orientation), np.nan)
        angles = np.full(len(orientation), angle)
        return Cantilever(orientation, data["overhang"], angles, unknown, data.lines)
    if "length" in data:
        _require_positive(data, "length")
        low, high = math.radians(1.0), math.radians(85.0)
        outside = np.flatnonzero((data["angle"] < low) | (data["angle"] > high))
        if len(outside):
            raise data.wrong("angle", outside[0], "must lie between 1 deg and 85 deg")
        unknown = np.full(len(orientation), np.nan)
        return Cantilever(orientation, data["length"], data["angle"], unknown, data.lines)
    return _tests_from_curves(data, orientation, areal_weight, angle)


def _tests_from_curves(data, orientation, areal_weight, angle) -> Cantilever:
    keys = np.round(np.degrees(orientation), 3) * 1e6 + data.specimen
    kept, overhang, error, lines, curves, along = [], [], [], [], [], []
    for key in np.unique(keys):
        rows = np.flatnonzero(keys == key)
        if len(rows) < _FEWEST_CURVE_POINTS:
            raise data.wrong(
                "x", rows[0], f"a deflection curve needs at least {_FEWEST_CURVE_POINTS} points"
            )
        x, y = data["x"][rows], data["y"][rows]
        drop = y if y[-1] > 0.0 else -y  # heights may be counted upwards
        if drop[-1] <= 0.0 or x[-1] <= 0.0:
            raise data.wrong("y", rows[-1], "the tip must lie below and in front of the clamp")
        stiffness, relative_error, fitted = fit_deflection_curve(x, drop, areal_weight)
        kept.append(orientation[rows[0]])
        overhang.append(float(overhang_at_angle(stiffness, areal_weight, angle)))
        error.append(relative_error / 3.0)  # the overhang goes with the cube root
        lines.append(data.lines[rows[0]])
        curves.append((x, drop, *fitted, orientation[rows[0]]))
        along.append(stiffness_along_strip(x, drop, stiffness, fitted))
    return Cantilever(
        np.array(kept), np.array(overhang), np.full(len(kept), angle), np.array(error),
        np.array(lines), tuple(curves), tuple(along),
    )  # fmt: skip


def _require_positive(data: CouponData, column: str) -> None:
    wrong = np.flatnonzero(data[column] <= 0.0)
    if len(wrong):
        raise data.wrong(column, wrong[0], "must be positive")


class StripsByFibre(NamedTuple):
    """Which tests are of strips along a fibre; masks (test_count,)."""

    along_1: np.ndarray
    along_2: np.ndarray
    orientation: np.ndarray  # (test_count,) [rad], those along a fibre exactly

    @property
    def between(self) -> np.ndarray:
        return ~(self.along_1 | self.along_2)


def strips_of(tests: Cantilever, file: str) -> StripsByFibre:
    """Sort the tests by their strips; InputError without a strip along either fibre."""
    along_1 = tests.orientation <= ALONG_FIBRE
    along_2 = tests.orientation >= 0.5 * np.pi - ALONG_FIBRE
    for found, degrees in ((along_1, 0), (along_2, 90)):
        if not found.any():
            raise InputError(
                f"has no strip with an orientation of {degrees} deg; both fibre directions are "
                "needed",
                file=file,
            )
    orientation = np.where(along_1, 0.0, np.where(along_2, 0.5 * np.pi, tests.orientation))
    return StripsByFibre(along_1, along_2, orientation)
