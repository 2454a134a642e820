"""The pin-jointed net: nodes on a surface, at fixed distances from their neighbours.

Fibres are bars of fixed length that turn freely where they cross (Mack and Taylor 1956, "The
fitting of woven cloth to surfaces"). Two start lines run from the seed, the warp and the weft
through it, as geodesics: the next node lies in the plane of the last bar and the surface normal.
The one along fibre 1 may follow given places instead, and the angle between both is free.
Every other node is one bar away from its two neighbours: where the circle in which two spheres
meet passes through the surface, on the far side of the node before. In the limit of short bars this
is the Chebyshev net of the surface, ω_uv = -K sin ω for the angle ω between the fibres and the
Gaussian curvature K.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.draping.surface import NO_GRADIENT, level
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import equation, routine

#: What became of a node.
PLACED = 0
LOCKED = 1  # the bars would have to pass each other
LOST = 2  # no place on the surface was found
UNREACHED = 3  # a neighbour that it hangs on has no place

#: Distance from the surface [parts of the edge length] at which a node is placed.
ACCURACY = 1e-13
#: Steps of Newton's method before the circle is searched, their longest length [rad], and how far
#: the circle is searched [rad], in how many steps to either side.
NEWTON_STEPS = 12
LONGEST_STEP = 0.3
SEARCHED = 2.1
SEARCH_STEPS = 42
MOST_STEPS = 100


@equation
def difference(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@equation
def moved(a, factor, b):
    """Return a + factor b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


@routine
def unit_normal(surface, side, x):
    """Return the normal of the surface at a point, to the side of the sheet that ``side`` says."""
    _, gx, gy, gz = level(surface, x[0], x[1], x[2])
    length = side * math.sqrt(gx * gx + gy * gy + gz * gz)
    if abs(length) < NO_GRADIENT:
        return (0.0, 0.0, 0.0)
    return (gx / length, gy / length, gz / length)


@equation
def on_circle(circle, angle):
    """Return the point of a circle (centre, radius, two unit vectors) at an angle [rad]."""
    centre, radius, first, second = circle
    return moved(moved(centre, radius * math.cos(angle), first), radius * math.sin(angle), second)


@routine
def level_on_circle(surface, circle, angle):
    """Return the level [m] at an angle of a circle, and its slope [m/rad]."""
    x = on_circle(circle, angle)
    f, gx, gy, gz = level(surface, x[0], x[1], x[2])
    _, radius, first, second = circle
    gradient = (gx, gy, gz)
    slope = math.cos(angle) * dot(gradient, second) - math.sin(angle) * dot(gradient, first)
    return f, radius * slope


@routine
def meet(surface, circle, accuracy):
    """Return the angle [rad] where a circle meets the surface next to 0, and whether it does.

    Newton's method first; where a surface bends too sharply for it, the circle is searched.
    """
    angle = 0.0
    for _ in range(NEWTON_STEPS):
        f, slope = level_on_circle(surface, circle, angle)
        if abs(f) <= accuracy:
            return angle, True
        if slope == 0.0:
            break
        angle -= max(-LONGEST_STEP, min(LONGEST_STEP, f / slope))
        if abs(angle) > SEARCHED:
            break
    return search_circle(surface, circle, accuracy)


@routine
def search_circle(surface, circle, accuracy):
    """Return the angle [rad] of the change of sign next to 0, by halving, and whether there is."""
    start = level_on_circle(surface, circle, 0.0)[0]
    before_up = before_down = start
    step = SEARCHED / SEARCH_STEPS
    low, high, at_low = 0.0, 0.0, start
    for k in range(1, SEARCH_STEPS + 1):
        up = level_on_circle(surface, circle, k * step)[0]
        if up * before_up <= 0.0:
            low, high, at_low = (k - 1) * step, k * step, before_up
            break
        down = level_on_circle(surface, circle, -k * step)[0]
        if down * before_down <= 0.0:
            low, high, at_low = -(k - 1) * step, -k * step, before_down
            break
        before_up, before_down = up, down
    if low == high:
        return 0.0, False
    for _ in range(MOST_STEPS):
        middle = 0.5 * (low + high)
        f = level_on_circle(surface, circle, middle)[0]
        if abs(f) <= accuracy or middle in (low, high):
            break
        if f * at_low > 0.0:
            low, at_low = middle, f
        else:
            high = middle
    return middle, abs(f) <= accuracy


@equation
def circle_of_spheres(first, first_length, second, second_length, away_from):
    """Return the circle in which two spheres meet, from its point farthest from a point.

    And the square of its radius [m²], which is not positive where they do not meet.
    """
    axis = difference(second, first)
    squared = dot(axis, axis)
    if squared == 0.0:
        return (first, 0.0, axis, axis), 0.0
    share = 0.5 + 0.5 * (first_length**2 - second_length**2) / squared
    centre = moved(first, share, axis)
    radius_squared = first_length**2 - share * share * squared
    way = difference(centre, away_from)
    way = moved(way, -dot(way, axis) / squared, axis)
    size = math.sqrt(dot(way, way))
    if radius_squared <= 0.0 or size == 0.0:
        return (first, 0.0, axis, axis), 0.0
    ahead = (way[0] / size, way[1] / size, way[2] / size)
    length = math.sqrt(squared)
    across = cross((axis[0] / length, axis[1] / length, axis[2] / length), ahead)
    return (centre, math.sqrt(radius_squared), ahead, across), radius_squared


@routine
def project(surface, x, accuracy):
    """Return the point of the surface next to x, along the gradient, and whether it was found."""
    for _ in range(MOST_STEPS):
        f, gx, gy, gz = level(surface, x[0], x[1], x[2])
        squared = gx * gx + gy * gy + gz * gz
        if abs(f) <= accuracy:
            return x, True
        if squared < NO_GRADIENT:
            return x, False
        x = moved(x, -f / squared, (gx, gy, gz))
    return x, False


@equation
def point_of(places, i, j):
    return (places[i, j, 0], places[i, j, 1], places[i, j, 2])


@equation
def keep(places, i, j, x):
    places[i, j, 0] = x[0]
    places[i, j, 1] = x[1]
    places[i, j, 2] = x[2]


@routine
def lay_start_line(surface, side, direction, lines, origin, other, along_u, way, accuracy,
                   places, status):  # fmt: skip
    """Lay the nodes of one half of a start line, a geodesic from the seed or the last steered node.

    direction : unit vector in the tangent plane at the seed, of growing line numbers.
    lines : fibre coordinates of the nodes [m]; origin : number of the seed; other : that of the
        start line across. way : 1 or -1, the half.
    """
    index = origin
    x = point_of(places, origin, other) if along_u else point_of(places, other, origin)
    ahead = (way * direction[0], way * direction[1], way * direction[2])
    while 0 <= index + way < lines.size:
        i, j = (index + way, other) if along_u else (other, index + way)
        if status[i, j] == PLACED:  # a steered node; beyond the last one its bar leads on
            y = point_of(places, i, j)
            ahead, x = difference(y, x), y
            index += way
            continue
        length = abs(lines[index + way] - lines[index])
        normal = unit_normal(surface, side, x)
        across = cross(normal, ahead)
        size = math.sqrt(dot(across, across))
        if size < NO_GRADIENT:
            found = False
        else:
            across = (across[0] / size, across[1] / size, across[2] / size)
            circle = (x, length, cross(across, normal), normal)
            angle, found = meet(surface, circle, accuracy)
        index += way
        if not found:
            status[i, j] = LOST
            return
        y = on_circle(circle, angle)
        ahead = difference(y, x)
        x = y
        keep(places, i, j, x)
        status[i, j] = PLACED


@routine
def lay_quarter(surface, side, u, v, i0, j0, way_u, way_v, locking, accuracy, places, status):
    """Lay the nodes between two halves of the start lines, row by row.

    locking : as for :func:`lay_net`.
    """
    j = j0 + way_v
    while 0 <= j < v.size:
        i = i0 + way_u
        length_v = abs(v[j] - v[j - way_v])
        while 0 <= i < u.size:
            length_u = abs(u[i] - u[i - way_u])
            if status[i - way_u, j] == PLACED and status[i, j - way_v] == PLACED:
                before_u, before_v = point_of(places, i - way_u, j), point_of(places, i, j - way_v)
                corner = point_of(places, i - way_u, j - way_v)
                circle, squared = circle_of_spheres(before_u, length_u, before_v, length_v, corner)
                status[i, j] = LOCKED
                if squared > 0.0:
                    angle, found = meet(surface, circle, accuracy)
                    y = on_circle(circle, angle)
                    if not found:
                        status[i, j] = LOST
                        i += way_u
                        continue
                    along_u, along_v = difference(y, before_u), difference(y, before_v)
                    normal = unit_normal(surface, side, y)
                    turned = dot(cross(along_u, along_v), normal) * way_u * way_v
                    if turned > locking * length_u * length_v:
                        status[i, j] = PLACED
                        keep(places, i, j, y)
            i += way_u
        j += way_v


@routine
def lay_net(
    surface, side, seed, direction_1, direction_2, u, v, i0, j0, locking, accuracy, steered
):
    """Lay a net from its seed.

    Parameters
    ----------
    surface : :class:`lcmchain.draping.surface.DrapedSurface`.
    side : 1 where the upper side of the sheet looks along the gradient of the level, else -1.
    seed : point of the surface [m]. direction_1, direction_2 : unit vectors of both fibres there.
    u, v : coordinates of the net's lines along fibre 1 and 2 [m], growing.
    i0, j0 : numbers of the lines through the seed.
    locking : least sine of the angle between the fibres.
    accuracy : of the conditions of a node [m].
    steered : given places of nodes on the start line along fibre 1 [m], shape (u.size, 3), without
        a gap from the seed on; nan for the nodes of a geodesic.

    Returns
    -------
    places [m], shape (u.size, v.size, 3), nan where there is none, and what became of the nodes.
    """
    places = np.full((u.size, v.size, 3), np.nan)
    status = np.full((u.size, v.size), UNREACHED)
    for i in range(u.size):
        if not math.isnan(steered[i, 0]):
            keep(places, i, j0, (steered[i, 0], steered[i, 1], steered[i, 2]))
            status[i, j0] = PLACED
    keep(places, i0, j0, seed)
    status[i0, j0] = PLACED
    for way in (1, -1):
        lay_start_line(surface, side, direction_1, u, i0, j0, True, way, accuracy, places, status)
        lay_start_line(surface, side, direction_2, v, j0, i0, False, way, accuracy, places, status)
    for way_u in (1, -1):
        for way_v in (1, -1):
            lay_quarter(
                surface, side, u, v, i0, j0, way_u, way_v, locking, accuracy, places, status
            )
    return places, status


@routine
def project_all(surface, points, accuracy):
    """Move points [m], shape (n, 3), onto the surface, in place; nan where there is no place."""
    for p in range(points.shape[0]):
        x, found = project(surface, (points[p, 0], points[p, 1], points[p, 2]), accuracy)
        for k in range(3):
            points[p, k] = x[k] if found else np.nan
