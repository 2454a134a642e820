"""Tool that slides on a guide under its weight, a force and the contact.

Its equation of motion is integrated by the solver; the table holds its data. A stop of the press
holds the tool where it may go no further, and takes the motion that it has left.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Direction,
    Force,
    PositiveLength,
    PositiveMass,
    Switch,
    TimeOrZero,
    ViscousDamping,
)
from lcmchain.tools.motion.base import (
    GUIDED,
    STANDARD_GRAVITY,
    ToolMotion,
    smooth_step,
    unit_direction,
)

# Of a process without a time: over which the load of a tool comes on.
RAMP_PART = 0.05


@equation
def way_to_stop(table, tool, travel):
    """Way [m] that a guided tool may still go along its direction, and the sign of that.

    0 at its stop and beyond it, infinite without one.
    """
    stop = table.stop[tool]
    side = math.copysign(1.0, stop)
    return max(side * (table.travel_start[tool] + stop - travel), 0.0), side


@equation
def guided_load(table, tool, added_force, time):
    """Load [N] on a guided tool along its direction: weight and forces, ramped up."""
    load = table.force[tool] + added_force + table.mass[tool] * table.gravity_along[tool]
    since = time - table.load_start[tool]
    if since < table.ramp[tool]:
        return smooth_step(since / table.ramp[tool])[0] * load
    return load


class GuidedMotion(ToolMotion):
    """The tool slides along a direction under its weight and a given force."""

    kind: ClassVar[int] = GUIDED

    type: Literal["guided"]
    direction: Direction = Field(description="Positive direction of travel.")
    mass: PositiveMass = Field(description="Mass of the tool.")
    force: Force = Field(default="0 N", description="Constant force along the direction.")  # type: ignore[assignment]
    gravity: Switch = Field(
        default=True, description="Add the component of 9.81 m/s2 (0, 0, -1) along the direction."
    )
    damping: ViscousDamping = Field(default="0 N*s/m", description="Viscous damping of the travel.")  # type: ignore[assignment]
    ramp: TimeOrZero = Field(  # type: ignore[assignment]
        default="0 s",
        description="Time over which weight and force come on smoothly; without it a tool laid on "
        "the blank bounces with twice its load. A process without a time fills it in: a twentieth.",
    )

    stop: Annotated[PositiveLength | None, AbsentMeans("no stop")] = Field(
        default=None,
        description="Travel at which a stop of the press holds the tool: it takes what the sheet "
        "leaves of the load.",
    )

    @property
    def load(self) -> float:
        """Force along the direction of travel from weight and given force [N]."""
        weight = -STANDARD_GRAVITY * self.mass * self.direction[2] if self.gravity else 0.0
        return self.force + weight

    def without_time(self, process_time: float, *, key: str) -> Self:
        self._require_no_time(key, "ramp")
        if "ramp" in self.model_fields_set:
            return self
        return self.model_copy(update={"ramp": RAMP_PART * process_time})

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        direction = unit_direction(self.direction, key)
        if not self.mass > 0.0:
            raise InputError(f"must be positive, is {self.mass:g} kg", key=f"{key}.mass")
        return self.columns(
            direction,
            mass=self.mass,
            force=self.force,
            damping=self.damping,
            ramp=self.ramp,
            stop=math.inf if self.stop is None else self.stop,
            gravity_along=-STANDARD_GRAVITY * direction[2] if self.gravity else 0.0,
        )

    @property
    def moves(self) -> bool:
        return self.load != 0.0

    def remarks(self, tool_name: str, process_time: float) -> list[str]:
        if self.load < 0.0:
            return [
                f'the load on "{tool_name}" ({self.load:.3g} N) points against its '
                "direction of travel"
            ]
        return []
