"""Gaps between tools that close on each other, and whether the sheet fits between them.

Prescribed tools go their way whatever lies between them. Two that face the sheet from either side
and come closer than half its thickness crush it: a punch in a hole that is too small, a stroke that
is too long, a tool in the way of another one. It is told. Two that pass through each other, or into
the fibres as they are without pores, are refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely

from lcmchain.check.tools_at_start import plies_at_start
from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model
from lcmchain.quantities.places import millimetres
from lcmchain.scene import Scene
from lcmchain.scene.stages import laid_later, stack_at
from lcmchain.tools.closest_gap import (
    ClosestGap,
    closest_gaps,
    places_of_sheet,
    side_of_sheet,
    times_of_motion,
)
from lcmchain.tools.motion import prescribed_travel
from lcmchain.tools.table import yields
from lcmchain.tools.turn import turning

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
    found = np.zeros(len(times), dtype=bool)
    for stage in model.stages:
        if stage.tools_at_work[one] and stage.tools_at_work[other]:
            found |= (times >= stage.start) & (times <= stage.end)
    return found


def tools_that_close(scene: Scene, model: Model, closing: list[Closing]) -> list[str]:
    """Say which tools leave no space for the sheet between them on their way."""

    def space(near: ClosestGap) -> float:
        return near.gap - LEAST_GAP * _thickness(scene, near)

    found = []
    for tools in closing:
        closest = _tightest(scene, tools, space)
        if space(closest) < 0.0 and not space(tools.start) < 0.0:
            first = next(near for near in tools.course if space(near) < 0.0)
            found.append(_sentence(scene, model, tools.pair, first, closest))
    return found


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
