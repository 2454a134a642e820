"""Bending with friction from loops of moment over curvature, as Kawabata's test measures them.

The elastic moment is odd in the curvature: one stiffness, or a softening curve by points where the
tests ask for it. Beside it stands Dahl's friction (:mod:`lcmchain.identification.loops.fit`).

Source: Kawabata, "The standardization and analysis of hand evaluation" (1980): bending rigidity
from the slope of the branches, 2HB from the width of the loop.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

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
from lcmchain.materials.features.rheology import Friction
from lcmchain.quantities.units import CURVATURE, FORCE

COLUMNS = (
    (Column("curvature", CURVATURE, through_zero=True), Column("moment", FORCE, through_zero=True)),
)
MINIMUM_ROWS = 12
# Curvatures of the points of a curve, over the largest one.
SHARES = np.array([0.06, 0.15, 0.35, 0.65, 1.0])
# A slope that falls by less than this part is one stiffness.
LEAST_SOFTENING = 0.1
# Smallest slope of a curve over the mean one: rising, with room for rounding in the scene file.
_SMALLEST_SLOPE = 1e-3
WORDS = Words("curvature", "1/m", 1.0, "moment")


def identify_bending_loop(
    data: CouponData,
    *,
    thickness: float,
    fibre: int = 1,
    noise_floor: float = NOISE_FLOOR,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify what a fabric resists and loses in bending along one fibre direction.

    Parameters
    ----------
    data : columns curvature [1/m] and moment per width [N], each test from rest at zero.
    thickness : of the unloaded fabric [m]. fibre : direction that was bent, 1 or 2.
    noise_floor : smallest noise of the moment relative to the largest one.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data.

    Raises
    ------
    InputError : tests that do not begin near zero, or moments without any signal.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    tests = bending_loops(data, curve=False)
    law = _law(data, tests, noise_floor)
    judgement = judge(law, WORDS, noise_floor, lambda rows: fit_loops(
        rows, noise_floor, friction=law.limit is not None
    ))  # fmt: skip
    law = replace(law, fit=replace(law.fit, blocks=judgement.blocks))
    fit, loops = law.fit, law.loops
    parameters = (*_elastic(law), *friction_parameters(law, "friction_moment", "N", "1/m"))
    return accepted(
        Identification(
            law="bending friction",
            method="least squares of the moment along the course of the tests, with "
            + ("one stiffness" if len(law.elastic) == 1 else "a curve by points")
            + (" and Dahl's friction" if law.limit is not None else ""),
            noise_model="independent errors of the moment, relative to it, at least "
            f"{100 * noise_floor:g} % of the largest moment",
            interval_method="Student's t from the Jacobian, in the logarithm of the curvature of "
            "the friction",
            inputs=(*inputs, ("fibre", f"{fibre}", f"--fibre {fibre}")),
            parameters=parameters,
            derived=_loss(law),
            scene_table="material",
            scene_entries=_entries(law, thickness, fibre),
            correlation=fit.correlation(),
            condition=fit.condition,
            relative_noise=fit.scale,
            r_squared=coefficient_of_determination(loops.measured, fit.model),
            point_count=len(loops.measured),
            warnings=(
                *general_warnings(parameters, fit.residuals, loops.data.specimen),
                *friction_notes(law, loops.turn_back, "curvature"),
            ),
            panels=loop_panels(law, "curvature [1/m]", "moment per width [mN]", 1.0, 1e3),
            objections=judgement.objections,
            holds=judgement.holds,
        ),
        data.file,
        accept,
    )


def bending_loops(data: CouponData, *, curve: bool) -> Loops:
    """Return tests as loops with one stiffness [N m], or with slopes of a curve between points."""
    order, branch, ways, begins = courses(data, data["curvature"], "curvature", 1)
    data = data.keep(order)
    place = data["curvature"]
    if np.sum(place * data["moment"]) <= 0.0:
        raise InputError(
            "the moment does not resist the curvature; both are positive to the same side",
            file=data.file,
        )
    stiffness = float(np.sum(place * data["moment"]) / np.sum(place**2))
    points = np.abs(place).max() * (SHARES if curve else SHARES[-1:])
    starts = np.append(0.0, points[:-1])
    ends = np.append(points[:-1], np.inf)
    size = np.abs(place)[:, None]
    elastic = np.sign(place)[:, None] * np.clip(size - starts, 0.0, ends - starts)
    # it rises, and softens
    rows = np.vstack([np.eye(len(points))[-1:], -np.diff(np.eye(len(points)), axis=0)])
    least = np.append(_SMALLEST_SLOPE * stiffness, np.zeros(len(points) - 1))
    return Loops(
        data=data, place=place, measured=data["moment"], elastic=elastic,
        lever=np.ones(len(place)), moments=None, at_least=(rows, least), stiffness=stiffness,
        branch=branch, ways=ways, begins=begins,
    )  # fmt: skip


def _law(data: CouponData, linear: Loops, noise_floor: float) -> LoopFit:
    """Return the simplest law that the tests do not contradict."""
    back = linear.turn_back
    law = fit_loops(linear, noise_floor, friction=back)
    softening = fit_loops(bending_loops(data, curve=True), noise_floor, friction=back)
    softens = softening.elastic[-1] < (1.0 - LEAST_SOFTENING) * softening.elastic[0]
    if softens and needs(softening, law, noise_floor):
        law = softening
    if back:
        plain = fit_loops(law.loops, noise_floor, friction=False)
        return law if rubs(law, plain, noise_floor) else plain
    return law


def _elastic(law: LoopFit) -> list[Parameter]:
    """Return the stiffness, or the slopes of the curve, with their intervals."""
    names = ["stiffness"]
    if len(law.elastic) > 1:
        names = [f"slope_{k + 1}" for k in range(len(law.elastic))]
    half = law.fit.half_widths()
    return [
        Parameter(name, float(value), "N*m", float(value - margin), float(value + margin))
        for name, value, margin in zip(names, law.elastic, half, strict=False)
    ]


def _loss(law: LoopFit) -> tuple[Parameter, ...]:
    """Return what a steady loop between the largest curvatures loses per area; none without."""
    if law.limit is None or law.length is None:
        return ()
    friction, largest = Friction(law.limit, law.length), law.loops.largest
    value = friction.loop_loss(largest)
    step = 1e-4
    longer = Friction(law.limit, law.length * (1.0 + step)).loop_loss(largest)
    slopes = np.array([value / law.limit, (longer - value) / step])
    places = len(law.elastic) + np.arange(2)
    variance = slopes @ law.fit.covariance[np.ix_(places, places)] @ slopes
    half = law.fit.student * math.sqrt(variance)
    return (Parameter("loop_loss", value, "J/m2", value - half, value + half),)


def _entries(law: LoopFit, thickness: float, fibre: int) -> dict[str, str]:
    modulus = 12.0 * law.elastic[0] / thickness**3
    entries = {f"bending.C{fibre}{fibre}": f'"{mega_pascal(modulus)}"'}
    if len(law.elastic) > 1:
        points = law.loops.largest * SHARES
        moments = np.cumsum(law.elastic * np.diff(points, prepend=0.0))
        # so many digits that rounding makes no slope steeper than the first
        k, M = (" ".join(f"{value:.9g}" for value in part) for part in (points, moments))
        entries[f"bending.curve_{fibre}"] = f'{{ curvature = "{k} 1/m", moment = "{M} N" }}'
    if law.limit is not None:
        entries[f"bending.friction_{fibre}"] = (
            f'{{ moment = "{law.limit:.10g} N", curvature = "{law.length:.10g} 1/m" }}'
        )
    return entries
