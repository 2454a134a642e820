"""Viscosity of a fabric's shear, with its shear polynomial, from picture frames at several speeds.

The force of a frame of pin-jointed, inextensible fibres is linear in s0 ... s4 and in η,

    S12 = Σ s_k |E12|^k 2 E12 + η γ'/cos γ,   γ' = d'/(L sin(45° - γ/2)),

with the speed d' of the machine along the diagonal of a frame of the side L
(:mod:`lcmchain.materials.viscous_shear`). Tests at one speed cannot tell both parts apart.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from lcmchain.coupons.analytic import PictureFrame, shear_strain
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.lack_of_fit import LackOfFit, lack_of_fit
from lcmchain.identification.regression import (
    Fit,
    coefficient_of_determination,
    fit_linear,
    noise_scale,
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
from lcmchain.identification.shear import (
    COEFFICIENT_COUNT,
    mean_secant,
    rising_stress,
)
from lcmchain.quantities.units import FORCE, LENGTH, SPEED

COLUMNS = (
    (Column("displacement", LENGTH, loading=1), Column("force", FORCE), Column("speed", SPEED)),
)
MINIMUM_ROWS = 12
# The fastest test over the slowest, at least: what is nearer tells the rate from the angle badly.
LEAST_SPEEDS_RATIO = 2.0
# Mean deviation of the tests at one rate that matters: a viscosity is there to tell rates apart.
TOLERANCE_OF_RATES = 0.03


def identify_viscous_shear(
    data: CouponData,
    specimen: PictureFrame,
    *,
    noise_floor: float = 0.01,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify shear polynomial and viscosity; the polynomial rises up to 90° as the scene demands.

    Parameters
    ----------
    data : columns displacement [m] along the diagonal, force [N] and speed [m/s] of the machine.
    specimen : side of frame and fabric, and thickness.
    noise_floor : smallest noise of the force relative to the largest force.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data.

    Raises
    ------
    InputError : a frame beyond 90°, a speed of zero, or speeds too near to each other.
    FitRefusedError : a constant viscosity does not describe the data, and ``accept`` is not given.
    """
    data = data.keep(data["displacement"] > 0.0)
    angle, force, speed = specimen.shear_angle(data["displacement"]), data["force"], data["speed"]
    beyond = np.flatnonzero(angle > math.radians(85.0))
    if beyond.size:
        raise data.wrong("displacement", beyond[0], "shears the frame by more than 85 deg")
    still = np.flatnonzero(speed <= 0.0)
    if still.size:
        raise data.wrong("speed", still[0], "is not above 0; a test that stands still relaxes")
    if len(force) < MINIMUM_ROWS or speed.max() < LEAST_SPEEDS_RATIO * speed.min():
        raise InputError(
            f"has speeds from {1e3 * speed.min():.4g} to {1e3 * speed.max():.4g} mm/s: shear law "
            f"and viscosity are told apart by speeds of a ratio of {LEAST_SPEEDS_RATIO:g} or more",
            file=data.file,
        )
    rate = rate_of(specimen, angle, speed)
    design = force_design(specimen, angle, rate)
    tangent, least = rising_stress(mean_secant(design, force))
    # and a viscosity is not negative
    bounds = (block_diag(tangent, 1.0), np.append(least, 0.0))
    free = fit_linear(design, force, noise_floor)
    fit = fit_linear(design, force, noise_floor, at_least=bounds)
    lacks = (
        lack_of_fit(angle, force, fit.model, data.specimen),
        lack_of_fit(rate, force, fit.model, data.specimen, tolerance=TOLERANCE_OF_RATES),
    )
    return accepted(
        _result(data, specimen, (angle, rate), free, fit, lacks, noise_floor, inputs),
        data.file,
        accept,
    )


def rate_of(specimen: PictureFrame, angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the rate of the shear angle [1/s] at speeds of the machine [m/s]."""
    return speed / (specimen.side * np.sin(0.25 * np.pi - 0.5 * angle))


def force_design(specimen: PictureFrame, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the force [N] per unit of s0 ... s4 and η, shape [point_count, 6]."""
    stresses = [2.0 * shear_strain(angle) ** (k + 1) for k in range(COEFFICIENT_COUNT)]
    stresses.append(rate / np.cos(angle))
    return np.stack([specimen.force(angle, lambda g, s=s: s) for s in stresses], axis=-1)  # type: ignore[misc]


def _result(
    data: CouponData,
    specimen: PictureFrame,
    abscissae: tuple[np.ndarray, np.ndarray],
    free: Fit,
    fit: Fit,
    lacks: tuple[LackOfFit, LackOfFit],
    noise_floor: float,
    inputs: tuple,
) -> Identification:
    force, (angle, rate) = data["force"], abscissae
    of_angle, of_rate = lacks
    objections = []
    if of_angle.is_systematic:
        objections.append(of_angle.text("the law", "the shear angle", "deg", 180.0 / math.pi))
    if of_rate.is_systematic:
        objections.append(of_rate.text("a constant viscosity", "the rate", "1/s"))
    blocks = next((own.blocks for own in lacks if own.blocks is not None), None)
    spread = replace(free, blocks=blocks)
    half = spread.half_widths()
    names = [*(f"s{k}" for k in range(COEFFICIENT_COUNT)), "viscosity"]
    parameters = tuple(
        Parameter(
            name,
            float(value),
            "Pa*s" if name == "viscosity" else "Pa",
            float(np.fmin(middle - width, value)),
            float(np.fmax(middle + width, value)),
        )
        for name, value, middle, width in zip(
            names, fit.parameters, free.parameters, half, strict=True
        )
    )
    residuals = (force - fit.model) / noise_scale(fit.model, force, noise_floor)
    warnings = general_warnings(parameters, residuals, data.specimen)
    if fit.constrained:
        warnings.append("a bound of the scene holds the fit: a rising stress, or no viscosity")
    viscosity = float(fit.parameters[-1])
    return Identification(
        law="viscous shear",
        method="least squares of the force of the frame, linear in s0 ... s4 and the viscosity",
        noise_model="independent errors of the force, relative to it, at least "
        f"{100 * noise_floor:g} % of the largest force",
        interval_method="Student's t, exact for the linear fit",
        inputs=inputs,
        parameters=parameters,
        derived=(),
        scene_table="material",
        scene_entries={
            "membrane.shear_polynomial": f'"{mega_pascal(*fit.parameters[:-1])}"',
            "membrane.shear_range": f'"{np.degrees(angle.max()):.4g} deg"',
            **({"viscous.viscosity": f'"{viscosity:.10g} Pa*s"'} if viscosity > 0.0 else {}),
        },
        correlation=spread.correlation(),
        condition=free.condition,
        relative_noise=float(np.sqrt(np.sum(residuals**2) / fit.degrees_of_freedom)),
        r_squared=coefficient_of_determination(force, fit.model),
        point_count=len(force),
        warnings=tuple(warnings),
        panels=_panels(data, specimen, fit, residuals, angle, rate),
        objections=tuple(objections),
        holds="tests whose rates lie nearer to each other may follow one viscosity; where it falls "
        "with the rate, fit each pair of speeds for itself and state material.viscous.cross"
        if objections
        else "",
    )


def _panels(data, specimen, fit: Fit, residuals, angle, rate) -> tuple[Panel, ...]:
    displacement, curves = data["displacement"], []
    for speed in np.unique(data["speed"])[:6]:
        own = np.linspace(0.0, displacement[data["speed"] == speed].max(), 101)[1:]
        turned = specimen.shear_angle(own)
        design = force_design(specimen, turned, rate_of(specimen, turned, speed))
        curves.append(Band(1e3 * own, design @ fit.parameters, f"fit, {1e3 * speed:.4g} mm/s"))
    return (
        Panel(
            "displacement [mm]", "force [N]",
            (Points(1e3 * displacement, data["force"], "measured", data.specimen),),
            tuple(curves),
        ),
        Panel(
            "shear angle [deg]", "residual [%]",
            (Points(np.degrees(angle), 100.0 * residuals, "measured", data.specimen),),
            is_residual=True,
        ),
        Panel(
            "rate [1/s]", "residual [%]",
            (Points(rate, 100.0 * residuals, "measured", data.specimen),), is_residual=True,
            log_x=True,
        ),
    )  # fmt: skip
