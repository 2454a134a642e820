"""Why an energy balance ran away: what the energies say, and which entry of the scene cures it."""

from __future__ import annotations

import numpy as np

from lcmchain.model import Model
from lcmchain.solver.remedies import slower_process
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
from lcmchain.tools.distance import gaps

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
