"""Contact forces of the tools on the nodes of a chunk.

Nodes are taken in spans of 16 neighbours (``tools/span_distance.py``), those of which one is near a
tool. Everything about a span happens in loops over its nodes that compile to vectors: the
distances, the pressure forces, friction, and the sums. What the nodes have is copied into rows of
one scratch array before. Nodes of the span that do not touch the tool get a force of zero.
"""

from __future__ import annotations

import math

from lcmchain.effects.contact import normal_force
from lcmchain.effects.friction import friction
from lcmchain.effects.gravity import weight_at, weights_of
from lcmchain.jit import span_part, span_routine
from lcmchain.state import CONTACT, CONTACT_DAMPING, FRICTION, TOOL_COLUMNS, WORK_COLUMNS
from lcmchain.tools.span_distance import (
    DISTANCE_ROWS,
    GAP,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    SPAN,
    load_row,
    span_distances,
)

# Rows of the scratch array of a span, behind those of the distance. What the nodes have:
VELOCITY_X = DISTANCE_ROWS  # relative to the tool [m/s]
VELOCITY_Y = DISTANCE_ROWS + 1
VELOCITY_Z = DISTANCE_ROWS + 2
OTHERS_X = DISTANCE_ROWS + 3  # all other forces [N]
OTHERS_Y = DISTANCE_ROWS + 4
OTHERS_Z = DISTANCE_ROWS + 5
FREE_X = DISTANCE_ROWS + 6
FREE_Y = DISTANCE_ROWS + 7
FREE_Z = DISTANCE_ROWS + 8
INVERSE_MASS = DISTANCE_ROWS + 9
AREA = DISTANCE_ROWS + 10
IMPEDANCE = DISTANCE_ROWS + 11
STICK_X = DISTANCE_ROWS + 12  # elastic slip of the friction springs [m]
STICK_Y = DISTANCE_ROWS + 13
STICK_Z = DISTANCE_ROWS + 14
# What contact adds:
PRESSURE = DISTANCE_ROWS + 15  # normal force [N]
FORCE_X = DISTANCE_ROWS + 16
FORCE_Y = DISTANCE_ROWS + 17
FORCE_Z = DISTANCE_ROWS + 18
STORED = DISTANCE_ROWS + 19  # energy of the springs [J]
DAMPED = DISTANCE_ROWS + 20  # energy that contact damping takes [J]
LOST = DISTANCE_ROWS + 21  # energy that sliding takes [J]
ROWS = DISTANCE_ROWS + 22


@span_routine
def add_contact_forces(arrays, tools, environment, first, last, dt_last, dt, work, sums):
    """Add the contact forces of all tools to the nodes ``first`` to ``last`` of a chunk.

    Energies, the forces on the tools and the deepest penetrations go to ``sums``; ``work`` has
    ROWS * SPAN numbers.
    """
    near = arrays.near_span
    contact_force = arrays.contact_force[first:last]
    for i in range(last - first):
        contact_force[i] = 0.0
    for tool in range(tools.kind.size):
        for span in range(first // SPAN, -(-last // SPAN)):
            if near[tool, span] != 0:
                begin = span * SPAN
                end = min(begin + SPAN, last)
                add_span_forces(
                    arrays, tools, environment, tool, begin, end, dt_last, dt, work, sums
                )


@span_part
def add_span_forces(arrays, tools, environment, tool, begin, end, dt_last, dt, work, sums):
    """Add the contact forces of one tool to the nodes ``begin`` to ``end`` of a span."""
    position = arrays.position
    span_distances(
        tools,
        tool,
        position[0, begin:end],
        position[1, begin:end],
        position[2, begin:end],
        arrays.tool_travel[tool],
        work,
    )
    column = WORK_COLUMNS + TOOL_COLUMNS * tool + 3
    deepest = -arrays.penetration_max[tool]
    touching, deeper = find_gaps(
        arrays.offset[begin:end], tools.initial_overlap[tool], deepest, end - begin, work
    )
    sticks = tools.friction[tool] > 0.0
    if touching == 0 and not (sticks and is_displaced(arrays.stick[tool], begin, end)):
        return
    if deeper > 0:
        for i in range(SPAN):
            sums[column] = min(sums[column], work[GAP * SPAN + i])
    load_span(arrays, arrays.free, tools, tool, begin, end, work)
    normal_forces(environment, arrays.free, begin, end, dt_last, dt, work)
    if sticks:
        friction_forces(
            arrays.stick[tool], tools.friction[tool], environment, begin, end, dt_last, work
        )
    add_to_nodes(arrays.force, arrays.contact_force, tool, begin, end, work, sums)


@span_part
def find_gaps(offset, overlap, deepest, count, work):
    """Turn distances into gaps [m]; return how many nodes touch, and how many lie the deepest."""
    touching, deeper = 0, 0
    load_row(offset, INVERSE_MASS, work)
    for i in range(SPAN):
        gap = work[GAP * SPAN + i] - (work[INVERSE_MASS * SPAN + i] - overlap)
        gap = gap if i < count else math.inf
        work[GAP * SPAN + i] = gap
        touching += 1 if gap < 0.0 else 0
        deeper += 1 if gap < deepest else 0
    return touching, deeper


@span_part
def is_displaced(stick, begin, end):
    """Tell whether a friction spring of the span holds any slip."""
    displaced = 0
    for i in range(begin, end):
        displaced += 1 if (stick[0, i] != 0.0) | (stick[1, i] != 0.0) | (stick[2, i] != 0.0) else 0
    return displaced > 0


@span_part
def load_span(arrays, free, tools, tool, begin, end, work):
    """Copy what the nodes have into their rows, and take their velocities relative to the tool."""
    velocity, force = arrays.velocity, arrays.force
    load_row(velocity[0, begin:end], VELOCITY_X, work)
    load_row(velocity[1, begin:end], VELOCITY_Y, work)
    load_row(velocity[2, begin:end], VELOCITY_Z, work)
    load_row(force[0, begin:end], OTHERS_X, work)
    load_row(force[1, begin:end], OTHERS_Y, work)
    load_row(force[2, begin:end], OTHERS_Z, work)
    if free is not None:
        load_row(free[0, begin:end], FREE_X, work)
        load_row(free[1, begin:end], FREE_Y, work)
        load_row(free[2, begin:end], FREE_Z, work)
    load_row(arrays.inverse_mass[begin:end], INVERSE_MASS, work)
    load_row(arrays.area[begin:end], AREA, work)
    load_row(arrays.impedance[begin:end], IMPEDANCE, work)
    speed, direction = arrays.tool_velocity[tool], tools.direction
    tool_x = speed * direction[tool, 0]
    tool_y = speed * direction[tool, 1]
    tool_z = speed * direction[tool, 2]
    for i in range(SPAN):
        work[VELOCITY_X * SPAN + i] -= tool_x
        work[VELOCITY_Y * SPAN + i] -= tool_y
        work[VELOCITY_Z * SPAN + i] -= tool_z


@span_part
def normal_forces(environment, free, begin, end, dt_last, dt, work):
    """Write the pressure forces, and their energies, from the gaps and normals."""
    penalty, weights = environment.penalty, weights_of(environment.gravity, begin, end)
    damping = environment.contact_damping_ratio * 2.0 * math.sqrt(penalty)
    for i in range(SPAN):
        gap = work[GAP * SPAN + i]
        nx = work[NORMAL_X * SPAN + i]
        ny = work[NORMAL_Y * SPAN + i]
        nz = work[NORMAL_Z * SPAN + i]
        stiffness = penalty * work[AREA * SPAN + i]
        velocity = work[VELOCITY_X * SPAN + i] * nx + work[VELOCITY_Y * SPAN + i] * ny
        velocity += work[VELOCITY_Z * SPAN + i] * nz
        wx, wy, wz = nx, ny, nz  # of the components that are free
        if free is not None:
            wx *= work[FREE_X * SPAN + i]
            wy *= work[FREE_Y * SPAN + i]
            wz *= work[FREE_Z * SPAN + i]
        others = wx * work[OTHERS_X * SPAN + i] + wy * work[OTHERS_Y * SPAN + i]
        others += wz * work[OTHERS_Z * SPAN + i]
        inverse_mass = work[INVERSE_MASS * SPAN + i]
        normal, damped = normal_force(
            stiffness,
            damping * work[IMPEDANCE * SPAN + i],
            gap,
            velocity,
            (wx * nx + wy * ny + wz * nz) * inverse_mass,
            others * inverse_mass - wz * weight_at(weights, i),
            dt_last,
            dt,
        )
        normal = normal if gap < 0.0 else 0.0
        work[PRESSURE * SPAN + i] = normal
        work[FORCE_X * SPAN + i] = normal * nx
        work[FORCE_Y * SPAN + i] = normal * ny
        work[FORCE_Z * SPAN + i] = normal * nz
        work[DAMPED * SPAN + i] = damped if gap < 0.0 else 0.0
        work[STORED * SPAN + i] = 0.5 * stiffness * gap * gap if gap < 0.0 else 0.0
        work[LOST * SPAN + i] = 0.0


@span_part
def friction_forces(stick, coefficient, environment, begin, end, dt_last, work):
    """Add friction to the forces, and move the friction springs on.

    The spring of a node that lifts off is lost, and its energy with it.
    """
    load_row(stick[0, begin:end], STICK_X, work)
    load_row(stick[1, begin:end], STICK_Y, work)
    load_row(stick[2, begin:end], STICK_Z, work)
    tangential = environment.tangential_ratio * environment.penalty
    for i in range(SPAN):
        touches = work[GAP * SPAN + i] < 0.0
        nx = work[NORMAL_X * SPAN + i]
        ny = work[NORMAL_Y * SPAN + i]
        nz = work[NORMAL_Z * SPAN + i]
        stiffness = tangential * work[AREA * SPAN + i]
        ux = work[VELOCITY_X * SPAN + i]
        uy = work[VELOCITY_Y * SPAN + i]
        uz = work[VELOCITY_Z * SPAN + i]
        un = ux * nx + uy * ny + uz * nz
        sx = work[STICK_X * SPAN + i]
        sy = work[STICK_Y * SPAN + i]
        sz = work[STICK_Z * SPAN + i]
        before = 0.5 * stiffness * (sx * sx + sy * sy + sz * sz)
        slip = (dt_last * (ux - un * nx), dt_last * (uy - un * ny), dt_last * (uz - un * nz))
        limit = coefficient * work[PRESSURE * SPAN + i]
        s, f, dissipated = friction((sx, sy, sz), slip, (nx, ny, nz), stiffness, limit)
        after = 0.5 * stiffness * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
        work[STICK_X * SPAN + i] = s[0] if touches else 0.0
        work[STICK_Y * SPAN + i] = s[1] if touches else 0.0
        work[STICK_Z * SPAN + i] = s[2] if touches else 0.0
        work[FORCE_X * SPAN + i] += f[0] if touches else 0.0
        work[FORCE_Y * SPAN + i] += f[1] if touches else 0.0
        work[FORCE_Z * SPAN + i] += f[2] if touches else 0.0
        work[STORED * SPAN + i] += after if touches else 0.0
        lost = dissipated if touches else before
        work[LOST * SPAN + i] = lost if i < end - begin else 0.0
    store_row(work, STICK_X, stick[0, begin:end])
    store_row(work, STICK_Y, stick[1, begin:end])
    store_row(work, STICK_Z, stick[2, begin:end])


@span_part
def store_row(work, row, values):
    """Write a row back to the nodes of the span."""
    if values.size == SPAN:
        for i in range(SPAN):
            values[i] = work[row * SPAN + i]
    else:
        for i in range(values.size):
            values[i] = work[row * SPAN + i]


@span_part
def add_to_nodes(force, contact_force, tool, begin, end, work, sums):
    """Add the forces of the span to those of its nodes, and sum them up for the tool."""
    for i in range(SPAN):
        work[OTHERS_X * SPAN + i] += work[FORCE_X * SPAN + i]
        work[OTHERS_Y * SPAN + i] += work[FORCE_Y * SPAN + i]
        work[OTHERS_Z * SPAN + i] += work[FORCE_Z * SPAN + i]
    store_row(work, OTHERS_X, force[0, begin:end])
    store_row(work, OTHERS_Y, force[1, begin:end])
    store_row(work, OTHERS_Z, force[2, begin:end])
    load_row(contact_force[begin:end], IMPEDANCE, work)
    for i in range(SPAN):
        work[IMPEDANCE * SPAN + i] += work[PRESSURE * SPAN + i]
    store_row(work, IMPEDANCE, contact_force[begin:end])
    total_x, total_y, total_z, stored, damped, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(SPAN):
        total_x += work[FORCE_X * SPAN + i]
        total_y += work[FORCE_Y * SPAN + i]
        total_z += work[FORCE_Z * SPAN + i]
        stored += work[STORED * SPAN + i]
        damped += work[DAMPED * SPAN + i]
        lost += work[LOST * SPAN + i]
    column = WORK_COLUMNS + TOOL_COLUMNS * tool
    sums[column] -= total_x
    sums[column + 1] -= total_y
    sums[column + 2] -= total_z
    sums[CONTACT] += stored
    sums[CONTACT_DAMPING] += damped
    sums[FRICTION] += lost
