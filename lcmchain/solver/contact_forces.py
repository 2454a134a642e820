"""Contact forces of the tools on the nodes of a chunk.

A span is a run of neighbouring groups of nodes of which some are near a tool. Everything about a
span happens in loops over its nodes that compile to vectors: the distances, the pressure forces,
friction, and the sums. Nodes of the span that do not touch the tool get a force of zero.
"""

from __future__ import annotations

import math

from lcmchain.effects.contact import normal_force
from lcmchain.effects.friction import friction
from lcmchain.effects.gravity import weight_at, weights_of
from lcmchain.jit import span_routine
from lcmchain.state import (
    CONTACT,
    CONTACT_DAMPING,
    CONTACT_GROUP,
    FRICTION,
    TOOL_COLUMNS,
    WORK_COLUMNS,
)
from lcmchain.tools.span_distance import (
    DISTANCE_ROWS,
    GAP,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    SPAN,
    span_distances,
)

# Rows of the scratch array of a span, behind those of the distance.
PRESSURE = DISTANCE_ROWS  # normal force [N]
FORCE_X = DISTANCE_ROWS + 1
FORCE_Y = DISTANCE_ROWS + 2
FORCE_Z = DISTANCE_ROWS + 3
STORED = DISTANCE_ROWS + 4  # energy of the springs [J]
DAMPED = DISTANCE_ROWS + 5  # energy that contact damping takes [J]
ROWS = DISTANCE_ROWS + 6


@span_routine
def add_contact_forces(arrays, tools, environment, first, last, dt_last, dt, work, sums):
    """Add the contact forces of all tools to the nodes ``first`` to ``last`` of a chunk.

    Energies, the forces on the tools and the deepest penetrations go to ``sums``; ``work`` has
    ROWS * SPAN numbers.
    """
    near = arrays.near_group
    last_group = -(-last // CONTACT_GROUP)
    contact_force = arrays.contact_force[first:last]
    for i in range(last - first):
        contact_force[i] = 0.0
    for tool in range(tools.kind.size):
        group = first // CONTACT_GROUP
        while group < last_group:
            if near[tool, group] == 0:
                group += 1
                continue
            begin = group * CONTACT_GROUP
            while group < last_group and near[tool, group] != 0:
                group += 1
            end = min(group * CONTACT_GROUP, last)
            add_span_forces(arrays, tools, environment, tool, begin, end, dt_last, dt, work, sums)


@span_routine
def add_span_forces(arrays, tools, environment, tool, begin, end, dt_last, dt, work, sums):
    """Add the contact forces of one tool to the nodes ``begin`` to ``end``."""
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
    offset = arrays.offset[begin:end]
    overlap = tools.initial_overlap[tool]
    sticks = tools.friction[tool] > 0.0
    deepest = -arrays.penetration_max[tool]
    touching, deeper = 0, 0
    for i in range(end - begin):
        gap = work[GAP * SPAN + i] - (offset[i] - overlap)
        work[GAP * SPAN + i] = gap
        touching += 1 if gap < 0.0 else 0
        deeper += 1 if gap < deepest else 0
    stick = arrays.stick[tool]
    if touching == 0 and not (sticks and is_displaced(stick, begin, end)):
        return
    if deeper > 0:
        keep_smallest_gap(tool, end - begin, work, sums)
    normal_forces(arrays, tools, environment, tool, begin, end, dt_last, dt, work)
    if sticks:
        friction_forces(arrays, tools, environment, tool, begin, end, dt_last, work, sums)
    add_to_nodes(arrays.force, arrays.contact_force, tool, begin, end, work, sums)


@span_routine
def is_displaced(stick, begin, end):
    """Tell whether a friction spring of the span holds any slip."""
    x, y, z = stick[0, begin:end], stick[1, begin:end], stick[2, begin:end]
    displaced = 0
    for i in range(x.size):
        displaced += 1 if (x[i] != 0.0) | (y[i] != 0.0) | (z[i] != 0.0) else 0
    return displaced > 0


@span_routine
def keep_smallest_gap(tool, count, work, sums):
    column = WORK_COLUMNS + TOOL_COLUMNS * tool + 3
    for i in range(count):
        sums[column] = min(sums[column], work[GAP * SPAN + i])


@span_routine
def normal_forces(arrays, tools, environment, tool, begin, end, dt_last, dt, work):
    """Write the pressure forces, and their energies, from the gaps and normals."""
    velocity, force, free = arrays.velocity, arrays.force, arrays.free
    velocity_x, velocity_y = velocity[0, begin:end], velocity[1, begin:end]
    velocity_z = velocity[2, begin:end]
    force_x, force_y, force_z = force[0, begin:end], force[1, begin:end], force[2, begin:end]
    free_x, free_y, free_z = free[0, begin:end], free[1, begin:end], free[2, begin:end]
    inverse_mass, area = arrays.inverse_mass[begin:end], arrays.area[begin:end]
    impedance = arrays.impedance[begin:end]
    speed, direction = arrays.tool_velocity[tool], tools.direction
    tool_x = speed * direction[tool, 0]
    tool_y = speed * direction[tool, 1]
    tool_z = speed * direction[tool, 2]
    penalty, weights = environment.penalty, weights_of(environment.gravity, begin, end)
    critical = 2.0 * math.sqrt(penalty)
    damping = environment.contact_damping_ratio * critical
    for i in range(end - begin):
        gap = work[GAP * SPAN + i]
        nx = work[NORMAL_X * SPAN + i]
        ny = work[NORMAL_Y * SPAN + i]
        nz = work[NORMAL_Z * SPAN + i]
        stiffness = penalty * area[i]
        vx = velocity_x[i] - tool_x
        vy = velocity_y[i] - tool_y
        vz = velocity_z[i] - tool_z
        wx, wy, wz = free_x[i] * nx, free_y[i] * ny, free_z[i] * nz
        others = wx * force_x[i] + wy * force_y[i] + wz * force_z[i]
        normal, damped = normal_force(
            stiffness,
            damping * impedance[i],
            gap,
            vx * nx + vy * ny + vz * nz,
            (wx * nx + wy * ny + wz * nz) * inverse_mass[i],
            others * inverse_mass[i] - wz * weight_at(weights, i),
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


@span_routine
def friction_forces(arrays, tools, environment, tool, begin, end, dt_last, work, sums):
    """Add friction to the forces, and move the friction springs on.

    The spring of a node that lifts off is lost, and its energy with it.
    """
    velocity, stick = arrays.velocity, arrays.stick
    velocity_x, velocity_y = velocity[0, begin:end], velocity[1, begin:end]
    velocity_z = velocity[2, begin:end]
    stick_x, stick_y = stick[tool, 0, begin:end], stick[tool, 1, begin:end]
    stick_z = stick[tool, 2, begin:end]
    area = arrays.area[begin:end]
    speed, direction = arrays.tool_velocity[tool], tools.direction
    tool_x = speed * direction[tool, 0]
    tool_y = speed * direction[tool, 1]
    tool_z = speed * direction[tool, 2]
    coefficient = tools.friction[tool]
    tangential = environment.tangential_ratio * environment.penalty
    lost = 0.0
    for i in range(end - begin):
        touches = work[GAP * SPAN + i] < 0.0
        nx = work[NORMAL_X * SPAN + i]
        ny = work[NORMAL_Y * SPAN + i]
        nz = work[NORMAL_Z * SPAN + i]
        stiffness = tangential * area[i]
        ux = velocity_x[i] - tool_x
        uy = velocity_y[i] - tool_y
        uz = velocity_z[i] - tool_z
        un = ux * nx + uy * ny + uz * nz
        sx, sy, sz = stick_x[i], stick_y[i], stick_z[i]
        before = 0.5 * stiffness * (sx * sx + sy * sy + sz * sz)
        slip = (dt_last * (ux - un * nx), dt_last * (uy - un * ny), dt_last * (uz - un * nz))
        limit = coefficient * work[PRESSURE * SPAN + i]
        s, f, dissipated = friction((sx, sy, sz), slip, (nx, ny, nz), stiffness, limit)
        after = 0.5 * stiffness * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
        stick_x[i] = s[0] if touches else 0.0
        stick_y[i] = s[1] if touches else 0.0
        stick_z[i] = s[2] if touches else 0.0
        work[FORCE_X * SPAN + i] += f[0] if touches else 0.0
        work[FORCE_Y * SPAN + i] += f[1] if touches else 0.0
        work[FORCE_Z * SPAN + i] += f[2] if touches else 0.0
        work[STORED * SPAN + i] += after if touches else 0.0
        lost += dissipated if touches else before
    sums[FRICTION] += lost


@span_routine
def add_to_nodes(force, contact_force, tool, begin, end, work, sums):
    """Add the forces of the span to those of its nodes, and sum them up for the tool."""
    force_x, force_y, force_z = force[0, begin:end], force[1, begin:end], force[2, begin:end]
    pressure = contact_force[begin:end]
    total_x, total_y, total_z, stored, damped = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(end - begin):
        fx = work[FORCE_X * SPAN + i]
        fy = work[FORCE_Y * SPAN + i]
        fz = work[FORCE_Z * SPAN + i]
        force_x[i] += fx
        force_y[i] += fy
        force_z[i] += fz
        pressure[i] += work[PRESSURE * SPAN + i]
        total_x += fx
        total_y += fy
        total_z += fz
        stored += work[STORED * SPAN + i]
        damped += work[DAMPED * SPAN + i]
    column = WORK_COLUMNS + TOOL_COLUMNS * tool
    sums[column] -= total_x
    sums[column + 1] -= total_y
    sums[column + 2] -= total_z
    sums[CONTACT] += stored
    sums[CONTACT_DAMPING] += damped
