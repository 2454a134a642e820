"""The explicit time loop: central differences with a lumped mass.

One step: internal forces of all elements; per node the sum of its corner forces, contact with the
tools near it, and the update of velocity and position; then supported nodes and tools. Sums over
nodes are made per chunk of nodes and then over the chunks in a fixed order: bit-identical for any
number of threads.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", box 6.1, with a variable step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll, prange

from lcmchain.effects.damping import averaged_velocity, damped_velocity
from lcmchain.effects.face_pressure import face_forces, face_pressures
from lcmchain.effects.fibre_bending import (
    NEAR_ROWS,
    add_vectors,
    fibre_bending_forces,
    find_middle,
    find_vectors,
)
from lcmchain.effects.gravity import weight_at, weights_of
from lcmchain.effects.pore_pressure import pore_forces
from lcmchain.effects.supports import prescribed_position
from lcmchain.elements.blocks import LANES, NEXT_ROW, SECOND_ROW
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.kernel import forces_of_block
from lcmchain.interfaces.forces import (
    STEPS_LEFT,
    add_ply_forces,
    forces_of_points,
    list_points,
)
from lcmchain.interfaces.refresh import refresh
from lcmchain.jit import entry, kernel_part, ordered_span_routine, routine, span_routine
from lcmchain.model import NODE_CHUNK, NodeData
from lcmchain.solver.contact_forces import add_contact_forces, scratch_size
from lcmchain.solver.contact_search import find_near_spans
from lcmchain.state import (
    CONTACT,
    CONTACT_DAMPING,
    EXTERNAL,
    FRICTION,
    KINETIC,
    LAST_STEP,
    MASS_DAMPING,
    PACE,
    PEAK_FORCE,
    PEAK_TIME,
    PLY_REFRESH,
    SHEET_TIME,
    STEPS,
    TIME,
    TOOL_COLUMNS,
    WORK_COLUMNS,
    Scratch,
    State,
)
from lcmchain.tools.motion import GUIDED, guided_load, prescribed_travel

#: What the loop reads and writes: constants of the nodes, state, and scratch arrays.
Arrays: Any = NamedTuple(  # type: ignore[misc]
    "Arrays",
    [(name, np.ndarray) for name in (*NodeData._fields, *State.names(), *Scratch.names())],
)


@entry
def advance(
    arrays,
    bodies,
    fibre_bending,
    pore,
    face_pressure,
    pressed,
    plies,
    tools,
    environment,
    supports,
    averaging,
    schedule,
    unscheduled,
    step_count,
    dt,
):
    """Make ``step_count`` steps of size ``dt`` [s] of the sheet's time.

    The process goes on by as much times its pace: tools, supports and pressures follow its time.
    ``bodies`` are those placed in the model; ``fibre_bending``, ``pore``, ``face_pressure``,
    ``tools`` and ``supports`` are tables or None; ``pressed`` is True where ``pore`` or
    ``face_pressure`` is there, or None; ``plies`` are the constants of contact between sheets, or
    None; ``averaging`` is the time over which the mean velocity is
    taken that damping leaves alone [s], or None. ``schedule`` is the order of a step of one sheet
    (:class:`lcmchain.solver.schedule.Schedule`), or None: then every loop runs through the sheets,
    and ``unscheduled`` is True instead of None. Code is left out where an argument is None only.
    """
    clock = arrays.clock
    if tools is not None:
        find_near_spans(arrays.near, arrays.near_span)
    if plies is not None:
        list_points(plies, arrays)
    for _ in range(step_count):
        dt_last = clock[LAST_STEP]
        if unscheduled is not None:
            for body in literal_unroll(bodies):
                internal_forces(
                    body.data,
                    arrays.position,
                    arrays.corner_force[body.first_force : body.last_force],
                    arrays.history[body.first_history : body.last_history],
                )
            if fibre_bending is not None:
                fibre_bending_forces(
                    fibre_bending,
                    arrays.position,
                    arrays.corner_force,
                    arrays.bending_middle,
                    arrays.bending_vector,
                )
        if pore is not None:
            pore_forces(
                pore,
                arrays.position,
                arrays.velocity,
                arrays.pore_pressure,
                arrays.pore_rate,
                arrays.pore_resistance,
                dt,
                arrays.corner_load,
            )
        if face_pressure is not None:
            bottom, top = face_pressures(face_pressure, clock[TIME])
            face_forces(
                face_pressure.elements, arrays.position, bottom, top, pore, arrays.corner_load
            )
        if unscheduled is not None:
            if plies is not None:
                move_plies(plies, arrays, dt_last, dt)
            move_nodes(arrays, plies, tools, environment, pressed, averaging, dt_last, dt)
        if schedule is not None:
            for phase in range(schedule.phase_start.size - 1):
                make_parts(
                    arrays,
                    schedule,
                    phase,
                    bodies[0].data.corner_node,
                    bodies[0].data.corner_run,
                    bodies[0].data.element_data,
                    bodies[0].data.law,
                    bodies[0].data.options,
                    bodies[0].data.quick_data,
                    bodies[0].data.quick_options,
                    bodies[0].data.general,
                    fibre_bending,
                    tools,
                    environment,
                    pressed,
                    averaging,
                    dt_last,
                    dt,
                )
        add_chunk_sums(arrays)
        if supports is not None:
            move_supports(arrays, supports, environment, dt_last, dt)
        if tools is not None:
            add_tool_loads(arrays, clock[TIME], dt_last, dt)
            move_tools(arrays, tools, clock[TIME], dt_last, dt)
        clock[TIME] += clock[PACE] * dt
        clock[SHEET_TIME] += dt
        clock[LAST_STEP] = dt
        arrays.counters[STEPS] += 1


@routine
def move_plies(plies, arrays, dt_last, dt):
    """Make the forces of all points between sheets, on springs that are renewed when it is time."""
    if arrays.ply_counters[STEPS_LEFT] <= 0:
        arrays.work[PLY_REFRESH] -= refresh(plies, arrays, dt_last, dt)
    forces_of_points(plies, arrays, dt_last)
    arrays.ply_counters[STEPS_LEFT] -= 1


@kernel_part
def move_nodes(arrays, plies, tools, environment, pressed, averaging, dt_last, dt):
    """Sum the forces on the nodes, and update velocities and positions."""
    for place in prange(arrays.chunk_order.size):
        work = np.empty(scratch_size(tools))
        chunk = arrays.chunk_order[place]
        move_chunk(
            arrays,
            arrays.force_slot,
            plies,
            tools,
            environment,
            pressed,
            averaging,
            chunk,
            dt_last,
            dt,
            work,
        )


@routine
def move_chunk(
    arrays, force_slot, plies, tools, environment, pressed, averaging, chunk, dt_last, dt, work
):
    """Sum the forces on the nodes of a chunk, and update their velocities and positions."""
    first = chunk * NODE_CHUNK
    last = min(first + NODE_CHUNK, arrays.mass.size)
    sums = arrays.chunk_sums[chunk]
    sums[:] = 0.0
    gather_internal_forces(arrays, force_slot, first, last)
    if pressed is not None:
        add_pressure_loads(arrays, first, last, dt_last, sums)
    if plies is not None:
        stored, lost, damped = add_ply_forces(plies, arrays, first, last)
        sums[CONTACT] += stored
        sums[FRICTION] += lost
        sums[CONTACT_DAMPING] += damped
    if tools is not None:
        add_contact_forces(arrays, tools, environment, first, last, dt_last, dt, work, sums)
    integrate(arrays, arrays.free, environment, averaging, first, last, dt_last, dt, sums)


@kernel_part
def make_parts(
    arrays,
    schedule,
    phase,
    corner_node,
    corner_run,
    element_data,
    law,
    options,
    quick_data,
    quick_options,
    general,
    fibre_bending,
    tools,
    environment,
    pressed,
    averaging,
    dt_last,
    dt,
):
    """Make the parts of a phase of a step.

    One loop for all phases: compiled twice, a chunk of nodes might get other last digits between
    two parts than within one. The constants of a sheet of solid-shells come one by one: a parallel
    loop takes no tuple that holds tuples.
    """
    first_part = schedule.phase_start[phase]
    for k in prange(schedule.phase_start[phase + 1] - first_part):
        part = first_part + k
        work, near = np.empty(scratch_size(tools)), np.empty(NEAR_ROWS * LANES)
        for tile in range(schedule.part_start[part], schedule.part_start[part + 1]):
            for piece in range(schedule.block_start[tile], schedule.block_start[tile + 1]):
                block = schedule.block[piece]
                forces_of_block(
                    arrays.position,
                    corner_node,
                    corner_run,
                    element_data,
                    arrays.corner_force,
                    arrays.history,
                    law,
                    options,
                    quick_data,
                    quick_options,
                    general,
                    block,
                    schedule.place[block],
                )
            if fibre_bending is not None:
                bend_fibres(arrays, schedule, fibre_bending, tile, near)
            for piece in range(schedule.chunk_start[tile], schedule.chunk_start[tile + 1]):
                move_chunk(
                    arrays,
                    schedule.force_slot,
                    None,
                    tools,
                    environment,
                    pressed,
                    averaging,
                    schedule.chunk[piece],
                    dt_last,
                    dt,
                    work,
                )


@routine
def bend_fibres(arrays, schedule, data, tile, near):
    """Make what the fibres' bending has to do behind a tile of elements."""
    middle, vector, force = arrays.bending_middle, arrays.bending_vector, arrays.corner_force
    for k in range(schedule.middle_start[tile], schedule.middle_start[tile + 1]):
        find_middle(data, arrays.position, middle, schedule.middle[k], near)
    for k in range(schedule.vector_start[tile], schedule.vector_start[tile + 1]):
        find_vectors(data, middle, vector, schedule.vector[k], near)
    for k in range(schedule.sum_start[tile], schedule.sum_start[tile + 1]):
        add_vectors(data, vector, force, schedule.sum[k], near)


@ordered_span_routine
def gather_internal_forces(arrays, force_slot, first, last):
    """Set the force on each node to minus the sum of its corner forces.

    Summed in their order: a sheet moves as it does without the slots that others need.
    """
    force, corner_force = arrays.force, arrays.corner_force
    force_slot = force_slot[:, first:last]
    force_x, force_y, force_z = force[0, first:last], force[1, first:last], force[2, first:last]
    for i in range(last - first):
        x = 0.0
        y = 0.0
        z = 0.0
        for k in range(force_slot.shape[0]):
            slot = np.uint64(force_slot[k, i])
            x -= corner_force[slot]
            y -= corner_force[slot + NEXT_ROW]
            z -= corner_force[slot + SECOND_ROW]
        force_x[i] = x
        force_y[i] = y
        force_z[i] = z


@span_routine
def add_pressure_loads(arrays, first, last, dt_last, sums):
    """Sum up the loads on the corners for nodes ``first`` to ``last``, and add them to the force.

    The work since the last step, mean of both loads times the displacement, goes to ``sums``.
    """
    load, node_load, force_slot = arrays.corner_load, arrays.node_load, arrays.force_slot
    velocity, force = arrays.velocity, arrays.force
    work = 0.0
    for node in range(first, last):
        x = 0.0
        y = 0.0
        z = 0.0
        for i in range(force_slot.shape[0]):
            slot = force_slot[i, node]
            x += load[slot]
            y += load[slot + LANES]
            z += load[slot + 2 * LANES]
        work += (node_load[0, node] + x) * velocity[0, node]
        work += (node_load[1, node] + y) * velocity[1, node]
        work += (node_load[2, node] + z) * velocity[2, node]
        node_load[0, node] = x
        node_load[1, node] = y
        node_load[2, node] = z
        force[0, node] += x
        force[1, node] += y
        force[2, node] += z
    sums[EXTERNAL] += 0.5 * dt_last * work


@span_routine
def integrate(arrays, free, environment, averaging, first, last, dt_last, dt, sums):
    """Update velocity (to n + ½) and position (to n + 1), and sum the energies of the nodes.

    Components that are not free keep their position; supports move them afterwards.
    """
    interval = 0.5 * (dt_last + dt)
    damping = environment.mass_damping
    mass, inverse_mass = arrays.mass[first:last], arrays.inverse_mass[first:last]
    weights = weights_of(environment.gravity, first, last)
    for d in range(3):
        position, velocity = arrays.position[d, first:last], arrays.velocity[d, first:last]
        force = arrays.force[d, first:last]
        if free is not None:
            free_part = free[d, first:last]
        if averaging is not None:
            average = arrays.mean_velocity[d, first:last]
            part = min(interval / averaging, 1.0)
        kinetic, damped, weight = 0.0, 0.0, 0.0
        for i in range(last - first):
            gravity = -weight_at(weights, i) if d == 2 else 0.0
            share = 1.0
            if free is not None:
                share = free_part[i]
            old = velocity[i]
            acceleration = force[i] * inverse_mass[i] + gravity
            undamped = 0.0
            if averaging is not None:
                undamped = average[i]
            new = undamped + damped_velocity(old - undamped, acceleration, damping, interval)
            velocity[i] = new if share > 0.0 else old
            position[i] += share * dt * new
            mean = 0.5 * (old + new)
            free_mass = share * mass[i]
            kinetic += 0.5 * free_mass * old * new
            damped += damping * free_mass * (mean - undamped) * mean * interval
            if averaging is not None:
                average[i] = averaged_velocity(undamped, mean, part)
            weight += free_mass * gravity * mean * interval
        sums[KINETIC] += kinetic
        sums[MASS_DAMPING] += damped
        sums[EXTERNAL] += weight


@routine
def move_supports(arrays, supports, environment, dt_last, dt):
    """Move held components as prescribed, and sum the forces that the supports exert [N].

    Their impulses [N s] are summed over the process as well: a force averaged over an interval is
    the difference of two impulses, free of the noise of single steps.
    """
    position, velocity, free, mass = arrays.position, arrays.velocity, arrays.free, arrays.mass
    pace = arrays.clock[PACE]
    interval = 0.5 * (dt_last + dt)
    place = (arrays.clock[TIME] + pace * dt) / supports.interval
    piece = min(int(place), supports.affine.shape[1] - 2)
    s = min(place - piece, 1.0)
    arrays.support_force[:] = 0.0
    for k in range(supports.node.size):
        node, group = supports.node[k], supports.group[k]
        for d in range(3):
            if free[d, node] > 0.0:
                continue
            old = velocity[d, node]
            new = (prescribed_position(supports, k, d, piece, s) - position[d, node]) / dt
            gravity = -weight_at(environment.gravity, node) if d == 2 else 0.0
            held = mass[node] * ((new - old) / interval - gravity) - arrays.force[d, node]
            arrays.support_force[group, d] += held
            arrays.support_impulse[group, d] += held * (pace * interval)
            arrays.work[KINETIC] += 0.5 * mass[node] * old * new
            arrays.work[EXTERNAL] += (held + mass[node] * gravity) * 0.5 * (old + new) * interval
            velocity[d, node] = new
            position[d, node] += dt * new


@routine
def add_chunk_sums(arrays):
    """Reduce the sums of the chunks, in their order."""
    work, sums, tool_force = arrays.work, arrays.chunk_sums, arrays.tool_force
    work[KINETIC] = 0.0
    work[CONTACT] = 0.0
    tool_force[:] = 0.0
    for chunk in range(sums.shape[0]):
        for column in range(WORK_COLUMNS):
            work[column] += sums[chunk, column]
        for tool in range(tool_force.shape[0]):
            column = WORK_COLUMNS + TOOL_COLUMNS * tool
            for d in range(3):
                tool_force[tool, d] += sums[chunk, column + d]
            arrays.penetration_max[tool] = max(
                arrays.penetration_max[tool], -sums[chunk, column + 3]
            )


@routine
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


@routine
def move_tools(arrays, tools, time, dt_last, dt):
    """Update the travel of every tool: as prescribed, as driven, or by its equation of motion."""
    work, pace = arrays.work, arrays.clock[PACE]
    for tool in range(tools.kind.size):
        old = arrays.tool_velocity[tool]
        contact = 0.0
        for d in range(3):
            contact += arrays.tool_force[tool, d] * tools.direction[tool, d]
        if tools.motion_kind[tool] == GUIDED and arrays.driven[tool] == 0:
            mass = tools.mass[tool]
            applied = guided_load(tools, tool, arrays.tool_input[tool, 1], time)
            interval = 0.5 * (dt_last + dt)
            damping = tools.damping[tool] / mass
            new = damped_velocity(old, (contact + applied) / mass, damping, interval)
            displacement = dt * new
            mean = 0.5 * (old + new)
            work[KINETIC] += 0.5 * mass * old * new
            work[MASS_DAMPING] += tools.damping[tool] * mean * mean * interval
            work[EXTERNAL] += applied * mean * interval
            arrays.tool_work[tool] -= contact * mean * interval
        else:
            if arrays.driven[tool] != 0:
                displacement = dt * (pace * arrays.tool_input[tool, 0])
            else:
                target, _ = prescribed_travel(tools, tool, time + pace * dt)
                displacement = target - arrays.tool_travel[tool]
            new = displacement / dt
            on_sheets = -contact * 0.5 * (old * dt_last + displacement)
            work[EXTERNAL] += on_sheets
            arrays.tool_work[tool] += on_sheets
        arrays.tool_travel[tool] += displacement
        arrays.tool_velocity[tool] = new
