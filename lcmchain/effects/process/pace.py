"""Pace of a process that has no time of its own: found while it runs, from the sheet's energies.

Adds: nothing to the equations of the sheet. Process time is ``pace`` times the time of the sheet:
tools, supports and loads slow down where inertia takes part in the motion of the sheet, because it
is hardly strained yet, snaps or buckles. Forces of laws without a rate do not depend on the pace.
Source: the measure of quasi-static explicit analyses, kinetic over internal energy (Belytschko,
Liu, Moran, "Nonlinear Finite Elements", section 6.2; Abaqus, "Quasi-static analysis with
Abaqus/Explicit": below 5 to 10 %); the controller: own.
Stability limit: none; the step is that of the sheet.
Scene: ``process.time`` (left out: the pace is found), ``process.quasi_static``.
Fields: ``time`` is that of the process; ``history_sheet_time`` (history).

The mean kinetic energy is held below a part of the energy that is stored in the sheet, which is the
external work less the kinetic energy and what damping and friction took. It falls with the square
of the pace.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from lcmchain.effects.effect import Effect, EffectModel
from lcmchain.elements.family import Body
from lcmchain.materials.shear_waves import shear_energy
from lcmchain.quantities.readable import two_digits_up

#: Kinetic over stored energy: below it inertia does not show in the shape.
KINETIC_PART = 0.065
#: Slowest pace; the fastest is 1.
SLOWEST = 0.1
#: In parts of the process time: over which the kinetic energy is averaged, and in which the pace
#: grows and falls by a factor e at most. A tool that changes its speed faster strikes the sheet.
AVERAGING, GROWTH, FALL = 0.03, 0.2, 0.07
#: Below this part of the energy of shearing all of the sheet by this angle [rad] the stored energy
#: says nothing of inertia: the sheet is only touched.
FLOOR_PART, FLOOR_ANGLE = 0.012, 0.1
#: Advice to slow a process asks for this factor at least: a smaller one is lost in two digits.
LEAST_SLOWER = 1.05


class PaceLaw(NamedTuple):
    """How a pace is found.

    time : that the process takes at pace 1 [s].
    quasi_static : how much slower the process is than by default.
    kinetic_part : bound of the kinetic energy in parts of the stored energy.
    floor : stored energy [J] below which the kinetic energy is compared with it.
    """

    time: float
    quasi_static: float
    kinetic_part: float
    floor: float


def pace_law(bodies: Sequence[Body], time: float, quasi_static: float) -> PaceLaw:
    """Return how the pace of some sheets is found.

    Parameters
    ----------
    time : of the process at pace 1 [s]. quasi_static : as for a scene; the time is in proportion to
        it, and the kinetic energy falls with the square.
    """
    sheared = sum(shear_energy(body.material, FLOOR_ANGLE) * body.volume for body in bodies)
    part = KINETIC_PART / quasi_static**2
    return PaceLaw(time, quasi_static, part, FLOOR_PART * sheared)


def next_pace(
    law: PaceLaw,
    pace: float,
    mean_kinetic: float,
    *,
    kinetic: float,
    stored: float,
    duration: float,
) -> tuple[float, float]:
    """Return the pace after some steps, and the mean of the kinetic energy [J].

    Parameters
    ----------
    mean_kinetic : before the steps [J]. kinetic, stored : energy of motion, and what is stored in
        the sheet, after them [J]. duration : of the steps in the time of the sheet [s].
    """
    passed = duration / law.time
    mean_kinetic -= math.expm1(-passed / AVERAGING) * (kinetic - mean_kinetic)
    excess = mean_kinetic / (law.kinetic_part * max(stored, law.floor))
    if excess > 1.0:
        change = -min(0.5 * math.log(excess), passed / FALL)
    else:
        change = passed / GROWTH
        if excess > 0.0:
            change = min(-0.5 * math.log(excess), change)
    new_pace = min(max(pace * math.exp(change), SLOWEST), 1.0)
    # the motion follows the tools at once: the mean would tell of it too late
    return new_pace, mean_kinetic * (new_pace / pace) ** 2


def more_quasi_static(present: float, times: float) -> str:
    """Return the scene entry by which a process without a time takes so many times as long.

    present : ``process.quasi_static`` as it is. The value is rounded up: two digits of a factor
        close to 1 would be the present one.
    """
    return f"process.quasi_static = {two_digits_up(present * max(times, LEAST_SLOWER))}"


def active(model: EffectModel) -> list[Effect]:
    law = model.pace
    if law is None:
        return [Effect("pace", False, f"the process has a time, {1e3 * model.process_time:g} ms")]
    reason = (
        f"the kinetic energy stays about below {100 * law.kinetic_part:.2g} % of the energy "
        f"stored; at the fastest the process takes {1e3 * law.time:.3g} ms"
    )
    return [Effect("pace", True, reason)]
