"""Tools that never load the sheet: where it is plain before a run, and what a run shows.

A tool may never come to the sheet, or touch it at the start and move away from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.model import Model
from lcmchain.scene import Scene
from lcmchain.state import State
from lcmchain.tools.distance import gaps
from lcmchain.tools.initial_overlap import OVERLAP_TOLERANCE
from lcmchain.tools.motion import GUIDED, PRESCRIBED
from lcmchain.tools.motion.base import TABULATED
from lcmchain.tools.turn import lever, turning

if TYPE_CHECKING:
    from lcmchain.solver.simulation import Snapshot

#: Depth of a tool in the sheet, in parts of the thickness, that is rounding and no load.
NO_LOAD = 1e-9
#: Evaluations along a travel after which a tool counts as one that may touch.
MOST_EVALUATIONS = 2000
#: Places along a travel at which a tool that touches at the start is looked at.
SAMPLES_OF_TRAVEL = 51


def tools_out_of_reach(scene: Scene, model: Model) -> list[str]:
    """Say which tools cannot touch the blank, where the scene makes that certain.

    It does where the sheet stays as it is: no gravity, no tool that moves under a load, and no
    driven tool whose travel reaches the undeformed blank.
    """
    moving = [index for index, tool in enumerate(scene.tools) if tool.motion.moves]
    kinds = {int(model.tools.motion_kind[index]) for index in moving}
    if scene.process.gravity or not moving or GUIDED in kinds:
        return []
    least = {index: _least_gap_of_travel(model, index) for index in moving}
    away = {index: _gap_after_leaving(model, index) for index in moving if least[index] is None}
    if any(gap is None for gap in away.values()):
        return []
    return [
        f"{model.tool_names[index]} never touches the blank: over its whole travel it comes no "
        f"closer than {1e3 * gap:.3g} mm, and nothing else moves the sheet; {_remedy(model, index)}"
        if gap is not None
        else f"{model.tool_names[index]} touches the blank at the start and moves away from it, by "
        f"{1e3 * (away[index] or 0.0):.3g} mm at the end of its travel, and nothing else moves the "
        f"sheet: it will not be formed; {_remedy(model, index)}"
        for index, gap in least.items()
    ]


def tools_never_touched(model: Model, state: State, snapshots: Sequence[Snapshot]) -> list[str]:
    """Say which tools have not loaded the sheet in a complete run, and how close they came."""
    found = []
    idle = state.penetration_max <= NO_LOAD * min(body.material.thickness for body in model.bodies)
    for tool in np.flatnonzero(idle).tolist():
        each = [_gap(model, tool, s.position, float(s.tool_travel[tool])) for s in snapshots]
        gap = min(each)
        if gap <= _touch(model) < each[-1] and each[0] <= _touch(model):
            found.append(
                f"{model.tool_names[tool]} touched the sheet at the start, never pressed on it, "
                f"and is {1e3 * each[-1]:.3g} mm away from it at the end; {_remedy(model, tool)}"
            )
        if gap > _touch(model):
            found.append(
                f"{model.tool_names[tool]} never touched the sheet, and came no closer than "
                f"{1e3 * gap:.3g} mm in the saved frames; {_remedy(model, tool)}"
            )
    return found


def _touch(model: Model) -> float:
    """Gap that still counts as touching [m]."""
    return OVERLAP_TOLERANCE * min(body.material.thickness for body in model.bodies)


def _gap(model: Model, tool: int, positions: np.ndarray, travel: float) -> float:
    """Least gap of the sheets' nodes [m]; far from a surface mesh a lower bound."""
    distance = gaps(model.tools, tool, np.ascontiguousarray(positions), travel)
    return float((distance - model.nodes.offset).min())


def _ends_of_travel(model: Model, tool: int) -> list[float]:
    """Return the travel [m] at the end of a stroke, or the least and the most of a table."""
    tools = model.tools
    if tools.stroke_profile[tool] == TABULATED:
        own = slice(tools.table_start[tool], tools.table_start[tool + 1])
        travels = tools.table_travels[own]
        return [float(travels.min()), float(travels.max())]
    return [float(tools.stroke_distance[tool])]


def _least_gap_of_travel(model: Model, tool: int) -> float | None:
    """Least gap [m] of a prescribed tool to the undeformed sheet; None where it touches.

    A tool that is farther than a gap can travel by it without a touch, so that steps of the gap
    leave nothing out.
    """
    least, arm = np.inf, lever(model.tools, tool, model.node_positions)
    for end in _ends_of_travel(model, tool):
        way = 0.0
        for _ in range(MOST_EVALUATIONS):
            gap = _gap(model, tool, model.node_positions, float(np.copysign(way, end)))
            least = min(least, gap)
            if gap <= _touch(model):
                return None
            if way >= abs(end):
                break
            way = min(way + gap / arm, abs(end))
        else:
            return None
    return least


def _gap_after_leaving(model: Model, tool: int) -> float | None:
    """Return the gap [m] at the end of a travel that leads away from the undeformed sheet.

    None where the tool does not touch it at the start, or comes nearer to it anywhere on its way.
    """
    start = _gap(model, tool, model.node_positions, 0.0)
    last = start
    for end in _ends_of_travel(model, tool):
        for share in np.linspace(0.0, 1.0, SAMPLES_OF_TRAVEL)[1:]:
            last = _gap(model, tool, model.node_positions, float(share * end))
            if last < start - NO_LOAD * abs(start):
                return None
    return last if abs(start) <= _touch(model) < last else None


def _remedy(model: Model, tool: int) -> str:
    key = f"tools.{model.tool_names[tool]}"
    kind = int(model.tools.motion_kind[tool])
    if kind == PRESCRIBED:
        tabulated = model.tools.stroke_profile[tool] == TABULATED
        way = "travel" if tabulated else "distance"
        if turning(model.tools)[tool]:
            return f"check {key}.motion.axis, {key}.motion.angle and {key}.position"
        return f"check {key}.motion.direction, {key}.motion.{way} and {key}.position"
    if kind == GUIDED:
        return f"check {key}.motion.direction, its force and {key}.position"
    return f"check {key}.position, or leave the tool out"
