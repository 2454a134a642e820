"""Relaxing compaction from plate-to-plate tests that hold their gap: law, shares, relaxation times.

All rows of all tests are fitted together: the law of compaction at rest, Eq. (23), and Maxwell
elements beside it (:mod:`lcmchain.materials.relaxation`), along the thickness as it was measured
over time. So the closing may be slow beside what relaxes. Of one, two or three elements the fewest
are taken that leave as little as one more would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from lcmchain.coupons.analytic import compaction_strain
from lcmchain.identification.compaction import identify_compaction
from lcmchain.identification.data import CouponData
from lcmchain.identification.lack_of_fit import lack_of_fit
from lcmchain.identification.regression import (
    Fit,
    coefficient_of_determination,
    exponential,
    fit_nonlinear,
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
from lcmchain.materials.compaction import compaction_of

TIME = "time"
MINIMUM_ROWS = 6  # of a hold
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
        own = data["thickness"][rows]
        still = own <= own.min() * (1.0 + HELD)
        first = len(rows) - int(np.argmin(still[::-1])) if not still.all() else len(rows)
        held[rows[first:]] = len(rows) - first >= MINIMUM_ROWS
    return held


def identify_relaxing_compaction(
    data: CouponData,
    *,
    thickness: float,
    noise_floor: float = 0.001,
    accept: bool = False,
    **rest: Any,
) -> Identification:
    """Identify c0, c1, c2 of the law at rest, and shares and times of what relaxes.

    Parameters are those of :func:`~lcmchain.identification.compaction.identify_compaction`; the
    data have a time [s], and hold their thickness in the end (:func:`held_rows`).

    Raises
    ------
    InputError : what the law of the closing refuses.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    held = held_rows(data)
    closing = identify_compaction(
        data.keep(~held), thickness=thickness, noise_floor=noise_floor, accept=True, **rest
    )
    below = data.keep(data["thickness"] < thickness)
    start = np.array([closing[name].value for name in ("c0", "c1", "c2")])
    fit = _fewest(below, start, thickness, noise_floor)
    count = (len(fit.parameters) - 3) // 2
    lack = lack_of_fit(below[TIME], below["pressure"], fit.model, below.specimen)
    fit = replace(fit, blocks=lack.blocks)
    parameters = _parameters(fit, count)
    told = {own.name: own.value for own in parameters}
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
        panels=_panels(below, fit),
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


def _panels(below: CouponData, fit: Fit) -> tuple[Panel, ...]:
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
