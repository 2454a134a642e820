"""Bending of a fabric from cantilever tests: C^B, Eq. (25), and curves of moments.

One stiffness for each direction of the fibres describes strips that bend alike. Where it does not,
and deflection curves were measured, a curve of moment over curvature may: along a strip the moment
of the weight beyond each place is known from its shape, and the curvature from a curve of piecewise
linear curvature through its points
(:func:`lcmchain.identification.cantilever_tests.stiffness_along_strip`). A strip that hangs far
runs through all curvatures from its tip to its clamp. From these points a curve is brought, by
least squares, to give the measured shapes (:mod:`lcmchain.coupons.analytic.strip_bending`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    MomentCurve,
    bending_stiffness_from_overhang,
    curve_elastica,
    curve_elastica_with_tip_slope,
    overhang_at_angle,
    strip_stiffness,
)
from lcmchain.errors import InputError
from lcmchain.identification.cantilever_tests import (
    ALONG_FIBRE,
    Cantilever,
    StripsByFibre,
    cantilever_tests,
    distance_below,
    length_of_line,
    strips_of,
)
from lcmchain.identification.data import CouponData
from lcmchain.identification.regression import (
    TOLERANCE,
    Fit,
    LackOfFit,
    coefficient_of_determination,
    exponential,
    fit_nonlinear,
    lack_of_fit,
    student_factor,
)
from lcmchain.identification.result import (
    Band,
    Identification,
    Panel,
    Parameter,
    Points,
    accepted,
    general_warnings,
    mega_pascal,
)

ASSUMPTIONS = {
    "free-strip": "a narrow strip, free to twist and to curve across",
    "cylindrical": "a wide strip that curves along only",
}
# Degrees of freedom from which Student's t is normal.
_MANY = 10**6


def identify_bending(
    data: CouponData,
    *,
    thickness: float,
    areal_weight: float,
    angle: float = CANTILEVER_ANGLE,
    off_axis: str = "free-strip",
    inputs: tuple = (),
    accept: bool = False,
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
    accept : take the fit as it is where one stiffness does not describe the strips; the intervals
        are then those of the stiffness that they show.

    Raises
    ------
    InputError : no strip along fibre 1 or 2, a curve that is none, or off-axis strips that are too
        soft for any positive C12.
    FitRefusedError : one stiffness does not describe the strips, and ``accept`` is not given.
    """
    tests = cantilever_tests(data, areal_weight, angle)
    result = _bending_constants(
        tests,
        data.file,
        thickness=thickness,
        areal_weight=areal_weight,
        off_axis=off_axis,
        inputs=inputs,
    )
    return accepted(result, data.file, accept)


def _bending_constants(
    tests: Cantilever,
    file: str,
    *,
    thickness: float,
    areal_weight: float,
    off_axis: str = "free-strip",
    inputs: tuple = (),
) -> Identification:
    """Return what :func:`identify_bending` finds, with its objections, accepted or not.

    Parameters
    ----------
    tests : in one form; file : that they are from. The others are those of that function.

    Raises
    ------
    InputError : no strip along fibre 1 or 2, or off-axis strips that are too soft for any positive
        C12.
    """
    strips = strips_of(tests, file)
    per_stiffness = thickness**3 / 12.0
    stiffness = (
        bending_stiffness_from_overhang(tests.overhang, areal_weight, tests.angle) / per_stiffness
    )
    start, warnings = _first_estimate(stiffness, tests, strips, off_axis, file)

    def model(theta):
        values = np.exp(theta)
        twist = values[2] if len(values) > 2 else 1.0  # without off-axis strips it has no effect
        strip = strip_stiffness(values[0], values[1], twist, strips.orientation, off_axis)
        return overhang_at_angle(strip * per_stiffness, areal_weight, tests.angle)

    fit = fit_nonlinear(model, np.log(list(start.values())), tests.overhang, 0.0)
    lacks = _lacks_of_fit(tests, strips, fit)
    blocks = next((lack.blocks for lack in lacks.values() if lack.is_systematic), None)
    fit = replace(fit, blocks=blocks)
    half, interval_method = _half_widths(fit, tests)
    shown = _shown_stiffness(tests, strips, per_stiffness, fit, off_axis)
    parameters = tuple(
        Parameter(
            name, exponential(value), "Pa", _fmin(exponential(value - h), shown[name][0]),
            _fmax(exponential(value + h), shown[name][1]),
        )
        for name, value, h in zip(start, fit.parameters, half)
    )  # fmt: skip
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
    objections, holds = _objections(tests, lacks)
    if not all(along.one_stiffness for along in tests.along):
        interval_method += "; widened to the stiffnesses that the deflection curves show"
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
        objections=objections,
        holds=holds,
    )


def _lacks_of_fit(tests: Cantilever, strips: StripsByFibre, fit: Fit) -> dict[str, LackOfFit]:
    """Return how the tests deviate over the orientation and, where it was chosen, the length."""
    one = np.zeros(len(tests.overhang), dtype=int)

    def lack(x) -> LackOfFit:  # the stiffness goes with the third power of the overhang
        return lack_of_fit(x, tests.overhang, fit.model, one, tolerance=TOLERANCE / 3.0)

    lacks = {"orientation": lack(strips.orientation)}
    if np.ptp(tests.angle) > 0.0:
        # Sorted by what was measured itself, mere scatter would look like a trend.
        lacks["length"] = lack(tests.overhang)
    return lacks


def _objections(tests: Cantilever, lacks: dict[str, LackOfFit]) -> tuple[tuple[str, ...], str]:
    """Say why one stiffness does not describe the strips, and where it does; empty if it does."""
    found = []
    for along, line in zip(tests.along, tests.lines):
        if along.one_stiffness:
            continue
        low, high = along.span()
        same = np.flatnonzero(~along.differs)
        where = (
            "nowhere"
            if not len(same)
            else f"at {', '.join(f'{1e3 * along.arc[i]:.3g}' for i in same)} mm from the clamp"
        )
        found.append(
            f"M/kappa of the deflection curve from line {line} on runs from {1e3 * low:.3g} to "
            f"{1e3 * high:.3g} N mm along the strip, at curvatures of "
            f"{along.curvature.max():.3g} to {max(along.curvature.min(), 0.0):.3g} 1/m; its one "
            f"stiffness holds {where}"
        )
    words = {"orientation": ("deg", 180.0 / math.pi), "length": ("mm", 1e3)}
    for name, lack in lacks.items():
        if lack.is_systematic:
            unit, factor = words[name]
            found.append(lack.text("the stiffness", f"the {name}", unit, factor))
    if not found:
        return (), ""
    if tests.along:
        holds = (
            "a constant stiffness stands for the curvatures of one place of the strip only; test "
            "strips that bend as much as the part will, and take the fit of these, or take a curve "
            "of moments over curvature: --curve (in Python curve=True)"
        )
    else:
        lack = next(lack for lack in lacks.values() if lack.is_systematic)
        name = next(name for name, lack in lacks.items() if lack.is_systematic)
        unit, factor = words[name]
        kept = [f"{factor * x:.4g}" for x in lack.x[~lack.off]]
        holds = (
            f"the law describes the tests around {name} = {', '.join(kept)} {unit}; fit those"
            if kept
            else f"no {name} is described"
        )
    return tuple(found), holds


def _shown_stiffness(
    tests: Cantilever, strips: StripsByFibre, per_stiffness: float, fit: Fit, off_axis: str
) -> dict[str, tuple[float, float]]:
    """Least and largest C11, C22, C12 [Pa] that deflection curves show; nan where one fits."""
    unknown = (np.nan, np.nan)
    shown = {"C11": unknown, "C22": unknown, "C12": unknown}
    curves = np.array([not along.one_stiffness for along in tests.along], dtype=bool)
    if not curves.any():
        return shown
    spans = np.array([along.span() for along in tests.along]) / per_stiffness
    for name, mask in (("C11", strips.along_1), ("C22", strips.along_2)):
        if (mask & curves).any():
            shown[name] = spans[mask & curves, 0].min(), spans[mask & curves, 1].max()
    between = strips.between & curves
    if between.any():
        C11, C22 = np.exp(fit.parameters[:2])
        ends = [
            _torsional_stiffness(stiffness, C11, C22, orientation, off_axis)
            for span, orientation in zip(spans[between], strips.orientation[between])
            for stiffness in span
        ]
        # What no C12 explains is softer than any, or stiffer than any.
        positive = [value for value in ends if value > 0.0]
        shown["C12"] = (
            min(positive) if len(positive) == len(ends) else 0.0,
            max(positive) if len(positive) == len(ends) else math.inf,
        )
    return shown


def _fmin(a: float, b: float) -> float:
    return float(np.fmin(a, b))


def _fmax(a: float, b: float) -> float:
    return float(np.fmax(a, b))


def _first_estimate(
    stiffness: np.ndarray, tests: Cantilever, strips: StripsByFibre, off_axis: str, file
) -> tuple[dict[str, float], list[str]]:
    """Return the entries of C^B [Pa] from mean stiffnesses, and what they rest on in words."""
    C11, C22 = stiffness[strips.along_1].mean(), stiffness[strips.along_2].mean()
    estimate = {"C11": C11, "C22": C22}
    between = strips.between
    if not between.any():
        return estimate, ["no strip is cut off the fibres: C12 stays open; test one at 45 deg"]
    torsional = {
        assumption: _torsional_stiffness(
            stiffness[between].mean(), C11, C22, tests.orientation[between].mean(), assumption
        )
        for assumption in ASSUMPTIONS
    }
    if torsional[off_axis] <= 0.0:
        raise InputError(
            "the strips cut off the fibres are softer than any C12 allows under the "
            f'assumption "{off_axis}"; use the other one, or check orientation and overhang',
            file=file,
        )
    estimate["C12"] = torsional[off_axis]
    other = next(name for name in ASSUMPTIONS if name != off_axis)
    beside = (
        f"be {torsional[other] * 1e-6:.4g} MPa"
        if torsional[other] > 0.0
        else "have to be negative, which excludes it"
    )
    return estimate, [
        f"C12 rests on the assumption of {ASSUMPTIONS[off_axis]}; with {ASSUMPTIONS[other]} "
        f"it would {beside} (a real strip lies between the two)"
    ]


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


def _strip_curves(fit: Fit, per_stiffness: float, off_axis: str) -> list[Band]:
    """Bending stiffness [N m] over the orientation [deg] under both assumptions."""
    angle = np.linspace(0.0, 0.5 * np.pi, 91)

    def stiffness(theta, assumption):
        return per_stiffness * strip_stiffness(*np.exp(theta), angle, assumption)  # type: ignore[call-arg]

    curves = []
    for assumption in ASSUMPTIONS:
        centre = stiffness(fit.parameters, assumption)
        low = high = None
        if assumption == off_axis and fit.degrees_of_freedom > 0:
            step = 1e-5 * np.eye(len(fit.parameters))
            gradient = np.stack(
                [np.log(stiffness(fit.parameters + h, assumption) / centre) / 1e-5 for h in step]
            )
            variance = np.einsum("in,ij,jn->n", gradient, fit.covariance, gradient)
            ratio = np.exp(fit.student * np.sqrt(variance))
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


# --- curves of moments ----------------------------------------------------------------------------


# Curvatures of the points over the largest one that the strips show.
SHARES = np.array([0.02, 0.05, 0.12, 0.3, 1.0])
# The moment grows with such powers of the curvature in the curves with which the search begins:
# from one that is too soft, or not soft enough, it ends in a valley beside.
POWERS = (0.1, 0.5)
# Part of its length by which a strip may hang beside its shape.
CLOSE_SHAPE = 0.01


def identify_bending_curve(
    data: CouponData,
    *,
    thickness: float,
    areal_weight: float,
    angle: float = CANTILEVER_ANGLE,
    off_axis: str = "free-strip",
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify curves of both fibre directions beside constants of the whole strips.

    Parameters are those of :func:`identify_bending`; ``data`` must be deflection curves. That one
    stiffness does not describe them is no objection to a curve.

    Raises
    ------
    InputError : the data are no deflection curves, or show no curve.
    FitRefusedError : a strip of a curve hangs otherwise than it was measured, and ``accept`` is not
        given.
    """
    tests = cantilever_tests(data, areal_weight, angle)
    if not tests.curves:
        raise InputError(
            "has no deflection curves, from which a curve is found; give columns x and y",
            file=data.file,
        )
    constants = _bending_constants(
        tests, data.file, thickness=thickness, areal_weight=areal_weight, off_axis=off_axis,
        inputs=inputs,
    )  # fmt: skip
    entries = dict(constants.scene_entries)
    objections: list[str] = []
    panels = list(constants.panels)
    for number, direction in ((1, 0.0), (2, 0.5 * math.pi)):
        strips = np.flatnonzero(np.abs(tests.orientation - direction) < ALONG_FIBRE)
        points = _points(tests, strips, data.file)
        curve = _curve(tests, strips, points, areal_weight)
        objections += _misses(tests, strips, curve, areal_weight)
        entries[f"curve_{number}"] = _entry(curve)
        panels.append(_panel(number, points, curve))
    result = replace(
        constants,
        method=f"{constants.method}; curves from the curvature along deflection curves",
        scene_entries=entries,
        panels=tuple(panels),
        objections=tuple(objections),
        holds="the points between which the strips were measured" if objections else "",
    )
    return accepted(result, data.file, accept)


def _points(tests: Cantilever, strips: np.ndarray, file: str) -> np.ndarray:
    """Return curvature [1/m] and moment [N] of all known places of strips, (2, n), rising."""
    curvature = np.concatenate([tests.along[i].curvature for i in strips])
    moment = curvature * np.concatenate([tests.along[i].stiffness for i in strips])
    known = np.isfinite(moment) & (curvature > 0.0) & (moment > 0.0)
    if np.count_nonzero(known) < 2:
        raise InputError("shows too few curvatures for a curve; measure more points", file=file)
    order = np.argsort(curvature[known])
    return np.stack([curvature[known][order], moment[known][order]])


def _curve(tests: Cantilever, strips: np.ndarray, points: np.ndarray, weight: float) -> MomentCurve:
    """Return the softening curve whose strips hang as they were measured.

    Its slopes are those of least squares of the distances of all points from the shapes; the
    slopes of the strips at rest of their tips are found with them.
    """
    largest, moment = points[:, -1]
    curvature = largest * SHARES
    measured = [np.stack(tests.curves[strip][:2]) for strip in strips]
    lengths = [length_of_line(*line) for line in measured]
    tips = [math.atan2(*(line[:, -1] - line[:, -2])[::-1]) for line in measured]

    def curve_of(theta: np.ndarray) -> MomentCurve:
        slopes = np.exp(theta[0] - np.append(0.0, np.cumsum(theta[1 : SHARES.size])))
        return MomentCurve(curvature, np.cumsum(slopes * np.diff(curvature, prepend=0.0)))

    def residuals(theta: np.ndarray) -> np.ndarray:
        curve, found = curve_of(theta), []
        for line, length, tip in zip(measured, lengths, theta[SHARES.size :], strict=True):
            shape = curve_elastica_with_tip_slope(curve, weight, tip)
            hanging = (shape.load_parameter * curve.start_slope / weight) ** (1.0 / 3.0)
            away = distance_below(line, hanging * np.stack([shape.x, shape.y]))
            found.append(np.append(away, hanging - length) / length)
        return np.concatenate(found)

    low = np.concatenate([[-np.inf], np.zeros(SHARES.size - 1), np.full(len(tips), 1e-3)])
    high = np.concatenate([np.full(SHARES.size, np.inf), np.full(len(tips), 1.56)])
    solutions = []
    for power in POWERS:
        at = moment * SHARES**power
        slope = np.diff(at, prepend=0.0) / np.diff(curvature, prepend=0.0)
        falls = np.maximum(-np.diff(np.log(slope)), 1e-2)
        start = np.concatenate([[math.log(slope[0])], falls, np.clip(tips, 0.02, 1.5)])
        # shapes are integrated to 1e-9: smaller steps would be those of its errors
        solutions.append(
            least_squares(residuals, start, bounds=(low, high), x_scale="jac", diff_step=1e-4)
        )
    return curve_of(min(solutions, key=lambda found: found.cost).x)


def _misses(tests: Cantilever, strips: np.ndarray, curve: MomentCurve, weight: float) -> list[str]:
    """Say of which strips the shape by the curve is not the measured one."""
    found = []
    for strip in strips:
        x, y = tests.curves[strip][:2]
        length = length_of_line(x, y)
        shape = curve_elastica(curve, weight, length)
        away = distance_below(np.stack([x, y]), length * np.stack([shape.x, shape.y]))
        off = float(np.abs(away).max()) / length
        if off > CLOSE_SHAPE:
            found.append(
                f"the strip from line {tests.lines[strip]} on hangs up to {1e3 * off * length:.3g} "
                "mm beside the shape by its curve"
            )
    return found


def _entry(curve: MomentCurve) -> str:
    # so many digits that rounding makes no slope steeper than the first
    k, M = (" ".join(f"{value:.9g}" for value in np.asarray(part)) for part in curve)
    return f'{{ curvature = "{k} 1/m", moment = "{M} N" }}'


def _panel(number: int, points: np.ndarray, curve: MomentCurve) -> Panel:
    k, M = (np.append(0.0, part) for part in curve)
    measured = Points(points[0], points[1], "along the strips")
    return Panel(
        f"curvature along fibre {number} [1/m]", "moment per width [N]", (measured,),
        (Band(k, M, f"curve_{number}"),),
    )  # fmt: skip
