"""Travel of tools whose motion is given over time: the choice among the compiled laws."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from lcmchain.jit import equation
from lcmchain.tools.motion.base import PRESCRIBED, TABULATED, ToolMotion
from lcmchain.tools.motion.stroke import stroke_travel
from lcmchain.tools.motion.table import tabulated_travel


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
