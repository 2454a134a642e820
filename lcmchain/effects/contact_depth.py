"""Depth of the nodes in the tools, driven to zero where tools close on the sheet.

Adds: to the depth of every node in a tool an offset h, which the spring of the contact feels as
further depth: p = k (depth + h), dh/dt = (1 + s) depth / τ, h >= 0, and h = 0 where the node has
left. s is about the stiffness of the sheet over its thickness relative to k: a stiff sheet gives
way by 1/(1 + s) of what the offset moves. A sheet that is pressed steadily ends with depth 0, under
a pressure that no longer depends on the contact stiffness k. Without the offset two plates that
close to a gap leave the sheet thicker by twice the depth p/k. A compaction law that stiffens by
orders of magnitude turns this into a force that is too low by tens of percent. The spring's energy
is ½ k (depth + h)² - ½ k h², which vanishes with the depth. What a change of h adds to it,
k depth dh, counts as external work.
Source: augmented Lagrange multipliers, e.g. Wriggers, "Computational Contact Mechanics", section
6.3.3, with an update at every step.
Stability limit: none of its own, since the stiffness within a step stays k. But an offset that
follows too fast feeds the vibration on the contact springs. With the damping c of the contact it
stays calm for τ > m/c (Routh: τ/(1 + s) > m/c k/(k + K) on a sheet of the stiffness K = s k). τ is
at least ten times as much, and n² times that for n sheets on each other, whose thickness vibrates
more slowly.
Scene: ``contact.depth``; automatically where tools with prescribed motions come nearer to each
other than the sheet is thick, and ``contact.penalty`` is left to the program. Not with a guided
tool: it may swing on its contact, and the thickness under a given force does not depend on k.
Fields: ``tool_pressure``, ``tool_force``, ``energy_contact``, ``energy_external`` (history).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any, Protocol

import numpy as np

from lcmchain.effects.contact import Contact
from lcmchain.effects.effect import Effect, EffectModel, EffectScene, Refusal, Switch, of_table
from lcmchain.jit import equation
from lcmchain.materials.law import Material
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.tools.closest_gap import closest_gaps, places_of_sheet, side_of_sheet, times_of_motion
from lcmchain.tools.table import ToolTable, yields

#: Time over which the depth goes to zero: this part of the process, at least so many times m/c.
PART_OF_PROCESS = 1.0 / 200.0
LEAST_DAMPED_TIMES = 10.0
#: Tools close on the sheet where they leave less than this part of its thickness.
CLOSED = 0.999
#: Evenly spaced times of the process at which the gap between tools is looked for.
TIMES = 11

#: Stretch over the thickness down to which a pressure is looked up.
MOST_COMPACTED = 0.5
#: Stretch over the thickness at which the stiffening of a law is looked up.
COMPACTED, STRETCH_STEP = 0.7, 1e-3

AUTOMATIC, HELD, FREE = "automatic", "zero", "free"


@equation
def offset_change(depth, offset, share, stiffening):
    """Return the change of the offset h [m] in a step.

    depth : of the node, without the offset [m]; share : of the step in τ; stiffening : by which s
    grows with pressure over k [1/m].
    """
    relative = 1.0 + stiffening * max(depth + offset, 0.0)
    change = min(relative * share, 1.0) * depth
    # neither the offset nor the force may become negative
    return max(change, max(-offset, -(depth + offset)))


class ToolsAtWork(Protocol):
    """Which tools are at work in a stage of the process, and its start and end [s]."""

    @property
    def tools(self) -> Sequence[bool]: ...
    @property
    def start(self) -> float: ...
    @property
    def end(self) -> float: ...


def depth_control(
    contact: Contact,
    tools: ToolTable,
    gap: float,
    materials: Sequence[Material],
    process_time: float,
    rate: float,
) -> tuple[float | None, float]:
    """Return the time τ [s], None where depths stay, and how s grows with p/k [1/m].

    Parameters
    ----------
    contact : table of a scene. gap : from :func:`gap_left` [m]. materials : of the sheets.
    rate : smallest c/m of the nodes on their contact springs [1/s].
    """
    wanted = getattr(contact, "depth", FREE)
    if wanted == FREE or tools.kind.size == 0 or rate <= 0.0 or not math.isfinite(process_time):
        return None, 0.0
    if wanted == AUTOMATIC:
        thickness = sum(material.thickness for material in materials)
        if contact.penalty is not None or gap > CLOSED * thickness:
            return None, 0.0
    # the slowest vibration of n sheets on each other has about 1/n² of the ω² of one on its springs
    least = LEAST_DAMPED_TIMES * len(materials) ** 2 / rate
    time = max(PART_OF_PROCESS * process_time, least)
    return time, min(stiffening_of(material) for material in materials)


def gap_left(
    tools: ToolTable,
    meshes: Sequence[SheetMesh],
    process_time: float,
    stages: Sequence[ToolsAtWork] = (),
) -> float:
    """Return the smallest gap that tools of given motions leave near the sheets [m].

    Infinite with a tool that a force guides or stops, fewer than two tools, or no time. Two tools
    on the same side have no sheet between them: a holder may overlap the punch that moves in it.

    stages : of the process (:class:`lcmchain.scene.stages.StagePlan`): only tools that are at work
        in one of them together leave a gap, and a guided one says nothing of those without it.
    """
    if tools.kind.size < 2 or not math.isfinite(process_time):
        return math.inf
    guided = yields(tools)
    together = [(np.flatnonzero(plan.tools).tolist(), plan.start, plan.end) for plan in stages]
    together = together or [(list(range(tools.kind.size)), 0.0, process_time)]
    known = [one for one in together if not guided[one[0]].any()]
    return closest_gap(tools, meshes, process_time, known) if known else math.inf


def pressure_in_gap(gap: float, materials: Sequence[Material]) -> float:
    """Return the pressure of sheets that lie over each other in a gap [m], from their laws [Pa].

    0 where they are not pressed, or nothing resists. Beyond ``MOST_COMPACTED`` it no longer grows.
    """
    if gap >= sum(material.thickness for material in materials):
        return 0.0
    stretch = np.linspace(1.0, MOST_COMPACTED, 701)
    each = [np.maximum.accumulate(nominal_pressure(material, stretch)) for material in materials]
    pressure = np.unique(np.concatenate(each))
    height = sum(
        material.thickness * np.interp(pressure, pressures, stretch)
        for material, pressures in zip(materials, each, strict=True)
    )
    return float(np.interp(-gap, -height, pressure))


def stiffening_of(material: Material) -> float:
    """Return by how much s grows with pressure over k [1/m].

    A law that stiffens has a tangent that is about proportional to its pressure p. Pressed between
    two tools, a sheet becomes thinner by twice the depth that one of them gains.
    """
    stretch = np.array([COMPACTED - STRETCH_STEP, COMPACTED + STRETCH_STEP])
    firm, soft = nominal_pressure(material, stretch).tolist()
    if not soft > 0.0:
        return 0.0  # nothing resists: the springs alone are stiff
    return 2.0 * math.log(firm / soft) / (2.0 * STRETCH_STEP * material.thickness)


def closest_gap(
    tools: ToolTable,
    meshes: Sequence[SheetMesh],
    process_time: float,
    together: Sequence[tuple[Sequence[int], float, float]] = (),
) -> float:
    """Return about the smallest gap [m] between tools with flat sheets between them, near these.

    together : numbers of tools that are at work together, from a time to another [s]; without any
        all of them over the process.
    """
    chosen = together or [(range(tools.kind.size), 0.0, process_time)]
    sides = [side_of_sheet(tools, tool, meshes) for tool in range(tools.kind.size)]
    places, times = places_of_sheet(meshes), times_of_motion(tools, process_time, TIMES)
    return min(
        (
            closest.gap
            for working, start, end in chosen
            for pair in combinations(working, 2)
            if sides[pair[0]] * sides[pair[1]] <= 0
            for closest in closest_gaps(tools, pair, places, np.unique(np.clip(times, start, end)))
        ),
        default=math.inf,
    )


def nominal_pressure(material: Material, stretch: np.ndarray) -> np.ndarray:
    """Return the pressure λ |S33| [Pa] of a law at stretches λ (n,) over the thickness alone.

    0 where the law pulls.
    """
    strain = np.zeros((len(stretch), 6))
    strain[:, 2] = 0.5 * (stretch**2 - 1.0)
    return np.maximum(-stretch * material.stress_and_tangent(strain)[0][:, 2], 0.0)


SWITCH = Switch(
    entry="contact.depth",
    without="that pressure and thickness between tools do not depend on the contact stiffness",
    called=lambda scene: {HELD: True, FREE: False}.get(scene.contact.depth),
    off=of_table("contact", depth=FREE),
    on=lambda scene: _held(scene),
)


def _held(scene: EffectScene) -> dict[str, Any]:
    if not scene.tools:
        raise Refusal("there are no tools; add [[tools]]")
    if scene.contact.damping_ratio == 0.0:
        raise Refusal("contact is not damped; give contact.damping_ratio")
    return of_table("contact", depth=HELD)(scene)


def active(model: EffectModel) -> list[Effect]:
    time = model.environment.depth_time
    name = "depth in the tools driven to zero"
    if time is None:
        return [Effect(name, False, "contact.depth, or no tools that close on the sheet")]
    return [Effect(name, True, f"within about {1e3 * time:.3g} ms")]
