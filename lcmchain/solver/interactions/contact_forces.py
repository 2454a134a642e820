"""Contact with tools within a step: which nodes can touch which tool, and the forces on them.

Now and then a search marks the nodes near a tool. In a step, nodes are taken in packs of eight
neighbours (:mod:`lcmchain.packs`): those packs of which one node is near a tool. Where one of them
touches the tool, the forces of all eight are made together; nodes that do not touch it get a force
of zero.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from lcmchain.dispatch import implements
from lcmchain.effects.contact import normal_force
from lcmchain.effects.contact_depth import offset_change
from lcmchain.effects.friction import friction, friction_loss
from lcmchain.effects.gravity import weights_from
from lcmchain.effects.interaction import add_to_nodes, scratch_size
from lcmchain.elements.blocks import PACKS_OF_CHUNK
from lcmchain.elements.vectors import dot, plus, products, scaled
from lcmchain.jit import equation, kernel, span_routine, standalone_span_routine, uncounted_routine
from lcmchain.packs import (
    PACK,
    any_lane,
    choose,
    first_lanes,
    load,
    load_first,
    load_vector,
    pack_of,
    store,
    store_first,
    store_vector,
    sum_of,
)
from lcmchain.state import CONTACT, CONTACT_DAMPING, EXTERNAL, FRICTION, TOOL_COLUMNS, WORK_COLUMNS
from lcmchain.tools.distance import arm_at
from lcmchain.tools.pack_distance import (
    DISTANCE_PACKS,
    keep_distance,
    kept_distance,
    pack_distance,
)
from lcmchain.tools.table import ToolTable


@kernel
def find_near_nodes(arrays, tools, reach):
    """Mark in ``arrays.near`` the nodes nearer to a tool than ``reach`` (tool_count,) [m]."""
    for place in prange(arrays.chunk_order.size):
        chunk = arrays.chunk_order[place]
        first, last = arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]
        work = np.empty(DISTANCE_PACKS * PACK)
        for tool in range(tools.kind.size):
            mark_near_nodes(arrays, tools, tool, reach[tool], first, last, work)


@span_routine
def mark_near_nodes(arrays, tools, tool, reach, first, last, work):
    near, travel = arrays.near[tool], arrays.tool_travel[tool]
    for begin in range(first, last, PACK):
        count = min(PACK, last - begin)
        position = load_vector(arrays.position, begin, count)
        gap, _ = pack_distance(tools, tool, position, travel, work, 0)
        store(work, 0, gap)
        for i in range(count):
            near[begin + i] = 1 if work[i] < reach else 0


@uncounted_routine
def find_near_packs(near, chunk_start, near_pack, tools_near):
    """Mark the packs of nodes of which one is near to a tool, and count these tools.

    Parameters
    ----------
    near : (tool_count, node_count), of the last search. near_pack : (pack_count, tool_count).
    tools_near : (pack_count,). Every chunk of nodes has as many packs, of which the last ones may
        be empty.
    """
    tools_near[:] = 0
    for number in range(tools_near.size):
        chunk = number // PACKS_OF_CHUNK
        first = chunk_start[chunk] + number % PACKS_OF_CHUNK * PACK
        for tool in range(near.shape[0]):
            found = 0
            for node in range(first, min(first + PACK, chunk_start[chunk + 1])):
                found |= near[tool, node]
            near_pack[number, tool] = found
            tools_near[number] += found


# What is kept for every tool, in packs: gap and normal of the present nodes, and a number that is
# 1 where they touch the tool; then what the tool does to the nodes of the chunk, lane by lane.
TOUCHED = DISTANCE_PACKS
ADDED = TOUCHED + 1  # force [N]
STORED = ADDED + 3  # energy of the springs [J]
DAMPED = ADDED + 4  # energy that contact damping takes [J]
LOST = ADDED + 5  # energy that sliding takes [J]
MOMENT = ADDED + 6  # about the axis of a tool that turns [N m]
KEPT_PACKS = ADDED + 7


@implements(scratch_size, ToolTable)
@equation
def scratch_of_contact(tools):
    return KEPT_PACKS * PACK * tools.kind.size


@equation
def kept_place(tool, row):
    """Return where a pack that is kept for a tool begins."""
    return (KEPT_PACKS * tool + row) * PACK


@implements(add_to_nodes, ToolTable)
@equation
def contact_of_chunk(tools, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    add_contact_forces(arrays, tools, environment, chunk, first, last, dt_last, dt, work, sums)


@standalone_span_routine
def add_contact_forces(arrays, tools, environment, chunk, first, last, dt_last, dt, work, sums):
    """Add the contact forces of all tools to the nodes ``first`` to ``last`` of a chunk.

    Energies, the forces on the tools and the deepest penetrations go to ``sums``; ``work`` has
    :func:`scratch_of_contact` numbers.
    """
    touched = 0
    for place in range(PACKS_OF_CHUNK):
        number = chunk * PACKS_OF_CHUNK + place
        if arrays.tools_near[number] > 0:
            begin = first + place * PACK
            count = min(PACK, last - begin)
            touching, tool = find_contacts(
                arrays, tools, environment, environment.depth_time, number, begin, count, dt_last,
                work, sums,
            )  # fmt: skip
            if touching > 0 and touched == 0:
                clear_sums(tools, work)
            touched += touching
            if touching == 1:
                add_force_of_one(
                    arrays, tools, environment, arrays.free, tools.turn_axis, tool, begin, count,
                    dt_last, dt, work,
                )  # fmt: skip
            elif touching > 1:
                add_forces_of_several(
                    arrays, tools, environment, arrays.free, tools.turn_axis, begin, count,
                    dt_last, dt, work, sums,
                )  # fmt: skip
            else:
                store_first(arrays.contact_force, begin, pack_of(0.0), count)
    if touched > 0:
        add_sums(tools, tools.turn_axis, work, sums)


@equation
def clear_sums(tools, work):
    """Set to zero what is summed up over a chunk."""
    for tool in range(tools.kind.size):
        for k in range(kept_place(tool, ADDED), kept_place(tool, KEPT_PACKS)):
            work[k] = 0.0


@equation
def find_contacts(
    arrays, tools, environment, depth_time, number, begin, count, dt_last, work, sums
):
    """Find the tools that a pack of nodes touches; return how many they are, and the last of them.

    Their gaps and normals are kept.
    """
    found, last = 0, 0
    for tool in range(tools.kind.size):
        work[kept_place(tool, TOUCHED)] = 0.0
        if arrays.near_pack[number, tool] != 0:
            at, position = kept_place(tool, 0), load_vector(arrays.position, begin, count)
            distance, normal = pack_distance(
                tools, tool, position, arrays.tool_travel[tool], work, at
            )
            gap = distance - (load_first(arrays.offset, begin, count) - tools.initial_overlap[tool])
            # of fewer nodes than a pack has the others have no mass, area and velocity
            gap = choose(first_lanes(count), gap, math.inf)
            keep_distance(gap, normal, work, at)
            if any_lane(gap < -arrays.penetration_max[tool]):
                deepest = WORK_COLUMNS + TOOL_COLUMNS * tool + 3
                for i in range(at, at + PACK):
                    sums[deepest] = min(sums[deepest], work[i])
            if depth_time is not None:
                gap = hold_depths(
                    arrays.depth_offset[tool], arrays.area, environment, dt_last / depth_time,
                    begin, count, gap, sums,
                )  # fmt: skip
                store(work, at, gap)
            touches = any_lane(gap < 0.0)
            if not touches and tools.friction[tool] > 0.0:
                # a spring that is left from the step before is still to be lost
                stick = load_vector(arrays.stick[tool], begin, count)
                touches = any_lane((stick[0] != 0.0) | (stick[1] != 0.0) | (stick[2] != 0.0))
            work[kept_place(tool, TOUCHED)] = 1.0 if touches else 0.0
            found += 1 if touches else 0
            last = tool if touches else last
    return found, last


@equation
def hold_depths(offset, area, environment, share, begin, count, gap, sums):
    """Move the offsets of the depths on; return the gaps with them.

    See :mod:`lcmchain.effects.contact_depth`. The energy of the springs is made from these gaps,
    ½ k (depth + h)²; here ½ k h² is taken off it.
    """
    depth = -gap
    held = load_first(offset, begin, count)
    stiffness = environment.penalty * load_first(area, begin, count)
    touches = depth + held > 0.0
    change = offset_change(depth, held, share, environment.depth_stiffening)
    after = choose(touches, held + change, 0.0)
    booked = choose(touches, change * depth, 0.5 * held * held)
    store_first(offset, begin, after, count)
    sums[CONTACT] -= sum_of(0.5 * stiffness * after * after)
    sums[EXTERNAL] += sum_of(stiffness * booked)
    return gap - after


class PackOfNodes(NamedTuple):
    """What contact asks of eight nodes, in packs.

    velocity : [m/s]. inverse_mass : [1/kg]. weight : acceleration along -z, a number or a pack
    [m/s²]. stiffness, tangential : of the springs against the normal and along the tool [N/m].
    damping : [N s/m].
    """

    velocity: Any
    inverse_mass: Any
    weight: Any
    stiffness: Any
    tangential: Any
    damping: Any


@equation
def load_nodes(arrays, environment, begin, count):
    penalty = environment.penalty
    damping = environment.contact_damping_ratio * 2.0 * math.sqrt(penalty)
    stiffness = penalty * load_first(arrays.area, begin, count)
    return PackOfNodes(
        load_vector(arrays.velocity, begin, count),
        load_first(arrays.inverse_mass, begin, count),
        weights_from(environment.gravity, begin, count),
        stiffness,
        environment.tangential_ratio * stiffness,
        damping * load_first(arrays.impedance, begin, count),
    )


@equation
def movable_part(free, a, begin, count):
    """Return a vector without the components in which nodes are held; none is without ``free``."""
    if free is not None:
        return products(a, load_vector(free, begin, count))
    return a


@equation
def add_force_of_one(
    arrays, tools, environment, free, turn_axis, tool, begin, count, dt_last, dt, work
):
    """Add the contact forces of the one tool that a pack of nodes touches."""
    nodes = load_nodes(arrays, environment, begin, count)
    force = load_vector(arrays.force, begin, count)
    force, pressure, _, damped = add_force_of_tool(
        arrays, tools, tool, free, turn_axis, nodes, force, force, begin, count, dt_last, dt, work
    )
    add(work, kept_place(tool, DAMPED), damped)
    store_vector(arrays.force, begin, count, force)
    store_first(arrays.contact_force, begin, pressure, count)


@equation
def add_forces_of_several(
    arrays, tools, environment, free, turn_axis, begin, count, dt_last, dt, work, sums
):
    """Add the contact forces of the tools that a pack of nodes touches.

    Where one node touches several tools, what each of them takes for the motion of the node has to
    know of the forces of the others: two tools that hold a sheet from both sides press hard and
    move nothing.
    """
    nodes = load_nodes(arrays, environment, begin, count)
    force, interval = load_vector(arrays.force, begin, count), 0.5 * (dt_last + dt)
    pressed = 0.0 * nodes.stiffness
    # springs of the tools that are still to come, and what damping has taken off those before [N]
    pending = taken_off = (pressed, pressed, pressed)
    for tool in range(tools.kind.size):
        pending = plus_spring(1.0, nodes.stiffness, tool, work, pending)
    for tool in range(tools.kind.size):
        if work[kept_place(tool, TOUCHED)] > 0.0:
            pending = plus_spring(-1.0, nodes.stiffness, tool, work, pending)
            others = plus(1.0, pending, force)
            force, pressure, taken, _ = add_force_of_tool(
                arrays, tools, tool, free, turn_axis, nodes, force, others, begin, count, dt_last,
                dt, work,
            )  # fmt: skip
            pressed += pressure
            taken_off = plus(1.0, taken, taken_off)
            # the motion is known when all have added their forces; this is the part of the tool
            against = velocity_against(arrays, tools, tool, turn_axis, nodes.velocity, begin, count)
            moving = plus(-1.0, against, nodes.velocity)
            add(work, kept_place(tool, DAMPED), -interval * dot(moving, taken))
    change = scaled(nodes.inverse_mass, force)
    change = (change[0], change[1], change[2] - nodes.weight)
    mean = plus(0.5 * interval, movable_part(free, change, begin, count), nodes.velocity)
    sums[CONTACT_DAMPING] += interval * sum_of(dot(taken_off, mean))
    store_vector(arrays.force, begin, count, force)
    store_first(arrays.contact_force, begin, pressed, count)


@equation
def add_force_of_tool(
    arrays, tools, tool, free, turn_axis, nodes, force, others, begin, count, dt_last, dt, work
):
    """Return forces with those of a tool, its pressure, what damping takes [N], and its energy [J].

    others : all forces on the nodes but that of the tool [N].
    """
    gap, normal = kept_distance(work, kept_place(tool, 0))
    velocity = velocity_against(arrays, tools, tool, turn_axis, nodes.velocity, begin, count)
    movable = movable_part(free, normal, begin, count)
    pressure, taken, damped, stored = press(
        nodes, movable, gap, normal, velocity, others, dt_last, dt
    )
    added = scaled(pressure, normal)
    if tools.friction[tool] > 0.0:
        before = load_vector(arrays.stick[tool], begin, count)
        limit = tools.friction[tool] * pressure
        drag, stick, kept, lost = rub(nodes, limit, before, gap, normal, velocity, dt_last)
        store_vector(arrays.stick[tool], begin, count, stick)
        added = plus(1.0, drag, added)
        stored += kept
        add(work, kept_place(tool, LOST), lost)
    add(work, kept_place(tool, ADDED), added[0])
    add(work, kept_place(tool, ADDED + 1), added[1])
    add(work, kept_place(tool, ADDED + 2), added[2])
    add(work, kept_place(tool, STORED), stored)
    add_moment(arrays, tools, tool, turn_axis, added, begin, count, work)
    return plus(1.0, added, force), pressure, scaled(taken, normal), damped


@equation
def press(nodes, movable, gap, normal, velocity, others, dt_last, dt):
    """Return pressure [N], what damping takes off the springs [N], and both energies [J].

    movable : the normal, without components in which nodes are held. velocity : against the tool
    [m/s]. others : all other forces on the nodes [N].
    """
    touches = gap < 0.0
    pressure, taken, damped = normal_force(
        nodes.stiffness,
        nodes.damping,
        gap,
        dot(velocity, normal),
        dot(movable, normal) * nodes.inverse_mass,
        dot(movable, others) * nodes.inverse_mass - movable[2] * nodes.weight,
        dt_last,
        dt,
    )
    return (
        choose(touches, pressure, 0.0),
        choose(touches, taken, 0.0),
        choose(touches, damped, 0.0),
        choose(touches, 0.5 * nodes.stiffness * gap * gap, 0.0),
    )


@equation
def rub(nodes, limit, before, gap, normal, velocity, dt_last):
    """Return the friction force [N], the elastic slip [m], and energies stored and lost [J].

    The spring of a node that lifts off is lost, and its energy with it.
    """
    touches, stiffness = gap < 0.0, nodes.tangential
    along = plus(-dot(velocity, normal), normal, velocity)
    stick, drag = friction(before, scaled(dt_last, along), normal, stiffness, limit)
    stick = vector_where(touches, stick)
    lost = friction_loss(before, stick, scaled(dt_last, velocity), stiffness)
    return (
        vector_where(touches, drag),
        stick,
        0.5 * stiffness * dot(stick, stick),
        lost,
    )


@equation
def plus_spring(factor, stiffness, tool, work, force):
    """Add the springs of a tool that a pack of nodes touches to forces, with a factor."""
    if work[kept_place(tool, TOUCHED)] > 0.0:
        gap, normal = kept_distance(work, kept_place(tool, 0))
        return plus(factor * stiffness * max(-gap, 0.0), normal, force)
    return force


@equation
def velocity_against(arrays, tools, tool, turn_axis, velocity, begin, count):
    """Return the velocity of a pack of nodes against a tool [m/s]."""
    speed = arrays.tool_velocity[tool]
    moving = (
        speed * tools.direction[tool, 0],
        speed * tools.direction[tool, 1],
        speed * tools.direction[tool, 2],
    )
    against = plus(-1.0, moving, velocity)
    if turn_axis is not None:
        against = plus(-speed, arms_of(arrays, tools, tool, begin, count), against)
    return against


@equation
def arms_of(arrays, tools, tool, begin, count):
    """Return the velocities of a tool at a pack of nodes for a turn of 1 rad/s [m]."""
    x, y, z = load_vector(arrays.position, begin, count)
    return arm_at(tools, tool, x, y, z)


@equation
def add_moment(arrays, tools, tool, turn_axis, force, begin, count, work):
    """Sum up the moment about the axis of a tool, where a tool turns."""
    if turn_axis is not None:
        arms = arms_of(arrays, tools, tool, begin, count)
        add(work, kept_place(tool, MOMENT), dot(force, arms))


@equation
def vector_where(condition, a):
    """Return a vector where the condition holds, else zero."""
    return choose(condition, a[0], 0.0), choose(condition, a[1], 0.0), choose(condition, a[2], 0.0)


@equation
def add(work, at, numbers):
    """Add a pack to what is summed up."""
    store(work, at, load(work, at) + numbers)


@equation
def add_sums(tools, turn_axis, work, sums):
    """Hand over what the tools do to the nodes of a chunk."""
    for tool in range(tools.kind.size):
        column = WORK_COLUMNS + TOOL_COLUMNS * tool
        sums[column] -= sum_of(load(work, kept_place(tool, ADDED)))
        sums[column + 1] -= sum_of(load(work, kept_place(tool, ADDED + 1)))
        sums[column + 2] -= sum_of(load(work, kept_place(tool, ADDED + 2)))
        sums[CONTACT] += sum_of(load(work, kept_place(tool, STORED)))
        sums[CONTACT_DAMPING] += sum_of(load(work, kept_place(tool, DAMPED)))
        sums[FRICTION] += sum_of(load(work, kept_place(tool, LOST)))
        if turn_axis is not None:
            moments = WORK_COLUMNS + TOOL_COLUMNS * tools.kind.size
            sums[moments + tool] -= sum_of(load(work, kept_place(tool, MOMENT)))
