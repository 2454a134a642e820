"""Tools that never touch the sheet: where it is plain before a run, and what a run shows."""

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

if TYPE_CHECKING:
    from lcmchain.solver.simulation import Snapshot

#: Evaluations along a travel after which a tool counts as one that may touch.
MOST_EVALUATIONS = 2000


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
    if any(gap is None for gap in least.values()):
        return []
    return [
        f"{model.tool_names[index]} never touches the blank: over its whole travel it comes no "
        f"closer than {1e3 * gap:.3g} mm, and nothing else moves the sheet; {_remedy(model, index)}"
        for index, gap in least.items()
        if gap is not None
    ]


def tools_never_touched(model: Model, state: State, snapshots: Sequence[Snapshot]) -> list[str]:
    """Say which tools have not touched the sheet in a complete run, and how close they came."""
    found = []
    for tool in np.flatnonzero(state.penetration_max == 0.0).tolist():
        gap = min(_gap(model, tool, s.position, float(s.tool_travel[tool])) for s in snapshots)
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


def _least_gap_of_travel(model: Model, tool: int) -> float | None:
    """Least gap [m] of a prescribed tool to the undeformed sheet; None where it touches.

    A tool that is farther than a gap can travel by it without a touch, so that steps of the gap
    leave nothing out.
    """
    tools = model.tools
    ends = [float(tools.stroke_distance[tool])]
    if tools.stroke_profile[tool] == TABULATED:
        own = slice(tools.table_start[tool], tools.table_start[tool + 1])
        travels = tools.table_travels[own]
        ends = [float(travels.min()), float(travels.max())]
    least = np.inf
    for end in ends:
        way = 0.0
        for _ in range(MOST_EVALUATIONS):
            gap = _gap(model, tool, model.node_positions, float(np.copysign(way, end)))
            least = min(least, gap)
            if gap <= _touch(model):
                return None
            if way >= abs(end):
                break
            way = min(way + gap, abs(end))
        else:
            return None
    return least


def _remedy(model: Model, tool: int) -> str:
    key = f"tools.{model.tool_names[tool]}"
    kind = int(model.tools.motion_kind[tool])
    if kind == PRESCRIBED:
        tabulated = model.tools.stroke_profile[tool] == TABULATED
        way = "travel" if tabulated else "distance"
        return f"check {key}.motion.direction, {key}.motion.{way} and {key}.position"
    if kind == GUIDED:
        return f"check {key}.motion.direction, its force and {key}.position"
    return f"check {key}.position, or leave the tool out"
