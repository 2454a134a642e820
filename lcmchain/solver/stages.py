"""The border between two stages of a process: what comes to work, what leaves, and what that books.

Tables of the new stage come from the model (:mod:`lcmchain.stages`). Here the state is made ready
for them. What leaves takes its energy along, and the balance counts that as work of the outside:
the springs of contact and of friction of a tool, the motion of a guided one that is held from now
on, what the laws of an interface stored that the plies no longer have. Energies of springs are
taken half a step before, as central differences conserve them
(:meth:`lcmchain.model.Model.renew`).
"""

from __future__ import annotations

import numpy as np

from lcmchain.errors import SimulationError
from lcmchain.interfaces.change import change_interfaces
from lcmchain.interfaces.forces import STEPS_LEFT
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.solver.guards import when
from lcmchain.solver.laid_plies import lay_down, newcomers, require_clear
from lcmchain.stages import StageTables
from lcmchain.state import (
    CONTACT,
    EXTERNAL,
    KINETIC,
    PACE,
    PLY_REFRESH,
    STAGE,
    START_OVERLAP,
    START_TRAVEL,
    State,
)
from lcmchain.tools.distance import gaps
from lcmchain.tools.initial_overlap import OVERLAP_TOLERANCE, ROUNDING
from lcmchain.tools.motion import GUIDED


def is_over(model: Model, state: State) -> bool:
    """Tell whether the present stage has come to its end, and another one follows."""
    stage = model.present_stage
    follows = model.stage + 1 < len(model.stages)
    return stage is not None and follows and state.time >= stage.end


def begin_first(model: Model, state: State) -> None:
    """Make a state at rest ready for the first stage.

    Grippers that hold, and are not at work in it, let the nodes free. Plies that are laid down
    later are held where they wait.
    """
    if model.supports is not None:
        state.gripped_at[:] = state.position
    if model.lets_go:
        state.free[:] = model.stages[0].free(model.whole, state.support_let_go)


def begin_stage(model: Model, state: State, number: int, arrays: object) -> Model:
    """Begin a stage, and return the model in it.

    Parameters
    ----------
    model : in the stage that has ended. number : of the one that begins. arrays : of the loop.

    Raises
    ------
    SimulationError : a tool that comes to work reaches into the sheet, or a ply that is laid down
        lies in a tool or in another ply; the state is that before.
    """
    before, now = model.stages[model.stage], model.stages[number]
    overlap = _overlap_of_newcomers(model, state, before, now)
    laid_down = newcomers(model, before, now)
    if laid_down:
        require_clear(model, state, before, now, laid_down)
    for tool in np.flatnonzero(before.tools_at_work & ~now.tools_at_work).tolist():
        _take_away(state, CONTACT, _take_contact_away(model, state, tool))
    _hold_guided(before, now, state)
    onward = _at_same_stop(before, now)
    state.tool_start[~onward, START_TRAVEL] = state.tool_travel[~onward]
    state.tool_start[:, START_OVERLAP] = overlap
    _begin_grippers(model, state, before, now)
    if model.supports is not None:
        state.gripped_at[:] = state.position
    if model.lets_go:
        state.free[:] = now.free(model.whole, state.support_let_go)
    if laid_down:
        energy = lay_down(model, state, before, now, laid_down)
        _take_away(state, CONTACT, -energy)
    if now.ply_contact is not None and before.ply_contact is not None:
        data = now.ply_contact.data
        if (data.interface != before.ply_contact.data.interface).any():
            given = change_interfaces(data, now.ply_contact.laws, arrays, state.last_step)
            state.work[PLY_REFRESH] -= given
            state.work[CONTACT] += given
            state.ply_acts[:] = 1
            state.ply_counters[STEPS_LEFT] = 0
    if now.pace is None:
        state.clock[PACE] = 1.0
    if model.averaging is not None and np.isinf(now.averaging or 0.0):
        state.mean_velocity[:] = 0.0
    state.counters[STAGE] = number
    return model.in_stage(number, state)


def _take_away(state: State, column: int, energy: float) -> None:
    """Take an energy [J] out of the sheets' and tools', as work of the outside.

    column : of ``State.work`` that holds it since the last step, which the next one makes anew.
    """
    state.work[EXTERNAL] -= energy
    state.work[column] -= energy


def _overlap_of_newcomers(
    model: Model, state: State, before: StageTables, now: StageTables
) -> np.ndarray:
    """Return the depth of every tool in the sheet up to which it exerts no force [m].

    A tool that comes to work may touch the sheet, as at the start of a process.

    Raises
    ------
    SimulationError : one reaches into the sheet; names all of them.
    """
    overlap = state.tool_start[:, START_OVERLAP].copy()
    thinnest = min(body.material.thickness for body in model.bodies)
    there = slice(None) if now.absent is None else ~now.absent
    positions, found = np.ascontiguousarray(state.position.T[there]), []
    for tool in np.flatnonzero(now.tools_at_work & ~before.tools_at_work).tolist():
        gap = gaps(model.tools, tool, positions, float(state.tool_travel[tool]))
        gap = gap - model.nodes.offset[there]
        deepest = int(np.argmin(gap))
        depth = -float(gap[deepest])
        if depth > OVERLAP_TOLERANCE * thinnest:
            found.append(
                f"{model.tool_names[tool]} reaches {1e3 * depth:.3g} mm into the sheet at "
                f"{millimetres(positions[deepest])}"
            )
        overlap[tool] = depth if depth > ROUNDING * thinnest else 0.0
    if found:
        raise SimulationError(
            f'the stage "{now.name}" cannot begin at {when(state)}: {", ".join(found)}. A tool '
            "that comes to work must lie outside of the sheet: check its position and its motion "
            f"in the stages before, or add a stage that brings it there before {now.name}"
        )
    return overlap


def _take_contact_away(model: Model, state: State, tool: int) -> float:
    """Take a tool off the sheet, and return what its springs stored [J]."""
    half = 0.5 * state.last_step
    positions = np.ascontiguousarray((state.position - half * state.velocity).T)
    travel = float(state.tool_travel[tool] - half * state.tool_velocity[tool])
    gap = gaps(model.tools, tool, positions, travel)
    gap = gap - (model.nodes.offset - model.tools.initial_overlap[tool])
    near = state.near[tool] != 0
    stiffness = np.where(near, model.contact_stiffness, 0.0)
    held = np.zeros_like(gap)
    if model.environment.depth_time is not None:
        held = state.depth_offset[tool].copy()
        state.depth_offset[tool] = 0.0
    depth = np.maximum(held - gap, 0.0)
    stored = 0.5 * float(np.sum(stiffness * (depth**2 - held**2)))
    if state.stick.size:
        slip2 = np.sum(state.stick[tool] ** 2, axis=0)
        tangential = model.environment.tangential_ratio * model.contact_stiffness
        stored += 0.5 * float(np.sum(tangential * slip2))
        state.stick[tool] = 0.0
    return stored


def _hold_guided(before: StageTables, now: StageTables, state: State) -> None:
    """Take the motion out of guided tools that are held or led from now on."""
    ended = (before.tools.motion_kind == GUIDED) & (now.tools.motion_kind != GUIDED)
    for tool in np.flatnonzero(ended & (state.driven == 0)).tolist():
        velocity = float(state.tool_velocity[tool])
        _take_away(state, KINETIC, 0.5 * float(before.tools.mass[tool]) * velocity**2)
        state.tool_velocity[tool] = 0.0


def _at_same_stop(before: StageTables, now: StageTables) -> np.ndarray:
    """Return which tools (T,) go on under their load to the same stop, which stays where it is."""
    guided = (before.tools.motion_kind == GUIDED) & (now.tools.motion_kind == GUIDED)
    same = before.tools.load_start == now.tools.load_start
    return guided & same & np.isfinite(now.tools.stop)


def _begin_grippers(model: Model, state: State, before: StageTables, now: StageTables) -> None:
    """Let grippers that come to work grip where their place is now."""
    if model.grippers is None:
        return
    pulling = [grip for grip in model.grips if grip.settings.pulls]
    for number in np.flatnonzero(now.grippers_at_work & ~before.grippers_at_work).tolist():
        grip = pulling[number]
        place = state.position[:, grip.nodes] @ grip.weights
        state.gripper_start[number] = place - grip.place
        state.gripper_travel[number] = 0.0
        state.gripper_force[number] = 0.0
