"""Scene tables of the process and of its stages, and the time of one that gives none.

A process without rates takes any time. In the simulation it takes as long as inertia needs to stay
small, and no longer. The slowest shear vibration of the sheet, where its law is softest, is the
measure; while the process runs, its pace follows the energies
(:mod:`lcmchain.effects.process.pace`).

A stage is a time with motions of its own, and with the tools, grippers, pressures and interfaces
that are at work in it.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, PrivateAttr

from lcmchain.effects.process.mass_scaling import MassScaling
from lcmchain.errors import InputError
from lcmchain.materials.law import Material
from lcmchain.materials.shear_waves import shear_wave_speeds
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Name,
    Number,
    PositiveTime,
    Range,
    Rate,
    SceneModel,
    Switch,
)
from lcmchain.tools.motion import (
    Motion,
)

#: What leaving out the time means, for the table of defaulted values.
FOUND_TIME = "found from the sheet"


class Process(SceneModel):
    """Time, frames, gravity and damping.

    Without a time the scene fills in what it finds (:func:`lcmchain.scene.process.found_time`).
    """

    time: Annotated[PositiveTime, AbsentMeans(FOUND_TIME)] = Field(
        default=None,  # type: ignore[assignment]  # the scene fills it in before anybody reads it
        validate_default=False,
        description="Simulated time. Left out where a stroke leads the sheet, it is found from "
        "the sheet, and the pace follows its energies.",
    )
    quasi_static: Annotated[float, Number(2.0, Range(0.1, 100.0))] = Field(
        default=1.0,
        description="How slow a process without a time is: 2 has twice the steps and a quarter "
        "of the kinetic energy.",
    )
    frames: Annotated[int, Number(21, Range(2, 100_000), whole=True)] = Field(
        default=21, description="Saved frames, including the start."
    )
    mass_damping: Rate = Field(
        default="0 1/s",  # type: ignore[assignment]
        description="Mass-proportional damping; without it 0 1/s, and found together with a time "
        "that is left out.",
    )
    damping_average: Annotated[PositiveTime | None, AbsentMeans("none: all motion is damped")] = (
        Field(
            default=None,
            description="Mass damping acts on a velocity less its mean over about this time: "
            "steady drawing is not damped.",
        )
    )
    gravity: Switch = Field(default=False, description="9.81 m/s2 along -z on the blank.")
    step_safety: Annotated[float, Number(0.9, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.9, description="Fraction of the critical time step that is used."
    )
    fibre_modulus_factor: Annotated[float, Number(0.25, Range(0.0, 1.0, (0.0,)))] = Field(
        default=1.0,
        description="Simulated modulus of the fibres over that of the fabric: a lower one makes "
        "the time step larger.",
    )
    fibre_strain_allowed: Annotated[float, Number(0.002, Range(0.0, 0.1, (0.0,)))] = Field(
        default=0.002,
        description="Largest fibre strain with a lowered modulus; a run that exceeds it says "
        "which factor to use.",
    )
    mass_scaling: Annotated[MassScaling | None, AbsentMeans("no mass is added")] = Field(
        default=None,
        description="Inertia that is added to the sheet for a larger time step.",
    )


class Stage(SceneModel):
    """A stage of the process: its time, and what moves in it."""

    name: Annotated[str, Name("close")] = Field(description="Name in results and messages.")
    time: Annotated[PositiveTime, AbsentMeans(FOUND_TIME)] = Field(
        default=None,  # type: ignore[assignment]  # filled in before anybody reads it
        validate_default=False,
        description="How long it takes. Left out where a stroke leads the sheet, it is found as "
        "process.time is.",
    )
    motions: Annotated[dict[Annotated[str, Name("punch")], Motion], AbsentMeans("")] = Field(
        default_factory=dict,
        description="Motions by the name of a tool, or of a gripper that holds. Travel and times "
        "count from the start of the stage.",
    )
    mass_damping: Annotated[Rate | None, AbsentMeans("process.mass_damping")] = Field(
        default=None, description="Mass-proportional damping in this stage."
    )
    rest: Switch = Field(
        default=False,
        description="The sheet comes to rest: it is stopped at each peak of its kinetic energy, "
        "and the stage ends when it is at rest, at the latest after its time.",
    )
    rest_energy: Annotated[float, Number(1e-4, Range(0.0, 0.1, (0.0,)))] = Field(
        default=1e-4,
        description="The sheet is at rest when its kinetic energy stays below this part of the "
        "energy that was stored when the motions of the stage had ended.",
    )
    resin_time: Annotated[PositiveTime | None, AbsentMeans("part of infiltration.time")] = Field(
        default=None,
        description="Time of the stage for a resin that flows meanwhile "
        "(infiltration.with_forming). Stages without it share what is left of "
        "infiltration.time by their times.",
    )
    springback_from: Annotated[
        Annotated[str, Name("close")] | None, AbsentMeans("the stage before")
    ] = Field(
        default=None,
        description="With rest: the stage at whose end the part has the shape that springback is "
        "measured from.",
    )

    _found: bool = PrivateAttr(default=False)

    @property
    def time_is_found(self) -> bool:
        """Whether the scene gives no time for it."""
        return self._found


# --- the time that is found -----------------------------------------------------------------------


#: Periods of the slowest shear vibration that the process takes at the fastest.
PERIODS = 2.4
#: Speed of the waves where the law is softest, over that at rest, at least: where a measured law is
#: flat, waves stand still, and the pace that follows the energies is the better measure.
LEAST_SPEED = 0.2
#: Mean speed of a tool at most [m/s]: a stiff sheet has fast waves.
TOOL_SPEED = 2.0
#: Rate of the mass damping times the time of the process.
DAMPING_TIMES_TIME = 10.0
#: Part of the time over which the motion is averaged that the damping leaves alone.
AVERAGING_PART = 0.06


def found_time(
    process: Process, extent: tuple[float, float], material: Material, travel: float
) -> float:
    """Return the time of a process at pace 1 [s].

    Parameters
    ----------
    process : its table, without a time. extent : of the blank along x and y [m].
    travel : longest stroke of a tool [m].
    """
    at_rest, softest = shear_wave_speeds(material)
    period = 2.0 * max(extent) / max(softest, LEAST_SPEED * at_rest)
    # added mass slows the waves down; what a target step adds is not known before the mesh is
    scaling = process.mass_scaling
    slower = 1.0 if scaling is None else math.sqrt(scaling.factor)
    return process.quasi_static * slower * max(PERIODS * period, travel / TOOL_SPEED)


def require_time_for_fluid(*, time_is_found: bool, pore_pressure: bool) -> None:
    """Refuse a fluid in the pores of a sheet whose process has no time.

    Raises
    ------
    InputError : there is one.
    """
    if time_is_found and pore_pressure:
        raise InputError(
            "is missing, but a fluid acts in the pores, and it has a time of its own; give "
            'time = "200 ms"',
            key="process.time",
        )


#: Why a sheet has a time of its own, in words.
DEPENDS_ON_RATES = (
    "the fabric depends on its rate or relaxes (material.viscous, material.bending.viscous_1)"
)


def require_time_for_rates(*, time_is_found: bool, resists_rates: bool) -> None:
    """Refuse a sheet whose stress depends on its rate in a process that has no time.

    Raises
    ------
    InputError : there is one.
    """
    if time_is_found and resists_rates:
        raise InputError(
            f'is missing, but {DEPENDS_ON_RATES}; give time = "200 ms"',
            key="process.time",
        )
