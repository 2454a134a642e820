"""Values of scene entries that cure what a guard stops, by what the run itself knows.

A guard stops a run early, as soon as a measure is beyond its limit. What it is to be at the end of
the process is taken to grow as the process goes on: a value that cures the present alone would be
followed by the next stop.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from lcmchain.effects.process.pace import more_quasi_static
from lcmchain.model import Model
from lcmchain.quantities.rounded import milliseconds, two_digits, two_digits_up
from lcmchain.state import State
from lcmchain.thresholds import (
    LARGEST_HOURGLASS_PART,
    LARGEST_KINETIC_PART,
    LARGEST_PENETRATION,
)
from lcmchain.tools.distance import signed_distance
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
    longer = f"process.time = {milliseconds(times * model.process_time)}"
    stage = model.present_stage
    if stage is not None:
        time = milliseconds(times * (stage.end - stage.start))
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
