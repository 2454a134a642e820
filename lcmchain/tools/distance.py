"""Signed distance from a point to a rigid tool: the innermost function of contact.

Scalar code without allocation, called for every node near a tool in every step. Positive
distances are free space, negative ones lie inside the tool; the normal is the gradient of the
distance, a unit vector that points into free space.

A tool that turns about an axis has its angle for a travel, and its direction is 0. Where no tool of
a scene turns, the table has no axes, and the code for turns is left out of all that is compiled.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from lcmchain.jit import FLOATING_POINT, equation, inlined_routine
from lcmchain.tools.profiles import ARC

#: Values of ToolTable.kind.
PLANE = 0
REVOLVED = 1
EXTRUDED = 2
FIELD = 3

# Reading an array out of the table would count a reference up and down: with every array of the
# table, more work than the distance. These functions keep no array, so they need no counting.
_UNCOUNTED: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": FLOATING_POINT,
    "cache": True,
    "nogil": True,
    "_nrt": False,
}

#: Radius [m] below which a point lies on the axis of revolution (its square is still normal).
ON_AXIS = 1e-100


@equation
def turned(x, y, z, axis, tool, angle):
    """Turn a vector about the axis of a tool, a row of ``axis`` (T, 3); 0 leaves it as it is.

    Source: Rodrigues' formula for the rotation of a vector.
    """
    ax, ay, az = axis[tool, 0], axis[tool, 1], axis[tool, 2]
    if ax * ax + ay * ay + az * az == 0.0:
        return x, y, z
    c, s = math.cos(angle), math.sin(angle)
    rest = (1.0 - c) * (ax * x + ay * y + az * z)
    return (
        c * x + s * (ay * z - az * y) + rest * ax,
        c * y + s * (az * x - ax * z) + rest * ay,
        c * z + s * (ax * y - ay * x) + rest * az,
    )


@equation
def origin_at(turn_axis, table, tool, travel):
    """Return the origin of a tool [m] at a travel [m], or at an angle [rad] if it turns.

    turn_axis : of the table, None where no tool turns.
    """
    x = table.origin[tool, 0] + travel * table.direction[tool, 0]
    y = table.origin[tool, 1] + travel * table.direction[tool, 1]
    z = table.origin[tool, 2] + travel * table.direction[tool, 2]
    if turn_axis is not None:
        px, py, pz = table.turn_point[tool, 0], table.turn_point[tool, 1], table.turn_point[tool, 2]
        x, y, z = turned(x - px, y - py, z - pz, turn_axis, tool, travel)
        return x + px, y + py, z + pz
    return x, y, z


@equation
def local_axis_at(turn_axis, table, tool, travel, axis):
    """Return a local axis of a tool, 0 to 2, in global coordinates at a travel or angle."""
    x = table.rotation[tool, axis, 0]
    y = table.rotation[tool, axis, 1]
    z = table.rotation[tool, axis, 2]
    if turn_axis is not None:
        return turned(x, y, z, turn_axis, tool, travel)
    return x, y, z


@equation
def arm_at(table, tool, x, y, z):
    """Return the velocity of a tool at a point for an angular velocity of 1 [m]; 0 without a turn.

    The moment of a force about the axis is its product with this vector.
    """
    ax, ay, az = table.turn_axis[tool, 0], table.turn_axis[tool, 1], table.turn_axis[tool, 2]
    rx = x - table.turn_point[tool, 0]
    ry = y - table.turn_point[tool, 1]
    rz = z - table.turn_point[tool, 2]
    return ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx


@njit(**_UNCOUNTED)
def profile_distance(segments, first, last, corners, first_corner, last_corner, x, z):
    """Signed distance [m] of a point of the profile plane, and the unit normal there.

    The closest point lies inside a line or an arc, or on a corner. Lines and arcs only count where
    the foot of the perpendicular lies within them; corners always do.
    """
    closest = math.inf
    distance = math.inf
    nx = 0.0
    nz = 1.0
    for s in range(first, last):
        dx = x - segments[s, 1]
        dz = z - segments[s, 2]
        if segments[s, 0] == ARC:
            along = dx * segments[s, 3] + dz * segments[s, 4]
            rho = math.sqrt(dx * dx + dz * dz)
            if along >= rho * segments[s, 5]:
                d = segments[s, 7] * (rho - segments[s, 6])
                if abs(d) < closest:
                    closest = abs(d)
                    distance = d
                    if rho > ON_AXIS:
                        nx = segments[s, 7] * dx / rho
                        nz = segments[s, 7] * dz / rho
                    else:
                        nx = segments[s, 7] * segments[s, 3]
                        nz = segments[s, 7] * segments[s, 4]
        else:
            along = dx * segments[s, 3] + dz * segments[s, 4]
            d = dx * segments[s, 7] + dz * segments[s, 8]
            if abs(d) < closest and along >= segments[s, 5] and along <= segments[s, 6]:
                closest = abs(d)
                distance = d
                nx = segments[s, 7]
                nz = segments[s, 8]
    for c in range(first_corner, last_corner):
        dx = x - corners[c, 0]
        dz = z - corners[c, 1]
        squared = dx * dx + dz * dz
        if squared < closest * closest:
            closest = math.sqrt(squared)
            side = 1.0 if dx * corners[c, 2] + dz * corners[c, 3] >= 0.0 else -1.0
            distance = side * closest
            if closest > ON_AXIS:
                nx = side * dx / closest
                nz = side * dz / closest
            else:
                nx = corners[c, 2]
                nz = corners[c, 3]
    return distance, nx, nz


@equation
def quadratic_weights(t):
    """Quadratic B-spline weights of three nodes, and slopes; |t| <= 1/2 from the middle one."""
    below = 0.5 - t
    above = 0.5 + t
    return (
        (0.5 * below * below, 0.75 - t * t, 0.5 * above * above),
        (-below, -2.0 * t, above),
    )


@equation
def unit_or(x, y, z, default_x, default_y, default_z):
    """Return the vector scaled to length one, or the default where it has no length."""
    length = math.sqrt(x * x + y * y + z * z)
    if length > ON_AXIS:
        return x / length, y / length, z / length
    return default_x, default_y, default_z


@njit(**_UNCOUNTED)
def field_distance(h, origin, shape, box, start, coefficients, far_bound, tool, x, y, z):
    """Signed distance [m] interpolated in the distance field of a surface mesh, and the normal.

    Near the surface the field is a quadratic B-spline: continuous with its gradient, so that
    normals do not jump where a node slides from cell to cell. Elsewhere the magnitude is a lower
    bound of the distance. The arguments are columns of the tool table and the spacing h [m].
    """
    # Position in the grid, whose nodes i = 0 ... n-1 lie at origin + i h.
    u = (x - origin[tool, 0]) / h
    v = (y - origin[tool, 1]) / h
    w = (z - origin[tool, 2]) / h
    n_x, n_y, n_z = shape[tool, 0], shape[tool, 1], shape[tool, 2]
    inside_grid = (
        u > 0.5 and u < n_x - 1.5 and v > 0.5 and v < n_y - 1.5 and w > 0.5 and w < n_z - 1.5
    )
    if not inside_grid:
        # The surface lies in its box: the distance to the box is a lower bound.
        dx = x - min(max(x, box[tool, 0]), box[tool, 3])
        dy = y - min(max(y, box[tool, 1]), box[tool, 4])
        dz = z - min(max(z, box[tool, 2]), box[tool, 5])
        nx, ny, nz = unit_or(dx, dy, dz, 0.0, 0.0, 1.0)
        return math.sqrt(dx * dx + dy * dy + dz * dz), nx, ny, nz

    i, j, k = int(u + 0.5), int(v + 0.5), int(w + 0.5)
    stride_y = n_z
    stride_x = n_y * n_z
    centre = start + i * stride_x + j * stride_y + k
    bound = far_bound[centre]
    if bound != 0:
        nx = float(far_bound[centre + stride_x]) - float(far_bound[centre - stride_x])
        ny = float(far_bound[centre + stride_y]) - float(far_bound[centre - stride_y])
        nz = float(far_bound[centre + 1]) - float(far_bound[centre - 1])
        nx, ny, nz = unit_or(nx, ny, nz, 0.0, 0.0, 1.0)
        if bound > 0:
            return (bound - 1) * h, nx, ny, nz
        return (bound + 1) * h, nx, ny, nz

    weights_x, slopes_x = quadratic_weights(u - i)
    weights_y, slopes_y = quadratic_weights(v - j)
    weights_z, slopes_z = quadratic_weights(w - k)
    d = 0.0
    nx = 0.0
    ny = 0.0
    nz = 0.0
    for a in range(3):
        for b in range(3):
            row = centre + (a - 1) * stride_x + (b - 1) * stride_y
            c0 = float(coefficients[row - 1])
            c1 = float(coefficients[row])
            c2 = float(coefficients[row + 1])
            value = weights_z[0] * c0 + weights_z[1] * c1 + weights_z[2] * c2
            slope = slopes_z[0] * c0 + slopes_z[1] * c1 + slopes_z[2] * c2
            d += weights_x[a] * weights_y[b] * value
            nx += slopes_x[a] * weights_y[b] * value
            ny += weights_x[a] * slopes_y[b] * value
            nz += weights_x[a] * weights_y[b] * slope
    nx, ny, nz = unit_or(nx, ny, nz, 0.0, 0.0, 1.0)
    return d, nx, ny, nz


@inlined_routine
def distance_in_field(table, tool, x, y, z):
    """As :func:`field_distance`, of a tool of a table."""
    return field_distance(
        table.spacing[tool],
        table.grid_origin,
        table.grid_shape,
        table.box,
        table.grid_start[tool],
        table.coefficients,
        table.far_bound,
        tool,
        x,
        y,
        z,
    )


@njit(**_UNCOUNTED, forceinline=True)
def signed_distance(table, tool, x, y, z, travel):
    """Signed distance [m] from a point to a tool, and the unit normal of the tool there.

    Parameters
    ----------
    table : ToolTable.
    tool : index of the tool.
    x, y, z : point [m].
    travel : travel [m] of the tool along its direction, or angle [rad] about its axis.

    Returns
    -------
    gap [m], negative inside the tool, and the normal (nx, ny, nz), pointing into free space. Exact
    for the analytic shapes. For a surface mesh: interpolated near the surface, else a gap whose
    magnitude is a lower bound of the distance.
    """
    x0, y0, z0 = origin_at(table.turn_axis, table, tool, travel)
    x -= x0
    y -= y0
    z -= z0
    kind = table.kind[tool]
    zx, zy, zz = local_axis_at(table.turn_axis, table, tool, travel, 2)
    if kind == PLANE:
        nx, ny, nz = zx, zy, zz
        return x * nx + y * ny + z * nz, nx, ny, nz

    aligned = table.aligned[tool] != 0
    xx, xy, xz = local_axis_at(table.turn_axis, table, tool, travel, 0)
    yx, yy, yz = local_axis_at(table.turn_axis, table, tool, travel, 1)
    if not aligned:
        x, y, z = (
            xx * x + xy * y + xz * z,
            yx * x + yy * y + yz * z,
            zx * x + zy * y + zz * z,
        )
    if kind == FIELD:
        gap, nx, ny, nz = distance_in_field(table, tool, x, y, z)
    else:
        radial_x, radial_y, across = 1.0, 0.0, x
        if kind == REVOLVED:
            across = math.sqrt(x * x + y * y)
            if across > ON_AXIS:
                radial_x, radial_y = x / across, y / across
        gap, across_normal, nz = profile_distance(
            table.segments,
            table.segment_start[tool],
            table.segment_start[tool + 1],
            table.corners,
            table.corner_start[tool],
            table.corner_start[tool + 1],
            across,
            z,
        )
        nx, ny = across_normal * radial_x, across_normal * radial_y
    if aligned:
        return gap, nx, ny, nz
    return (
        gap,
        xx * nx + yx * ny + zx * nz,
        xy * nx + yy * ny + zy * nz,
        xz * nx + yz * ny + zz * nz,
    )


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True, nogil=True)
def gaps(table, tool, points, travel):
    """Signed distances [m] from points [m], shape [point_count, 3], to a tool at its travel [m]."""
    result = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        result[p] = signed_distance(table, tool, x, y, z, travel)[0]
    return result
