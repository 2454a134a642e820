"""Compaction of sheared fabric from plate-to-plate tests: a coupling β, or a table of pressures.

The rows without shear give the compaction law, those with shear one more number, the exponent β.
Plates measure the pressure on the present area, that on the area at the start over cos γ
(:mod:`lcmchain.materials.features.shear_compaction`).

Where one exponent does not describe how the shear changes the compaction, every angle has a curve
of its own, Eq. (23) from its own free thickness. Points of these curves are the table that
``material.compaction.table`` takes (:mod:`lcmchain.materials.features.pressure_table`): measured
rows carry noise, which a law that meets its points would follow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupons.analytic import compaction_pressure
from lcmchain.errors import InputError
from lcmchain.identification.compaction import COLUMNS, identify_compaction
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.regression import (
    Fit,
    coefficient_of_determination,
    exponential,
    fit_nonlinear,
    lack_of_fit,
)
from lcmchain.identification.result import (
    Band,
    Identification,
    Panel,
    Parameter,
    Points,
    accepted,
    mega_pascal,
)
from lcmchain.materials.features.pressure_curves import (
    LARGEST_ANGLE,
    MOST_ANGLES,
    MOST_PRESSURES,
    PressureCurve,
)
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.quantities.units import ANGLE

SHEAR_ANGLE = "shear angle"
SHEARED_COLUMNS = ((*COLUMNS[0], Column(SHEAR_ANGLE, ANGLE)),)
# What is sheared less than this counts as unsheared: cos γ is within 1e-3 of 1.
LEAST_SHEAR = math.radians(2.0)
LARGEST_SHEAR = math.radians(80.0)
LARGEST_COUPLING = 2.0
_SHEARED_ROWS = 4
EACH_ANGLE = "the law of the unsheared rows holds; --table takes every angle by itself"


def sheared_pressure(
    stretch: np.ndarray, shear_angle: np.ndarray, law: Sequence[float], beta: float
) -> np.ndarray:
    """Return the pressure [Pa] on the present area at stretches t/t0 and shear angles [rad]."""
    thinner = np.cos(shear_angle) ** beta
    return thinner * compaction_pressure(thinner * stretch, *law) / np.cos(shear_angle)


def _unsheared_law(
    data: CouponData,
    thickness: float,
    solid_height: float,
    noise_floor: float,
    inputs: tuple,
    accept: bool,
) -> tuple[Identification, np.ndarray]:
    """Return the law of the unsheared rows, and which rows are sheared.

    Parameters are those of :func:`~lcmchain.identification.compaction.identify_compaction`.

    Raises
    ------
    InputError : a shear angle out of range, no rows without shear, or too few with it.
    FitRefusedError : the law does not describe its rows, and ``accept`` is not given.
    """
    angle = np.abs(data[SHEAR_ANGLE])
    wrong = np.flatnonzero(angle > LARGEST_SHEAR)
    if wrong.size:
        raise data.wrong(SHEAR_ANGLE, wrong[0], "is more than 80 deg")
    sheared = angle >= LEAST_SHEAR
    if sheared.all():
        raise InputError(
            "has no rows without shear, which give the compaction law; add a test at 0 deg",
            file=data.file,
        )
    if np.count_nonzero(sheared) < _SHEARED_ROWS:
        raise InputError(
            f"has {np.count_nonzero(sheared)} sheared rows; at least {_SHEARED_ROWS} are needed",
            file=data.file,
        )
    law = identify_compaction(
        data.keep(~sheared), thickness=thickness, solid_height=solid_height,
        noise_floor=noise_floor, inputs=inputs, accept=accept,
    )  # fmt: skip
    return law, sheared


def identify_sheared_compaction(
    data: CouponData,
    *,
    thickness: float,
    solid_height: float,
    noise_floor: float = 0.001,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify c0, c1, c2 from the unsheared rows, and β from all of them.

    Parameters
    ----------
    data : columns thickness [m], pressure [Pa] and shear angle [rad].
    thickness : thickness t0 of the unloaded, unsheared fabric [m].
    solid_height, noise_floor, inputs, accept : as of
        :func:`~lcmchain.identification.compaction.identify_compaction`.

    Raises
    ------
    InputError : a shear angle out of range, no rows without shear, or too few with it.
    FitRefusedError : law or coupling does not describe the data, and ``accept`` is not given.
    """
    plain, sheared = _unsheared_law(data, thickness, solid_height, noise_floor, inputs, accept)
    law = tuple(plain[name].value for name in ("c0", "c1", "c2"))
    fit = _fit_all(data, thickness, law, noise_floor)
    beta, half = float(fit.parameters[3]), float(fit.half_widths()[3])
    rows = data.keep(sheared)
    stretch, gamma = rows["thickness"] / thickness, np.abs(rows[SHEAR_ANGLE])
    model = sheared_pressure(stretch, gamma, law, beta)
    lack = lack_of_fit(gamma, rows["pressure"], model, rows.specimen)
    objections = list(plain.objections)
    if lack.is_systematic:
        objections.append(lack.text("the coupling", "the shear angle", "deg", 180.0 / math.pi))
    warnings = list(plain.warnings)
    if fit.constrained or not 1e-6 < beta < LARGEST_COUPLING - 1e-6:
        warnings.append(f"the coupling stops at a bound of the scene, 0 to {LARGEST_COUPLING:g}")
    count = len(plain.parameters)
    correlation = np.eye(count + 1)
    correlation[:count, :count] = plain.correlation
    result = replace(
        plain,
        method=f"{plain.method}; coupling by least squares of all rows",
        parameters=(
            *plain.parameters,
            Parameter("shear_coupling", beta, "1", beta - half, beta + half),
        ),
        scene_entries={**plain.scene_entries, "shear_coupling": f"{beta:.4g}"},
        correlation=correlation,
        point_count=plain.point_count + len(gamma),
        r_squared=min(plain.r_squared, coefficient_of_determination(rows["pressure"], model)),
        relative_noise=max(plain.relative_noise, fit.scale),
        warnings=tuple(warnings),
        panels=(*plain.panels, _panel_of_coupling(rows, thickness, law, beta)),
        objections=tuple(objections),
        holds=plain.holds or (EACH_ANGLE if objections else ""),
    )
    return accepted(result, data.file, accept)


def _fit_all(data: CouponData, thickness: float, law: Sequence[float], noise_floor: float) -> Fit:
    """Fit β with the law free to follow all rows, so that its interval holds that of the law.

    The parameters are the logarithms of c0, c1, c2 over those of ``law``, and β.
    """
    free = thickness / np.cos(data[SHEAR_ANGLE]) ** LARGEST_COUPLING
    rows = data.keep(data["thickness"] < free)
    stretch, gamma = rows["thickness"] / thickness, np.abs(rows[SHEAR_ANGLE])

    def model(theta: np.ndarray) -> np.ndarray:
        varied = tuple(np.multiply(law, np.exp(theta[:3])))
        return sheared_pressure(stretch, gamma, varied, theta[3])

    return fit_nonlinear(
        model, np.array([0.0, 0.0, 0.0, 0.5]), rows["pressure"], noise_floor,
        bounds=([-2.0, -2.0, -0.5, 0.0], [2.0, 2.0, 0.5, LARGEST_COUPLING]),
    )  # fmt: skip


def _panel_of_coupling(
    rows: CouponData, thickness: float, law: Sequence[float], beta: float
) -> Panel:
    """Return thickness against pressure at each of the shear angles."""
    degrees = np.round(np.degrees(np.abs(rows[SHEAR_ANGLE])), 1)
    points, curves = [], []
    for angle in np.unique(degrees):
        at_angle = degrees == angle
        t = rows["thickness"][at_angle]
        points.append(Points(1e3 * t, 1e-6 * rows["pressure"][at_angle], f"{angle:g} deg"))
        grid = np.linspace(t.max(), t.min(), 100)
        pressure = sheared_pressure(grid / thickness, np.radians(angle), law, beta)
        curves.append(Band(1e3 * grid, 1e-6 * pressure, f"β = {beta:.3g}"))
    return Panel("thickness [mm]", "pressure [MPa]", tuple(points), tuple(curves), log_y=True)


# --- a table of pressures -------------------------------------------------------------------------


_ROWS_OF_AN_ANGLE = 6
# Angles that differ by less are one [rad].
SAME_ANGLE = math.radians(1.0)
# The free thickness is sought from the thickest pressed row up to so many times it.
THICKEST = 1.5


class _Angle(NamedTuple):
    """Rows of one shear angle [rad], and the fit of their curve.

    theta of the fit : ln c0, ln c1, and ln of the free thickness over t0.
    """

    angle: float
    rows: CouponData
    fit: Fit


def identify_pressure_table(
    data: CouponData,
    *,
    thickness: float,
    solid_height: float,
    noise_floor: float = 0.001,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify c0, c1, c2 from the unsheared rows, and a table of pressures from all of them.

    Parameters are those of :func:`identify_sheared_compaction`.

    Raises
    ------
    InputError : too many angles, too few rows at one, or points of which no law can be made.
    FitRefusedError : a curve does not describe the rows of its angle, and ``accept`` is not given.
    """
    plain, is_sheared = _unsheared_law(data, thickness, solid_height, noise_floor, inputs, accept)
    law = np.array([plain[name].value for name in ("c0", "c1", "c2")])
    thinnest = float(data["thickness"][~is_sheared].min()) / thickness
    sheared = [
        _fitted(angle, rows, thickness, law, noise_floor)
        for angle, rows in _by_angle(data, is_sheared)
    ]
    curves = [_points(0.0, law, 1.0, thinnest), *(_curve(one, thickness, law) for one in sheared)]
    if fault := PressureTable(curves, *law).fault():
        raise InputError(f"gives a table that {fault}", file=data.file)
    objections = [*plain.objections, *filter(None, map(_objection, sheared))]
    pressure = np.concatenate([one.rows["pressure"] for one in sheared])
    model = np.concatenate([one.fit.model for one in sheared])
    result = replace(
        plain,
        method=f"{plain.method}; at each shear angle a curve of its own, given by points",
        derived=(*plain.derived, *map(_free_stretch, sheared)),
        scene_entries={**plain.scene_entries, "table": _entry(curves)},
        point_count=plain.point_count + len(pressure),
        r_squared=min(plain.r_squared, coefficient_of_determination(pressure, model)),
        relative_noise=max(plain.relative_noise, *(one.fit.scale for one in sheared)),
        panels=(*plain.panels, _panel_of_angles(sheared, thickness, law)),
        objections=tuple(objections),
        holds=plain.holds or ("the curves of the other angles hold" if objections else ""),
    )
    return accepted(result, data.file, accept)


def _by_angle(data: CouponData, is_sheared: np.ndarray) -> list[tuple[float, CouponData]]:
    """Return the shear angles [rad] and their rows, rising.

    Raises
    ------
    InputError : more angles, or larger ones, than a table takes, or too few rows at one.
    """
    angle = np.abs(data[SHEAR_ANGLE])
    order = np.sort(angle[is_sheared])
    starts = order[np.concatenate([[True], np.diff(order) > SAME_ANGLE])]
    if len(starts) >= MOST_ANGLES or order[-1] > LARGEST_ANGLE:
        raise InputError(
            f"has {len(starts)} shear angles up to {math.degrees(order[-1]):.4g} deg; keep "
            f"{MOST_ANGLES - 1} beside 0 deg, up to {math.degrees(LARGEST_ANGLE):g} deg",
            file=data.file,
        )
    number = np.searchsorted(starts, angle, side="right")
    found = []
    for k, start in enumerate(starts):
        at_angle = is_sheared & (number == k + 1)
        if np.count_nonzero(at_angle) < _ROWS_OF_AN_ANGLE:
            raise InputError(
                f"has {np.count_nonzero(at_angle)} rows at {math.degrees(start):.4g} deg; at least "
                f"{_ROWS_OF_AN_ANGLE} are needed",
                file=data.file,
            )
        found.append((float(angle[at_angle].mean()), data.keep(at_angle)))
    return found


def _pressure(stretch: np.ndarray, angle: float, theta: np.ndarray, c2: float) -> np.ndarray:
    """Return the pressure [Pa] on the present area of a curve at stretches t/t0."""
    free = exponential(theta[2])
    law = (exponential(theta[0]), exponential(theta[1]), c2)
    return compaction_pressure(stretch / free, *law) / (free * math.cos(angle))


def _fitted(
    angle: float, rows: CouponData, thickness: float, law: np.ndarray, noise_floor: float
) -> _Angle:
    """Return the curve of the rows of an angle."""
    stretch = rows["thickness"] / thickness
    thickest = math.log(stretch.max())
    start = np.array([*np.log(law[:2]), thickest + 0.05])
    fit = fit_nonlinear(
        lambda theta: _pressure(stretch, angle, theta, law[2]), start, rows["pressure"],
        noise_floor,
        bounds=([-np.inf, -np.inf, thickest - 0.2], [np.inf, np.inf, thickest + THICKEST]),
    )  # fmt: skip
    return _Angle(angle, rows, fit)


def _points(angle: float, law: np.ndarray, free: float, thinnest: float) -> PressureCurve:
    """Return points of a curve at equal steps of its strain, down to a stretch."""
    strain = 0.5 * ((thinnest / free) ** 2 - 1.0) * np.linspace(0.0, 1.0, 1 + MOST_PRESSURES)
    stretch = free * np.sqrt(1.0 + 2.0 * strain)
    theta = np.log([law[0], law[1], free])
    pressure = _pressure(stretch, angle, theta, law[2])
    return PressureCurve(angle, tuple(stretch), (0.0, *pressure[1:]))


def _curve(one: _Angle, thickness: float, law: np.ndarray) -> PressureCurve:
    c0, c1, free = np.exp(one.fit.parameters)
    thinnest = float(one.rows["thickness"].min()) / thickness
    return _points(one.angle, np.array([c0, c1, law[2]]), float(free), thinnest)


def _objection(one: _Angle) -> str:
    """Say where the curve of an angle misses its rows; empty where nowhere."""
    rows = one.rows
    lack = lack_of_fit(-rows["thickness"], rows["pressure"], one.fit.model, rows.specimen)
    if not lack.is_systematic:
        return ""
    return lack.text(f"the curve at {math.degrees(one.angle):.4g} deg", "the thickness", "mm", -1e3)


def _free_stretch(one: _Angle) -> Parameter:
    value, half = one.fit.parameters[2], one.fit.half_widths()[2]
    return Parameter(
        f"free_stretch_at_{math.degrees(one.angle):.0f}_deg", exponential(value), "1",
        exponential(value - half), exponential(value + half),
    )  # fmt: skip


def _entry(curves: list[PressureCurve]) -> str:
    """Return the table as scene text."""
    rows = [
        f'  {{ shear_angle = "{math.degrees(curve.shear_angle):.6g} deg", '
        f"stretch = [{', '.join(f'{stretch:.8g}' for stretch in curve.stretch)}], "
        f'pressure = "{mega_pascal(*curve.pressure)}" }},'
        for curve in curves
    ]
    return "\n".join(["[", *rows, "]"])


def _panel_of_angles(sheared: list[_Angle], thickness: float, law: np.ndarray) -> Panel:
    """Return thickness against pressure at each of the shear angles."""
    points, curves = [], []
    for one in sheared:
        t, name = one.rows["thickness"], f"{math.degrees(one.angle):.3g} deg"
        points.append(Points(1e3 * t, 1e-6 * one.rows["pressure"], name))
        grid = np.linspace(t.max(), t.min(), 100)
        pressure = _pressure(grid / thickness, one.angle, one.fit.parameters, law[2])
        curves.append(Band(1e3 * grid, 1e-6 * pressure, f"curve at {name}"))
    return Panel("thickness [mm]", "pressure [MPa]", tuple(points), tuple(curves), log_y=True)
