"""Bending stiffness from the shape of a strip that bends under its own weight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import elastica_with_tip_slope

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
    own = np.append(0.0, np.cumsum(step)) / np.sum(step)
    share = along / along[-1]
    ideal = _PiecewiseCurvature(
        np.interp(share, own, curve[0]), np.interp(share, own, curve[1]), count
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
            return np.append(signed_distance(np.stack([x, y]), curve), beyond) / scale

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
        distance = signed_distance(np.stack([x, y]), curve)
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


def signed_distance(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
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
