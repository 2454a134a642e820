"""Travel of tools whose motion is given over time: the choice among the compiled laws."""

from __future__ import annotations

from lcmchain.jit import equation
from lcmchain.tools.motion.base import PRESCRIBED, TABULATED
from lcmchain.tools.motion.stroke import stroke_travel
from lcmchain.tools.motion.table import tabulated_travel


@equation
def prescribed_travel(table, tool, time):
    """Travel [m] of a fixed or prescribed tool along its direction, and its velocity [m/s].

    A guided tool has no prescribed travel: the result is (0, 0).
    """
    if table.motion_kind[tool] != PRESCRIBED:
        return 0.0, 0.0
    if table.stroke_profile[tool] == TABULATED:
        return tabulated_travel(
            table.table_times,
            table.table_travels,
            table.table_start[tool],
            table.table_start[tool + 1],
            time,
        )
    return stroke_travel(table, tool, time)
