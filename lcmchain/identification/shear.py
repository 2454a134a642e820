"""Shear polynomial C12(|E12|), Eq. (21), from the force of bias extension or a picture frame.

The shear angle is that of the machine's travel in a net of inextensible fibres, or was measured on
the fabric. A measured angle knows of no slip: the force is then that of the net which is sheared so
far, and what the machine has travelled beyond it counts as slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from lcmchain.coupons.analytic import BiasExtension, PictureFrame, shear_strain
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData, require_unlike
from lcmchain.identification.entering_rows import SHOWN
from lcmchain.identification.regression import (
    Fit,
    LackOfFit,
    coefficient_of_determination,
    falling_row,
    fit_linear,
    lack_of_fit,
    longest_range,
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
from lcmchain.quantities.units import ANGLE, FORCE, LENGTH

#: A specimen in which the angle follows from the displacement, and the force from the stress.
Specimen = BiasExtension | PictureFrame
COLUMNS = ((Column("displacement", LENGTH, loading=1), Column("force", FORCE)),)
#: Tests whose shear angle was measured on the fabric.
ANGLE_COLUMNS = ((Column("shear angle", ANGLE, loading=1), Column("force", FORCE)),)
MINIMUM_ROWS = 8
LARGEST_MEASURED_ANGLE = math.radians(85.0)
METHODS = {
    "force": "least squares of the energetic force, linear in s0 ... s4",
    "recursion": "S12 by the recursion of Eq. (22) with the full power of zone B, then polynomial",
    "printed": "S12 by Eq. (22) as printed (half the power of zone B), then polynomial",
}
COEFFICIENT_COUNT = 5
# Strains up to a shear angle of 90 deg where the scene demands a rising stress.
_STRAIN = np.linspace(0.0, 0.5, 2001)
# Smallest tangent relative to the mean secant: rising, with room for rounding in the scene file.
_SMALLEST_TANGENT = 1e-3
# Largest shear angle of a pin-jointed net that a fabric follows: the yarns would stand at a third
# of their spacing, cos 70 deg. Woven and stitched fabrics lock between 30 and 65 deg and then slip.
LARGEST_PLAUSIBLE_ANGLE = math.radians(70.0)


def identify_shear(
    data: CouponData,
    specimen: Specimen,
    *,
    method: str = "force",
    convention: str = "engineering",
    noise_floor: float = 0.01,
    bootstrap_count: int = 400,
    seed: int = 0,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify the shear polynomial of a fabric; it rises up to 90° as the scene demands.

    Methods (paper section 3.2.1): ``"force"`` fits the force itself, in which the coefficients
    are linear and each error enters once; ``"recursion"`` first turns the force into stress,
    which piles up the errors at γ, γ/2, γ/4 ... and divides them by cos γ; ``"printed"`` uses
    the factor 1/2 of the printed Eq. (22), for comparison with the paper.

    Parameters
    ----------
    data : columns displacement [m] or shear angle [rad], and force [N].
    specimen : geometry of the test; a picture frame needs the method ``"force"``.
    convention : S12 = C12 2 E12 (``"engineering"``) or C12 E12 (``"tensor"``).
    noise_floor : smallest noise of the force relative to the largest force.
    bootstrap_count, seed : parametric bootstrap behind the intervals of the recursion, where the
        force enters each stress many times over; the direct fit is linear, its intervals exact.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data: the force falls, the fabric
        slips, or the law misses them systematically. The intervals are then those of the misfit,
        and ``shear_range`` ends where the law holds.

    The intervals are those of the fit without the demand for a rising stress: with an active
    bound neither Student's t nor the bootstrap holds its 95 % (the bootstrap covered 76 to 94 %).

    Raises
    ------
    InputError : a displacement beyond the locking of the pin-jointed specimen, or a force without
        any signal.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    data = _loaded_rows(data, specimen)
    angle, force = _angles(data, specimen), data["force"]
    require_unlike(
        data, angle, COEFFICIENT_COUNT, loads="forces", places="shear angles", test="pull"
    )
    factor = {"engineering": 2.0, "tensor": 1.0}[convention]
    share = 0.5 if method == "printed" else 1.0
    design = force_design(specimen, angle, factor)
    secant = mean_secant(design, force)
    if secant <= 0.0:
        raise InputError("the force is not positive; tension counts as positive", file=data.file)
    rising = rising_stress(secant)
    fit_force = partial(fit_linear, design, floor=noise_floor)
    fit_stress = partial(_fit_stress, data, specimen, design, factor, share, floor=noise_floor)
    fit_once = fit_force if method == "force" else fit_stress
    free, fit = fit_once(force), fit_once(force, at_least=rising)
    judgement = _judge(data, specimen, angle, design, rising, noise_floor)
    spread: _LinearSpread | _BootstrapSpread
    if method == "force" or judgement.lack.blocks is not None:
        spread = _LinearSpread(replace(free, blocks=judgement.lack.blocks))
    else:
        # The direct fit tells the scatter of the force: the printed equation is not its inverse,
        # so that its curve is not meant to meet the data.
        direct = fit_force(force)
        spread = _BootstrapSpread(
            fit_once, direct.model, direct.scale * direct.noise_scale, free.parameters,
            bootstrap_count, seed,
        )  # fmt: skip
    parameters = _parameters(fit, spread)
    model = design @ fit.parameters
    residuals = (force - model) / noise_scale(model, force, noise_floor)
    warnings = general_warnings(parameters, residuals, data.specimen)
    warnings += _shear_warnings(fit, angle)
    result = Identification(
        law="shear",
        method=METHODS[method] + (" (picture frame)" if isinstance(specimen, PictureFrame) else ""),
        noise_model="independent errors of the force, relative to it, at least "
        f"{100 * noise_floor:g} % of the largest force",
        interval_method=spread.name,
        inputs=inputs,
        parameters=parameters,
        derived=(),
        scene_table="material.membrane",
        scene_entries={
            "shear_polynomial": f'"{mega_pascal(*fit.parameters)}"',
            "shear_convention": f'"{convention}"',
            "shear_range": f'"{np.degrees(judgement.shear_range):.4g} deg"',
        },
        correlation=spread.correlation(),
        condition=free.condition,
        relative_noise=float(np.sqrt(np.sum(residuals**2) / fit.degrees_of_freedom)),
        r_squared=coefficient_of_determination(force, model),
        point_count=len(force),
        warnings=tuple(warnings),
        panels=_panels(
            data, specimen, angle, fit.parameters, spread, residuals, factor, share, judgement
        ),
        objections=judgement.objections,
        holds=judgement.holds,
    )
    return accepted(result, data.file, accept)


def _fit_stress(
    data: CouponData,
    specimen: Specimen,
    design: np.ndarray,
    factor: float,
    share: float,
    force: np.ndarray,
    *,
    floor: float,
    at_least: tuple[np.ndarray, np.ndarray] | None = None,
) -> Fit:
    """Fit the coefficients to the stress [Pa] that forces [N] at the angles of the data ask for."""
    angle = _angles(data, specimen)
    stress = stress_from_force(specimen, angle, force, data.specimen, share=share)
    per_force = _own_stress_per_force(specimen, angle)
    return fit_linear(
        stress_design(angle, factor), stress, floor, at_least=at_least,
        scale_of=lambda s: per_force * noise_scale(design @ s, force, floor),
    )  # fmt: skip


def _parameters(fit: Fit, spread: _LinearSpread | _BootstrapSpread) -> tuple[Parameter, ...]:
    """Return s0 ... s4 with their intervals.

    A value held by a bound may lie outside; the interval then reaches to it.
    """
    low, high = spread.interval(np.eye(COEFFICIENT_COUNT))
    return tuple(
        Parameter(f"s{k}", float(v), "Pa", float(np.fmin(low[k], v)), float(np.fmax(high[k], v)))
        if np.isfinite(low[k])
        else Parameter(f"s{k}", float(v), "Pa", np.nan, np.nan)
        for k, v in enumerate(fit.parameters)
    )


@dataclass(frozen=True)
class _Judgement:
    """Whether the law describes the forces, and up to which shear angle [rad]."""

    lack: LackOfFit
    objections: tuple[str, ...]
    shear_range: float
    holds: str


def _angles(data: CouponData, specimen: Specimen) -> np.ndarray:
    """Return the shear angle [rad] of the rows: measured, or that of their displacement."""
    if "displacement" in data:
        return specimen.shear_angle(data["displacement"])
    return data["shear angle"]


def _own_stress_per_force(specimen: Specimen, angle: np.ndarray) -> np.ndarray:
    """Return S12 [Pa] per force of its own angle [N]; at half of it counts as known."""
    if isinstance(specimen, PictureFrame):
        return 1.0 / specimen.force(angle, np.ones_like)
    _, _, sheared = specimen.zone_areas
    return specimen.displacement_slope(angle) / (specimen.thickness * sheared * np.cos(angle))


def _judge(data: CouponData, specimen, angle, design, rising, noise_floor: float) -> _Judgement:
    """Judge the direct fit of the force, which every method stands or falls with."""
    force = data["force"]

    def lack_of(rows) -> LackOfFit:
        fit = fit_linear(design[rows], force[rows], noise_floor, at_least=rising)
        return lack_of_fit(angle[rows], force[rows], fit.model, data.specimen[rows])

    lack = lack_of(np.ones(len(angle), dtype=bool))
    objections, limit = _failures(data, specimen, angle)
    if lack.is_systematic:
        objections.append(lack.text("the polynomial", "the shear angle", "deg", 180.0 / math.pi))
    if not objections:
        return _Judgement(lack, (), float(angle.max()), "")
    sound = np.flatnonzero(angle <= limit)
    rows = longest_range(
        angle[sound], lambda chosen: not lack_of(sound[chosen]).is_systematic, MINIMUM_ROWS
    )
    if rows is None:
        end = float(angle[sound].max()) if len(sound) else 0.0
        return _Judgement(
            lack, tuple(objections), min(end, float(angle.max())),
            f"nothing tears or slips up to {np.degrees(end):.1f} deg, but the law follows no range "
            "of angles from zero on; check the zeros of force and displacement, and the sizes",
        )  # fmt: skip
    last = int(sound[rows][np.argmax(angle[sound][rows])])
    way = f"{1e3 * data['displacement'][last]:.4g} mm, " if "displacement" in data else ""
    return _Judgement(
        lack, tuple(objections), float(angle[last]),
        f"a fit of the rows up to {np.degrees(angle[last]):.1f} deg "
        f"({way}line {data.lines[last]}) describes them; "
        "remove the rows beyond",
    )  # fmt: skip


def _failures(data: CouponData, specimen: Specimen, angle) -> tuple[list[str], float]:
    """Tell in words where the specimen tears or slips; up to which angle [rad] it does neither."""
    found, limit = [], math.inf
    force = data["force"]
    fallen = falling_row(force, data.specimen)
    if fallen is not None:
        one = np.flatnonzero(data.specimen[:fallen] == data.specimen[fallen])
        found.append(
            f"the force falls from {force[one].max():.4g} N to {force[fallen]:.4g} N at line "
            f"{data.lines[fallen]} ({np.degrees(angle[fallen]):.1f} deg): the specimen tore, "
            "slipped or was unloaded"
        )
        limit = float(np.nextafter(angle[fallen], 0.0))
    stress = stress_from_force(specimen, angle, force, data.specimen)
    slipped = falling_row(stress, data.specimen, for_good=True)
    if slipped is not None and angle[slipped] < limit:
        one = np.flatnonzero(data.specimen[:slipped] == data.specimen[slipped])
        limit = _knee(angle[one], stress[one])
        found.append(
            "the shear stress that the force asks for bends down at "
            f"{np.degrees(limit):.1f} deg and falls at {np.degrees(angle[slipped]):.1f} deg: the "
            "yarns slip there instead of shearing"
        )
    if angle.max() > LARGEST_PLAUSIBLE_ANGLE and _is_net(data, specimen):
        found.append(
            f"the angle of a pin-jointed net reaches {np.degrees(angle.max()):.1f} deg, which no "
            f"fabric shears to (at most {np.degrees(LARGEST_PLAUSIBLE_ANGLE):.0f} deg): the yarns "
            "slip, or length and width are not those of the specimen"
        )
        limit = min(limit, LARGEST_PLAUSIBLE_ANGLE)
    return found, limit


def _is_net(data: CouponData, specimen: Specimen) -> bool:
    """Tell whether the angle is that of a net, which the fabric may not have followed."""
    return "displacement" in data and isinstance(specimen, BiasExtension)


def _knee(angle: np.ndarray, stress: np.ndarray) -> float:
    """Angle [rad] where a rising stress bends down: farthest above its chord from half to peak."""
    peak = int(np.argmax(stress))
    half = int(np.argmax(stress >= 0.5 * stress[peak]))
    if peak - half < 2:
        return float(angle[peak])
    share = (angle[half : peak + 1] - angle[half]) / (angle[peak] - angle[half])
    above = stress[half : peak + 1] - (stress[half] + share * (stress[peak] - stress[half]))
    return float(angle[half + int(np.argmax(above))])


class _LinearSpread:
    """Intervals of linear combinations of the coefficients of a linear fit."""

    name = "Student's t, exact for the linear fit"

    def __init__(self, fit: Fit):
        self._fit = fit

    def interval(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the 95 % intervals of rows @ coefficients."""
        value = rows @ self._fit.parameters
        variance = np.einsum("ni,ij,nj->n", rows, self._fit.covariance, rows)
        half = self._fit.student * np.sqrt(variance)
        return value - half, value + half

    def correlation(self) -> np.ndarray:
        return self._fit.correlation()


class _BootstrapSpread:
    """Basic bootstrap intervals: fits to forces drawn around the fitted ones.

    The errors of the samples, against the coefficients found from the force without noise, are
    mirrored at the fit, so that a bias is not counted twice as by plain percentiles.
    """

    def __init__(self, fit_once, force, deviation, coefficients, count: int, seed: int):
        generator = np.random.default_rng(seed)
        draws = force + deviation * generator.standard_normal((count, len(force)))
        self.name = f"basic bootstrap of {count} samples" if count else "none"
        self._coefficients = coefficients
        self._samples = np.array([fit_once(draw).parameters for draw in draws])
        self._centre = fit_once(force).parameters

    def interval(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the 95 % intervals of rows @ coefficients."""
        value = rows @ self._coefficients
        if len(self._samples) < 2:
            return np.full(len(rows), np.nan), np.full(len(rows), np.nan)
        errors = (self._samples - self._centre) @ rows.T
        least, largest = np.percentile(errors, (2.5, 97.5), axis=0)
        return value - largest, value - least

    def correlation(self) -> np.ndarray:
        if len(self._samples) < 2:
            return np.full((COEFFICIENT_COUNT, COEFFICIENT_COUNT), np.nan)
        return np.corrcoef(self._samples.T)


def mean_secant(design: np.ndarray, force: np.ndarray) -> float:
    """Return the mean secant modulus [Pa]: s0 of a polynomial that has nothing else."""
    return float(np.sum(force * design[:, 0]) / np.sum(design[:, 0] ** 2))


def rising_stress(secant: float) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (n, 5) and least values (n,) of s0 ... s4 that let the stress rise up to 90°."""
    powers = np.arange(COEFFICIENT_COUNT)
    tangent = (powers + 1) * _STRAIN[:, None] ** powers
    return tangent, np.full(len(_STRAIN), _SMALLEST_TANGENT * secant)


def force_design(specimen: Specimen, angle: np.ndarray, factor: float) -> np.ndarray:
    """Return the force [N] per unit of each coefficient, shape [point_count, 5]."""
    return np.stack(
        [
            specimen.force(angle, lambda g, k=k: factor * shear_strain(g) ** (k + 1))  # type: ignore[misc]
            for k in range(COEFFICIENT_COUNT)
        ],
        axis=-1,
    )


def stress_design(angle: np.ndarray, factor: float) -> np.ndarray:
    """Return S12 [Pa] per unit of each coefficient, shape [point_count, 5]."""
    return factor * shear_strain(angle)[:, None] ** np.arange(1, COEFFICIENT_COUNT + 1)


def stress_from_force(
    specimen: Specimen,
    angle: np.ndarray,
    force: np.ndarray,
    number: np.ndarray,
    *,
    share: float = 1.0,
) -> np.ndarray:
    """Return S12 [Pa] at the measured shear angles, by Eq. (22) within each specimen.

    The force between the measured angles follows a monotone cubic through the origin. In a picture
    frame all fabric has one angle.
    """
    if isinstance(specimen, PictureFrame):
        return force / specimen.force(angle, np.ones_like)
    stress = np.empty_like(force)
    for one in np.unique(number):
        rows = number == one
        known, first = np.unique(angle[rows], return_inverse=True)
        mean = np.bincount(first, force[rows]) / np.bincount(first)
        curve = PchipInterpolator(np.append(0.0, known), np.append(0.0, mean))
        stress[rows] = specimen.shear_stress_from_force(
            curve, known, linear_below=known[0], share=share
        )[first]
    return stress


def _loaded_rows(data: CouponData, specimen: Specimen) -> CouponData:
    if "displacement" not in data:
        return _sheared_rows(data)
    limit = specimen.locking_displacement
    sizes = "side" if isinstance(specimen, PictureFrame) else "length, width"
    beyond = np.flatnonzero(data["displacement"] >= limit * (1.0 - 1e-6))
    if len(beyond):
        raise data.wrong(
            "displacement", beyond[0],
            f"is {data['displacement'][beyond[0]] * 1e3:g} mm; the fibres of this specimen are "
            f"parallel at {limit * 1e3:.4g} mm, check {sizes} and unit",
        )  # fmt: skip
    loaded = data["displacement"] > 0.0  # without displacement the force holds no stiffness
    if np.count_nonzero(loaded) < MINIMUM_ROWS:
        raise InputError(
            f"fewer than {MINIMUM_ROWS} rows have a positive displacement", file=data.file
        )
    return data.keep(loaded)


def _sheared_rows(data: CouponData) -> CouponData:
    angle = data["shear angle"]
    beyond = np.flatnonzero(angle > LARGEST_MEASURED_ANGLE)
    if len(beyond):
        raise data.wrong("shear angle", beyond[0], "is more than 85 deg; check the unit")
    if np.count_nonzero(angle > 0.0) < MINIMUM_ROWS:
        raise InputError(
            f"fewer than {MINIMUM_ROWS} rows have a positive shear angle", file=data.file
        )
    return data.keep(angle > 0.0)


def _shear_warnings(fit: Fit, angle: np.ndarray) -> list[str]:
    found = []
    first, last = np.degrees([angle.min(), angle.max()])
    if last < 45.0:
        found.append(
            f"the shear angle ends at {last:.1f} deg; forming reaches 45 deg and more, where this "
            "law is extrapolated"
        )
    if first > 5.0:
        found.append(
            f"the shear angle starts at {first:.1f} deg: the initial stiffness s0 is extrapolated"
        )
    if fit.constrained:
        found.append(
            "without a constraint the fitted stress would fall somewhere below 90 deg; it is held "
            "rising there, as a scene demands (the intervals are those without the constraint)"
        )
    return found


def _panels(
    data, specimen, angle, coefficients, spread, residuals, factor, share, judgement: _Judgement
):
    name = "displacement" if "displacement" in data else "shear angle"
    driven, (label, _, unit) = data[name], SHOWN[name]
    way = np.linspace(0.0, driven.max(), 201)[1:]
    way_angle = specimen.shear_angle(way) if "displacement" in data else way
    design = force_design(specimen, way_angle, factor)
    law_angle = np.linspace(0.0, 0.5 * np.pi, 181)
    law = stress_design(law_angle, factor)
    stiffness = shear_strain(law_angle)[:, None] ** np.arange(COEFFICIENT_COUNT)
    stress = stress_from_force(specimen, angle, data["force"], data.specimen, share=share)
    end = float(np.degrees(judgement.shear_range))

    def band(x, matrix, scale, label, angle):
        low, high = spread.interval(matrix)
        curve = matrix @ coefficients
        if judgement.lack.is_systematic:  # known no better than it meets the data
            missed = np.abs(curve) * judgement.lack.widening(angle)
            low, high = np.fmin(low, curve) - missed, np.fmax(high, curve) + missed
        return Band(x, scale * curve, label, scale * low, scale * high)

    u = unit * driven
    degrees = np.degrees(angle)
    secant = stress / (factor * shear_strain(angle))
    stress_name = "Eq. (22) of the data" + (", as printed" if share != 1.0 else "")
    if isinstance(specimen, PictureFrame):
        stress_name = "from the force"
    return (
        Panel(
            label, "force [N]",
            (Points(u, data["force"], "measured", data.specimen),),
            (band(unit * way, design, 1.0, "fit", way_angle),),
        ),
        Panel(
            "shear angle [deg]", "shear stress S12 [MPa]",
            (Points(degrees, 1e-6 * stress, stress_name, data.specimen),),
            (band(np.degrees(law_angle), law, 1e-6, "law", law_angle),), data_end=end,
        ),
        Panel(
            label, "residual [%]",
            (Points(u, 100.0 * residuals, "measured", data.specimen),), is_residual=True,
        ),
        Panel(
            "shear angle [deg]", "shear stiffness C12 [MPa]",
            (Points(degrees, 1e-6 * secant, stress_name, data.specimen),),
            (band(np.degrees(law_angle), stiffness, 1e-6, "law", law_angle),), data_end=end,
        ),
    )  # fmt: skip
