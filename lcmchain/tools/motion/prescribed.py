"""Motions whose travel is given over time: strokes, turns and tables, with their compiled laws.

:func:`prescribed_travel` chooses among the laws of one table of tools.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Angle,
    Direction,
    Length,
    Position,
    PositiveForce,
    PositiveLength,
    PositiveTime,
    Row,
    TimeOrZero,
    wrong,
)
from lcmchain.tools.motion.base import (
    LINEAR,
    PRESCRIBED,
    SMOOTH,
    TABULATED,
    ToolMotion,
    smooth_step,
    unit_direction,
)


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


class _BetweenTimes(ToolMotion):
    """Base of what begins and ends once; the entries below are stated in an order of their own."""

    kind: ClassVar[int] = PRESCRIBED

    if TYPE_CHECKING:
        type: str
        profile: Literal["smooth", "linear"]
        start: TimeOrZero
        end: PositiveTime | None

    def without_time(self, process_time: float, *, key: str) -> Self:
        self._require_no_time(key, "start", "end")
        return self

    def completed(self, process_time: float, *, key: str) -> Self:
        end = end_of_motion(self.start, self.end, process_time, key=key)
        return self.model_copy(update={"end": end})

    def timed_columns(self, way: float, process_time: float, *, key: str) -> dict[str, float]:
        """Return the columns of a way [m or rad] between the times, see :meth:`columns`."""
        end = process_time if self.end is None else self.end
        if not end > self.start:
            raise InputError(
                f"the {self.type} ends at {end:g} s but starts at {self.start:g} s; let it end "
                "later",
                key=f"{key}.end",
            )
        if self.profile not in ("smooth", "linear"):
            raise InputError(f'"{self.profile}" is not "smooth" or "linear"', key=f"{key}.profile")
        return {
            "stroke_profile": LINEAR if self.profile == "linear" else SMOOTH,
            "stroke_distance": way,
            "stroke_start": self.start,
            "stroke_end": end,
        }

    @property
    def moves(self) -> bool:
        return True


class StrokeMotion(_BetweenTimes):
    """The tool travels a distance along a direction between two times, then stays."""

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

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        return self.columns(
            unit_direction(self.direction, key),
            **self.timed_columns(self.distance, process_time, key=key),
            until_force=math.inf if self.until_force is None else self.until_force,
        )


class TurnMotion(_BetweenTimes):
    """The tool turns about an axis by an angle between two times, then stays."""

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

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        return self.columns(
            np.zeros(3),
            turn_axis=unit_direction(self.axis, f"{key}.axis"),
            turn_point=np.array(self.point, dtype=float),
            **self.timed_columns(self.angle, process_time, key=key),
        )

    @property
    def turns(self) -> bool:
        return True

    def remarks(self, tool_name: str, process_time: float) -> list[str]:
        if abs(self.angle) > 2.0 * math.pi:
            degrees = math.degrees(abs(self.angle))
            return [f'"{tool_name}" turns by {degrees:.4g} degrees, more than once around']
        return []


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


@equation
def prescribed_travel(table, tool, time):
    """Travel [m] of a fixed or prescribed tool along its direction, and its velocity [m/s].

    A guided tool has no prescribed travel: the result is that at the start, and 0.
    """
    start = table.travel_start[tool]
    if table.motion_kind[tool] != PRESCRIBED:
        return start, 0.0
    if table.stroke_profile[tool] == TABULATED:
        travel, velocity = tabulated_travel(
            table.table_times,
            table.table_travels,
            table.table_start[tool],
            table.table_start[tool + 1],
            time,
        )
        return start + travel, velocity
    travel, velocity = stroke_travel(table, tool, time)
    return start + travel, velocity


def travel_along(motion: ToolMotion, process_time: float) -> Callable[[float], float]:
    """Return the travel [m] of a prescribed motion by the time of the process [s].

    For what is led without being a tool.
    """
    entries = motion.table_entries(np.array([0.0, 0.0, 1.0]), process_time, key="motion")
    if entries["stroke_profile"] == TABULATED:
        times, travels = entries["table_times"], entries["table_travels"]
        return lambda time: float(np.interp(time, times, travels))
    stroke = SimpleNamespace(
        **{name: (value,) for name, value in entries.items() if name.startswith("stroke_")}
    )
    return lambda time: float(stroke_travel.py_func(stroke, 0, time)[0])
