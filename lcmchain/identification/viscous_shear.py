"""Shear of a fabric that resists its rate, with its shear polynomial, from picture frames.

The force of a frame of pin-jointed, inextensible fibres follows from

    S12 = Σ s_k |E12|^k 2 E12 + (η γ' + Σ G_k m_k) / cos γ,   γ' = d'/(L sin(45° - γ/2)),

with the speed d' of the machine along the diagonal of a frame of the side L
(:mod:`lcmchain.materials.features.viscous_shear`). Speeds tell the viscosity, constant or falling
with the rate; a frame that stands still after its pull tells Maxwell elements; temperatures tell
the energy of activation. The simplest law that describes the tests is taken.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lcmchain.coupons.analytic import PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.data import CouponData
from lcmchain.identification.regression import (
    TOLERANCE,
    LackOfFit,
    coefficient_of_determination,
    lack_of_fit,
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
from lcmchain.identification.shear import COEFFICIENT_COUNT
from lcmchain.identification.viscous_fit import (
    COLUMNS,
    Form,
    FrameTests,
    RateFit,
    RateLaws,
    frame_tests,
)

__all__ = ["COLUMNS", "MINIMUM_ROWS", "identify_viscous_shear"]

MINIMUM_ROWS = 12
# The fastest test over the slowest, at least: what is nearer tells the rate from the angle badly.
LEAST_SPEEDS_RATIO = 2.0
# Three numbers of Cross's law ask for as many speeds.
SPEEDS_OF_CROSS = 3
# Mean deviation of the tests at one rate, time or temperature that matters: the law is there to
# tell these apart.
TOLERANCE_OF_RATES = 0.03
# Chance that Cross's law is given a viscosity at very high rates which it does not have.
FALSE_LIMIT = 0.05
_UNITS = {
    "viscosity": "Pa*s",
    "infinite_viscosity": "Pa*s",
    "time_constant": "s",
    "exponent": "1",
    "activation_energy": "J/mol",
    "modulus": "Pa",
    "relaxation_time": "s",
}


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
    data : columns displacement [m] along the diagonal, force [N], and the speed [m/s] of the
        machine or the time [s]; temperature [K] if the tests differ in it.
    specimen : side of frame and fabric, and thickness.
    noise_floor : smallest noise of the force relative to the largest force.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data.

    Raises
    ------
    InputError : a frame beyond 85°, a speed of zero, or speeds too near to each other.
    FitRefusedError : no law describes the data, and ``accept`` is not given.
    """
    tests = frame_tests(data, specimen)
    _require_enough(tests)
    reference = _middle_of(tests.temperatures)
    laws = RateLaws(tests, reference, noise_floor)
    heated = len(tests.temperatures) > 1
    fit = laws.with_elements(Form(heated=heated))
    notes: list[str] = []
    if len(tests.speeds) >= SPEEDS_OF_CROSS:
        fit, notes = _thinning(laws, fit)
    else:
        notes = [
            f"tests at {len(tests.speeds)} speed{'s' if len(tests.speeds) > 1 else ''} do not tell "
            "whether the viscosity falls with the rate: it holds at these rates alone; Cross's law "
            f"takes {SPEEDS_OF_CROSS} speeds"
        ]
    lacks, objections = _judge(tests, fit)
    result = _result(laws, fit, lacks, objections, (*inputs, *_told(tests, reference)))
    result = replace(result, warnings=(*result.warnings, *notes))
    return accepted(result, data.file, accept)


def _thinning(laws: RateLaws, constant: RateFit) -> tuple[RateFit, list[str]]:
    """Return the fit with a viscosity that falls with the rate if the tests ask for it, and notes.

    To how much it falls, at very high rates, is a fourth number, which few tests tell.
    """
    heated = constant.form.heated
    thinning = laws.with_elements(Form(cross=True, heated=heated))
    if not laws.needs(thinning, constant):
        return constant, []
    to_a_limit = laws.with_elements(Form(cross=True, infinite=True, heated=heated))
    if laws.needs(to_a_limit, thinning, chance=FALSE_LIMIT):
        return to_a_limit, []
    limit = next(p for p in _parameters(to_a_limit) if p.name == "infinite_viscosity")
    return thinning, [
        "the tests do not tell to what the viscosity falls at very high rates: "
        f"infinite_viscosity is left at 0, and up to {limit.high:.3g} Pa*s would do as well"
    ]


def _require_enough(tests: FrameTests) -> None:
    speeds = tests.speeds
    if len(tests.angle) >= MINIMUM_ROWS and len(speeds):
        if tests.still.any() or tests.speed.max() >= LEAST_SPEEDS_RATIO * speeds[0]:
            return
    least, largest = (1e3 * speeds[0], 1e3 * tests.speed.max()) if len(speeds) else (0.0, 0.0)
    raise InputError(
        f"has {len(tests.angle)} rows with speeds from {least:.4g} to {largest:.4g} mm/s: at least "
        f"{MINIMUM_ROWS} are needed, and shear law and viscosity are told apart by speeds of a "
        f"ratio of {LEAST_SPEEDS_RATIO:g} or more, or by a frame that stands still after its pull "
        "(a column time [s] in place of the speed)",
        file=tests.data.file,
    )


def _middle_of(temperatures: np.ndarray) -> float:
    """Return the temperature whose inverse is nearest to their mean; not-a-number without any."""
    if not len(temperatures):
        return math.nan
    inverse = 1.0 / temperatures
    return float(temperatures[np.argmin(np.abs(inverse - inverse.mean()))])


def _told(tests: FrameTests, reference: float) -> list[tuple[str, str, str]]:
    """Return what the tests differ in, and what they can therefore not tell."""
    speeds = ", ".join(f"{1e3 * speed:.4g}" for speed in tests.speeds)
    rows = [("speeds", f"{speeds} mm/s", "of the machine")]
    if tests.still.any():
        longest = tests.since_stop[tests.still].max()
        rows.append(("held", f"{longest:.4g} s", "longest stand after a pull"))
    else:
        rows.append(("Maxwell elements", "none looked for", "no frame stands still after its pull"))
    if len(tests.temperatures) > 1:
        rows.append(("reference temperature", f"{reference:.6g} K", "of all times"))
    elif len(tests.temperatures):
        rows.append(("activation energy", "not looked for", "all tests at one temperature"))
    return rows


def _judge(tests: FrameTests, fit: RateFit) -> tuple[list[LackOfFit], dict[str, str]]:
    """Return the misfit over all that tests differ in, and what is wrong by what it is wrong in."""
    force, model, moving = tests.force, fit.linear.model, ~tests.still
    dashpot = "Cross's law" if fit.form.cross else "a constant viscosity"
    looks = [
        ("angle", tests.angle, np.ones(len(force), dtype=bool), TOLERANCE,
         ("the law", "the shear angle", "deg", 180.0 / math.pi)),
        ("rate", tests.rate, moving, TOLERANCE_OF_RATES, (dashpot, "the rate", "1/s", 1.0)),
    ]  # fmt: skip
    if tests.still.any():
        looks.append(
            ("time", tests.since_stop, tests.still, TOLERANCE_OF_RATES,
             ("the relaxation", "the time since the stop", "s", 1.0))
        )  # fmt: skip
    if tests.temperature is not None and len(tests.temperatures) > 1:
        looks.append(
            ("temperature", tests.temperature, np.ones(len(force), dtype=bool), TOLERANCE_OF_RATES,
             ("one energy of activation", "the temperature", "K", 1.0))
        )  # fmt: skip
    lacks, objections = [], {}
    for name, x, rows, tolerance, words in looks:
        lack = lack_of_fit(
            x[rows], force[rows], model[rows], tests.data.specimen[rows], tolerance=tolerance
        )
        if rows.all():
            lacks.append(lack)
        if lack.is_systematic:
            objections[name] = lack.text(*words)
    return lacks, objections


def _result(
    laws: RateLaws,
    fit: RateFit,
    lacks: list[LackOfFit],
    objections: dict[str, str],
    inputs: tuple,
) -> Identification:
    tests = laws.tests
    force, model = tests.force, fit.linear.model
    blocks = next((lack.blocks for lack in lacks if lack.blocks is not None), None)
    fit = replace(fit, whole=replace(fit.whole, blocks=blocks))
    parameters = _parameters(fit)
    residuals = (force - model) / noise_scale(model, force, laws.noise_floor)
    warnings = general_warnings(parameters, residuals, tests.data.specimen)
    if fit.linear.constrained:
        warnings.append("a bound of the scene holds the fit: a rising stress, or no viscosity")
    return Identification(
        law="viscous shear",
        method=_method(fit.form),
        noise_model="independent errors of the force, relative to it, at least "
        f"{100 * laws.noise_floor:g} % of the largest force",
        interval_method="Student's t from the Jacobian, in the logarithms of times",
        inputs=inputs,
        parameters=parameters,
        derived=(),
        scene_table="material",
        scene_entries=_entries(laws, fit),
        correlation=fit.whole.correlation(),
        condition=fit.whole.condition,
        relative_noise=float(np.sqrt(np.sum(residuals**2) / fit.whole.degrees_of_freedom)),
        r_squared=coefficient_of_determination(force, model),
        point_count=len(force),
        warnings=(*warnings, *_range_warnings(tests, fit, parameters)),
        panels=_panels(laws, fit),
        objections=tuple(objections.values()),
        holds=_holds(objections),
    )


def _method(form: Form) -> str:
    parts = ["s0 ... s4", "Cross's law" if form.cross else "a constant viscosity"]
    if form.elements:
        parts.append(f"{form.elements} Maxwell element" + ("s" if form.elements > 1 else ""))
    if form.heated:
        parts.append("an energy of activation")
    return f"least squares of the force of the frame, with {', '.join(parts)}"


def _parameters(fit: RateFit) -> tuple[Parameter, ...]:
    """Return all parameters with their intervals, which reach to a value that a bound holds."""
    names = [*(f"s{k}" for k in range(COEFFICIENT_COUNT)), *fit.form.names]
    half = fit.whole.half_widths()
    found = []
    for k, (name, value) in enumerate(zip(names, fit.linear.parameters, strict=True)):
        middle = fit.free.parameters[k]
        found.append(
            Parameter(
                name, float(value), _unit(name),
                float(np.fmin(middle - half[k], value)), float(np.fmax(middle + half[k], value)),
            )
        )  # fmt: skip
    ends = [fit.form.values(fit.theta + sign * half[len(names) :]) for sign in (-1.0, 0.0, 1.0)]
    for name, low, value, high in zip(fit.form.searched, *ends, strict=True):
        found.append(Parameter(name, float(value), _unit(name), float(low), float(high)))
    return tuple(found)


def _unit(name: str) -> str:
    return "Pa" if name[0] == "s" else _UNITS[name.rstrip("_0123456789")]


def _entries(laws: RateLaws, fit: RateFit) -> dict[str, str]:
    """Return the entries of a scene below [material]."""
    form = fit.form
    entries = {
        "membrane.shear_polynomial": f'"{mega_pascal(*fit.linear.parameters[:COEFFICIENT_COUNT])}"',
        "membrane.shear_range": f'"{np.degrees(laws.tests.angle.max()):.4g} deg"',
    }
    viscosity = fit.value("viscosity")
    if viscosity > 0.0:
        entries["viscous.viscosity"] = f'"{viscosity:.10g} Pa*s"'
        if form.cross:
            entries["viscous.cross.time_constant"] = f'"{fit.value("time_constant"):.10g} s"'
            entries["viscous.cross.exponent"] = f"{fit.value('exponent'):.10g}"
            if fit.value("infinite_viscosity") > 0.0:
                text = f'"{fit.value("infinite_viscosity"):.10g} Pa*s"'
                entries["viscous.cross.infinite_viscosity"] = text
    elements = [
        (fit.value(f"modulus_{k + 1}"), fit.value(f"relaxation_time_{k + 1}"))
        for k in range(form.elements)
    ]
    stated = [
        f'{{ modulus = "{mega_pascal(modulus)}", relaxation_time = "{time:.10g} s" }}'
        for modulus, time in elements
        if modulus > 0.0
    ]
    if stated:
        entries["viscous.maxwell"] = f"[{', '.join(stated)}]"
    if form.heated and (viscosity > 0.0 or stated):
        entries["viscous.temperature"] = f'"{laws.reference:.6g} K"'
        entries["viscous.reference_temperature"] = f'"{laws.reference:.6g} K"'
        energy = 1e-3 * fit.value("activation_energy")
        entries["viscous.activation_energy"] = f'"{energy:.10g} kJ/mol"'
    return entries


def _range_warnings(
    tests: FrameTests, fit: RateFit, parameters: tuple[Parameter, ...]
) -> list[str]:
    """Say why parameters of the rate are not determined, and what would determine them."""
    known = {p.name: p.is_determined for p in parameters}
    rates = tests.rate[tests.rate > 0.0]
    warnings = []
    if fit.form.cross and not known["viscosity"]:
        warnings.append(
            f"the rates of {rates.min():.3g} to {rates.max():.3g} 1/s do not reach down to a "
            "constant viscosity: the law holds between them, and the viscosity at rest, which "
            "bounds the time step, may be any above; test more slowly"
        )
    if fit.held:
        warnings.append(
            f"{', '.join(fit.held)} stops at a bound of the search; the other intervals take that "
            "as given"
        )
    for k in range(fit.form.elements):
        time = fit.value(f"relaxation_time_{k + 1}")
        longest = tests.since_stop[tests.still].max()
        if time > longest:
            warnings.append(
                f"Maxwell element {k + 1} relaxes in {time:.3g} s, longer than a frame stands "
                f"still ({longest:.3g} s): what the fabric bears at rest is extrapolated; hold it "
                "longer"
            )
    if fit.form.heated:
        warnings.append(
            "material.viscous.temperature is that of the reference; state that of your process"
        )
    return warnings


def _holds(objections: dict[str, str]) -> str:
    """Say what may hold all the same."""
    if not objections:
        return ""
    if "rate" in objections:
        return (
            "tests whose rates lie nearer to each other, around those of the process, may follow "
            "one viscosity; remove the others"
        )
    if "temperature" in objections:
        return "tests at two temperatures near that of the process may follow one energy"
    if "time" in objections:
        return "a shorter stand may be described; remove the last rows of it"
    return "a fit of smaller shear angles may hold; remove the rows beyond"


def _panels(laws: RateLaws, fit: RateFit) -> tuple[Panel, ...]:
    tests = laws.tests
    travel, force, model = tests.data["displacement"], tests.force, fit.linear.model
    residuals = 100.0 * (force - model) / noise_scale(model, force, laws.noise_floor)
    curves = []
    for number in np.unique(tests.data.specimen)[:6]:
        of_test = (tests.data.specimen == number) & ~tests.still
        name = f"fit, {1e3 * np.median(tests.speed[of_test]):.4g} mm/s"
        curves.append(Band(1e3 * travel[of_test], model[of_test], name))
    panels = [
        Panel(
            "displacement [mm]", "force [N]",
            (Points(1e3 * travel, force, "measured", tests.data.specimen),), tuple(curves),
        ),
        Panel(
            "shear angle [deg]", "residual [%]",
            (Points(np.degrees(tests.angle), residuals, "measured", tests.data.specimen),),
            is_residual=True,
        ),
    ]  # fmt: skip
    if tests.still.any():
        still, since = tests.still, tests.since_stop
        held = []
        for number in np.unique(tests.data.specimen[still])[:6]:
            of_test = still & (tests.data.specimen == number)
            fastest = tests.speed[tests.data.specimen == number].max()
            held.append(
                Band(since[of_test], model[of_test], f"fit, after {1e3 * fastest:.4g} mm/s")
            )
        panels.append(
            Panel(
                "time since the stop [s]", "force [N]",
                (Points(since[still], force[still], "measured", tests.data.specimen[still]),),
                tuple(held), log_x=True,
            )
        )  # fmt: skip
    else:
        panels.append(
            Panel(
                "rate [1/s]", "residual [%]",
                (Points(tests.rate, residuals, "measured", tests.data.specimen),),
                is_residual=True, log_x=True,
            )
        )  # fmt: skip
    return tuple(panels)
