"""Weighted least squares with intervals, and whether the law that was fitted describes its data.

Noise model: the error of a measurement y is normal with a standard deviation proportional to
max(|model|, floor * largest |y|), the factor being unknown. Weights follow the fitted model
(iteratively reweighted), not the data, which would bias the fit towards values measured too small.

Lack of fit: noise scatters to both sides of a law. A law that misses its data lies above them over
one part of the range and below over another. The rows are therefore sorted into bands along the
range: a band is off where the mean deviation in it is larger than scatter explains, and large
enough to matter.
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


# --- lack of fit ----------------------------------------------------------------------------------


# Mean deviation of a band that matters, of the measured value or of a fifth of the largest one.
TOLERANCE = 0.1
_SMALL_VALUE = 0.2
# Chance of calling pure noise systematic, over all bands of a fit.
_FALSE_ALARM = 1e-4
_ROWS_PER_BAND, _MOST_BANDS = 5, 10
# Fewer differences of neighbours than this do not tell the scatter.
_FEWEST_DIFFERENCES = 4
# A load falls where it is this much below its peak, and by more than noise can explain.
_FALL, _FALL_IN_NOISE = 0.1, 6.0
# Largest number of shorter ranges that are tried.
_TRIALS = 30


@dataclass(frozen=True)
class LackOfFit:
    """Mean deviation of the data from a law in bands along the range of the test.

    Attributes
    ----------
    band : number of the band of each row, shape [row_count].
    x : mean abscissa of each band, shape [band_count].
    deviation : mean of (data - model) / max(\\|model\\|, a fifth of the largest value), or over
        another scale, shape [band_count].
    off : whether the deviation is systematic and matters, shape [band_count].
    """

    band: np.ndarray
    x: np.ndarray
    deviation: np.ndarray
    off: np.ndarray

    @property
    def is_systematic(self) -> bool:
        return bool(self.off.any())

    @property
    def blocks(self) -> np.ndarray | None:
        """Bands whose rows err together, for the intervals of the fit; None if errors are noise."""
        return self.band if self.is_systematic and len(self.x) > 1 else None

    def widening(self, x: np.ndarray) -> np.ndarray:
        """Return the relative deviation that a band of confidence has to reach to, shape as x."""
        if not self.is_systematic:
            return np.zeros(np.shape(x))
        return np.interp(x, self.x, np.abs(self.deviation))

    def text(self, law: str, quantity: str, unit: str, factor: float = 1.0, *, of: str = "") -> str:
        """Say where the law misses the data; ``factor`` turns the abscissa into ``unit``.

        of : what the deviation is a part of, as " of the friction", if not of the value.
        """
        worst = int(np.argmax(np.where(self.off, np.abs(self.deviation), 0.0)))
        side = "below" if self.deviation[worst] > 0.0 else "above"
        return (
            f"{law} does not follow the data: it lies "
            f"{100.0 * abs(self.deviation[worst]):.0f} %{of} {side} them around {quantity} = "
            f"{factor * self.x[worst]:.4g} {unit}, which is no scatter"
        )


def lack_of_fit(
    x: np.ndarray,
    data: np.ndarray,
    model: np.ndarray,
    specimen: np.ndarray,
    *,
    tolerance: float = TOLERANCE,
    scale: np.ndarray | None = None,
) -> LackOfFit:
    """Compare data and model band by band.

    Parameters
    ----------
    x : abscissa of the rows (displacement, thickness, orientation), shape [row_count].
    data, model : measured and fitted values, shape [row_count].
    specimen : number of the specimen of each row, shape [row_count].
    tolerance : mean deviation of a band that matters.
    scale : what deviations are taken over, shape [row_count]; the values by default.
    """
    x, data, model = (np.asarray(values, dtype=float) for values in (x, data, model))
    if scale is None:
        smallest = _SMALL_VALUE * np.max(np.abs(data))
        scale = np.maximum(np.abs(model), smallest)
    deviation = (data - model) / np.maximum(scale, 1e-300)
    order = np.argsort(x, kind="stable")
    band = np.empty(len(x), dtype=int)
    band[order] = _bands(x[order])
    count = int(band.max()) + 1
    rows = np.bincount(band)
    mean = np.bincount(band, deviation) / rows
    centre = np.bincount(band, x) / rows
    neighbours = band[order][1:] == band[order][:-1]
    differences = np.diff(deviation[order])[neighbours]
    if len(differences) < _FEWEST_DIFFERENCES:
        return LackOfFit(band, centre, mean, np.zeros(count, dtype=bool))
    # The median is not moved by the one jump that is looked for; 0.954 = 0.6745 sqrt(2).
    scatter = float(np.median(np.abs(differences))) / 0.954
    error = np.maximum(
        scatter / np.sqrt(rows), [_between(deviation[band == b], specimen[band == b])
                                  for b in range(count)],
    )  # fmt: skip
    # Two differences that share a row count as little more than one.
    freedom = max(1.0, 0.6 * len(differences))
    factor = float(student.ppf(1.0 - 0.5 * _FALSE_ALARM / count, freedom))
    off = (np.abs(mean) > factor * error) & (np.abs(mean) > tolerance)
    return LackOfFit(band, centre, mean, off)


def _bands(x: np.ndarray) -> np.ndarray:
    """Return the band of each of the sorted rows: few distinct abscissae, or equal counts."""
    new = np.append(False, np.diff(x) > 1e-6 * max(np.ptp(x), 1e-300))
    distinct = np.cumsum(new)
    if distinct[-1] + 1 <= max(2, len(x) // 2) and distinct[-1] < _MOST_BANDS:
        return distinct
    count = int(np.clip(len(x) // _ROWS_PER_BAND, 1, _MOST_BANDS))
    return np.arange(len(x)) * count // len(x)


def _between(deviation: np.ndarray, specimen: np.ndarray) -> float:
    """Error of a mean that the scatter between specimens leaves; 0 for one specimen."""
    numbers = np.unique(specimen)
    if len(numbers) < 2:
        return 0.0
    means = [deviation[specimen == number].mean() for number in numbers]
    return float(np.std(means, ddof=1) / math.sqrt(len(numbers)))


def falling_row(
    load: np.ndarray,
    specimen: np.ndarray,
    *,
    for_good: bool = False,
    noise_floor: float = 0.0,
) -> int | None:
    """Return the first row where the load of a specimen falls below its peak, None without one.

    A test that loads the specimen cannot lower the load of a law that rises: the specimen tore,
    slipped in its clamps, or was unloaded. Single peaks and scatter are no fall.

    Parameters
    ----------
    load : force or pressure in the order of loading, shape [row_count].
    specimen : number of the specimen of each row, shape [row_count].
    for_good : count only a fall of two rows or more from which the load never comes back to its
        peak, for a load that was computed and scatters more in one place than in another.
    noise_floor : smallest noise relative to the largest load.
    """
    first = []
    for number in np.unique(specimen):
        rows = np.flatnonzero(specimen == number)
        values = load[rows]
        if len(values) < 3:
            continue
        middle = medians(values)
        peak = np.maximum.accumulate(middle)
        least = max(noise_floor * float(np.max(np.abs(middle))), 1e-300)
        noise = relative_scatter(values, middle, least)
        size = np.maximum(peak, least) if noise_floor > 0.0 else peak
        fallen = peak - values > np.maximum(_FALL * peak, _FALL_IN_NOISE * noise * size)
        # What is small against the whole test is the start of it, not its end.
        fallen &= peak > _FALL * np.max(middle)
        if for_good:
            later = np.maximum.accumulate(middle[::-1])[::-1]
            fallen &= later < peak
            fallen &= np.count_nonzero(fallen) >= 2
        if fallen.any():
            first.append(rows[int(np.argmax(fallen))])
    return int(min(first)) if first else None


def medians(load: np.ndarray) -> np.ndarray:
    """Return the load without its single peaks: medians of three, the lesser one at the ends."""
    middle = np.array([np.median(load[max(i - 1, 0) : i + 2]) for i in range(len(load))])
    middle[0], middle[-1] = min(middle[:2].min(), load[0]), min(middle[-1], middle[-2])
    return middle


def relative_scatter(load: np.ndarray, middle: np.ndarray, least: float = 1e-300) -> float:
    """Return the standard deviation of a load over itself; a rise does not count.

    load, middle : of three rows or more in the order of loading, and their medians.
    least : smallest value that it is taken over.
    """
    usable = np.abs(middle) > _FALL * np.max(np.abs(middle))
    ratio = (load[1:] - load[:-1]) / np.maximum(np.abs(middle[1:]), least)
    # Second differences do not see the rise of the load, only its scatter.
    rough = np.abs(np.diff(ratio))[usable[2:]]
    return float(np.median(rough)) / (0.6745 * math.sqrt(6.0)) if len(rough) else 0.0


def longest_range(
    x: np.ndarray,
    holds: Callable[[np.ndarray], bool],
    fewest: int,
    *,
    from_start_only: bool = True,
) -> np.ndarray | None:
    """Return the most rows at one end of the range, as a mask, whose own fit holds; else None.

    Parameters
    ----------
    x : abscissa of the rows in the order of loading, from the unloaded state, shape [row_count].
    holds : says whether a fit of these rows alone describes them.
    fewest : fewest rows that can be fitted.
    from_start_only : whether the range has to begin with the unloaded state.
    """
    count = len(x)
    order = np.argsort(x, kind="stable")
    step = max(1, (count - fewest) // _TRIALS)
    for kept in range(count, fewest - 1, -step):
        for chosen in (order[:kept],) if from_start_only else (order[:kept], order[count - kept :]):
            rows = np.zeros(count, dtype=bool)
            rows[chosen] = True
            if holds(rows):
                return rows
    return None
