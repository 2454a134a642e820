"""Bending stiffness C^B, Eq. (25), from cantilever tests under own weight."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    bending_stiffness_from_overhang,
    elastica_with_tip_slope,
    overhang_at_angle,
    strip_stiffness,
)
from lcmchain.coupons.data import Column, CouponData
from lcmchain.coupons.identification import (
    Band,
    Identification,
    Panel,
    Parameter,
    Points,
    general_warnings,
    mega_pascal,
)
from lcmchain.coupons.regression import (
    Fit,
    coefficient_of_determination,
    fit_nonlinear,
    student_factor,
)
from lcmchain.errors import InputError
from lcmchain.quantities.units import ANGLE, LENGTH

_ORIENTATION = Column("orientation", ANGLE)
COLUMNS = (
    (_ORIENTATION, Column("overhang", LENGTH)),
    (_ORIENTATION, Column("length", LENGTH), Column("angle", ANGLE)),
    (_ORIENTATION, Column("x", LENGTH, loading=1), Column("y", LENGTH)),
)
ASSUMPTIONS = {
    "free-strip": "a narrow strip, free to twist and to curve across",
    "cylindrical": "a wide strip that curves along only",
}
# Strips within this angle of a fibre direction are taken as cut along it.
_ALONG_FIBRE = math.radians(2.0)
_FEWEST_CURVE_POINTS = 5
# Degrees of freedom from which Student's t is normal.
_MANY = 10**6


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
    """

    orientation: np.ndarray
    overhang: np.ndarray
    angle: np.ndarray
    error: np.ndarray
    curves: tuple = ()


def identify_bending(
    data: CouponData,
    *,
    thickness: float,
    areal_weight: float,
    angle: float = CANTILEVER_ANGLE,
    off_axis: str = "free-strip",
    inputs: tuple = (),
) -> Identification:
    """Identify C11, C22 and, from strips cut off the fibres, C12 of C^B.

    A strip bent along a fibre gives the stiffness of that direction. What a strip at 45° says of
    C12 depends on its freedom (``off_axis``): a narrow one twists and curves across freely
    (``"free-strip"``), a wide one curves along only (``"cylindrical"``); a real strip lies
    between, and the result of the other assumption is reported beside. For equal overhang the
    free strip gives the larger C12.

    Parameters
    ----------
    data : orientation [rad] with either overhang [m], or length [m] and chord angle [rad], or a
        deflection curve x, y [m] from clamp to tip.
    thickness : t0 [m].
    areal_weight : weight per area [N/m²].
    angle : chord angle that an overhang belongs to [rad].
    off_axis : assumption about strips cut off the fibre directions.
    inputs : rows of the table of inputs.

    Raises
    ------
    InputError : no strip along fibre 1 or 2, a curve that is none, or off-axis strips that are too
        soft for any positive C12.
    """
    tests = cantilever_tests(data, areal_weight, angle)
    along_1 = tests.orientation <= _ALONG_FIBRE
    along_2 = tests.orientation >= 0.5 * np.pi - _ALONG_FIBRE
    for found, degrees in ((along_1, 0), (along_2, 90)):
        if not found.any():
            raise InputError(
                f"has no strip with an orientation of {degrees} deg; both fibre directions are "
                "needed",
                file=data.file,
            )
    between = ~(along_1 | along_2)
    per_stiffness = thickness**3 / 12.0
    stiffness = (
        bending_stiffness_from_overhang(tests.overhang, areal_weight, tests.angle) / per_stiffness
    )
    C11, C22 = stiffness[along_1].mean(), stiffness[along_2].mean()
    names = ["C11", "C22"]
    start = [C11, C22]
    warnings = []
    if between.any():
        estimates = {
            assumption: _torsional_stiffness(
                stiffness[between].mean(), C11, C22, tests.orientation[between].mean(), assumption
            )
            for assumption in ASSUMPTIONS
        }
        if estimates[off_axis] <= 0.0:
            raise InputError(
                "the strips cut off the fibres are softer than any C12 allows under the "
                f'assumption "{off_axis}"; use the other one, or check orientation and overhang',
                file=data.file,
            )
        names.append("C12")
        start.append(estimates[off_axis])
        other = next(name for name in ASSUMPTIONS if name != off_axis)
        beside = (
            f"be {estimates[other] * 1e-6:.4g} MPa"
            if estimates[other] > 0.0
            else "have to be negative, which excludes it"
        )
        warnings.append(
            f"C12 rests on the assumption of {ASSUMPTIONS[off_axis]}; with {ASSUMPTIONS[other]} "
            f"it would {beside} (a real strip lies between the two)"
        )
    else:
        warnings.append("no strip is cut off the fibres: C12 stays open; test one at 45 deg")

    def model(theta):
        values = np.exp(theta)
        twist = values[2] if len(values) > 2 else 1.0  # without off-axis strips it has no effect
        orientation = np.where(along_1, 0.0, np.where(along_2, 0.5 * np.pi, tests.orientation))
        strip = strip_stiffness(values[0], values[1], twist, orientation, off_axis)
        return overhang_at_angle(strip * per_stiffness, areal_weight, tests.angle)

    fit = fit_nonlinear(model, np.log(start), tests.overhang, 0.0)
    half, interval_method = _half_widths(fit, tests)
    parameters = tuple(
        Parameter(name, math.exp(value), "Pa", math.exp(value - h), math.exp(value + h))
        for name, value, h in zip(names, fit.parameters, half)
    )
    derived = tuple(
        Parameter(f"D({degrees} deg)", per_stiffness * p.value, "N*m",
                  per_stiffness * p.low, per_stiffness * p.high)
        for p, degrees in zip(parameters, (0, 90))
    )  # fmt: skip
    if not np.isfinite(half).all():
        warnings.append(
            "there are no more tests than parameters: nothing tells the scatter, so no intervals; "
            "repeat each orientation"
        )
    warnings += general_warnings(parameters, fit.residuals, np.arange(len(fit.residuals)))
    return Identification(
        law="bending",
        method="heavy elastica: overhang of a strip that bends under its own weight",
        noise_model="independent errors of the overhang, relative to it and equal for all tests",
        interval_method=interval_method,
        inputs=inputs,
        parameters=parameters,
        derived=derived,
        scene_table="material.bending",
        scene_entries={p.name: f'"{mega_pascal(p.value)}"' for p in parameters},
        correlation=fit.correlation(),
        condition=fit.condition,
        relative_noise=fit.scale,
        r_squared=coefficient_of_determination(tests.overhang, fit.model),
        point_count=len(tests.overhang),
        warnings=tuple(warnings),
        panels=_panels(tests, fit, per_stiffness, areal_weight, off_axis),
    )


def cantilever_tests(data: CouponData, areal_weight: float, angle: float) -> Cantilever:
    """Bring overhangs, length-angle pairs or deflection curves to one form."""
    orientation = np.abs(data["orientation"]) % np.pi
    orientation = np.minimum(orientation, np.pi - orientation)
    if "overhang" in data:
        _require_positive(data, "overhang")
        unknown = np.full(len(orientation), np.nan)
        return Cantilever(
            orientation, data["overhang"], np.full(len(orientation), angle), unknown
        )
    if "length" in data:
        _require_positive(data, "length")
        low, high = math.radians(1.0), math.radians(85.0)
        outside = np.flatnonzero((data["angle"] < low) | (data["angle"] > high))
        if len(outside):
            raise data.wrong("angle", outside[0], "must lie between 1 deg and 85 deg")
        unknown = np.full(len(orientation), np.nan)
        return Cantilever(orientation, data["length"], data["angle"], unknown)
    return _tests_from_curves(data, orientation, areal_weight, angle)


def _tests_from_curves(data, orientation, areal_weight, angle) -> Cantilever:
    keys = np.round(np.degrees(orientation), 3) * 1e6 + data.specimen
    kept, overhang, error, curves = [], [], [], []
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
        curves.append((x, drop, *fitted, orientation[rows[0]]))
    return Cantilever(
        np.array(kept), np.array(overhang), np.full(len(kept), angle), np.array(error),
        tuple(curves),
    )  # fmt: skip


def fit_deflection_curve(x, y, areal_weight):
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


def _torsional_stiffness(strip, C11, C22, orientation, assumption) -> float:
    """C12 [Pa] of a strip stiffness; not positive where none gives it."""
    c2, s2 = math.cos(orientation) ** 2, math.sin(orientation) ** 2
    if assumption == "cylindrical":
        return (strip - c2**2 * C11 - s2**2 * C22) / (4.0 * s2 * c2)
    compliance = 1.0 / strip - c2**2 / C11 - s2**2 / C22
    return s2 * c2 / compliance if compliance > 0.0 else -1.0


def _half_widths(fit: Fit, tests: Cantilever) -> tuple[np.ndarray, str]:
    """Half widths of the intervals of the logarithms, and how they were found."""
    if fit.degrees_of_freedom > 0:
        return fit.half_widths(), "Student's t from the Jacobian, in the logarithms"
    if np.isfinite(tests.error).all():
        # No repeated tests, but every deflection curve brings the error of its own fit.
        inverse = np.linalg.pinv(fit.jacobian)
        variance = np.sum((inverse * tests.error) ** 2, axis=1)
        return student_factor(_MANY) * np.sqrt(variance), (
            "error of each deflection curve's fit; the scatter between specimens is not in it"
        )
    return np.full(len(fit.parameters), np.nan), "none, as many parameters as tests"


def _require_positive(data: CouponData, column: str) -> None:
    wrong = np.flatnonzero(data[column] <= 0.0)
    if len(wrong):
        raise data.wrong(column, wrong[0], "must be positive")


def _strip_curves(fit: Fit, per_stiffness: float, off_axis: str) -> list[Band]:
    """Bending stiffness [N m] over the orientation [deg] under both assumptions."""
    angle = np.linspace(0.0, 0.5 * np.pi, 91)

    def stiffness(theta, assumption):
        return per_stiffness * strip_stiffness(*np.exp(theta), angle, assumption)

    curves = []
    for assumption in ASSUMPTIONS:
        centre = stiffness(fit.parameters, assumption)
        low = high = None
        if assumption == off_axis and fit.degrees_of_freedom > 0:
            step = 1e-5 * np.eye(len(fit.parameters))
            gradient = np.stack(
                [
                    np.log(stiffness(fit.parameters + h, assumption) / centre) / 1e-5
                    for h in step
                ]
            )
            variance = np.einsum("in,ij,jn->n", gradient, fit.covariance, gradient)
            ratio = np.exp(student_factor(fit.degrees_of_freedom) * np.sqrt(variance))
            low, high = centre / ratio, centre * ratio
        label = assumption.replace("-", " ")
        curves.append(
            Band(np.degrees(angle), centre, label, low, high, dashed=assumption != off_axis)
        )
    return curves


def _panels(tests: Cantilever, fit: Fit, per_stiffness, areal_weight, off_axis):
    degrees = np.degrees(tests.orientation)
    measured = bending_stiffness_from_overhang(tests.overhang, areal_weight, tests.angle)
    curves = _strip_curves(fit, per_stiffness, off_axis) if len(fit.parameters) > 2 else []

    def over_orientation(label, convert):
        bands = (
            replace(
                c, y=convert(c.y), low=None if c.low is None else convert(c.low),
                high=None if c.high is None else convert(c.high),
            )
            for c in curves
        )  # fmt: skip
        points = (Points(degrees, convert(measured), "measured"),)
        return Panel("orientation [deg]", label, points, tuple(bands))

    if tests.curves:
        second = Panel(
            "reach [mm]", "deflection [mm]",
            tuple(Points(1e3 * x, -1e3 * y, f"{math.degrees(o):.0f} deg")
                  for x, y, _, _, o in tests.curves),
            tuple(Band(1e3 * fx, -1e3 * fy, "") for _, _, fx, fy, _ in tests.curves),
        )  # fmt: skip
    else:
        second = over_orientation(
            "overhang at 41.5 deg [mm]", lambda D: 1e3 * overhang_at_angle(D, areal_weight)
        )
    residuals = Panel(
        "orientation [deg]", "residual of the overhang [%]",
        (Points(degrees, 100.0 * fit.residuals, "measured"),), is_residual=True,
    )  # fmt: skip
    return over_orientation("bending stiffness [N mm]", lambda D: 1e3 * D), second, residuals
