"""Compaction of a fabric from plate-to-plate tests: at rest, Eq. (23) and (24), and what relaxes.

Tests that only close tell the compaction law, Eq. (23), and the power law, Eq. (24). Tests that
hold their gap in the end tell the relaxation too. All rows of all tests are then fitted together:
the law of compaction at rest and Maxwell elements beside it
(:mod:`lcmchain.materials.features.relaxation`), along the thickness as it was measured over time.
The closing may therefore be slow against the relaxation. The fit has the fewest of one, two or
three elements that leave as little scatter as one more would.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from lcmchain.coupons.analytic import (
    compaction_pressure,
    compaction_strain,
    power_law_fibre_volume_fraction,
    power_law_pressure,
)
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData, require_unlike
from lcmchain.identification.regression import (
    Fit,
    LackOfFit,
    coefficient_of_determination,
    exponential,
    falling_row,
    fit_nonlinear,
    lack_of_fit,
    longest_range,
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
from lcmchain.materials.features.compaction import compaction_of
from lcmchain.quantities.units import FRACTION, LENGTH, PRESSURE

COLUMNS = ((Column("thickness", LENGTH, loading=-1), Column("pressure", PRESSURE)),)
FRACTION_NAME = "fibre volume fraction"
#: Rows that tell the fibre volume fraction in place of the thickness (:func:`with_thickness`).
FRACTION_COLUMNS = ((Column(FRACTION_NAME, FRACTION, loading=1), Column("pressure", PRESSURE)),)
MINIMUM_ROWS = 6
#: c0, c1 and c2.
COEFFICIENT_COUNT = 3
# Part of the largest pressure by which noise may take a reading of none below zero.
LARGEST_PULL = 0.1
# Bounds of the scene for c2, and of c1 0.5^c2, the exponent at full compaction.
_GROWTH_EXPONENT = (1.0, 10.0)
_LARGEST_EXPONENT = 200.0


def identify_compaction(
    data: CouponData,
    *,
    thickness: float,
    solid_height: float,
    noise_floor: float = 0.001,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify c0, c1, c2 of p = λ|S33|, and A, B of Φ = A (p/kPa)^B, from the same data.

    For a given c2 the logarithm of the law is linear in ln c0 and c1: the start comes from a
    search over c2 alone, and trust-region least squares of the pressure ends it.

    Parameters
    ----------
    data : columns thickness [m] and pressure [Pa].
    thickness : thickness t0 of the unloaded fabric [m].
    solid_height : areal mass / fibre density [m].
    noise_floor : smallest noise of the pressure relative to the largest pressure.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where the pressure falls or the law misses it systematically;
        the intervals are then those of the misfit.

    Raises
    ------
    InputError : no pressure, a thickness that is not positive, a pressure far below zero, or too
        few rows below t0.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    below, warnings = _loaded_rows(data, thickness)
    pressure = below["pressure"]
    fit = _fit_law(below, thickness, noise_floor)
    judgement = _judge(below, fit, thickness, noise_floor)
    fit = replace(fit, blocks=judgement.lack.blocks)
    low, high = _GROWTH_EXPONENT
    parameters = (
        _positive("c0", "Pa", fit, 0),
        _positive("c1", "1", fit, 1),
        _plain("c2", "1", fit, 2),
    )
    c0, c1, c2 = (p.value for p in parameters)
    experimental = _fit_power_law(data, solid_height, noise_floor)
    derived = (_positive("A", "1", experimental, 0), _positive("B", "1", experimental, 1))
    warnings += general_warnings(parameters, fit.residuals, below.specimen)
    if fit.constrained:
        warnings.append(f"c2 stops at a bound of the scene, {low:g} to {high:g}")
    if c1 * 0.5**c2 > _LARGEST_EXPONENT:
        warnings.append(
            f"the stiffness would grow by exp({c1 * 0.5**c2:.0f}) up to full compaction, which a "
            "scene does not take; test up to higher pressure"
        )
    result = Identification(
        law="compaction",
        method="least squares of the pressure p = t/t0 |S33|, start from a search over c2",
        noise_model="independent errors of the pressure, relative to it, at least "
        f"{100 * noise_floor:g} % of the largest pressure; thickness taken as exact",
        interval_method="Student's t from the Jacobian, in ln c0, ln c1 and c2",
        inputs=inputs,
        parameters=parameters,
        derived=derived,
        scene_table="material.compaction",
        scene_entries={
            "c0": f'"{mega_pascal(c0)}"',
            "c1": f"{c1:.10g}",
            "c2": f"{c2:.10g}",
        },
        correlation=fit.correlation(),
        condition=fit.condition,
        relative_noise=fit.scale,
        r_squared=coefficient_of_determination(pressure, fit.model),
        point_count=len(pressure),
        warnings=tuple(warnings),
        panels=_panels(data, below, fit, experimental, thickness, solid_height, judgement.lack),
        objections=judgement.objections,
        holds=judgement.holds,
    )
    return accepted(result, data.file, accept)


def _loaded_rows(data: CouponData, thickness: float) -> tuple[CouponData, list[str]]:
    """Return the rows below the thickness t0 [m], and what is said of the others.

    Raises
    ------
    InputError : no pressure, a thickness that is not positive, a pressure far below zero, or too
        few rows.
    """
    wrong = np.flatnonzero(data["thickness"] <= 0.0)
    if len(wrong):
        raise data.wrong("thickness", wrong[0], "must be positive")
    if data["pressure"].max() <= 0.0:
        raise InputError("the pressure is nowhere positive", file=data.file)
    pulled = np.flatnonzero(data["pressure"] < -LARGEST_PULL * data["pressure"].max())
    if len(pulled):
        raise data.wrong("pressure", pulled[0], "is negative; remove or correct it")
    loaded = data["thickness"] < thickness
    below = data.keep(loaded)
    if len(below.lines) < MINIMUM_ROWS:
        raise InputError(
            f"only {len(below.lines)} rows lie below the initial thickness "
            f"{thickness * 1e3:g} mm, at least {MINIMUM_ROWS} are needed; check --thickness and "
            "the unit",
            file=data.file,
        )
    require_unlike(
        below, below["thickness"], COEFFICIENT_COUNT,
        loads="pressures", places="thicknesses", test="closing",
    )  # fmt: skip
    if loaded.all():
        return below, []
    return below, [
        f"{np.count_nonzero(~loaded)} rows at or above the thickness t0 = "
        f"{thickness * 1e3:g} mm do not enter the law, which carries no pressure there"
    ]


def with_thickness(data: CouponData, solid_height: float) -> CouponData:
    """Return rows with the thickness [m] that their fibre volume fraction tells.

    solid_height : areal mass / fibre density [m].

    Raises
    ------
    InputError : a fraction that is not between 0 and 1.
    """
    fraction = data[FRACTION_NAME]
    wrong = np.flatnonzero((fraction <= 0.0) | (fraction >= 1.0))
    if len(wrong):
        raise data.wrong(FRACTION_NAME, wrong[0], "must lie between 0 and 1; write [%] of percents")
    return replace(data, columns={**data.columns, "thickness": solid_height / fraction})


def _fit_law(below: CouponData, thickness: float, noise_floor: float) -> Fit:
    """Fit ln c0, ln c1 and c2 to the pressures below the initial thickness."""
    stretch, pressure = below["thickness"] / thickness, below["pressure"]

    def law(theta):
        c0, c1, c2 = exponential(theta[0]), exponential(theta[1]), theta[2]
        return compaction_pressure(stretch, c0, c1, c2)

    low, high = _GROWTH_EXPONENT
    return fit_nonlinear(
        law, _start(stretch, pressure, noise_floor), pressure, noise_floor,
        bounds=([-np.inf, -np.inf, low], [np.inf, np.inf, high]),
    )  # fmt: skip


@dataclass(frozen=True)
class _Judgement:
    """Whether the law describes the pressures, and over which thicknesses."""

    lack: LackOfFit
    objections: tuple[str, ...]
    holds: str


def _judge(below: CouponData, fit: Fit, thickness: float, noise_floor: float) -> _Judgement:
    closed = -below["thickness"]  # rises while the plates close

    def lack_of(data: CouponData, fit: Fit) -> LackOfFit:
        return lack_of_fit(-data["thickness"], data["pressure"], fit.model, data.specimen)

    def holds(rows) -> bool:
        data = below.keep(rows)
        if falling_row(data["pressure"], data.specimen) is not None:
            return False
        if np.count_nonzero(data["pressure"] > noise_floor * data["pressure"].max()) < MINIMUM_ROWS:
            return False
        return not lack_of(data, _fit_law(data, thickness, noise_floor)).is_systematic

    lack, objections = lack_of(below, fit), []
    fallen = falling_row(below["pressure"], below.specimen)
    if fallen is not None:
        one = below.specimen[: fallen + 1] == below.specimen[fallen]
        peak = below["pressure"][: fallen + 1][one].max()
        objections.append(
            f"the pressure falls from {1e-6 * peak:.4g} MPa to "
            f"{1e-6 * below['pressure'][fallen]:.4g} MPa at line {below.lines[fallen]} while the "
            "plates close: keep only the loading branch"
        )
    if lack.is_systematic:
        objections.append(lack.text("the law", "the thickness", "mm", -1e3))
    if not objections:
        return _Judgement(lack, (), "")
    rows = longest_range(closed, holds, MINIMUM_ROWS, from_start_only=False)
    if rows is None:
        return _Judgement(
            lack, tuple(objections),
            "no range of thicknesses is described; check the data and --thickness",
        )  # fmt: skip
    kept = 1e3 * below["thickness"][rows]
    return _Judgement(
        lack, tuple(objections),
        f"a fit of the rows from {kept.max():.4g} mm to {kept.min():.4g} mm describes them; remove "
        "the others",
    )  # fmt: skip


def _start(stretch, pressure, floor) -> np.ndarray:
    strain = -compaction_strain(stretch)
    usable = pressure > floor * pressure.max()
    rhs = np.log(pressure[usable] / (stretch * strain)[usable])

    def linear(c2):
        design = np.stack([np.ones(len(rhs)), strain[usable] ** c2], axis=-1)
        (ln_c0, c1), *_ = np.linalg.lstsq(design, rhs, rcond=None)
        return ln_c0, c1, np.sum((rhs - design @ (ln_c0, c1)) ** 2)

    c2 = minimize_scalar(lambda c: linear(c)[2], bounds=_GROWTH_EXPONENT, method="bounded").x
    ln_c0, c1, _ = linear(c2)
    # Data that soften would ask for c1 < 0, which the law does not allow.
    return np.array([ln_c0, math.log(max(c1, 1e-3)), np.clip(c2, 1.01, 9.9)])


def _fit_power_law(data: CouponData, solid_height: float, floor: float) -> Fit:
    thickness, pressure = data["thickness"], data["pressure"]
    usable = pressure > floor * pressure.max()
    ln_fraction = np.log(solid_height / thickness[usable])
    slope, intercept = np.polyfit(np.log(pressure[usable] / 1e3), ln_fraction, 1)
    return fit_nonlinear(
        lambda theta: power_law_pressure(thickness, *np.exp(theta), solid_height),  # type: ignore[call-arg]
        np.array([intercept, math.log(max(slope, 1e-3))]), pressure, floor,
    )  # fmt: skip


def _positive(name: str, unit: str, fit: Fit, index: int) -> Parameter:
    """Parameter that was fitted by its logarithm."""
    value, half = fit.parameters[index], fit.half_widths()[index]
    low, high = exponential(value - half), exponential(value + half)
    return Parameter(name, exponential(value), unit, low, high)


def _plain(name: str, unit: str, fit: Fit, index: int) -> Parameter:
    value, half = float(fit.parameters[index]), float(fit.half_widths()[index])
    return Parameter(name, value, unit, value - half, value + half)


def _panels(data, below, fit: Fit, experimental: Fit, thickness, solid_height, lack: LackOfFit):
    ln_c0, ln_c1, c2 = fit.parameters
    law = (math.exp(ln_c0), math.exp(ln_c1), c2)
    A, B = np.exp(experimental.parameters)
    t = np.linspace(min(thickness * 0.998, data["thickness"].max()), data["thickness"].min(), 200)
    curve = compaction_pressure(t / thickness, *law)
    strain = -compaction_strain(t / thickness)
    # Relative band of the law from the gradient of ln p in (ln c0, ln c1, c2).
    exponent = law[1] * strain**c2
    gradient = np.stack([np.ones_like(strain), exponent, exponent * np.log(strain)], axis=-1)
    variance = np.einsum("ni,ij,nj->n", gradient, fit.covariance, gradient)
    ratio = np.exp(fit.student * np.sqrt(variance)) * (1.0 + lack.widening(-t))
    millimetres = 1e3 * t
    strain_data = -compaction_strain(below["thickness"] / thickness)
    stiffness_data = below["pressure"] * thickness / below["thickness"] / strain_data
    stiffness = law[0] * np.exp(exponent)
    loaded = data["pressure"] > 0.0
    pressure = np.geomspace(data["pressure"][loaded].min(), data["pressure"].max(), 100)
    power = 1e-6 * power_law_pressure(t, A, B, solid_height)
    return (
        Panel(
            "thickness [mm]", "pressure [MPa]",
            (Points(1e3 * data["thickness"][loaded], 1e-6 * data["pressure"][loaded], "measured",
                    data.specimen[loaded]),),
            (Band(millimetres, 1e-6 * curve, "fit, Eq. (23)", 1e-6 * curve / ratio,
                  1e-6 * curve * ratio),
             Band(millimetres, power, "power law, Eq. (24)", dashed=True)),
            log_y=True,
        ),
        Panel(
            "compressive strain |E33|", "compaction stiffness C33 [MPa]",
            (Points(strain_data, 1e-6 * stiffness_data, "measured", below.specimen),),
            (Band(strain, 1e-6 * stiffness, "law", 1e-6 * stiffness / ratio,
                  1e-6 * stiffness * ratio),),
            log_y=True,
        ),
        Panel(
            "thickness [mm]", "residual [%]",
            (Points(1e3 * below["thickness"], 100.0 * fit.residuals, "measured", below.specimen),),
            is_residual=True,
        ),
        Panel(
            "pressure [kPa]", "fibre volume fraction",
            (Points(1e-3 * data["pressure"][loaded], (solid_height / data["thickness"])[loaded],
                    "measured", data.specimen[loaded]),),
            (Band(1e-3 * curve, solid_height / t, "fit, Eq. (23)"),
             Band(1e-3 * pressure, power_law_fibre_volume_fraction(pressure, A, B),
                  "power law, Eq. (24)", dashed=True)),
            log_x=True,
        ),
    )  # fmt: skip


# --- what relaxes ---------------------------------------------------------------------------------


TIME = "time"
_ROWS_OF_A_HOLD = 6
# Rows whose thickness is within this part of the smallest are held.
HELD = 0.003
MOST_ELEMENTS = 3
# One element more must leave at least so much less of the scatter.
WORTH = 0.95
# Logarithms of shares and relaxation times over that of the hold.
BOUNDS = (-7.0, 3.0)


def held_rows(data: CouponData) -> np.ndarray:
    """Tell which rows belong to a hold at the end of their test; none without a time."""
    held = np.zeros(len(data.lines), dtype=bool)
    if TIME not in data:
        return held
    for number in np.unique(data.specimen):
        rows = np.flatnonzero(data.specimen == number)
        thickness = data["thickness"][rows]
        still = thickness <= thickness.min() * (1.0 + HELD)
        first = len(rows) - int(np.argmin(still[::-1])) if not still.all() else len(rows)
        held[rows[first:]] = len(rows) - first >= _ROWS_OF_A_HOLD
    return held


def identify_relaxing_compaction(
    data: CouponData,
    *,
    thickness: float,
    solid_height: float,
    noise_floor: float = 0.001,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify c0, c1, c2 of the law at rest, and shares and times of what relaxes.

    Parameters are those of :func:`identify_compaction`; the data have a time [s], and hold their
    thickness in the end (:func:`held_rows`).

    Raises
    ------
    InputError : what the law of the closing refuses.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    held = held_rows(data)
    closing = identify_compaction(
        data.keep(~held), thickness=thickness, solid_height=solid_height,
        noise_floor=noise_floor, inputs=inputs, accept=True,
    )  # fmt: skip
    below = data.keep(data["thickness"] < thickness)
    start = np.array([closing[name].value for name in ("c0", "c1", "c2")])
    fit = _fewest(below, start, thickness, noise_floor)
    count = (len(fit.parameters) - 3) // 2
    lack = lack_of_fit(below[TIME], below["pressure"], fit.model, below.specimen)
    fit = replace(fit, blocks=lack.blocks)
    parameters = _parameters(fit, count)
    told = {parameter.name: parameter.value for parameter in parameters}
    objections = (lack.text("the law", "the time", "s"),) if lack.is_systematic else ()
    warnings = [*general_warnings(parameters, fit.residuals, below.specimen)]
    longest = max(told[f"relaxation_time_{k + 1}"] for k in range(count))
    duration = _longest_hold(below)
    if longest > duration:
        warnings.append(
            f"the longest relaxation time, {longest:.3g} s, is beyond the hold of "
            f"{duration:.3g} s: what the fabric bears at rest is extrapolated; hold longer"
        )
    shares = ", ".join(
        f"{{ share = {told[f'share_{k + 1}']:.6g}, "
        f'relaxation_time = "{told[f"relaxation_time_{k + 1}"]:.6g} s" }}'
        for k in range(count)
    )
    result = replace(
        closing,
        method="least squares of the pressure of closing and hold together, along the thickness "
        f"over time; {count} relaxing parts",
        interval_method="Student's t from the Jacobian, in logarithms but for c2",
        parameters=parameters,
        derived=(),
        scene_table="material",
        scene_entries={
            "compaction.c0": f'"{mega_pascal(told["c0"])}"',
            "compaction.c1": f"{told['c1']:.10g}",
            "compaction.c2": f"{told['c2']:.10g}",
            "viscous.compaction": f"[{shares}]",
        },
        correlation=fit.correlation(),
        condition=fit.condition,
        relative_noise=fit.scale,
        r_squared=coefficient_of_determination(below["pressure"], fit.model),
        point_count=len(below.lines),
        warnings=tuple(warnings),
        panels=_panels_over_time(below, fit),
        objections=objections,
        holds="keep a shorter hold, or tests of like speed" if objections else "",
    )
    return accepted(result, data.file, accept)


def _longest_hold(data: CouponData) -> float:
    held = held_rows(data)
    return max(
        float(np.ptp(data[TIME][held & (data.specimen == number)]))
        for number in np.unique(data.specimen[held])
    )


def _fewest(below: CouponData, start: np.ndarray, thickness: float, noise_floor: float) -> Fit:
    """Return the fit with the fewest elements that leaves as little as one more would."""
    duration = _longest_hold(below)
    fits: list[Fit] = []
    for count in range(1, MOST_ELEMENTS + 1):
        times = duration * np.geomspace(0.02, 0.5, count + 2)[1:-1]
        shares = np.full(count, 0.5 / count)
        theta = [*np.log([start[0] / 1.5, start[1]]), start[2], *np.log(shares), *np.log(times)]
        low = [-np.inf, -np.inf, 1.0, *[BOUNDS[0]] * count, *[np.log(duration) + BOUNDS[0]] * count]
        high = [np.inf, np.inf, 10.0, *[BOUNDS[1]] * count]
        high += [np.log(duration) + BOUNDS[1]] * count
        fits.append(
            fit_nonlinear(
                _model(below, thickness, count), np.array(theta), below["pressure"], noise_floor,
                bounds=(low, high),
            )
        )  # fmt: skip
        if count > 1 and fits[-1].scale > WORTH * fits[-2].scale:
            return fits[-2]
    return fits[-1]


def _model(below: CouponData, thickness: float, count: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return the pressures [Pa] of the rows as a function of ln c0, ln c1, c2, ln r and ln l."""
    stretch = below["thickness"] / thickness
    strain = compaction_strain(stretch)
    size = np.diff(below[TIME], prepend=below[TIME][0])
    first = np.diff(below.specimen, prepend=-1) != 0

    def pressure(theta: np.ndarray) -> np.ndarray:
        law = compaction_of(np.exp(theta[0]), np.exp(theta[1]), theta[2], strain)[0]
        shares, times = np.exp(theta[3 : 3 + count]), np.exp(theta[3 + count :])
        h, total = np.zeros(count), np.zeros(len(law))
        for k in range(len(law)):
            if first[k]:
                h = shares * law[k]  # closed at once as far as the first row
            else:
                x = size[k] / times
                h = np.exp(-x) * h - shares * np.expm1(-x) / x * (law[k] - law[k - 1])
            total[k] = law[k] + h.sum()
        return -stretch * total

    return pressure


def _parameters(fit: Fit, count: int) -> tuple[Parameter, ...]:
    names = ["c0", "c1", "c2", *(f"share_{k + 1}" for k in range(count))]
    names += [f"relaxation_time_{k + 1}" for k in range(count)]
    units = ["Pa", "1", "1", *["1"] * count, *["s"] * count]
    found = []
    for name, unit, value, half in zip(
        names, units, fit.parameters, fit.half_widths(), strict=True
    ):
        ends = (value, value - half, value + half)
        v, low, high = ends if name == "c2" else map(exponential, ends)
        found.append(Parameter(name, float(v), unit, float(low), float(high)))
    return tuple(found)


def _panels_over_time(below: CouponData, fit: Fit) -> tuple[Panel, ...]:
    """Return pressure over time and over thickness, and the residual."""
    time, p = below[TIME], 1e-6 * below["pressure"]
    curve = 1e-6 * fit.model
    t = 1e3 * below["thickness"]
    measured = Points(time, p, "measured", below.specimen)
    return (
        Panel("time [s]", "pressure [MPa]", (measured,), (Band(time, curve, "fit"),)),
        Panel(
            "thickness [mm]", "pressure [MPa]", (Points(t, p, "measured", below.specimen),),
            (Band(t, curve, "fit"),), log_y=True,
        ),
        Panel(
            "time [s]", "residual [%]",
            (Points(time, 100.0 * fit.residuals, "measured", below.specimen),), is_residual=True,
        ),
    )  # fmt: skip
