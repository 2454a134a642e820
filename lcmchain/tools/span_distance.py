"""Signed distances from a span of nodes to a rigid tool, in loops that compile to vectors.

The same distances as :func:`lcmchain.tools.distance.signed_distance`, which says what they mean.
Here the loop over the nodes of a span (``span_rows.py``) is the innermost one, inside that over the
pieces of the profile.
"""

from __future__ import annotations

import math

from lcmchain.jit import span_part
from lcmchain.tools.distance import FIELD, ON_AXIS, PLANE, REVOLVED, field_distance
from lcmchain.tools.level_part import BEGIN, DEPTH, END, HEIGHT, NORMAL
from lcmchain.tools.profiles import ARC
from lcmchain.tools.span_rows import SPAN, load_rows
from lcmchain.tools.turn import local_axis_at, origin_at

# Rows of ``work``, each of one value per point. What the caller gets:
GAP = 0
NORMAL_X = 1
NORMAL_Y = 2
NORMAL_Z = 3
# In between: the point in the frame of the tool and in the plane of its profile, the distance to
# the closest piece so far, and the length of the normal as long as it is not one.
LOCAL_X = 4
LOCAL_Y = 5
LOCAL_Z = 6
ACROSS = 7
CLOSEST = 8
LENGTH = 9
DISTANCE_ROWS = 10


@span_part
def span_distances(table, tool, position, first, count, travel, work):
    """Write the gaps [m] and unit normals of points to the first rows of ``work``.

    Parameters
    ----------
    table, tool, travel : see :func:`lcmchain.tools.distance.signed_distance`.
    position : (3, node_count) [m], of which the nodes from ``first`` on are taken: ``count`` of
        them, SPAN or, of the last span, fewer. What is written for the missing ones means nothing.
    work : (DISTANCE_ROWS * SPAN,) or longer.
    """
    load_rows(position, first, count, LOCAL_X, work)
    to_tool_frame(table, tool, travel, work)
    kind = table.kind[tool]
    if kind == PLANE:
        for i in range(SPAN):
            work[GAP * SPAN + i] = work[LOCAL_Z * SPAN + i]
            work[NORMAL_X * SPAN + i] = 0.0
            work[NORMAL_Y * SPAN + i] = 0.0
            work[NORMAL_Z * SPAN + i] = 1.0
    elif kind == FIELD:
        field_distances(table, tool, work)
    elif faces_level_part(table.level_part[tool], kind == REVOLVED, work):
        for i in range(SPAN):
            up = table.level_part[tool, NORMAL]
            work[GAP * SPAN + i] = up * (work[LOCAL_Z * SPAN + i] - table.level_part[tool, HEIGHT])
            work[NORMAL_X * SPAN + i] = 0.0
            work[NORMAL_Y * SPAN + i] = 0.0
            work[NORMAL_Z * SPAN + i] = up
    else:
        profile_distances(table, tool, kind == REVOLVED, work)
    if table.aligned[tool] == 0:
        normals_from_tool_frame(table, tool, travel, work)


@span_part
def to_tool_frame(table, tool, travel, work):
    """Take the nodes to the frame of the tool."""
    x0, y0, z0 = origin_at(table.turn_axis, table, tool, travel)
    if table.aligned[tool] != 0:
        for i in range(SPAN):
            work[LOCAL_X * SPAN + i] -= x0
            work[LOCAL_Y * SPAN + i] -= y0
            work[LOCAL_Z * SPAN + i] -= z0
        return
    xx, xy, xz = local_axis_at(table.turn_axis, table, tool, travel, 0)
    yx, yy, yz = local_axis_at(table.turn_axis, table, tool, travel, 1)
    zx, zy, zz = local_axis_at(table.turn_axis, table, tool, travel, 2)
    for i in range(SPAN):
        dx = work[LOCAL_X * SPAN + i] - x0
        dy = work[LOCAL_Y * SPAN + i] - y0
        dz = work[LOCAL_Z * SPAN + i] - z0
        work[LOCAL_X * SPAN + i] = xx * dx + xy * dy + xz * dz
        work[LOCAL_Y * SPAN + i] = yx * dx + yy * dy + yz * dz
        work[LOCAL_Z * SPAN + i] = zx * dx + zy * dy + zz * dz


@span_part
def normals_from_tool_frame(table, tool, travel, work):
    xx, xy, xz = local_axis_at(table.turn_axis, table, tool, travel, 0)
    yx, yy, yz = local_axis_at(table.turn_axis, table, tool, travel, 1)
    zx, zy, zz = local_axis_at(table.turn_axis, table, tool, travel, 2)
    for i in range(SPAN):
        nx = work[NORMAL_X * SPAN + i]
        ny = work[NORMAL_Y * SPAN + i]
        nz = work[NORMAL_Z * SPAN + i]
        work[NORMAL_X * SPAN + i] = xx * nx + yx * ny + zx * nz
        work[NORMAL_Y * SPAN + i] = xy * nx + yy * ny + zy * nz
        work[NORMAL_Z * SPAN + i] = xz * nx + yz * ny + zz * nz


@span_part
def field_distances(table, tool, work):
    """Write what the distance field of a surface mesh says, point by point."""
    for i in range(SPAN):
        gap, nx, ny, nz = field_distance(
            table.spacing[tool],
            table.grid_origin,
            table.grid_shape,
            table.box,
            table.grid_start[tool],
            table.coefficients,
            table.far_bound,
            tool,
            work[LOCAL_X * SPAN + i],
            work[LOCAL_Y * SPAN + i],
            work[LOCAL_Z * SPAN + i],
        )
        work[GAP * SPAN + i] = gap
        work[NORMAL_X * SPAN + i] = nx
        work[NORMAL_Y * SPAN + i] = ny
        work[NORMAL_Z * SPAN + i] = nz


@span_part
def faces_level_part(part, revolved, work):
    """Tell whether all nodes are nearer to the level part of a profile than to any other part.

    That is all there is to plates away from their edges: neither root nor division.
    """
    begin, end, height, depth = part[BEGIN], part[END], part[HEIGHT], part[DEPTH]
    if begin >= end:
        return False
    facing = 0
    for i in range(SPAN):
        x, y = work[LOCAL_X * SPAN + i], work[LOCAL_Y * SPAN + i]
        away = abs(work[LOCAL_Z * SPAN + i] - height)
        low, high = begin + away, end - away
        if revolved:
            squared = x * x + y * y
            inside = ((low < 0.0) | (squared > low * low)) & (high > 0.0) & (squared < high * high)
        else:
            inside = (x > low) & (x < high)
        facing += 1 if inside & (away < depth) else 0
    return facing == SPAN


@span_part
def profile_distances(table, tool, revolved, work):
    """Write the distances to a profile, piece by piece; normals in its plane, then in space."""
    for i in range(SPAN):
        x, y = work[LOCAL_X * SPAN + i], work[LOCAL_Y * SPAN + i]
        work[ACROSS * SPAN + i] = math.sqrt(x * x + y * y) if revolved else x
        work[CLOSEST * SPAN + i] = math.inf
        work[GAP * SPAN + i] = math.inf
        work[LENGTH * SPAN + i] = 1.0
        work[NORMAL_X * SPAN + i] = 0.0
        work[NORMAL_Y * SPAN + i] = 0.0
        work[NORMAL_Z * SPAN + i] = 1.0
    for s in range(table.segment_start[tool], table.segment_start[tool + 1]):
        if table.segments[s, 0] == ARC:
            distances_to_arc(table.segments[s], work)
        else:
            distances_to_line(table.segments[s], work)
    for c in range(table.corner_start[tool], table.corner_start[tool + 1]):
        distances_to_corner(table.corners[c], work)
    # one division for the unit normals of arcs and corners and for the direction from the axis
    for i in range(SPAN):
        across, length = work[ACROSS * SPAN + i], work[LENGTH * SPAN + i]
        radius = across if revolved & (across > ON_AXIS) else 1.0
        x = work[LOCAL_X * SPAN + i] if revolved & (across > ON_AXIS) else 1.0
        y = work[LOCAL_Y * SPAN + i] if revolved & (across > ON_AXIS) else 0.0
        scale = 1.0 / (length * radius)
        in_plane = scale * work[NORMAL_X * SPAN + i]
        work[NORMAL_X * SPAN + i] = in_plane * x
        work[NORMAL_Y * SPAN + i] = in_plane * y
        work[NORMAL_Z * SPAN + i] *= scale * radius if length != 1.0 else 1.0


@span_part
def distances_to_line(line, work):
    """Take the distance to a line where its foot lies within it and nothing is closer so far."""
    x0, z0, tx, tz = line[1], line[2], line[3], line[4]
    begin, end, nx, nz = line[5], line[6], line[7], line[8]
    for i in range(SPAN):
        dx = work[ACROSS * SPAN + i] - x0
        dz = work[LOCAL_Z * SPAN + i] - z0
        along = dx * tx + dz * tz
        d = dx * nx + dz * nz
        closest = work[CLOSEST * SPAN + i]
        taken = (abs(d) < closest) & (along >= begin) & (along <= end)
        work[CLOSEST * SPAN + i] = abs(d) if taken else closest
        work[GAP * SPAN + i] = d if taken else work[GAP * SPAN + i]
        work[NORMAL_X * SPAN + i] = nx if taken else work[NORMAL_X * SPAN + i]
        work[NORMAL_Z * SPAN + i] = nz if taken else work[NORMAL_Z * SPAN + i]
        work[LENGTH * SPAN + i] = 1.0 if taken else work[LENGTH * SPAN + i]


@span_part
def distances_to_arc(arc, work):
    """Take the distance to an arc where it faces the point and nothing is closer so far."""
    x0, z0, middle_x, middle_z = arc[1], arc[2], arc[3], arc[4]
    cosine, radius, side = arc[5], arc[6], arc[7]
    for i in range(SPAN):
        dx = work[ACROSS * SPAN + i] - x0
        dz = work[LOCAL_Z * SPAN + i] - z0
        rho = math.sqrt(dx * dx + dz * dz)
        along = dx * middle_x + dz * middle_z
        d = side * (rho - radius)
        nx = dx if rho > ON_AXIS else middle_x
        nz = dz if rho > ON_AXIS else middle_z
        length = rho if rho > ON_AXIS else 1.0
        closest = work[CLOSEST * SPAN + i]
        taken = (abs(d) < closest) & (along >= rho * cosine)
        work[CLOSEST * SPAN + i] = abs(d) if taken else closest
        work[GAP * SPAN + i] = d if taken else work[GAP * SPAN + i]
        work[NORMAL_X * SPAN + i] = side * nx if taken else work[NORMAL_X * SPAN + i]
        work[NORMAL_Z * SPAN + i] = side * nz if taken else work[NORMAL_Z * SPAN + i]
        work[LENGTH * SPAN + i] = length if taken else work[LENGTH * SPAN + i]


@span_part
def distances_to_corner(corner, work):
    """Take the distance to a corner where nothing is closer so far; its sign by the bisector."""
    x0, z0, bisector_x, bisector_z = corner[0], corner[1], corner[2], corner[3]
    for i in range(SPAN):
        dx = work[ACROSS * SPAN + i] - x0
        dz = work[LOCAL_Z * SPAN + i] - z0
        length = math.sqrt(dx * dx + dz * dz)
        side = 1.0 if dx * bisector_x + dz * bisector_z >= 0.0 else -1.0
        apart = length > ON_AXIS
        closest = work[CLOSEST * SPAN + i]
        taken = length < closest
        nx = side * dx if apart else bisector_x
        nz = side * dz if apart else bisector_z
        work[CLOSEST * SPAN + i] = length if taken else closest
        work[GAP * SPAN + i] = side * length if taken else work[GAP * SPAN + i]
        work[NORMAL_X * SPAN + i] = nx if taken else work[NORMAL_X * SPAN + i]
        work[NORMAL_Z * SPAN + i] = nz if taken else work[NORMAL_Z * SPAN + i]
        size = length if apart else 1.0
        work[LENGTH * SPAN + i] = size if taken else work[LENGTH * SPAN + i]
