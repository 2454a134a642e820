"""Why a run goes wrong, and which value of which scene entry cures it, by what the run knows.

A guard stops a run early, as soon as a measure is beyond its limit. What it is to be at the end of
the process is taken to grow as the process goes on: a value that cures the present alone would be
followed by the next stop. Why an energy balance ran away is told from the energies themselves.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from lcmchain.effects.process.pace import more_quasi_static
from lcmchain.model import Model
from lcmchain.quantities.readable import time_entry, two_digits, two_digits_up
from lcmchain.state import (
    CONTACT,
    CONTACT_DAMPING,
    FRICTION,
    KINETIC,
    MASS_DAMPING,
    PLY_REFRESH,
    RENEWAL,
    State,
)
from lcmchain.thresholds import (
    LARGEST_HOURGLASS_PART,
    LARGEST_KINETIC_PART,
    LARGEST_PENETRATION,
)
from lcmchain.tools.distance import gaps, signed_distance
from lcmchain.tools.motion import FIXED, GUIDED, PRESCRIBED

#: A measure counts as growing by this factor at most until the end of the process, and a pressure.
MOST_GROWTH, MOST_PRESSURE_GROWTH = 10.0, 100.0
#: Part of the largest depth in a tool without a warning that a stiffer contact is to leave.
DEPTH_LEFT = 0.5
#: Elements follow a tool over which its normal turns by this angle from corner to corner at most: a
#: third of its radius.
LARGEST_TURN = 1.0 / 3.0


def growth(model: Model, state: State) -> float:
    """Return by how much a measure is larger at the end of the process, if it grows with time."""
    return min(model.process_time / max(state.time, 1e-300), MOST_GROWTH)


def stiffer_contact(model: Model, state: State) -> str:
    """Return the contact stiffness as a scene entry that leaves little of the deepest penetration.

    Pressures on faces are known until the end of the process. A stiffness that is given switches
    off what drives depths to zero by itself, which is then asked for as well.
    """
    thickness = min(body.material.thickness for body in model.bodies)
    depth = float(state.penetration_max.max())
    grows, pressure = 0.0, model.face_pressure
    if pressure is None or (model.tools.motion_kind != FIXED).any():
        # the pressure of a tool that goes on grows with about the square of its travel
        grows = growth(model, state) ** 2
    if pressure is not None:
        now = pressure.size_at(state.time)
        grows = max(grows, pressure.largest / max(now, pressure.largest / MOST_PRESSURE_GROWTH))
    left = DEPTH_LEFT * LARGEST_PENETRATION * thickness
    needed = model.environment.penalty * max(grows * depth / left, 1.0)
    if not math.isfinite(needed):
        return "a larger contact.penalty"
    entry = f'contact.penalty = "{two_digits_up(1e-9 * needed)} N/mm^3"'
    return entry + (' and contact.depth = "zero"' if model.environment.depth_time else "")


def slower_process(model: Model) -> str:
    """Name the entry that makes a process slower, where no value of it is known."""
    if model.pace is not None:
        return "a larger process.quasi_static"
    stage = model.present_stage
    return "a longer process.time" if stage is None else f"a longer stages.{stage.name}.time"


def slower_loads(model: Model, moved: float) -> str:
    """Return the entries that make a process slow enough whose sheet moves too much.

    moved : kinetic energy over the strain energy, which falls with the square of the time.
    """
    tools = model.tools
    if not math.isfinite(moved):
        return slower_process(model)
    times = math.sqrt(max(moved / LARGEST_KINETIC_PART, 1.0))
    if model.pace is not None:
        return more_quasi_static(model.pace.quasi_static, times)
    pressed = model.face_pressure is not None and model.face_pressure.largest > 0.0
    entries = ["pressure.ramp"] if pressed else []  # in this stage: it may come later or be gone
    for tool in np.flatnonzero(tools.motion_kind == GUIDED).tolist():
        entries.append(f"tools.{model.tool_names[tool]}.motion.ramp")
    longer = f"process.time = {time_entry(times * model.process_time)}"
    stage = model.present_stage
    if stage is not None:
        time = time_entry(times * (stage.end - stage.start))
        longer = f"stages.{stage.name}.time = {time}"
    if not entries:
        return longer
    factor = f"{two_digits_up(times)} times as long"
    led = bool((tools.motion_kind == PRESCRIBED).any())
    damped = "" if led else ", or more process.mass_damping"
    return f"{longer} with {' and '.join(entries)} {factor}{damped}"


def finer_elements(model: Model, state: State, part: float) -> str:
    """Return the edge length as a scene entry that resolves a sheet to the end of the process.

    part : hourglass energy over strain energy, which falls with the square of the edge length.
    """
    at_the_end = part * growth(model, state)
    if not math.isfinite(at_the_end):
        return "a smaller blank.edge_length"
    coarser = max(at_the_end / LARGEST_HOURGLASS_PART, 1.0)
    edge = element_size(model) / math.sqrt(coarser)
    return f'blank.edge_length = "{two_digits(1e3 * edge)} mm"'


def element_size(model: Model) -> float:
    """Return the edge of a square as large as most elements are at rest [m]."""
    areas = np.concatenate([body.mesh.element_areas for body in model.bodies])
    return float(np.sqrt(np.median(areas)))


def bending_tool(model: Model, state: State, element: int) -> str | None:
    """Name the tool that turns under an element by more than elements of this size can follow.

    Of the tools within an edge length of its corners; None where none does.
    """
    body = model.body_of_element(element)
    nodes = body.mesh.elements[element - body.first_element] + body.first_node
    corners, near = state.position[:, np.unique(nodes)].T, element_size(model)
    for tool, name in enumerate(model.tool_names):
        found = [
            signed_distance(model.tools, tool, *corner, state.tool_travel[tool])
            for corner in corners
        ]
        normals = np.array([normal for gap, *normal in found if abs(gap) < near])
        turns = [float(one @ other) for one, other in combinations(normals, 2)]
        if turns and math.acos(min(max(min(turns), -1.0), 1.0)) > LARGEST_TURN:
            return name
    return None


# Part of the thickness of the sheet that a tool moves in one step only where its motion jumps.
JUMP = 0.1
# Part of the surplus that springs loaded from the start must have held to be its cause.
UNPAID = 0.5
# Above this part of the critical one, contact damping is no longer what keeps contacts calm.
STRONG_DAMPING = 1.0

WORDS = {
    KINETIC: "kinetic energy",
    CONTACT: "contact springs",
    FRICTION: "friction",
    CONTACT_DAMPING: "contact damping",
    MASS_DAMPING: "mass damping",
    RENEWAL: "renewed curvature",
    PLY_REFRESH: "renewed springs between plies",
}


def energies_in_words(state: State) -> str:
    """Say where the energy [J] is, the largest part first."""
    parts = sorted(WORDS, key=lambda column: -float(state.work[column]))
    told = [f"{WORDS[c]} {state.work[c]:.3g} J" for c in parts if state.work[c] > 0.0]
    return ", ".join(told)


def cause_of_runaway(model: Model, state: State, surplus: float) -> str:
    """Return the most likely cause of a surplus of energy [J], and its remedy, in words."""
    found = _overlap_at_start(model, surplus) or _jumping_tool(model, state)
    if found is not None:
        return found
    largest = max(WORDS, key=lambda column: float(state.work[column]))
    if largest in (CONTACT, CONTACT_DAMPING):
        return _contact(model, state)
    if largest == MASS_DAMPING:
        return (
            "motion that damping takes, but nothing drives; look for what moves the sheet before "
            "process.mass_damping slows it, and lower process.step_safety"
        )
    sources = [entry for body in model.bodies for entry in body.without_potential]
    if sources:
        return (
            f"{' and '.join(sources)}: such forces have no potential and can feed energy to the "
            "sheet; take the default"
        )
    given = "" if model.automatic_penalty else ", and leave contact.penalty to the program"
    return (
        "an unstable time step, since the energy is in the motion of the nodes; use "
        f"process.step_safety = {0.5 * model.step_safety:g}{given}"
    )


def _jumping_tool(model: Model, state: State) -> str | None:
    """Name the tool that moves by a good part of the thickness in one step."""
    if not model.tool_names:
        return None
    way = np.abs(state.tool_velocity) * state.last_step
    tool = int(np.argmax(way))
    if way[tool] <= JUMP * _thickness(model):
        return None
    name = model.tool_names[tool]
    what = (
        "the velocity that drives it from outside"
        if state.driven[tool]
        else f"tools.{name}.motion, and use a longer time for it"
    )
    return f"{name} jumps by {1e3 * way[tool]:.3g} mm in one step; check {what}"


def _overlap_at_start(model: Model, surplus: float) -> str | None:
    """Name the tool whose contact springs held much of the surplus before anything moved."""
    tools, nodes = model.tools, model.nodes
    positions = np.ascontiguousarray(model.node_positions)
    energies, depths = [], []
    for tool in range(len(model.tool_names)):
        gap = gaps(tools, tool, positions, 0.0) - nodes.offset + tools.initial_overlap[tool]
        depth = np.maximum(-gap, 0.0)
        energies.append(0.5 * model.environment.penalty * float(np.sum(nodes.area * depth**2)))
        depths.append(float(depth.max()))
    if sum(energies) <= UNPAID * surplus:
        return None
    tool = int(np.argmax(energies))
    name = model.tool_names[tool]
    return (
        f"{name} reaches {1e3 * depths[tool]:.3g} mm into the sheet at the start, and its contact "
        f"springs held {energies[tool]:.3g} J that nobody put in; check tools.{name}.position and "
        "blank.height"
    )


def _contact(model: Model, state: State) -> str:
    ratio = model.environment.contact_damping_ratio
    if state.work[CONTACT_DAMPING] > state.work[CONTACT] and ratio > STRONG_DAMPING:
        return (
            f"contact damping of {ratio:g} times the critical one; use contact.damping_ratio "
            "below 1"
        )
    if not model.automatic_penalty:
        return (
            f"contact.penalty = {1e-9 * model.environment.penalty:.3g} N/mm^3 is given, and nodes "
            "bounce on springs so stiff; lower it, or leave it to the program"
        )
    tool = int(np.argmax(state.penetration_max))
    return (
        f"contact with {model.tool_names[tool]} (up to {1e3 * state.penetration_max[tool]:.3g} mm "
        f"deep) takes in more than the tools put out; use {slower_process(model)} or "
        f"lower process.step_safety = {model.step_safety:g}"
    )


def _thickness(model: Model) -> float:
    return min(float(body.material.thickness) for body in model.bodies)
