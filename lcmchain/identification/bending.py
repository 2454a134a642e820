"""Bending stiffness C^B, Eq. (25), from cantilever tests under own weight."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    bending_stiffness_from_overhang,
    overhang_at_angle,
    strip_stiffness,
)
from lcmchain.errors import InputError
from lcmchain.identification.cantilever_tests import Cantilever, cantilever_tests
from lcmchain.identification.data import CouponData
from lcmchain.identification.lack_of_fit import TOLERANCE, LackOfFit, lack_of_fit
from lcmchain.identification.regression import (
    Fit,
    coefficient_of_determination,
    exponential,
    fit_nonlinear,
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
# Strips within this angle of a fibre direction are taken as cut along it.
ALONG_FIBRE = math.radians(2.0)
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
    result = bending_constants(
        tests,
        data.file,
        thickness=thickness,
        areal_weight=areal_weight,
        off_axis=off_axis,
        inputs=inputs,
    )
    return accepted(result, data.file, accept)


def bending_constants(
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
    strips = _strips(tests, file)
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


def _lacks_of_fit(tests: Cantilever, strips: _Strips, fit: Fit) -> dict[str, LackOfFit]:
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
    tests: Cantilever, strips: _Strips, per_stiffness: float, fit: Fit, off_axis: str
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


class _Strips(NamedTuple):
    """Which tests are of strips along a fibre; masks (test_count,)."""

    along_1: np.ndarray
    along_2: np.ndarray
    orientation: np.ndarray  # (test_count,) [rad], those along a fibre exactly

    @property
    def between(self) -> np.ndarray:
        return ~(self.along_1 | self.along_2)


def _strips(tests: Cantilever, file) -> _Strips:
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
    return _Strips(along_1, along_2, orientation)


def _first_estimate(
    stiffness: np.ndarray, tests: Cantilever, strips: _Strips, off_axis: str, file
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
