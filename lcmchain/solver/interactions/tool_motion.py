"""Tools within a step: forces and impulses on them, their travel, and how they limit the step."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.dispatch import implements
from lcmchain.effects.interaction import Bound, after_nodes, begin_steps, bound
from lcmchain.effects.process.damping import damped_velocity
from lcmchain.jit import equation, standalone_routine, uncounted_routine
from lcmchain.model import Model
from lcmchain.solver.interactions.contact_forces import find_near_packs
from lcmchain.state import (
    EXTERNAL,
    KINETIC,
    MASS_DAMPING,
    PACE,
    PEAK_FORCE,
    PEAK_TIME,
    STAGE,
    STOPPED_TIME,
    STOPPED_TRAVEL,
    TIME,
    TOOL_COLUMNS,
    WORK_COLUMNS,
    State,
)
from lcmchain.tools.motion import GUIDED, guided_load, prescribed_travel, way_to_stop
from lcmchain.tools.table import ToolTable


@implements(begin_steps, ToolTable)
@equation
def begin_contact(tools, arrays):
    find_near_packs(arrays.near, arrays.chunk_start, arrays.near_pack, arrays.tools_near)
    arrays.contact_force[:] = 0.0  # of nodes near no tool it stays so


@implements(after_nodes, ToolTable)
@equation
def load_and_move_tools(tools, arrays, environment, dt_last, dt):
    finish_tools(tools, arrays, dt_last, dt)


@standalone_routine
def finish_tools(tools, arrays, dt_last, dt):
    """Sum up what the nodes have done to the tools in a step, and move these."""
    add_moments(tools.turn_axis, arrays, 0.5 * (dt_last + dt))
    add_tool_loads(arrays, arrays.clock[TIME], dt_last, dt)
    move_tools(arrays, tools, arrays.clock[TIME], dt_last, dt)


@uncounted_routine
def add_moments(turn_axis, arrays, interval):
    """Sum the moments on tools that turn [N m] over the chunks, in their order, and over time."""
    if turn_axis is not None:
        moment, sums = arrays.tool_moment, arrays.chunk_sums
        moment[:] = 0.0
        for chunk in range(sums.shape[0]):
            for tool in range(moment.size):
                moment[tool] += sums[chunk, WORK_COLUMNS + TOOL_COLUMNS * moment.size + tool]
        for tool in range(moment.size):
            arrays.tool_moment_impulse[tool] += moment[tool] * (arrays.clock[PACE] * interval)


@equation
def with_moment(turn_axis, arrays, tool, contact):
    """Add to the force along the travel of a tool [N] its moment [N m]: one of them is 0."""
    if turn_axis is not None:
        return contact + arrays.tool_moment[tool]
    return contact


@uncounted_routine
def add_tool_loads(arrays, time, dt_last, dt):
    """Sum the impulses [N s] of the tool forces, and keep the largest force of a step [N].

    A force averaged over an interval of the process is the difference of two impulses over it.
    """
    interval = arrays.clock[PACE] * 0.5 * (dt_last + dt)
    for tool in range(arrays.tool_force.shape[0]):
        squared = 0.0
        for d in range(3):
            force = arrays.tool_force[tool, d]
            arrays.tool_impulse[tool, d] += force * interval
            squared += force * force
        peak = arrays.tool_peak[tool]
        if squared > peak[PEAK_FORCE] * peak[PEAK_FORCE]:
            peak[PEAK_FORCE] = math.sqrt(squared)
            peak[PEAK_TIME] = time


@uncounted_routine
def move_tools(arrays, tools, time, dt_last, dt):
    """Update the travel of every tool: as prescribed, as driven, or by its equation of motion.

    A stop takes from a guided tool the speed with which it would go beyond it. Its force is what
    the equation of motion then leaves; its work is that of the press, and so external.
    """
    work, pace = arrays.work, arrays.clock[PACE]
    for tool in range(tools.kind.size):
        old = arrays.tool_velocity[tool]
        contact = held = 0.0
        for d in range(3):
            contact += arrays.tool_force[tool, d] * tools.direction[tool, d]
        contact = with_moment(tools.turn_axis, arrays, tool, contact)
        if tools.motion_kind[tool] == GUIDED and arrays.driven[tool] == 0:
            mass = tools.mass[tool]
            applied = guided_load(tools, tool, arrays.tool_input[tool, 1], time)
            interval = 0.5 * (dt_last + dt)
            damping = tools.damping[tool] / mass
            new = damped_velocity(old, (contact + applied) / mass, damping, interval)
            displacement = dt * new
            room, side = way_to_stop(tools, tool, arrays.tool_travel[tool])
            if side * displacement > room:
                displacement = side * room
                new = displacement / dt
                held = contact + applied - mass * (new - old) / interval
                held -= tools.damping[tool] * 0.5 * (old + new)
                note_stop(arrays, tool, time)
            mean = 0.5 * (old + new)
            work[KINETIC] += 0.5 * mass * old * new
            work[MASS_DAMPING] += tools.damping[tool] * mean * mean * interval
            work[EXTERNAL] += (applied - held) * mean * interval
            arrays.tool_stop_impulse[tool] += held * interval * pace
            arrays.tool_work[tool] -= contact * mean * interval
        else:
            if arrays.driven[tool] != 0:
                displacement = dt * (pace * arrays.tool_input[tool, 0])
            else:
                target, _ = prescribed_travel(tools, tool, time + pace * dt)
                displacement = target - arrays.tool_travel[tool]
                against = -math.copysign(1.0, tools.stroke_distance[tool]) * contact
                if against >= tools.until_force[tool]:
                    note_stop(arrays, tool, time)
                if arrays.tool_stopped[tool, arrays.counters[STAGE], STOPPED_TIME] <= time:
                    displacement = 0.0
            new = displacement / dt
            on_sheets = -contact * 0.5 * (old * dt_last + displacement)
            work[EXTERNAL] += on_sheets
            arrays.tool_work[tool] += on_sheets
        arrays.tool_travel[tool] += displacement
        arrays.tool_velocity[tool] = new
        arrays.tool_stop_force[tool] = held


@uncounted_routine
def note_stop(arrays, tool, time):
    """Note when and where [s, m] a tool has first been stopped in the present stage."""
    stopped = arrays.tool_stopped[tool, arrays.counters[STAGE]]
    if time < stopped[STOPPED_TIME]:
        stopped[STOPPED_TIME] = time
        stopped[STOPPED_TRAVEL] = arrays.tool_travel[tool]


@bound.register(ToolTable)
def _bound_of_contact(tools: ToolTable, model: Model, state: State, ahead: float) -> Bound:
    """Contact stiffness of the nodes near tools; the damping of a contact limits no step.

    It is averaged over the step, but its reaction on a guided tool is not.
    """
    contact2 = rate = 0.0
    if state.near.any():
        contact2 = float(np.max(state.near.sum(axis=0) * model.contact_omega2))
        for tool, tool_mass in enumerate(tools.mass):
            if tool_mass > 0.0:
                near = state.near[tool] != 0
                contact2 += float(np.sum(model.contact_stiffness[near])) / tool_mass
                rate = max(rate, float(np.sum(model.contact_damping[near])) / tool_mass)
    return Bound(contact2, rate, "contact stiffness")
