"""Shear with friction from loops: picture frames there and back, or shear stress over shear angle.

The elastic shear is the polynomial of Eq. (21). Beside it stands Dahl's friction, whose limit may
grow with the elastic moment (:mod:`lcmchain.materials.features.shear_friction`,
:mod:`lcmchain.identification.loops.fit`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lcmchain.coupons.analytic import PictureFrame, shear_strain
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.loops.fit import (
    NOISE_FLOOR,
    LoopFit,
    Loops,
    courses,
    fit_loops,
    friction_notes,
    friction_parameters,
    loop_panels,
    needs,
    rubs,
)
from lcmchain.identification.loops.judgement import Words, judge
from lcmchain.identification.regression import coefficient_of_determination
from lcmchain.identification.result import (
    Identification,
    Parameter,
    accepted,
    general_warnings,
    mega_pascal,
)
from lcmchain.identification.shear import COEFFICIENT_COUNT, rising_stress
from lcmchain.quantities.units import ANGLE, FORCE, LENGTH, STIFFNESS

_FORCE = Column("force", FORCE, through_zero=True)
_ANGLE = Column("shear angle", ANGLE, through_zero=True)
#: What a file may hold; the first that fits is taken.
COLUMNS = (
    (Column("displacement", LENGTH, through_zero=True), _FORCE),
    (_ANGLE, _FORCE),
    (_ANGLE, Column("shear stress", STIFFNESS, through_zero=True)),
)
MINIMUM_ROWS = 20
LARGEST_ANGLE = math.radians(85.0)
# Parts of the way between two rows, over which the limit of the friction is one.
PARTS = 4
WORDS = Words("shear angle", "deg", 180.0 / math.pi, "shear force")


def identify_shear_loop(
    data: CouponData,
    specimen: PictureFrame,
    *,
    noise_floor: float = NOISE_FLOOR,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify shear polynomial and friction; the polynomial rises up to 90° as the scene demands.

    Parameters
    ----------
    data : displacement [m] along the diagonal, or shear angle [rad], and force [N] along the
        diagonal or shear stress S12 [Pa]; each test from rest at zero.
    specimen : side of frame and fabric, and thickness.
    noise_floor : smallest noise of the force relative to the largest one.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data.

    Raises
    ------
    InputError : a frame beyond 85°, tests that do not begin near zero, or no signal.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    tests = shear_loops(data, specimen)
    law = _law(tests, noise_floor)
    judgement = judge(law, WORDS, noise_floor, lambda rows: fit_loops(
        rows, noise_floor, friction=law.limit is not None, growth=law.growth is not None
    ))  # fmt: skip
    law = replace(law, fit=replace(law.fit, blocks=judgement.blocks))
    fit, half = law.fit, law.fit.half_widths()
    parameters = [
        Parameter(f"s{k}", float(s), "Pa", float(s - half[k]), float(s + half[k]))
        for k, s in enumerate(law.elastic)
    ]
    parameters += friction_parameters(law, "friction_stress", "Pa", "rad")
    warnings = general_warnings(parameters, fit.residuals, tests.data.specimen)
    if fit.constrained:
        warnings.append("a bound of the scene holds the fit: a rising stress, or no friction")
    stress = "shear stress" in tests.data
    return accepted(
        Identification(
            law="shear friction",
            method="least squares of the force along the course of the tests, with s0 ... s4"
            + (" and Dahl's friction" if law.limit is not None else "")
            + (" that grows with the shear stress" if law.growth is not None else ""),
            noise_model="independent errors of the force, relative to it, at least "
            f"{100 * noise_floor:g} % of the largest force",
            interval_method="Student's t from the Jacobian, in the logarithm of the angle of the "
            "friction",
            inputs=inputs,
            parameters=tuple(parameters),
            derived=(),
            scene_table="material.membrane",
            scene_entries=_entries(law),
            correlation=fit.correlation(),
            condition=fit.condition,
            relative_noise=fit.scale,
            r_squared=coefficient_of_determination(tests.measured, fit.model),
            point_count=len(tests.measured),
            warnings=(*warnings, *friction_notes(law, tests.turn_back, "angle")),
            panels=loop_panels(
                law, "shear angle [deg]", "shear stress [kPa]" if stress else "force [N]",
                180.0 / math.pi, 1e-3 if stress else 1.0,
            ),
            objections=judgement.objections,
            holds=judgement.holds,
        ),
        data.file,
        accept,
    )  # fmt: skip


def shear_loops(data: CouponData, specimen: PictureFrame) -> Loops:
    """Return tests as loops: force or stress over shear angle, linear in s0 ... s4."""
    name = "displacement" if "displacement" in data else "shear angle"
    angle = specimen.shear_angle(data[name]) if name == "displacement" else data[name]
    beyond = np.flatnonzero(np.abs(angle) > LARGEST_ANGLE)
    if beyond.size:
        raise data.wrong(name, beyond[0], "shears the fabric by more than 85 deg")
    order, branch, ways, begins = courses(data, angle, name, PARTS)
    data, angle = data.keep(order), angle[order]
    if "force" in data:
        measured, lever = data["force"], specimen.force(angle, lambda g: np.ones_like(g))
    else:
        measured, lever = data["shear stress"], np.ones_like(angle)
    ends = np.abs(_ends(ways, begins))
    strain = shear_strain(angle)
    elastic = lever[:, None] * _stress(strain)
    secant = float(np.sum(measured * elastic[:, 0]) / np.sum(elastic[:, 0] ** 2))
    if secant <= 0.0:
        raise InputError(
            "the force does not resist the shear; both are positive to the same side",
            file=data.file,
        )
    return Loops(
        data=data, place=angle, measured=measured, elastic=elastic, lever=lever / np.cos(angle),
        moments=np.cos(ends)[..., None] * _stress(shear_strain(ends)),
        at_least=rising_stress(secant), stiffness=secant, branch=branch, ways=ways, begins=begins,
    )  # fmt: skip


def _stress(strain: np.ndarray) -> np.ndarray:
    """Return S12 per unit of s0 ... s4, shape [..., 5]."""
    return 2.0 * strain[..., None] * np.abs(strain)[..., None] ** np.arange(COEFFICIENT_COUNT)


def _ends(ways: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Return the angles at the ends of the parts of the way, each test from zero on."""
    found = np.empty_like(ways)
    starts = np.append(np.flatnonzero(begins), len(ways))
    for first, last in zip(starts, starts[1:], strict=False):
        found[first:last] = np.cumsum(ways[first:last]).reshape(-1, ways.shape[1])
    return found


def _law(tests: Loops, noise_floor: float) -> LoopFit:
    """Return the simplest law that the tests do not contradict."""
    plain = fit_loops(tests, noise_floor, friction=False)
    if not tests.turn_back:
        return plain
    constant = fit_loops(tests, noise_floor)
    growing = fit_loops(tests, noise_floor, growth=True)
    law = growing if needs(growing, constant, noise_floor) else constant
    return law if rubs(law, plain, noise_floor) else plain


def _entries(law: LoopFit) -> dict[str, str]:
    entries = {
        "shear_polynomial": f'"{mega_pascal(*law.elastic)}"',
        "shear_range": f'"{np.degrees(law.loops.largest):.4g} deg"',
    }
    if law.limit is not None and law.length is not None:
        grows = "" if law.growth is None else f", growth = {law.growth:.6g}"
        entries["friction"] = (
            f'{{ stress = "{mega_pascal(law.limit)}", '
            f'angle = "{math.degrees(law.length):.10g} deg"{grows} }}'
        )
    return entries
