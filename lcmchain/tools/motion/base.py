"""What every motion offers to the tool table, to checks and to the FMU; a tool at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np

from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import SceneModel, wrong

#: Values of ToolTable.motion_kind.
FIXED = 0
PRESCRIBED = 1
GUIDED = 2

#: Values of ToolTable.stroke_profile.
SMOOTH = 0
LINEAR = 1
TABULATED = 2

STANDARD_GRAVITY = 9.81  # [m/s2], along -z


class ToolMotion(SceneModel):
    """Motion of a rigid tool along a direction or about an axis; sub-classes are scene tables."""

    #: Value in ToolTable.motion_kind.
    kind: ClassVar[int]

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        """Entries of the motion in the tool table, see :meth:`columns`.

        Parameters
        ----------
        axis : unit vector [3] of the tool's local z, the direction of a tool that never moves.
        process_time : end [s] of a motion that does not say when it ends.
        key : scene key of the motion, named in errors.

        Raises
        ------
        InputError : a motion that is not one; names the entry.
        """
        raise NotImplementedError

    def columns(self, direction: np.ndarray, **given: Any) -> dict[str, Any]:
        """Entries of one tool in the motion columns of the tool table, zero where not given."""
        return {
            "motion_kind": self.kind,
            "direction": direction,
            "turn_axis": np.zeros(3),
            "turn_point": np.zeros(3),
            "mass": 0.0,
            "force": 0.0,
            "damping": 0.0,
            "ramp": 0.0,
            "gravity_along": 0.0,
            "load_start": 0.0,
            "travel_start": 0.0,
            "stop": math.inf,
            "until_force": math.inf,
            "stroke_profile": SMOOTH,
            "stroke_distance": 0.0,
            "stroke_start": 0.0,
            "stroke_end": 1.0,
            "table_times": np.zeros(0),
            "table_travels": np.zeros(0),
            **given,
        }

    def completed(self, process_time: float, *, key: str) -> Self:
        """Fill the entries whose default is another entry of the scene; an error names the key."""
        return self

    def without_time(self, process_time: float, *, key: str) -> Self:
        """Fill the entries that are times where the process has none; an error names a given one.

        process_time : that is found for it [s].
        """
        return self

    def _require_no_time(self, key: str, *entries: str) -> None:
        """Refuse entries that are times of a process which has none."""
        for entry in entries:
            if entry in self.model_fields_set and getattr(self, entry):
                raise wrong(
                    "is a time of the process, but process.time is left out; give process.time, "
                    "or leave this entry out as well",
                    field=f"{key}.{entry}",
                )

    @property
    def moves(self) -> bool:
        """Whether the tool is driven: by a prescribed travel or by a load."""
        return False

    @property
    def turns(self) -> bool:
        """Whether the tool turns about an axis; else it goes along a direction."""
        return False

    def remarks(self, tool_name: str, process_time: float) -> list[str]:
        """Say what is allowed but probably not meant, in a process of a duration [s]."""
        return []


def unit_direction(direction: Sequence[float] | np.ndarray, key: str) -> np.ndarray:
    """Scale the direction of a motion to length one."""
    vector = np.array(direction, dtype=float)
    length = math.hypot(*vector)
    if vector.shape != (3,) or not 0.0 < length < math.inf:
        raise InputError(
            f"{direction} is not a direction; give three numbers, not all zero",
            key=f"{key}.direction",
        )
    return vector / length


class FixedMotion(ToolMotion):
    """The tool does not move."""

    kind: ClassVar[int] = FIXED

    type: Literal["fixed"] = "fixed"

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        return self.columns(np.asarray(axis, dtype=float))


@equation
def smooth_step(s):
    """Quintic smoothstep 10 s^3 - 15 s^4 + 6 s^5 and its derivative, 0 <= s <= 1.

    Velocity and acceleration vanish at both ends, so that a stroke starts and stops without a jerk.
    """
    value = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    slope = 30.0 * s * s * (1.0 - s) * (1.0 - s)
    return value, slope
