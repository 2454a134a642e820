"""Scene table of a rigid tool."""

from __future__ import annotations

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AT_WORK,
    AbsentMeans,
    AtWork,
    Direction,
    FrictionCoefficient,
    Name,
    Position,
    SceneModel,
)
from lcmchain.tools.motion import FixedMotion, Motion
from lcmchain.tools.shapes import Shape


class Tool(SceneModel):
    """A rigid tool: shape, place, motion, friction."""

    name: Annotated[str, Name("punch")] = Field(
        description="Name in reports, files and overrides, as in --set tools.punch.friction=0.2."
    )
    stages: AtWork = Field(default=None, description=AT_WORK)
    shape: Shape = Field(description="Surface of the tool.")
    position: Position = Field(  # type: ignore[assignment]
        default=("0 mm", "0 mm", "0 mm"), description="Place of the shape's local origin."
    )
    axis: Direction = Field(default=(0, 0, 1), description="Local z axis of the shape.")
    motion: Motion = Field(default_factory=FixedMotion, description="How the tool moves.")
    friction: Annotated[FrictionCoefficient | None, AbsentMeans("contact.friction")] = Field(
        default=None, description="Coulomb friction coefficient; default contact.friction."
    )

    def completed(self, friction: float, process_time: float, *, key: str) -> Self:
        """Fill the entries whose default is another entry of the scene; an error names the key."""
        changes: dict[str, Any] = {}
        if self.friction is None:
            changes["friction"] = friction
        motion = self.motion.completed(process_time, key=f"{key}.motion")
        if motion is not self.motion:
            changes["motion"] = motion
        return self.model_copy(update=changes)

    def without_time(self, process_time: float, *, key: str) -> Self:
        """Fill the times of the motion in a process without a time; an error names the key."""
        motion = self.motion.without_time(process_time, key=f"{key}.motion")
        return self.model_copy(update={"motion": motion})

    def local_axes(self, *, key: str) -> np.ndarray:
        """Local axes of the tool as rows, shape [3, 3]; an error names the key.

        Local z is the tool's axis. Local y is perpendicular to it and to global x (or is global y
        where the axis is along x), so that a tool with the axis (0, 0, 1) is not rotated.
        """
        axis = np.array(self.axis, dtype=float)
        length = np.linalg.norm(axis)
        if axis.shape != (3,) or not 0.0 < length < math.inf:
            raise InputError(
                f"{self.axis} is not a direction; give three numbers, not all zero", key=key
            )
        axis /= length
        across = np.cross(axis, [1.0, 0.0, 0.0])
        if np.linalg.norm(across) < 1e-9:
            across = np.array([0.0, 1.0, 0.0])
            axis = np.array([math.copysign(1.0, axis[0]), 0.0, 0.0])
        across /= np.linalg.norm(across)
        return np.array([np.cross(across, axis), across, axis]) + 0.0  # + 0.0 turns -0 into 0
