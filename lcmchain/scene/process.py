"""Scene table of the process: what holds for the whole run."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.effects.mass_scaling import MassScaling
from lcmchain.quantities.entry_types import AbsentMeans, Number, PositiveTime, Range, Rate, Switch
from lcmchain.quantities.scene_model import SceneModel

#: What leaving out the time means, for the table of defaulted values.
FOUND_TIME = "found from the sheet"


class Process(SceneModel):
    """Time, frames, gravity and damping.

    Without a time the scene fills in what it finds (:mod:`lcmchain.scene.found_time`).
    """

    time: Annotated[PositiveTime, AbsentMeans(FOUND_TIME)] = Field(
        default=None,  # type: ignore[assignment]  # the scene fills it in before anybody reads it
        validate_default=False,
        description="Simulated time. Left out where a stroke leads the sheet, it is found from the "
        "sheet, and the pace of the process follows its energies.",
    )
    quasi_static: Annotated[float, Number(2.0, Range(0.1, 100.0))] = Field(
        default=1.0,
        description="How slow a process without a time is: 2 takes twice the steps, and has a "
        "quarter of the kinetic energy.",
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
            description="Mass damping acts on a node's velocity relative to its mean over about "
            "this time, so that steady drawing is not damped.",
        )
    )
    gravity: Switch = Field(default=False, description="9.81 m/s2 along -z on the blank.")
    step_safety: Annotated[float, Number(0.9, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.9, description="Fraction of the critical time step that is used."
    )
    fibre_modulus_factor: Annotated[float, Number(0.25, Range(0.0, 1.0, (0.0,)))] = Field(
        default=1.0,
        description="Modulus of the fibres in the simulation over that of the fabric: a lower one "
        "makes the time step larger.",
    )
    fibre_strain_allowed: Annotated[float, Number(0.002, Range(0.0, 0.1, (0.0,)))] = Field(
        default=0.002,
        description="Largest fibre strain that a lowered modulus may lead to; a run that exceeds "
        "it warns and says which factor to use.",
    )
    mass_scaling: Annotated[MassScaling | None, AbsentMeans("no mass is added")] = Field(
        default=None,
        description="Inertia that is added to the sheet for a larger time step.",
    )
