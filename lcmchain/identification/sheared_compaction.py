"""Shear-compaction coupling β from plate-to-plate tests of sheared fabric.

The rows without shear give the compaction law, those with shear one more number. Plates measure the
pressure on the present area, that on the area at the start over cos γ
(:mod:`lcmchain.materials.shear_compaction`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lcmchain.coupons.analytic import compaction_pressure
from lcmchain.errors import InputError
from lcmchain.identification.compaction import COLUMNS, identify_compaction
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.lack_of_fit import lack_of_fit
from lcmchain.identification.regression import Fit, coefficient_of_determination, fit_nonlinear
from lcmchain.identification.result import (
    Band,
    Identification,
    Panel,
    Parameter,
    Points,
    accepted,
)
from lcmchain.quantities.units import ANGLE

SHEAR_ANGLE = "shear angle"
SHEARED_COLUMNS = ((*COLUMNS[0], Column(SHEAR_ANGLE, ANGLE)),)
# What is sheared less than this counts as unsheared: cos γ is within 1e-3 of 1.
LEAST_SHEAR = math.radians(2.0)
LARGEST_SHEAR = math.radians(80.0)
LARGEST_COUPLING = 2.0
MINIMUM_ROWS = 4
EACH_ANGLE = "the law of the unsheared rows holds; --table takes every angle by itself"


def sheared_pressure(
    stretch: np.ndarray, shear_angle: np.ndarray, law: Sequence[float], beta: float
) -> np.ndarray:
    """Return the pressure [Pa] on the present area at stretches t/t0 and shear angles [rad]."""
    thinner = np.cos(shear_angle) ** beta
    return thinner * compaction_pressure(thinner * stretch, *law) / np.cos(shear_angle)


def unsheared_law(data: CouponData, **options: Any) -> tuple[Identification, np.ndarray]:
    """Return the law of the unsheared rows, and which rows are sheared; for parameters see below.

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
    if np.count_nonzero(sheared) < MINIMUM_ROWS:
        raise InputError(
            f"has {np.count_nonzero(sheared)} sheared rows; at least {MINIMUM_ROWS} are needed",
            file=data.file,
        )
    return identify_compaction(data.keep(~sheared), **options), sheared


def identify_sheared_compaction(
    data: CouponData,
    *,
    thickness: float,
    noise_floor: float = 0.001,
    accept: bool = False,
    **rest: Any,
) -> Identification:
    """Identify c0, c1, c2 from the unsheared rows, and β from all of them.

    Parameters
    ----------
    data : columns thickness [m], pressure [Pa] and shear angle [rad].
    thickness : thickness t0 of the unloaded, unsheared fabric [m].
    noise_floor, accept, rest : as of
        :func:`~lcmchain.identification.compaction.identify_compaction`.

    Raises
    ------
    InputError : a shear angle out of range, no rows without shear, or too few with it.
    FitRefusedError : law or coupling does not describe the data, and ``accept`` is not given.
    """
    plain, sheared = unsheared_law(
        data, thickness=thickness, noise_floor=noise_floor, accept=accept, **rest
    )
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
        panels=(*plain.panels, _panel(rows, thickness, law, beta)),
        objections=tuple(objections),
        holds=plain.holds or (EACH_ANGLE if objections else ""),
    )
    return accepted(result, data.file, accept)


def _fit_all(data: CouponData, thickness: float, law: Any, noise_floor: float) -> Fit:
    """Fit β with the law free to follow all rows, so that its interval holds that of the law.

    The parameters are the logarithms of c0, c1, c2 over those of ``law``, and β.
    """
    free = thickness / np.cos(data[SHEAR_ANGLE]) ** LARGEST_COUPLING
    rows = data.keep(data["thickness"] < free)
    stretch, gamma = rows["thickness"] / thickness, np.abs(rows[SHEAR_ANGLE])

    def model(theta: np.ndarray) -> np.ndarray:
        own = tuple(np.multiply(law, np.exp(theta[:3])))
        return sheared_pressure(stretch, gamma, own, theta[3])

    return fit_nonlinear(
        model, np.array([0.0, 0.0, 0.0, 0.5]), rows["pressure"], noise_floor,
        bounds=([-2.0, -2.0, -0.5, 0.0], [2.0, 2.0, 0.5, LARGEST_COUPLING]),
    )  # fmt: skip


def _panel(rows: CouponData, thickness: float, law: Any, beta: float) -> Panel:
    """Return thickness against pressure at each of the shear angles."""
    degrees = np.round(np.degrees(np.abs(rows[SHEAR_ANGLE])), 1)
    points, curves = [], []
    for angle in np.unique(degrees):
        own = degrees == angle
        t = rows["thickness"][own]
        points.append(Points(1e3 * t, 1e-6 * rows["pressure"][own], f"{angle:g} deg"))
        grid = np.linspace(t.max(), t.min(), 100)
        pressure = sheared_pressure(grid / thickness, np.radians(angle), law, beta)
        curves.append(Band(1e3 * grid, 1e-6 * pressure, f"β = {beta:.3g}"))
    return Panel("thickness [mm]", "pressure [MPa]", tuple(points), tuple(curves), log_y=True)
