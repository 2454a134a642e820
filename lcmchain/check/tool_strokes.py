"""What tools do on their way: which close on each other too far, and which never load the sheet."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from lcmchain.check.tools_at_start import plies_at_start
from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.scene import Scene
from lcmchain.scene.stages import laid_later, stack_at
from lcmchain.state import State
from lcmchain.tools.closest_gap import (
    ClosestGap,
    closest_gaps,
    places_of_sheet,
    side_of_sheet,
    times_of_motion,
)
from lcmchain.tools.distance import gaps
from lcmchain.tools.motion import GUIDED, PRESCRIBED, prescribed_travel
from lcmchain.tools.motion.base import TABULATED
from lcmchain.tools.table import OVERLAP_TOLERANCE, lever, turning, yields

if TYPE_CHECKING:
    from lcmchain.solver.simulation import Snapshot


# --- tools that close on each other, and whether the sheet fits between them ----------------------


#: Gap in parts of the thickness below which no sheet fits between two tools.
LEAST_GAP = 0.5
#: Evenly spaced times of the process at which the tools are looked at.
TIMES = 101


class Closing(NamedTuple):
    """Two tools with the sheet between them, and how close they are at every time looked at."""

    pair: tuple[int, int]
    course: list[ClosestGap]

    @property
    def start(self) -> ClosestGap:
        return self.course[0]

    @property
    def end(self) -> ClosestGap:
        return self.course[-1]

    @property
    def closest(self) -> ClosestGap:
        """The first of the closest."""
        return min(self.course, key=lambda closest: closest.gap)


def closing_tools(scene: Scene, blanks: Sequence[BlankMesh], model: Model) -> list[Closing]:
    """Return the pairs of tools that have the sheet between them, with their gaps over the process.

    Only over the blank as it lies at the start, and of tools that a stroke or a table drives: how
    far one goes that a force guides or stops is not known beforehand. Two tools on the same side of
    the blank have no sheet between them, and two that rest keep their gap of the start.
    """
    tools = model.tools
    led = np.flatnonzero(~yields(tools)).tolist()
    lying = [blank for blank, _ in plies_at_start(scene, blanks)]
    sides = {k: side_of_sheet(tools, k, lying) for k in led}
    places, times = places_of_sheet(blanks), times_of_motion(tools, model.process_time, TIMES)
    found = []
    for one, other in combinations(led, 2):
        moves = scene.tools[one].motion.moves or scene.tools[other].motion.moves
        if moves and sides[one] * sides[other] <= 0:
            own = times[_together(model, one, other, times)]
            closing = Closing((one, other), closest_gaps(tools, (one, other), places, own))
            if own.size and np.isfinite(closing.closest.gap):
                found.append(closing)
    return found


def _together(model: Model, one: int, other: int, times: np.ndarray) -> np.ndarray:
    """Return at which times [s] two tools are at work together; without stages at all."""
    if not model.stages:
        return np.ones(len(times), dtype=bool)
    together = np.zeros(len(times), dtype=bool)
    for stage in model.stages:
        if stage.tools_at_work[one] and stage.tools_at_work[other]:
            together |= (times >= stage.start) & (times <= stage.end)
    return together


def tools_that_close(
    scene: Scene, model: Model, closing: list[Closing], until: float = math.inf
) -> list[str]:
    """Say which tools leave no space for the sheet between them, up to a time [s] of their way."""

    def space(near: ClosestGap) -> float:
        return near.gap - LEAST_GAP * _thickness(scene, near)

    texts = []
    for tools in closing:
        closest = _tightest(scene, tools, space)
        if space(closest) < 0.0 and not space(tools.start) < 0.0:
            first = next(near for near in tools.course if space(near) < 0.0)
            if first.time > until:
                continue
            texts.append(_sentence(scene, model, tools.pair, first, closest))
    return texts


def _tightest(scene: Scene, tools: Closing, space: Callable[[ClosestGap], float]) -> ClosestGap:
    """Return where two tools are closest, where plies come later that leave least space [m]."""
    return min(tools.course, key=space) if laid_later(scene) else tools.closest


def _thickness(scene: Scene, near: ClosestGap) -> float:
    """Return the thickness of the plies that are there between two tools then [m]."""
    return stack_at(scene, near.time).thickness_at(near.place[0], near.place[1])


def require_space(scene: Scene, model: Model, closing: Sequence[Closing]) -> None:
    """Refuse tools that go through each other, or into the fibres between them.

    A sheet can be pressed to the height of its fibres without pores at most.

    Raises
    ------
    InputError : names the motion, the tools, the place and the time.
    """
    for tools in closing:
        near = _tightest(scene, tools, lambda one: one.gap - _solid_height(scene, one))
        start, solid = tools.start, _solid_height(scene, near)
        if near.gap >= solid or start.gap < solid:  # the start has a check of its own
            continue
        first = next(one for one in tools.course if one.gap < solid and one.time <= near.time)
        text = _sentence(scene, model, tools.pair, first, near)
        if near.gap >= 0.0:
            text += f"; its fibres alone, without pores, are {1e3 * solid:.4g} mm high"
        moving = next(k for k in tools.pair if scene.tools[k].motion.moves)
        raise InputError(text, key=f'tools[{moving}] "{model.tool_names[moving]}".motion')


def _solid_height(scene: Scene, near: ClosestGap) -> float:
    """Return the height of all fibres at a place without pores [m]; 0 where it is not known."""
    place = shapely.Point(near.place[0], near.place[1])
    return sum(
        ply.material.areal_mass / ply.material.fibre_density
        for ply in stack_at(scene, near.time).preform
        if ply.material.fibre_density is not None and ply.contours.polygon.covers(place)
    )


def _place_in_words(model: Model, tool: int, time: float) -> str:
    """Say where a tool has come to at a time [s]."""
    travel = prescribed_travel(model.tools, tool, time)[0]
    if turning(model.tools)[tool]:
        return f"at an angle of {math.degrees(travel):.4g} degrees"
    return f"at a travel of {1e3 * travel:.4g} mm"


def _sentence(
    scene: Scene, model: Model, pair: tuple[int, int], first: ClosestGap, closest: ClosestGap
) -> str:
    """Name tools, gap, place and travel where two tools are closest, and when it begins."""
    moving = [k for k in pair if scene.tools[k].motion.moves]
    thickness = _thickness(scene, closest)
    way = " and ".join(
        f"{model.tool_names[k]} {_place_in_words(model, k, closest.time)}" for k in moving
    )
    one, other = (model.tool_names[k] for k in pair)
    what = (
        f"overlap by {-1e3 * closest.gap:.3g} mm"
        if closest.gap < 0.0
        else f"are {1e3 * closest.gap:.3g} mm apart"
    )
    keys = " and ".join(f"tools.{model.tool_names[k]}.motion" for k in moving)
    return (
        f"{one} and {other} {what} at {millimetres(closest.place)} at "
        f"{1e3 * closest.time:.4g} ms, {way}: no space for the sheet, which is "
        f"{1e3 * thickness:.4g} mm thick, from {1e3 * first.time:.4g} ms on; check "
        f"{keys}, position and size of both"
    )


# --- tools that never load the sheet: plain before a run, and what a run shows --------------------


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
    texts = []
    idle = state.penetration_max <= NO_LOAD * min(body.material.thickness for body in model.bodies)
    for tool in np.flatnonzero(idle).tolist():
        each = [_gap(model, tool, s.position, float(s.tool_travel[tool])) for s in snapshots]
        gap = min(each)
        if gap <= _touch(model) < each[-1] and each[0] <= _touch(model):
            texts.append(
                f"{model.tool_names[tool]} touched the sheet at the start, never pressed on it, "
                f"and is {1e3 * each[-1]:.3g} mm away from it at the end; {_remedy(model, tool)}"
            )
        if gap > _touch(model):
            texts.append(
                f"{model.tool_names[tool]} never touched the sheet, and came no closer than "
                f"{1e3 * gap:.3g} mm in the saved frames; {_remedy(model, tool)}"
            )
    return texts


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
