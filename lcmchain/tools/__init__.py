"""Rigid tools: shapes as signed distances, and their motion.

    [[tools]] of a scene: Tool ─┬─ shapes ─▶ profiles, or distance fields of surfaces ─┐
       (tool.py)                └─ motion ─▶ travel over time, or mass and load ───────┤
                                                                                       ▼
        gap and normal at a point ◀── distance, pack_distance ◀── ToolTable (table.py)

- ``profiles.py``: plane curves of lines and arcs; ``profile_corners.py`` makes them from corner
  points and fillet radii.
- ``surfaces``: surfaces from mesh files, made sound, and their distance fields.
- ``distance.py``: what contact asks for one point; ``pack_distance.py``: for eight nodes at once.
- ``closest_gap.py``: how close two tools come to each other on their way.
"""

from __future__ import annotations

from lcmchain.tools.distance import EXTRUDED, FIELD, PLANE, REVOLVED, gaps, signed_distance
from lcmchain.tools.motion import FIXED, GUIDED, PRESCRIBED, prescribed_travel
from lcmchain.tools.surfaces.surface import ToolWarning
from lcmchain.tools.table import ToolTable, build_tool_table
from lcmchain.tools.tool import tool_surface

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
