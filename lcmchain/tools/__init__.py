"""Rigid tools: shapes as signed distances, and their motion."""

from __future__ import annotations

from lcmchain.tools.distance import EXTRUDED, FIELD, PLANE, REVOLVED, gaps, signed_distance
from lcmchain.tools.drawing import tool_surface
from lcmchain.tools.motion import FIXED, GUIDED, PRESCRIBED, prescribed_travel
from lcmchain.tools.surfaces.surface import ToolWarning
from lcmchain.tools.table import ToolTable, build_tool_table

__all__ = [
    "EXTRUDED",
    "FIELD",
    "FIXED",
    "GUIDED",
    "PLANE",
    "PRESCRIBED",
    "REVOLVED",
    "ToolTable",
    "ToolWarning",
    "build_tool_table",
    "gaps",
    "prescribed_travel",
    "signed_distance",
    "tool_surface",
]
