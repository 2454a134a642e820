"""Bending stiffness from the shape of a strip that bends under its own weight."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import elastica_with_tip_slope


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
        distance = _signed_distance(np.stack([x, y]), curve)
        along = np.array([np.cos(solved.slope[-1]), np.sin(solved.slope[-1])])
        return np.append(distance, along @ (np.array([x[-1], y[-1]]) - curve[:, -1])) / scale

    scale = math.hypot(x[-1], y[-1])
    length = np.sum(np.hypot(np.diff(x, prepend=0.0), np.diff(y, prepend=0.0)))
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


def _signed_distance(points, curve) -> np.ndarray:
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
