"""What a run says where a chunk of steps ended in values that are no numbers.

The run goes back to the state before the chunk and tries half the step. Where that cures it, the
step was the cause, and the run goes on with half the step and a warning. Where it does not, no step
would: the cause is looked for in the last sound state.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lcmchain.elements.family import Body
from lcmchain.elements.fibre_volume import SOLID_FIBRE
from lcmchain.mesh.sheet_mesh import shear_angles
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.solver.guards import (
    DEEPEST_PENETRATION,
    LARGEST_HOURGLASS_PART,
    energy_floor,
    when,
)
from lcmchain.solver.remedies import JUMP, finer_elements, slower_process, stiffer_contact
from lcmchain.state import HALVINGS, State
from lcmchain.tools.motion import PRESCRIBED, prescribed_travel

# A measure below this part of its limit is no cause.
LEAST_SUSPICION = 0.5


class Finding(NamedTuple):
    """One measure of a state: its part of what is possible, in words, and what cures it."""

    part: float
    text: str
    remedy: str


def halving_warnings(model: Model, state: State) -> list[str]:
    """Say when and where the step was halved, and what that made of the safety factor."""
    found = []
    for number, (time, *place) in enumerate(state.halvings[: int(state.counters[HALVINGS])], 1):
        factor = 0.5**number
        found.append(
            f"values were no numbers after {1e3 * time:.4f} ms near {millimetres(np.array(place))};"
            f" half the step cured it, and the run went on with {factor:g} of the stable step "
            f"times process.step_safety, as with process.step_safety = "
            f"{factor * model.step_safety:g}"
        )
    return found


def diagnosis(model: Model, state: State, energy: dict[str, float], interval: float) -> str:
    """Return what is extreme in a state [J, s] and which of it most likely ended the run.

    interval : [s] within which the values were lost.
    """
    found = [
        *(finding for body in model.bodies for finding in _of_elements(model, body, state)),
        *_of_contact(model, state),
        *_of_tools(model, state, interval),
        *_of_energy(model, state, energy),
        _of_speed(model, state, interval),
    ]
    worst = max(found, key=lambda finding: finding.part)
    cause = f"{worst.text}; {worst.remedy}"
    if worst.part <= LEAST_SUSPICION:
        cause = "nothing here is near its limit; look at what tools and supports do at this time"
    facts = ", ".join(finding.text for finding in found)
    return f"The last sound state, at {when(state)}: {facts}. Likely cause: {cause}"


def _of_elements(model: Model, body: Body, state: State) -> Iterator[Finding]:
    condition = body.condition(state.position, model.history_of(body, state.history))
    own = state.position[:, body.first_node : body.first_node + body.mesh.node_count].T
    angle = np.abs(shear_angles(body.mesh, own))

    def at(element: int) -> str:
        centre = own[body.mesh.elements[element]].mean(axis=0)
        return f"in element {body.first_element + element} at {millimetres(centre)}"

    fraction = body.fibre_volume_fraction(condition)
    if fraction is not None:
        fullest = int(np.argmax(fraction))
        yield Finding(
            float(fraction[fullest]) / SOLID_FIBRE,
            f"fibre volume fraction up to {fraction[fullest]:.2f} {at(fullest)}",
            "the fabric is sheared and compacted to where it holds hardly anything but fibre; "
            "state where it locks (material.membrane.locking_angle), or use larger radii and gaps "
            "of the tools",
        )
    sheared = int(np.argmax(angle))
    yield Finding(
        float(angle[sheared]) / (0.5 * np.pi),
        f"shear angle up to {np.degrees(angle[sheared]):.1f} deg {at(sheared)}",
        "state where the fabric locks (material.membrane.locking_angle), or let the sheet slide in "
        "more freely",
    )
    if body.mesh.has_thickness:
        thinnest = int(np.argmin(condition.thickness_stretch))
        stretch = float(condition.thickness_stretch[thinnest])
        yield Finding(
            1.0 - stretch,
            f"thickness down to {stretch:.2f} of the initial one {at(thinnest)}",
            "check gap and stroke of the tools, and use a smaller blank.edge_length or a larger "
            "radius",
        )


def _of_contact(model: Model, state: State) -> Iterator[Finding]:
    if not model.tool_names:
        return
    tool = int(np.argmax(state.penetration_max))
    limit = DEEPEST_PENETRATION * min(body.material.thickness for body in model.bodies)
    depth = float(state.penetration_max[tool])
    yield Finding(
        depth / limit,
        f"deepest penetration {1e3 * depth:.3f} mm ({model.tool_names[tool]})",
        f"check gap and stroke of the tools, or set {stiffer_contact(model, state)}",
    )


def _of_tools(model: Model, state: State, interval: float) -> Iterator[Finding]:
    """The prescribed tool that moves farthest in one step of the interval [s]."""
    step = state.last_step if state.last_step > 0.0 else interval
    times = state.time + np.arange(0.0, interval + 1.5 * step, step)
    ways = {
        tool: max(
            abs(after - before)
            for before, after in pairwise(prescribed_travel(model.tools, tool, t)[0] for t in times)
        )
        for tool in np.flatnonzero((model.tools.motion_kind == PRESCRIBED) & (state.driven == 0))
    }
    if not ways:
        return
    tool = max(ways, key=ways.__getitem__)
    name = model.tool_names[tool]
    limit = JUMP * min(body.material.thickness for body in model.bodies)
    yield Finding(
        ways[tool] / limit,
        f"{name} moves by {1e3 * ways[tool]:.3g} mm in one step",
        f"it jumps; check tools.{name}.motion, and use a longer time for it",
    )


def _of_energy(model: Model, state: State, energy: dict[str, float]) -> Iterator[Finding]:
    if energy["internal"] <= energy_floor(model):
        return
    part = energy["hourglass"] / energy["internal"]
    yield Finding(
        part / LARGEST_HOURGLASS_PART,
        f"hourglass energy {part:.1%} of the strain energy",
        f"the elements are too coarse for the tools; use {finer_elements(model, state, part)}",
    )


def _of_speed(model: Model, state: State, interval: float) -> Finding:
    speed = np.linalg.norm(state.velocity, axis=0)
    fastest = int(np.argmax(speed))
    length = min(body.shortest_length for body in model.bodies)
    return Finding(
        float(speed[fastest]) * interval / length,
        f"fastest node {speed[fastest]:.3g} m/s at {millimetres(state.position[:, fastest])}",
        f"it crosses an element within a few steps; use {slower_process(model)}",
    )
