"""Guards of a run: what stops it, and in which words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lcmchain.elements.family import Body, Condition
from lcmchain.errors import SimulationError
from lcmchain.interfaces.forces import TOO_DEEP
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.solver.remedies import (
    bending_tool,
    cause_of_runaway,
    element_size,
    energies_in_words,
    finer_elements,
    slower_loads,
    slower_process,
    stiffer_contact,
)
from lcmchain.state import (
    EXTERNAL,
    KINETIC,
    LOOKED,
    RESOLVED,
    SAMPLE_COLUMNS,
    SAMPLES,
    WORK_COLUMNS,
    State,
)
from lcmchain.thresholds import LARGEST_KINETIC_PART
from lcmchain.tools.distance import gaps

# Deeper in a tool than this part of its thickness, the sheet is not where the tools hold it.
DEEPEST_PENETRATION = 0.15

# Positions [m] and velocities [m/s] of this size are on their way to be no numbers.
BEYOND_ALL_BOUNDS = 1e6

# Energy that may appear from nowhere, relative to the external work, before a run is called
# unstable; the floor is the strain energy of a strain of 1e-4 over the whole sheet.
RUNAWAY_FRACTION = 0.1
# Hourglass energy over strain energy: sound runs stay below 0.04 (examples); where 10 mm elements
# jam on a fillet of 10 mm it passes 0.25 and the punch force is five times too high.
LARGEST_HOURGLASS_PART = 0.15
# Parts of the process: from one look at that ratio to the next, and for how long it may be larger,
# as it is for a moment where a tool touches first. At the end it may not.
LOOK_INTERVAL = 0.01
LONGEST_UNRESOLVED = 0.05
# A sheet counts as loaded where its strain energy is that of a strain of 5e-4 over all of it.
LOADED = 25.0
FLOOR_STRAIN = 1e-4


def lost_node(state: State) -> int | None:
    """Return the first node whose position or velocity is not a number or beyond all bounds."""
    if _within_bounds(state.position) and _within_bounds(state.velocity):
        return None
    largest = np.maximum(np.abs(state.position).max(axis=0), np.abs(state.velocity).max(axis=0))
    return int(np.argmax(~(largest < BEYOND_ALL_BOUNDS)))  # also where it is not a number


def require_finite(model: Model, state: State, cause: str) -> None:
    """Stop where a node has no finite position or velocity, for a ``cause`` in words."""
    node = lost_node(state)
    if node is None:
        return
    raise SimulationError(
        f"a position or velocity is not a number at node {node} (element "
        f"{model.element_at(node)}, initially at {millimetres(model.node_positions[node])}) at "
        f"{when(state)}. {cause}"
    )


def require_sound(model: Model, state: State, body: Body, condition: Condition) -> None:
    """Stop where an element is inverted, collapsed, or holds more fibre than it has space for."""

    def tools_near(nodes: np.ndarray) -> list[str]:
        near = state.near[:, nodes + body.first_node].any(axis=1)
        return [name for name, there in zip(model.tool_names, near, strict=True) if there]  # type: ignore[arg-type]

    found = body.unsound(state.position, condition, tools_near)
    if found is None:
        return
    corners = body.mesh.elements[found.element] + body.first_node
    centre = state.position[:, corners].mean(axis=1)
    raise SimulationError(
        f"{found.text}{_of_body(model, body)} at {millimetres(centre)} at {when(state)}. "
        f"Likely cause: {found.cause}"
    )


def require_outside(model: Model, state: State) -> None:
    """Stop where the sheet has sunk into a tool: more pressure than the contact can carry."""
    thinnest = min(model.bodies, key=lambda body: body.material.thickness)
    limit = DEEPEST_PENETRATION * thinnest.material.thickness
    if not (state.penetration_max > limit).any():
        return
    tool = int(np.argmax(state.penetration_max))
    depth = 1e3 * state.penetration_max[tool]
    whose = "the sheet"
    if len(model.bodies) > 1:
        whose = f"the thinnest ply, {thinnest.name} ({1e3 * thinnest.material.thickness:.3g} mm)"
    raise SimulationError(
        f"nodes are {depth:.3f} mm inside {model.tool_names[tool]} at {when(state)}"
        f"{_place_in_tool(model, state, tool, limit)}, more than {DEEPEST_PENETRATION:g} of the "
        f"thickness of {whose}. Likely cause: too much pressure for a contact stiffness of "
        f"{1e-9 * model.environment.penalty:.3g} N/mm^3; check gap and stroke of the tools, or set "
        f"{stiffer_contact(model, state)}"
    )


def _place_in_tool(model: Model, state: State, tool: int, limit: float) -> str:
    """Say where nodes have sunk into a tool, or what strikes it where they have come out again.

    limit : depth [m] of the guard; half of it tells the place.
    """
    near = np.flatnonzero(state.near[tool])
    if not near.size:
        return ""
    points = np.ascontiguousarray(state.position[:, near].T)
    depth = -gaps(model.tools, tool, points, float(state.tool_travel[tool]))

    def at(node: int) -> str:
        element = model.element_at(node)
        body = next(b for b in model.bodies if element < b.first_element + b.mesh.element_count)
        number = element - body.first_element
        place = millimetres(state.position[:, node])
        return f"element {number}{_of_body(model, body)} at {place}"

    if depth.max() > 0.5 * limit:
        return f", the deepest in {at(near[np.argmax(depth)])}"
    speed = np.linalg.norm(state.velocity[:, near], axis=0)
    fastest = int(np.argmax(speed))
    return (
        f", from which they have come out again; of the nodes beside it {at(near[fastest])} is "
        f"the fastest, with {speed[fastest]:.2g} m/s"
    )


def require_on_the_face(model: Model, state: State) -> None:
    """Stop where a ply has gone into another one deeper than its springs can follow.

    Raises
    ------
    SimulationError : it names the plies, the element, the place and the time.
    """
    if model.ply_contact is None:
        return
    data = model.ply_contact.data
    point = int(state.ply_counters[TOO_DEEP]) - 1
    if point < 0:
        return
    facet, own = int(state.ply_facet[point]), int(data.ply[point])
    other, penalty, away = "another ply", float(data.penalty.max()), state.velocity[:, point]
    if facet >= 0:
        faced = int(data.facet_ply[facet])
        other = model.bodies[faced].name
        penalty = float(data.penalty[data.interface[own, faced]])
        away = away - state.velocity[:, data.facet_node[facet]].mean(axis=1)
    body, speed = model.bodies[own], float(np.linalg.norm(away))
    raise SimulationError(
        f"the ply {body.name} has gone into {other} by more than half the thickness of the "
        f"thicker one, at its element {model.element_at(point) - body.first_element} at "
        f"{millimetres(state.position[:, point])}, {when(state)}, at {speed:.2g} m/s against each "
        "other: its contact is lost from there on. Likely cause: "
        f"{_cause_of_depth(model, state, penalty, speed)}"
    )


def _cause_of_depth(model: Model, state: State, penalty: float, speed: float) -> str:
    """Say why plies went into each other, the likeliest cause first.

    Loose rims of a process that is too fast flap, faster than any tool moves, and are driven
    through each other's edges at any contact stiffness. Else they were pressed.

    penalty : contact stiffness of the two [Pa/m]. speed : at which they move there [m/s].
    """
    stiffness = f"{1e-9 * penalty:.3g} N/mm^3"
    internal = sum(
        body.stored_energy(state.position, model.history_of(body, state.history))[0]
        for body in model.bodies
    )
    moved = float(state.work[KINETIC]) / max(internal, energy_floor(model))
    if moved > LARGEST_KINETIC_PART and speed > np.abs(state.tool_velocity).max(initial=0.0):
        return (
            "a process so fast that loose rims flap and strike each other: the kinetic energy is "
            f"{moved:.0%} of the strain energy (quasi-static: below {LARGEST_KINETIC_PART:.0%}); "
            f"use {slower_loads(model, moved)}. If it goes on in a slow process, pressure that a "
            f"contact stiffness of {stiffness} cannot carry; then set a higher interfaces.penalty, "
            "or shorten the edges"
        )
    return (
        f"pressure that a contact stiffness of {stiffness} cannot carry, or elements that are long "
        "for what they are bent over; set a higher interfaces.penalty, slow what presses the "
        "plies, or shorten the edges"
    )


def require_passive(model: Model, state: State) -> None:
    """Stop where motion and dissipation have taken more energy than was put in."""
    taken = float(np.sum(state.work[:WORK_COLUMNS]) - state.work[EXTERNAL])
    surplus = taken - float(state.work[EXTERNAL])
    limit = RUNAWAY_FRACTION * abs(float(state.work[EXTERNAL])) + energy_floor(model)
    if surplus <= limit:
        return
    fastest = int(np.argmax(np.sum(state.velocity**2, axis=0)))
    element = model.element_at(fastest)
    raise SimulationError(
        f"the energy balance runs away at {when(state)}: motion, contact and dissipation "
        f"({energies_in_words(state)}) exceed the external work {state.work[EXTERNAL]:.3g} J by "
        f"{surplus:.3g} J. The fastest node is {fastest} (element {element}) at "
        f"{millimetres(state.position[:, fastest])}. Likely cause: "
        f"{cause_of_runaway(model, state, surplus)}"
    )


def resolution_is_due(model: Model, state: State) -> bool:
    """Tell whether it is time to look at the hourglass energy, whatever else a run saves."""
    interval = LOOK_INTERVAL * model.process_time
    return state.time >= min(state.clock[LOOKED] + interval, model.process_time)


def require_resolved(model: Model, state: State, energy: Mapping[str, float]) -> None:
    """Stop where the hourglass terms carry the sheet: its elements cannot follow the tools."""
    part, now = hourglass_part(model, energy), state.time
    state.clock[LOOKED] = now
    if part <= LARGEST_HOURGLASS_PART:
        state.clock[RESOLVED] = now
        return
    lasted = now - float(state.clock[RESOLVED])
    if now < model.process_time and lasted < LONGEST_UNRESOLVED * model.process_time:
        return
    element, place = _most_hourglass(model, state)
    raise SimulationError(
        f"the hourglass energy is {part:.0%} of the strain energy at {when(state)}, more than "
        f"{LARGEST_HOURGLASS_PART:.0%}: forces and shape cannot be trusted. The most is in element "
        f"{element} at {millimetres(place)}. Likely cause: "
        f"{_cause_of_hourglass(model, state, energy, element)}"
    )


def _cause_of_hourglass(
    model: Model, state: State, energy: Mapping[str, float], element: int
) -> str:
    """Say why elements cannot follow the sheet: how it was struck, or how large they are, or both.

    A sheet that is struck bends between the tools tighter than their radii. A strip over an edge of
    5 mm, struck within 150 ms, reaches an hourglass energy of 28 % of the strain energy with
    elements of 1.5 mm; within 600 ms it stays at 0.1 %. Where a tool turns under the element by
    more than elements of this size can follow, no slower process cures it.
    """
    edge = 1e3 * element_size(model)
    finer = finer_elements(model, state, hourglass_part(model, energy))
    moved = largest_kinetic_energy(state) / energy["internal"]
    if moved <= LARGEST_KINETIC_PART:
        return (
            f"elements of {edge:.3g} mm are too coarse for the radii of the tools, or for folds of "
            f"the sheet between them; use {finer}, if it grows as it did until now"
        )
    bent = bending_tool(model, state, element)
    also = (
        f", and {finer}, since {bent} turns too fast for elements of {edge:.3g} mm"
        if bent
        else (f", before a smaller blank.edge_length than {edge:.3g} mm")
    )
    return (
        f"the sheet was struck, its kinetic energy reached {moved:.0%} of this strain energy "
        f"(quasi-static: below {LARGEST_KINETIC_PART:.0%}), and it folds tighter than its elements "
        f"can follow; use {slower_loads(model, moved)}{also}"
    )


def largest_kinetic_energy(state: State) -> float:
    """Return the largest kinetic energy of all samples up to now [J]; 0 without a sample."""
    rows = state.samples[: int(state.counters[SAMPLES]), SAMPLE_COLUMNS.index("kinetic")]
    return float(rows.max(initial=0.0))


def _most_hourglass(model: Model, state: State) -> tuple[int, np.ndarray]:
    """Return the element with the most hourglass energy, and its present centre [m]."""
    most, element, place = -1.0, 0, np.zeros(3)
    for body in model.bodies:
        history = model.history_of(body, state.history)
        energies = body.hourglass_energies(state.position, history)
        own = int(np.argmax(energies))
        if energies[own] > most:
            most, element = float(energies[own]), body.first_element + own
            nodes = body.mesh.elements[own] + body.first_node
            place = state.position[:, nodes].mean(axis=1)
    return element, place


def require_balanced(model: Model, state: State, energy: Mapping[str, float]) -> None:
    """Stop at the end of a process whose energy has vanished, or come from nowhere.

    What is allowed is that of :func:`require_passive`, which sees a surplus on the way.
    """
    if state.time < model.process_time:
        return
    error = energy["balance_error"]
    largest = max(abs(value) for name, value in energy.items() if name != "balance_error")
    if abs(error) <= RUNAWAY_FRACTION * largest + energy_floor(model):
        return
    what = "came from nowhere" if error > 0.0 else "vanished"
    raise SimulationError(
        f"{abs(error):.3g} J {what} up to {when(state)}, {abs(error) / largest:.0%} of the largest "
        f"energy (at most {RUNAWAY_FRACTION:.0%}): forces and shape cannot be trusted. Likely "
        "cause: impacts on the tools that the step does not resolve; slow what strikes them "
        f"({slower_process(model)}, process.mass_damping, the ramp of a load), or "
        f"lower process.step_safety = {model.step_safety:g}"
    )


def hourglass_part(model: Model, energy: Mapping[str, float]) -> float:
    """Return the hourglass energy over the strain energy, 0 where the ratio says nothing.

    That is at the first touch of a tool, while the sheet is hardly strained or moves more than it
    is strained, and where a body says so.
    """
    if energy["internal"] <= max(energy["kinetic"], LOADED * energy_floor(model)):
        return 0.0
    if not all(body.hourglass_tells for body in model.bodies):
        return 0.0
    return energy["hourglass"] / energy["internal"]


def energy_floor(model: Model) -> float:
    """Return the energy [J] below which a balance says nothing."""
    return 0.5 * FLOOR_STRAIN**2 * model.stiffness_at_rest


def _within_bounds(values: np.ndarray) -> bool:
    return bool(-BEYOND_ALL_BOUNDS < values.min() and values.max() < BEYOND_ALL_BOUNDS)


def _of_body(model: Model, body: Body) -> str:
    return f" of {body.name}" if len(model.bodies) > 1 else ""


def when(state: State) -> str:
    """Return time and step of a state in words."""
    return f"{1e3 * state.time:.4f} ms (step {state.step_count})"
