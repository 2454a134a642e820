"""Turn: an angle about an axis between two times, smooth or at constant speed."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Angle,
    Direction,
    Position,
    PositiveTime,
    TimeOrZero,
    wrong,
)
from lcmchain.tools.motion.base import LINEAR, PRESCRIBED, SMOOTH, ToolMotion, unit_direction
from lcmchain.tools.motion.stroke import end_of_motion, require_later_end


class TurnMotion(ToolMotion):
    """The tool turns about an axis by an angle between two times, then stays."""

    kind: ClassVar[int] = PRESCRIBED

    type: Literal["turn"]
    axis: Direction = Field(description="Direction of the axis; scaled to length one.")
    point: Position = Field(description="A point of the axis, as the tool stands at the start.")
    angle: Angle = Field(
        description="Angle at the end of the turn, right-handed about the axis; against it if "
        "negative."
    )
    profile: Literal["smooth", "linear"] = Field(
        default="smooth", description="Smooth: starts and ends without velocity and acceleration."
    )
    start: TimeOrZero = Field(default="0 s", description="Time at which the turn starts.")  # type: ignore[assignment]
    end: Annotated[PositiveTime | None, AbsentMeans("process.time")] = Field(
        default=None, description="Time at which the turn ends."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.angle == 0.0:
            raise wrong('is 0; give an angle, as "90 deg", or leave the motion out', field="angle")
        require_later_end(self.start, self.end)
        return self

    def without_time(self, process_time: float, *, key: str) -> Self:
        self._require_no_time(key, "start", "end")
        return self

    def completed(self, process_time: float, *, key: str) -> Self:
        end = end_of_motion(self.start, self.end, process_time, key=key)
        return self.model_copy(update={"end": end})

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        about = unit_direction(self.axis, f"{key}.axis")
        end = process_time if self.end is None else self.end
        if not end > self.start:
            raise InputError(
                f"the turn ends at {end:g} s but starts at {self.start:g} s; let it end later",
                key=f"{key}.end",
            )
        return self.columns(
            np.zeros(3),
            turn_axis=about,
            turn_point=np.array(self.point, dtype=float),
            stroke_profile=LINEAR if self.profile == "linear" else SMOOTH,
            stroke_distance=self.angle,
            stroke_start=self.start,
            stroke_end=end,
        )

    @property
    def moves(self) -> bool:
        return True

    @property
    def turns(self) -> bool:
        return True

    def remarks(self, tool_name: str, process_time: float) -> list[str]:
        if abs(self.angle) > 2.0 * math.pi:
            degrees = math.degrees(abs(self.angle))
            return [f'"{tool_name}" turns by {degrees:.4g} degrees, more than once around']
        return []
