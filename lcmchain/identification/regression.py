"""Weighted least squares with intervals, for measurements whose error is relative.

Noise model: the error of a measurement y is normal with a standard deviation proportional to
max(|model|, floor * largest |y|), the factor being unknown. Weights follow the fitted model
(iteratively reweighted), not the data, which would bias the fit towards values measured too small.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import f as fisher
from scipy.stats import t as student

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Fit:
    """A weighted least-squares fit.

    Attributes
    ----------
    parameters : shape [parameter_count].
    model : fitted values, shape [point_count].
    residuals : (data - model) / noise_scale, shape [point_count]; the estimate of the relative
        noise is their root mean square over the degrees of freedom, ``scale``.
    noise_scale : what a relative error of 1 amounts to, shape [point_count].
    jacobian : of model / noise_scale, shape [point_count, parameter_count].
    constrained : True if a constraint holds the parameters.
    blocks : number of the block of each row, shape [point_count], where the residuals within a
        block err together instead of scattering (a law that misses its data); None for noise.
    """

    parameters: np.ndarray
    model: np.ndarray
    residuals: np.ndarray
    noise_scale: np.ndarray
    jacobian: np.ndarray
    constrained: bool = False
    blocks: np.ndarray | None = None

    @property
    def degrees_of_freedom(self) -> int:
        return len(self.residuals) - len(self.parameters)

    @property
    def scale(self) -> float:
        """Estimated relative noise; not-a-number without degrees of freedom."""
        return _noise(self.residuals, self.degrees_of_freedom)

    @property
    def condition(self) -> float:
        """Condition number of the Jacobian with columns scaled to unit length."""
        scaled, _ = _unit_columns(self.jacobian)
        return float(np.linalg.cond(scaled))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the parameters, shape [parameter_count, parameter_count].

        With ``blocks`` the residuals of a block add up as they are (cluster-robust covariance,
        Liang and Zeger 1986): a misfit that many rows share is counted once, not averaged away.
        It is never less than that of independent errors.
        """
        scaled, lengths = _unit_columns(self.jacobian)
        inverse = np.linalg.pinv(scaled) / lengths[:, None]
        independent = self.scale**2 * (inverse @ inverse.T)
        if self.blocks is None:
            return independent
        count = int(self.blocks.max()) + 1
        per_block = np.zeros((count, len(self.parameters)))
        np.add.at(per_block, self.blocks, (inverse * self.residuals).T)
        return independent + count / (count - 1) * (per_block.T @ per_block)

    @property
    def student(self) -> float:
        """Two-sided 95 % quantile that belongs to the covariance; not-a-number without freedom."""
        if self.blocks is None:
            return student_factor(self.degrees_of_freedom)
        return student_factor(min(self.degrees_of_freedom, int(self.blocks.max())))

    @property
    def standard_errors(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self) -> np.ndarray:
        """Half the widths of the 95 % confidence intervals (Student's t)."""
        return self.student * self.standard_errors

    def correlation(self) -> np.ndarray:
        """Correlation matrix of the parameters."""
        error = self.standard_errors
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.covariance / np.outer(error, error)


def exponential(logarithm: float) -> float:
    """Return e to a power, infinite beyond the largest number."""
    return math.inf if logarithm > 709.0 else math.exp(logarithm)  # not-a-number stays so


def student_factor(degrees_of_freedom: int) -> float:
    """Return the two-sided 95 % quantile of Student's t; not-a-number without freedom."""
    if degrees_of_freedom < 1:
        return np.nan
    return float(student.ppf(0.5 + 0.5 * CONFIDENCE, degrees_of_freedom))


def noise_scale(model: np.ndarray, data: np.ndarray, floor: float) -> np.ndarray:
    """Return the standard deviation, up to a common factor, of each measurement."""
    return np.maximum(np.abs(model), floor * np.max(np.abs(data)))


def coefficient_of_determination(data: np.ndarray, model: np.ndarray) -> float:
    """Return R² = 1 - Σ(y - model)² / Σ(y - mean)² of the unweighted data."""
    spread = np.sum((data - data.mean()) ** 2)
    return float(1.0 - np.sum((data - model) ** 2) / spread) if spread > 0.0 else np.nan


def is_better_by_more_than_chance(
    before: float, left: float, count: int, free: int, chance: float
) -> bool:
    """Whether a law with more parameters describes the data better than scatter would let it.

    Parameters
    ----------
    before, left : sums of squares of the law with less and with more.
    count : of the parameters that it has more. free : degrees of freedom that are left.
    chance : of a wrong yes for data with normal errors (F test).
    """
    if free < 1 or count < 1 or left >= before:
        return False
    return bool(fisher.sf((before - left) / count / (left / free), count, free) < chance)


def residual_autocorrelation(residuals: np.ndarray, group: np.ndarray) -> float:
    """Return the lag-1 autocorrelation of residuals, taken within each group of rows."""
    within = group[1:] == group[:-1]
    product = np.sum(residuals[1:][within] * residuals[:-1][within])
    total = np.sum(residuals**2)
    return float(product / total) if total > 0.0 else 0.0


def fit_linear(
    design: np.ndarray,
    data: np.ndarray,
    floor: float,
    *,
    at_least: tuple[np.ndarray, np.ndarray] | None = None,
    scale_of: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Fit:
    """Fit data = design @ parameters, optionally with bounds G @ parameters >= h.

    Parameters
    ----------
    design : shape [point_count, parameter_count].
    data : shape [point_count].
    floor : smallest noise relative to the largest measurement.
    at_least : (G, h), shapes [bound_count, parameter_count] and [bound_count].
    scale_of : noise scale for given parameters, where it is not :func:`noise_scale` of the model.
    """
    if scale_of is None:

        def scale_of(parameters):
            return noise_scale(design @ parameters, data, floor)

    # Start from the scale of the data; the passes end when the weights repeat themselves.
    scale, constrained = noise_scale(data, data, floor), False
    for _ in range(50):
        weighted = design / scale[:, None]
        parameters = _solve(weighted, data / scale)
        constrained = at_least is not None and bool(np.any(at_least[0] @ parameters < at_least[1]))
        if at_least is not None and constrained:
            parameters = _solve_bounded(weighted, data / scale, *at_least)
        previous, scale = scale, scale_of(parameters)
        if np.max(np.abs(scale / previous - 1.0)) < 1e-9:
            break
    return _finish(design, parameters, design @ parameters, data, scale, constrained)


def least_squares_within(
    design: np.ndarray, data: np.ndarray, at_least: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Return the parameters of least squares with G @ parameters >= h, ``at_least`` = (G, h)."""
    parameters = _solve(design, data)
    if np.any(at_least[0] @ parameters < at_least[1]):
        return _solve_bounded(design, data, *at_least)
    return parameters


def fit_nonlinear(
    model: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    data: np.ndarray,
    floor: float,
    *,
    bounds: tuple = (-np.inf, np.inf),
) -> Fit:
    """Fit data = model(parameters) by reweighted trust-region least squares."""
    parameters = np.asarray(start, dtype=float)
    scale = noise_scale(model(parameters), data, floor)
    for _ in range(50):
        solution = least_squares(
            lambda theta, scale=scale: (model(theta) - data) / scale, parameters, jac="3-point",
            bounds=bounds, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14,
        )  # fmt: skip
        parameters = solution.x
        previous, scale = scale, noise_scale(model(parameters), data, floor)
        if np.max(np.abs(scale / previous - 1.0)) < 1e-9:
            break
    jacobian = solution.jac * previous[:, None]
    constrained = bool(np.any(solution.active_mask != 0))
    return _finish(jacobian, parameters, model(parameters), data, scale, constrained)


def _finish(jacobian, parameters, model, data, scale, constrained) -> Fit:
    return Fit(
        parameters, model, (data - model) / scale, scale, jacobian / scale[:, None], constrained
    )


def _unit_columns(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    lengths = np.linalg.norm(matrix, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return matrix / lengths, lengths


def _noise(residuals, degrees_of_freedom: int) -> float:
    if degrees_of_freedom < 1:
        return np.nan
    return float(np.sqrt(np.sum(residuals**2) / degrees_of_freedom))


def _solve(design, data) -> np.ndarray:
    scaled, lengths = _unit_columns(design)
    return np.linalg.lstsq(scaled, data, rcond=None)[0] / lengths


def _solve_bounded(design, data, G, h) -> np.ndarray:
    """Least squares with G @ parameters >= h, exactly (Lawson and Hanson 1974, chapter 23).

    In z = R parameters - Qᵀ data the problem is: shortest z with (G R⁻¹) z >= h - G R⁻¹ Qᵀ data,
    whose dual is a non-negative least-squares problem.
    """
    Q, R = np.linalg.qr(design)
    target = Q.T @ data
    G_z = np.linalg.solve(R.T, G.T).T
    h_z = h - G_z @ target
    # Rows scaled to unit length: the same half-spaces, better conditioned.
    lengths = np.linalg.norm(G_z, axis=1)
    G_z, h_z = G_z / lengths[:, None], h_z / lengths
    system = np.vstack([G_z.T, h_z])
    unit = np.zeros(len(system))
    unit[-1] = 1.0
    dual, _ = nnls(system, unit, maxiter=20 * system.shape[1])
    residual = system @ dual - unit
    return np.linalg.solve(R, target - residual[:-1] / residual[-1])
