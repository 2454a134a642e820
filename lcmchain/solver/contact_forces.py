"""Contact forces of the tools on the nodes of a chunk.

Nodes are taken in spans of 16 neighbours (``tools/span_rows.py``), those of which one is near a
tool. Where one of a span touches, what all of them have is copied into rows of one scratch array;
one loop over the nodes for each tool, which compiles to vectors, makes its forces. Nodes of the
span that do not touch the tool get a force of zero.
"""

from __future__ import annotations

import math

from lcmchain.dispatch import implements
from lcmchain.effects.contact import normal_force
from lcmchain.effects.contact_depth import offset_change
from lcmchain.effects.friction import friction, friction_loss
from lcmchain.effects.gravity import weight_at
from lcmchain.effects.interaction import add_to_nodes, on_nodes, scratch_size
from lcmchain.elements.lane_runs import copy_lanes
from lcmchain.elements.vectors import dot, plus, products, scaled
from lcmchain.jit import equation, span_part, span_routine
from lcmchain.state import CONTACT, CONTACT_DAMPING, EXTERNAL, FRICTION, TOOL_COLUMNS, WORK_COLUMNS
from lcmchain.tools.span_distance import DISTANCE_ROWS, GAP, NORMAL_X, span_distances
from lcmchain.tools.span_rows import (
    SPAN,
    SPANS_OF_CHUNK,
    load_row,
    load_rows,
    put_vector,
    store_row,
    store_rows,
    vector_at,
)
from lcmchain.tools.table import ToolTable
from lcmchain.tools.turn import arm_at

# Rows of the scratch array of a span, behind those of the distance; of vectors the first of three.
# What the nodes have:
VELOCITY = DISTANCE_ROWS  # [m/s]
FORCE = DISTANCE_ROWS + 3  # all that have come before, then with those of the tool [N]
FREE = DISTANCE_ROWS + 6
STICK = DISTANCE_ROWS + 9  # elastic slip of the friction springs [m]
INVERSE_MASS = DISTANCE_ROWS + 12
AREA = DISTANCE_ROWS + 13
IMPEDANCE = DISTANCE_ROWS + 14
NORMAL_FORCE = DISTANCE_ROWS + 15  # sum over the tools [N]
WEIGHT = DISTANCE_ROWS + 16  # acceleration along -z [m/s²]
OFFSET = DISTANCE_ROWS + 17  # [m]
# What contact adds, for the sums: with them in the loop that makes the forces it finds no vectors.
ADDED = DISTANCE_ROWS + 18  # [N]
STORED = DISTANCE_ROWS + 21  # energy of the springs [J]
DAMPED = DISTANCE_ROWS + 22  # energy that contact damping takes [J]
LOST = DISTANCE_ROWS + 23  # energy that sliding takes [J]
# Springs of the tools that are still to come, where a span touches several [N].
PENDING = DISTANCE_ROWS + 24
# Force that damping takes off the spring, along the normal; of all tools together [N].
TAKEN = DISTANCE_ROWS + 27
ALL_TAKEN = DISTANCE_ROWS + 28
HELD = DISTANCE_ROWS + 31  # further depth that the springs feel [m]
# Velocity of the tool at the nodes, and that for a turn of 1 rad/s: of tools of which one turns.
TOOL_VELOCITY = DISTANCE_ROWS + 32  # [m/s]
ARM = DISTANCE_ROWS + 35  # [m]
ROWS = DISTANCE_ROWS + 38
# Behind them, what is kept for every tool: gap and normal, and a row that begins with 1 where the
# span touches the tool, else with 0.
TOUCHED = 4
KEPT_ROWS = 5
#: No tool.
NONE = -1


@implements(on_nodes, ToolTable)
@equation
def the_tools(tools):
    return tools


@implements(scratch_size, ToolTable)
@equation
def scratch_of_span(tools):
    return (ROWS + KEPT_ROWS * tools.kind.size) * SPAN


@equation
def kept_place(tool):
    """Return where the rows that are kept for a tool begin."""
    return (ROWS + KEPT_ROWS * tool) * SPAN


@implements(add_to_nodes, ToolTable)
@equation
def contact_of_chunk(tools, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    add_contact_forces(arrays, tools, environment, chunk, first, last, dt_last, dt, work, sums)


@span_routine
def add_contact_forces(arrays, tools, environment, chunk, first, last, dt_last, dt, work, sums):
    """Add the contact forces of all tools to the nodes ``first`` to ``last`` of a chunk.

    Energies, the forces on the tools and the deepest penetrations go to ``sums``; ``work`` has
    :func:`scratch_of_span` numbers.
    """
    contact_force = arrays.contact_force[first:last]
    for i in range(last - first):
        contact_force[i] = 0.0
    clear(PENDING, work)
    for place in range(-(-(last - first) // SPAN)):
        span, begin = chunk * SPANS_OF_CHUNK + place, first + place * SPAN
        count = min(SPAN, last - begin)
        touching, present = find_contacts(
            arrays, tools, environment, environment.depth_time, span, begin, count, dt_last, work,
            sums,
        )  # fmt: skip
        if touching > 0:
            load_span(arrays, arrays.free, environment.gravity, begin, count, work)
            if touching > 1:
                keep_distances(present, work)
                present = NONE
                add_springs(tools, environment.penalty, work)
            add_span_forces(
                arrays, tools, environment, touching, present, begin, count, dt_last, dt, work, sums
            )


@span_part
def find_contacts(arrays, tools, environment, depth_time, span, begin, count, dt_last, work, sums):
    """Find the tools that a span touches; return how many they are, and one of them.

    The distances to this one are in their rows, those to the others are kept.
    """
    found, present = 0, NONE
    for tool in range(tools.kind.size):
        work[kept_place(tool) + TOUCHED * SPAN] = 0.0
        if arrays.near_span[tool, span] != 0:
            keep_distances(present, work)
            present = NONE
            travel = arrays.tool_travel[tool]
            span_distances(tools, tool, arrays.position, begin, count, travel, work)
            deepest = -arrays.penetration_max[tool]
            touching, deeper = find_gaps(
                arrays.offset, begin, count, tools.initial_overlap[tool], deepest, work
            )
            if deeper > 0:
                column = WORK_COLUMNS + TOOL_COLUMNS * tool
                for i in range(SPAN):
                    sums[column + 3] = min(sums[column + 3], work[GAP * SPAN + i])
            if depth_time is not None:
                touching = hold_depths(
                    arrays.depth_offset[tool], arrays.area, environment, dt_last / depth_time,
                    begin, count, work, sums,
                )  # fmt: skip
            sticks = tools.friction[tool] > 0.0
            if touching > 0 or (sticks and is_displaced(arrays.stick[tool], begin, count)):
                found += 1
                present = tool
                work[kept_place(tool) + TOUCHED * SPAN] = 1.0
    return found, present


@span_part
def keep_distances(tool, work):
    """Copy the distances to a tool, where there is one, from their rows to those that are kept."""
    if tool != NONE:
        copy_rows(work, GAP * SPAN, kept_place(tool))


@span_part
def copy_rows(work, source, target):
    """Copy the rows of gap and normal."""
    for k in range(TOUCHED):
        row = source + k * SPAN
        copy_lanes(work, row, row, SPAN, work, target + k * SPAN)  # type: ignore[call-arg]


@span_part
def add_springs(tools, penalty, work):
    """Start with the springs of all tools that a span touches, and with nothing taken off them."""
    clear(ALL_TAKEN, work)
    for tool in range(tools.kind.size):
        kept = kept_place(tool)
        if work[kept + TOUCHED * SPAN] > 0.0:
            copy_rows(work, kept, GAP * SPAN)
            add_pending(penalty, work)


@span_part
def add_span_forces(
    arrays, tools, environment, touching, present, begin, count, dt_last, dt, work, sums
):
    """Add the contact forces of so many tools to the nodes of a span, ``count`` from ``begin`` on.

    Where one node touches several tools, what each of them takes for the motion of the node has to
    know of the forces of the others: two tools that hold a sheet from both sides press hard and
    move nothing. ``present`` is the tool whose distances are in their rows.
    """
    for tool in range(tools.kind.size):
        kept = kept_place(tool)
        if work[kept + TOUCHED * SPAN] > 0.0:
            if tool != present:
                copy_rows(work, kept, GAP * SPAN)
            if touching > 1:
                add_pending(-environment.penalty, work)
            direction, speed = tools.direction, arrays.tool_velocity[tool]
            velocity = (
                speed * direction[tool, 0],
                speed * direction[tool, 1],
                speed * direction[tool, 2],
            )
            turn_axis = tools.turn_axis
            find_tool_velocities(
                turn_axis, tools, tool, velocity, speed, arrays.position, begin, count, work
            )
            coefficient = tools.friction[tool]
            if coefficient > 0.0:
                stick = arrays.stick[tool]
                load_rows(stick, begin, count, STICK, work)
                make_forces(
                    environment, arrays.free, turn_axis, velocity, coefficient, count, dt_last, dt,
                    work,
                )  # fmt: skip
                store_rows(work, STICK, stick, begin, count)
            else:
                make_forces(
                    environment, arrays.free, turn_axis, velocity, None, count, dt_last, dt, work
                )
            if touching > 1:
                share_damping(turn_axis, velocity, dt_last, dt, work)
            add_sums(work, sums, WORK_COLUMNS + TOOL_COLUMNS * tool)
            add_moment(turn_axis, work, sums, WORK_COLUMNS + TOOL_COLUMNS * tools.kind.size + tool)
    if touching > 1:
        add_shared_damping(arrays.free, dt_last, dt, work, sums)
        clear(PENDING, work)
    store_rows(work, FORCE, arrays.force, begin, count)
    store_row(work, NORMAL_FORCE, arrays.contact_force, begin, count)


@span_part
def clear(row, work):
    """Set three rows to zero."""
    for i in range(SPAN):
        put_vector(work, row, i, (0.0, 0.0, 0.0))


@span_part
def add_pending(penalty, work):
    """Add the springs of a tool, or take them away, to those of the tools that follow."""
    for i in range(SPAN):
        depth = max(-work[GAP * SPAN + i], 0.0)
        force = penalty * work[AREA * SPAN + i] * depth
        pending = plus(force, vector_at(work, NORMAL_X, i), vector_at(work, PENDING, i))
        put_vector(work, PENDING, i, pending)


@span_part
def find_tool_velocities(
    turn_axis, tools, tool, tool_velocity, speed, position, begin, count, work
):
    """Write the velocities of a tool at the nodes, and those for 1 rad/s, where a tool turns."""
    if turn_axis is not None:
        load_rows(position, begin, count, ARM, work)
        for i in range(SPAN):
            x, y, z = vector_at(work, ARM, i)
            arm = arm_at(tools, tool, x, y, z)
            put_vector(work, ARM, i, arm)
            put_vector(work, TOOL_VELOCITY, i, plus(speed, arm, tool_velocity))


@equation
def velocity_of_tool(turn_axis, tool_velocity, work, i):
    """Return the velocity of a tool at a node [m/s]: everywhere the same where no tool turns."""
    if turn_axis is not None:
        return vector_at(work, TOOL_VELOCITY, i)
    return tool_velocity


@span_part
def add_moment(turn_axis, work, sums, column):
    """Sum up the moment of the forces on a tool about its axis, where a tool turns."""
    if turn_axis is not None:
        moment = 0.0
        for i in range(SPAN):
            moment += dot(vector_at(work, ADDED, i), vector_at(work, ARM, i))
        sums[column] -= moment


@span_part
def share_damping(turn_axis, tool_velocity, dt_last, dt, work):
    """Set aside what damping takes off the springs, and leave of its energy the part of the tool.

    The mean velocity of a node is known when all tools have added their forces.
    """
    interval = 0.5 * (dt_last + dt)
    for i in range(SPAN):
        normal, taken = vector_at(work, NORMAL_X, i), work[TAKEN * SPAN + i]
        put_vector(work, ALL_TAKEN, i, plus(taken, normal, vector_at(work, ALL_TAKEN, i)))
        moving = velocity_of_tool(turn_axis, tool_velocity, work, i)
        work[DAMPED * SPAN + i] = -interval * taken * dot(moving, normal)


@span_part
def add_shared_damping(free, dt_last, dt, work, sums):
    """Sum up what the damping of all tools takes from the motion of the nodes."""
    interval, total = 0.5 * (dt_last + dt), 0.0
    for i in range(SPAN):
        change = scaled(work[INVERSE_MASS * SPAN + i], vector_at(work, FORCE, i))
        change = (change[0], change[1], change[2] - work[WEIGHT * SPAN + i])
        if free is not None:
            change = products(change, vector_at(work, FREE, i))
        mean = plus(0.5 * interval, change, vector_at(work, VELOCITY, i))
        total += interval * dot(vector_at(work, ALL_TAKEN, i), mean)
    sums[CONTACT_DAMPING] += total


@span_part
def find_gaps(offset, begin, count, overlap, deepest, work):
    """Turn distances into gaps [m]; return how many nodes touch, and how many lie the deepest."""
    touching, deeper = 0, 0
    load_row(offset, begin, count, OFFSET, work)
    for i in range(SPAN):
        gap = work[GAP * SPAN + i] - (work[OFFSET * SPAN + i] - overlap)
        gap = gap if i < count else math.inf
        work[GAP * SPAN + i] = gap
        touching += 1 if gap < 0.0 else 0
        deeper += 1 if gap < deepest else 0
    return touching, deeper


@span_part
def hold_depths(offset, area, environment, share, begin, count, work, sums):
    """Move the offsets of the depths on, and gaps by them; return how many nodes touch.

    See :mod:`lcmchain.effects.contact_depth`. The loop over the springs that follows adds
    ½ k (depth + h)² to the energy; here ½ k h² is taken off it.
    """
    touching, stored, added = 0, 0.0, 0.0
    load_row(offset, begin, count, HELD, work)
    load_row(area, begin, count, AREA, work)
    for i in range(SPAN):
        depth, held = -work[GAP * SPAN + i], work[HELD * SPAN + i]
        stiffness = environment.penalty * work[AREA * SPAN + i] if i < count else 0.0
        touches = depth + held > 0.0
        change = offset_change(depth, held, share, environment.depth_stiffening)
        after = held + change if touches else 0.0
        booked = change * depth if touches else 0.5 * held * held
        work[HELD * SPAN + i] = after
        work[GAP * SPAN + i] -= after
        touching += 1 if work[GAP * SPAN + i] < 0.0 else 0
        added += stiffness * booked if i < count else 0.0
        stored += 0.5 * stiffness * after * after
    store_row(work, HELD, offset, begin, count)
    sums[CONTACT] -= stored
    sums[EXTERNAL] += added
    return touching


@span_part
def is_displaced(stick, begin, count):
    """Tell whether a friction spring of the span holds any slip."""
    displaced = 0
    for i in range(begin, begin + count):
        displaced += 1 if (stick[0, i] != 0.0) | (stick[1, i] != 0.0) | (stick[2, i] != 0.0) else 0
    return displaced > 0


@span_part
def load_span(arrays, free, gravity, begin, count, work):
    """Copy what the nodes have into their rows."""
    load_rows(arrays.velocity, begin, count, VELOCITY, work)
    load_rows(arrays.force, begin, count, FORCE, work)
    if free is not None:
        load_rows(free, begin, count, FREE, work)
    load_row(arrays.inverse_mass, begin, count, INVERSE_MASS, work)
    load_row(arrays.area, begin, count, AREA, work)
    load_row(arrays.impedance, begin, count, IMPEDANCE, work)
    load_row(arrays.contact_force, begin, count, NORMAL_FORCE, work)
    for i in range(SPAN):
        work[WEIGHT * SPAN + i] = weight_at(gravity, begin + min(i, count - 1))


@span_part
def make_forces(environment, free, turn_axis, tool_velocity, coefficient, count, dt_last, dt, work):
    """Add pressure and friction to the forces on the nodes, and move the friction springs on.

    Without friction ``coefficient`` is None. The spring of a node that lifts off is lost, and its
    energy with it.
    """
    penalty = environment.penalty
    damping = environment.contact_damping_ratio * 2.0 * math.sqrt(penalty)
    tangential = environment.tangential_ratio * penalty
    for i in range(SPAN):
        gap = work[GAP * SPAN + i]
        touches = gap < 0.0
        normal = vector_at(work, NORMAL_X, i)
        before = vector_at(work, FORCE, i)
        others = plus(1.0, vector_at(work, PENDING, i), before)
        moving = velocity_of_tool(turn_axis, tool_velocity, work, i)
        velocity = plus(-1.0, moving, vector_at(work, VELOCITY, i))
        leaving = dot(velocity, normal)
        movable = normal
        if free is not None:
            movable = products(normal, vector_at(work, FREE, i))
        inverse_mass, area = work[INVERSE_MASS * SPAN + i], work[AREA * SPAN + i]
        stiffness = penalty * area
        pressure, taken, damped = normal_force(
            stiffness,
            damping * work[IMPEDANCE * SPAN + i],
            gap,
            leaving,
            dot(movable, normal) * inverse_mass,
            dot(movable, others) * inverse_mass - movable[2] * work[WEIGHT * SPAN + i],
            dt_last,
            dt,
        )
        pressure = pressure if touches else 0.0
        force = scaled(pressure, normal)
        stored = 0.5 * stiffness * gap * gap if touches else 0.0
        if coefficient is not None:
            stiffness = tangential * area
            before_slip = vector_at(work, STICK, i)
            way = scaled(dt_last, velocity)
            slip = scaled(dt_last, plus(-leaving, normal, velocity))
            limit = coefficient * pressure
            stick, drag = friction(before_slip, slip, normal, stiffness, limit)
            stick = vector_where(touches, stick)
            put_vector(work, STICK, i, stick)
            force = plus(1.0, vector_where(touches, drag), force)
            stored += 0.5 * stiffness * dot(stick, stick)
            lost = friction_loss(before_slip, stick, way, stiffness)
            work[LOST * SPAN + i] = lost if i < count else 0.0
        else:
            work[LOST * SPAN + i] = 0.0
        put_vector(work, FORCE, i, plus(1.0, before, force))
        put_vector(work, ADDED, i, force)
        work[NORMAL_FORCE * SPAN + i] += pressure
        work[STORED * SPAN + i] = stored
        work[TAKEN * SPAN + i] = taken if touches else 0.0
        work[DAMPED * SPAN + i] = damped if touches else 0.0


@equation
def vector_where(condition, a):
    """Return a vector where the condition holds, else zero."""
    x = a[0] if condition else 0.0
    y = a[1] if condition else 0.0
    z = a[2] if condition else 0.0
    return x, y, z


@span_part
def add_sums(work, sums, column):
    """Sum up the forces on the nodes for the tool, and the energies."""
    total_x, total_y, total_z, stored, damped, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(SPAN):
        total_x += work[ADDED * SPAN + i]
        total_y += work[(ADDED + 1) * SPAN + i]
        total_z += work[(ADDED + 2) * SPAN + i]
        stored += work[STORED * SPAN + i]
        damped += work[DAMPED * SPAN + i]
        lost += work[LOST * SPAN + i]
    sums[column] -= total_x
    sums[column + 1] -= total_y
    sums[column + 2] -= total_z
    sums[CONTACT] += stored
    sums[CONTACT_DAMPING] += damped
    sums[FRICTION] += lost
