"""Motion that follows a table of travel over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import Direction, Length, Row, TimeOrZero, wrong
from lcmchain.tools.motion.base import (
    PRESCRIBED,
    TABULATED,
    ToolMotion,
    unit_direction,
)


@equation
def tabulated_travel(times, travels, first, last, time):
    """Piecewise linear travel [m] and its velocity [m/s]; at rest before and after the table."""
    if time <= times[first]:
        return travels[first], 0.0
    if time >= times[last - 1]:
        return travels[last - 1], 0.0
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    velocity = (travels[high] - travels[low]) / (times[high] - times[low])
    return travels[low] + velocity * (time - times[low]), velocity


class TableMotion(ToolMotion):
    """The tool follows a table of travel over time along a direction."""

    kind: ClassVar[int] = PRESCRIBED

    type: Literal["table"]
    direction: Direction = Field(description="Direction of travel; scaled to length one.")
    times: Annotated[
        tuple[TimeOrZero, ...], Row('"0 10 20 ms"', minimum_count=2, entries="times")
    ] = Field(description="Times of the table, increasing.")
    travel: Annotated[
        tuple[Length, ...], Row('"0 5 20 mm"', minimum_count=2, entries="lengths")
    ] = Field(description="Travel at these times, from 0; linear in between.")

    #: Of a course over stages: the force [N] of the sheet that may stop the tool before.
    _until_force: float = PrivateAttr(default=math.inf)
    #: Of a course over stages of a tool that turns: its axis, and a point of that [m].
    _turn_axis: tuple[float, ...] = PrivateAttr(default=())
    _turn_point: tuple[float, ...] = PrivateAttr(default=())

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if len(self.times) != len(self.travel):
            raise wrong(
                f"has {len(self.travel)} values for {len(self.times)} times; give one per time",
                field="travel",
            )
        for number, (earlier, later) in enumerate(zip(self.times, self.times[1:])):
            if later <= earlier:
                raise wrong(f"do not increase after entry [{number}]", field="times")
        if self.travel[0] != 0.0:
            raise wrong(
                f"starts at {self.travel[0] * 1e3:g} mm; it is counted from the tool's position "
                "and must start at 0 mm",
                field="travel",
            )
        return self

    def without_time(self, process_time: float, *, key: str) -> Self:
        self._require_no_time(key, "times")
        return self

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        direction = unit_direction(self.direction, key)
        times = np.array(self.times, dtype=float)
        travels = np.array(self.travel, dtype=float)
        if len(times) != len(travels):
            raise InputError(
                f"{len(travels)} values for {len(times)} times; give one travel per time",
                key=f"{key}.travel",
            )
        if len(times) < 2:
            raise InputError("a table of motion needs at least two times", key=f"{key}.times")
        if not (np.diff(times) > 0.0).all():
            i = int(np.argmin(np.diff(times) > 0.0)) + 1
            raise InputError(
                f"times must rise, but time {i} ({times[i]:g} s) follows {times[i - 1]:g} s",
                key=f"{key}.times[{i}]",
            )
        course = self.columns(
            direction,
            stroke_profile=TABULATED,
            table_times=times,
            table_travels=travels,
            until_force=self._until_force,
        )
        if not self._turn_axis:
            return course
        return course | {
            "direction": np.zeros(3),
            "turn_axis": unit_direction(self._turn_axis, f"{key}.axis"),
            "turn_point": np.array(self._turn_point, dtype=float),
        }

    def at_most(self, until_force: float) -> Self:
        """Return this course as the farthest of a tool that a force [N] may stop before."""
        course = self.model_copy()
        course._until_force = until_force
        return course

    def about(self, axis: Sequence[float], point: Sequence[float]) -> Self:
        """Return this course as one of angles [rad] about an axis through a point [m]."""
        course = self.model_copy()
        course._turn_axis, course._turn_point = tuple(axis), tuple(point)
        return course

    @property
    def moves(self) -> bool:
        return True

    @property
    def turns(self) -> bool:
        return bool(self._turn_axis)

    def remarks(self, tool_name: str, process_time: float) -> list[str]:
        if self.times[-1] > process_time * (1 + 1e-12):
            return [f'the motion table of "{tool_name}" goes on after process.time']
        return []
