"""Signed distances from a pack of nodes to a rigid tool.

The same distances as :func:`lcmchain.tools.distance.signed_distance`, which says what they mean,
for eight nodes at once (:mod:`lcmchain.packs`), piece by piece of the profile.
"""

from __future__ import annotations

import math

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.jit import equation
from lcmchain.packs import PACK, all_lanes, choose, load, load_three, store, store_three
from lcmchain.tools.distance import (
    FIELD,
    ON_AXIS,
    PLANE,
    REVOLVED,
    distance_in_field,
    local_axis_at,
    origin_at,
)
from lcmchain.tools.profiles import ARC, BEGIN, DEPTH, END, HEIGHT, NORMAL

#: Packs of scratch for a distance: a gap and a normal.
DISTANCE_PACKS = 4


@equation
def keep_distance(gap, normal, work, at):
    """Write a gap and a normal to scratch."""
    store(work, at, gap)
    store_three(work, PACK, at + PACK, normal)


@equation
def kept_distance(work, at):
    """Return what :func:`keep_distance` has written."""
    return load(work, at), load_three(work, PACK, at + PACK)


@equation
def pack_distance(table, tool, position, travel, work, at):
    """Return the gap [m] and the unit normal of a tool at the places of a pack of nodes [m].

    Parameters
    ----------
    table, tool, travel : see :func:`lcmchain.tools.distance.signed_distance`.
    position : three packs. work : scratch, of which DISTANCE_PACKS from ``at`` on are used.
    """
    x0, y0, z0 = origin_at(table.turn_axis, table, tool, travel)
    local = (position[0] - x0, position[1] - y0, position[2] - z0)
    if table.aligned[tool] == 0:
        local = (
            dot(local_axis_at(table.turn_axis, table, tool, travel, 0), local),
            dot(local_axis_at(table.turn_axis, table, tool, travel, 1), local),
            dot(local_axis_at(table.turn_axis, table, tool, travel, 2), local),
        )
    kind = table.kind[tool]
    zero = 0.0 * local[2]
    if kind == PLANE:
        gap, normal = local[2], (zero, zero, zero + 1.0)
    elif kind == FIELD:
        gap, normal = field_distances(table, tool, local, work, at)
    elif faces_level_part(table.level_part[tool], kind == REVOLVED, local):
        up = table.level_part[tool, NORMAL]
        gap = up * (local[2] - table.level_part[tool, HEIGHT])
        normal = (zero, zero, zero + up)
    else:
        gap, normal = profile_distances(table, tool, kind == REVOLVED, local)
    if table.aligned[tool] == 0:
        x = local_axis_at(table.turn_axis, table, tool, travel, 0)
        y = local_axis_at(table.turn_axis, table, tool, travel, 1)
        z = local_axis_at(table.turn_axis, table, tool, travel, 2)
        normal = plus(normal[0], x, plus(normal[1], y, scaled(normal[2], z)))
    return gap, normal


@equation
def field_distances(table, tool, local, work, at):
    """Return what the distance field of a surface mesh says, node by node."""
    keep_distance(local[0], local, work, at)
    for i in range(at, at + PACK):
        x, y, z = work[i + PACK], work[i + 2 * PACK], work[i + 3 * PACK]
        gap, nx, ny, nz = distance_in_field(table, tool, x, y, z)
        work[i] = gap
        work[i + PACK] = nx
        work[i + 2 * PACK] = ny
        work[i + 3 * PACK] = nz
    return kept_distance(work, at)


@equation
def faces_level_part(part, revolved, local):
    """Tell whether all nodes are nearer to the level part of a profile than to any other part.

    That is all there is to plates away from their edges: neither root nor division.
    """
    begin, end, height, depth = part[BEGIN], part[END], part[HEIGHT], part[DEPTH]
    if begin >= end:
        return False
    x, y, z = local
    away = abs(z - height)
    low, high = begin + away, end - away
    if revolved:
        squared = x * x + y * y
        inside = ((low < 0.0) | (squared > low * low)) & (high > 0.0) & (squared < high * high)
    else:
        inside = (x > low) & (x < high)
    return all_lanes(inside & (away < depth))


@equation
def profile_distances(table, tool, revolved, local):
    """Return the distances to a profile, piece by piece; normals in its plane, then in space."""
    x, y, z = local
    zero = 0.0 * z
    across = x
    if revolved:
        across = math.sqrt(x * x + y * y)
    # the closest piece so far: how far it is, gap, normal in the plane, and the length of that
    best = (zero + math.inf, zero + math.inf, zero, zero + 1.0, zero + 1.0)
    for s in range(table.segment_start[tool], table.segment_start[tool + 1]):
        if table.segments[s, 0] == ARC:
            best = closer_arc(table.segments[s], across, z, best)
        else:
            best = closer_line(table.segments[s], across, z, best)
    for c in range(table.corner_start[tool], table.corner_start[tool + 1]):
        best = closer_corner(table.corners[c], across, z, best)
    _, gap, nx, nz, length = best
    # one division for the unit normals of arcs and corners and for the direction from the axis
    radial_x, radial_y, radius = zero + 1.0, zero, zero + 1.0
    if revolved:
        apart = across > ON_AXIS
        radial_x = choose(apart, x, 1.0)
        radial_y = choose(apart, y, 0.0)
        radius = choose(apart, across, 1.0)
    scale = 1.0 / (length * radius)
    in_plane = scale * nx
    nz = nz * choose(length != 1.0, scale * radius, 1.0)
    return gap, (in_plane * radial_x, in_plane * radial_y, nz)


@equation
def closer(taken, candidate, best):
    """Return a candidate where it is taken, else the best so far."""
    return (
        choose(taken, candidate[0], best[0]),
        choose(taken, candidate[1], best[1]),
        choose(taken, candidate[2], best[2]),
        choose(taken, candidate[3], best[3]),
        choose(taken, candidate[4], best[4]),
    )


@equation
def closer_line(line, across, z, best):
    """Take a line where the foot lies within it and nothing is closer so far."""
    dx, dz = across - line[1], z - line[2]
    along = dx * line[3] + dz * line[4]
    d = dx * line[7] + dz * line[8]
    taken = (abs(d) < best[0]) & (along >= line[5]) & (along <= line[6])
    return closer(taken, (abs(d), d, line[7], line[8], 1.0), best)


@equation
def closer_arc(arc, across, z, best):
    """Take an arc where it faces the node and nothing is closer so far."""
    middle_x, middle_z, cosine, radius, side = arc[3], arc[4], arc[5], arc[6], arc[7]
    dx, dz = across - arc[1], z - arc[2]
    rho = math.sqrt(dx * dx + dz * dz)
    along = dx * middle_x + dz * middle_z
    d = side * (rho - radius)
    apart = rho > ON_AXIS
    nx = side * choose(apart, dx, middle_x)
    nz = side * choose(apart, dz, middle_z)
    taken = (abs(d) < best[0]) & (along >= rho * cosine)
    return closer(taken, (abs(d), d, nx, nz, choose(apart, rho, 1.0)), best)


@equation
def closer_corner(corner, across, z, best):
    """Take a corner where nothing is closer so far; its sign by the bisector."""
    bisector_x, bisector_z = corner[2], corner[3]
    dx, dz = across - corner[0], z - corner[1]
    length = math.sqrt(dx * dx + dz * dz)
    side = choose(dx * bisector_x + dz * bisector_z >= 0.0, 0.0 * dx + 1.0, -1.0)
    apart = length > ON_AXIS
    nx = choose(apart, side * dx, bisector_x)
    nz = choose(apart, side * dz, bisector_z)
    taken = length < best[0]
    return closer(taken, (length, side * length, nx, nz, choose(apart, length, 1.0)), best)
