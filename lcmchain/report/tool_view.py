"""The surfaces of the tools and where they stand in every frame, for the 3D view of the report."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.history_group import tool_places
from lcmchain.fields.sheet import reference_positions, sheet_positions
from lcmchain.fields.stages import STAGE
from lcmchain.report.packing import packed
from lcmchain.scene.stages import at_work
from lcmchain.tools.drawing import tool_surface
from lcmchain.tools.turn import placement, turning

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.scene import Scene
    from lcmchain.tools.tool import Tool

#: Surfaces with more triangles than this in all are left out, the finest first.
MOST_TRIANGLES = 60_000
# Room around the sheet that tools are cut to, in parts of its length.
MARGIN = (0.08, 0.08, 0.25)


def tool_data(scene: Scene, sheet: xr.Dataset, history: xr.Dataset) -> list[dict[str, Any]]:
    """Return index, name, ``points`` [mm] and ``triangles`` of every tool, and its ``shift`` [mm].

    Parameters
    ----------
    scene : with the tools in the order of the result.
    sheet, history : root group and ``/history`` of the result.

    Returns
    -------
    Plain values for JSON; arrays as in :func:`lcmchain.report.field_view.view_data`. ``shift`` has
    three numbers for every saved frame, ``works`` whether the tool is at work in it; with ``turn``
    of a tool that turns, the nine of a rotation that comes before. A tool outside the room around
    the sheet is left out, and so is one that is never at work.
    """
    corners = np.concatenate([reference_positions(sheet), sheet_positions(sheet)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = np.array(MARGIN) * float(max(high - low))
    box = np.array([low - margin, high + margin])
    surfaces = [tool_surface(tool, scene.source.directory, box) for tool in scene.tools]
    found: list[dict[str, Any]] = []
    places = tool_places(history)
    for index in _shown(surfaces):
        points, triangles = surfaces[index]
        tool = scene.tools[index]
        works = _at_work(scene, tool, history)
        if not any(works):
            continue
        rotations, shifts = _places(tool, places[:, index])
        found.append(
            {
                "index": index,
                "name": tool.name,
                "points": packed(1e3 * points, "<f4"),
                "triangles": packed(triangles, "<i4"),
                "shift": np.round(1e3 * shifts, 4).tolist(),
                "works": works,
            }
        )
        if rotations is not None:
            found[-1]["turn"] = np.round(rotations.reshape(-1, 9), 6).tolist()
    return found


def _places(tool: Tool, travels: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """Return rotations (F, 3, 3) of a tool, None without, and shifts (F, 3) [m] in all frames."""
    key = f'tool "{tool.name}"'
    own = tool.motion.table_entries(tool.local_axes(key=key)[2], math.inf, key=key)
    columns = ("direction", "turn_axis", "turn_point")
    table = SimpleNamespace(kind=np.zeros(1), **{name: own[name][None] for name in columns})
    where = [placement(table, 0, float(travel)) for travel in travels]
    shifts = np.array([shift for _, shift in where]).reshape(-1, 3)
    if not turning(table)[0]:
        return None, shifts
    return np.array([rotation for rotation, _ in where]), shifts


def _at_work(scene: Scene, tool: Any, history: xr.Dataset) -> list[bool]:
    """Tell in which saved frames a tool is at work."""
    if STAGE not in history:
        return [True] * history.sizes["time"]
    by_stage = [at_work(tool, stage) for stage in scene.stages]
    return [by_stage[int(number)] for number in history[STAGE].values]


def _shown(surfaces: list[tuple[np.ndarray, np.ndarray]]) -> list[int]:
    """Return the tools with a surface in the room, as many as stay light, the coarsest first."""
    chosen, room = [], MOST_TRIANGLES
    for index in sorted(range(len(surfaces)), key=lambda i: len(surfaces[i][1])):
        room -= len(surfaces[index][1])
        if len(surfaces[index][1]) and room >= 0:
            chosen.append(index)
    return sorted(chosen)
