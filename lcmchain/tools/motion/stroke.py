"""Stroke: a distance between two times, smooth or at constant speed."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Direction,
    PositiveForce,
    PositiveLength,
    PositiveTime,
    TimeOrZero,
    wrong,
)
from lcmchain.tools.motion.base import (
    LINEAR,
    PRESCRIBED,
    SMOOTH,
    ToolMotion,
    unit_direction,
)
from lcmchain.tools.motion.smooth_step import smooth_step


@equation
def stroke_travel(table, tool, time):
    """Travel [m] of a stroke and its velocity [m/s]; at rest before and after it."""
    distance = table.stroke_distance[tool]
    start = table.stroke_start[tool]
    duration = table.stroke_end[tool] - start
    s = (time - start) / duration
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return distance, 0.0
    if table.stroke_profile[tool] == LINEAR:
        return s * distance, distance / duration
    value, slope = smooth_step(s)
    return value * distance, slope * distance / duration


def require_later_end(start: float, end: float | None) -> None:
    """Refuse a motion whose end [s], if it is given, is not after its start [s]."""
    if end is not None and end <= start:
        raise wrong(f"is {end:g} s, not after the start at {start:g} s", field="end")


def end_of_motion(start: float, end: float | None, process_time: float, *, key: str) -> float:
    """Return when a motion ends [s], that of the process [s] where it does not say.

    Raises
    ------
    PydanticCustomError : it would not begin or not finish in the process; names the entry.
    """
    if start >= process_time:
        raise wrong(
            f"is {start:g} s, not before the end of the process at {process_time:g} s; "
            "the tool would never move",
            field=f"{key}.start",
        )
    if end is not None and end > process_time * (1 + 1e-12):
        raise wrong(
            f"is {end:g} s, after the end of the process at {process_time:g} s: the stroke "
            "would not finish; give a longer process.time or an earlier end",
            field=f"{key}.end",
        )
    return process_time if end is None else end


class StrokeMotion(ToolMotion):
    """The tool travels a distance along a direction between two times, then stays."""

    kind: ClassVar[int] = PRESCRIBED

    type: Literal["stroke"]
    direction: Direction = Field(description="Direction of travel; scaled to length one.")
    distance: PositiveLength = Field(description="Travel at the end of the stroke.")
    profile: Literal["smooth", "linear"] = Field(
        default="smooth", description="Smooth: starts and ends without velocity and acceleration."
    )
    start: TimeOrZero = Field(default="0 s", description="Time at which the stroke starts.")  # type: ignore[assignment]
    end: Annotated[PositiveTime | None, AbsentMeans("process.time")] = Field(
        default=None, description="Time at which the stroke ends."
    )

    until_force: Annotated[PositiveForce | None, AbsentMeans("the whole distance")] = Field(
        default=None,
        description="Force of the sheet against the travel at which the tool stops where it is, "
        "and stays there; the distance is then the farthest that it goes.",
    )

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        require_later_end(self.start, self.end)
        return self

    def without_time(self, process_time: float, *, key: str) -> Self:
        self._require_no_time(key, "start", "end")
        return self

    def completed(self, process_time: float, *, key: str) -> Self:
        end = end_of_motion(self.start, self.end, process_time, key=key)
        return self.model_copy(update={"end": end})

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        direction = unit_direction(self.direction, key)
        start = 0.0 if self.start is None else self.start
        end = process_time if self.end is None else self.end
        if not end > start:
            raise InputError(
                f"the stroke ends at {end:g} s but starts at {start:g} s; let it end later",
                key=f"{key}.end",
            )
        if self.profile not in ("smooth", "linear"):
            raise InputError(f'"{self.profile}" is not "smooth" or "linear"', key=f"{key}.profile")
        return self.columns(
            direction,
            stroke_profile=LINEAR if self.profile == "linear" else SMOOTH,
            stroke_distance=self.distance,
            stroke_start=start,
            stroke_end=end,
            until_force=math.inf if self.until_force is None else self.until_force,
        )

    @property
    def moves(self) -> bool:
        return True
