"""Contact forces between plies in a step.

Every point over a facet has a spring that stays as it is until the next refresh: weights of the
facet's corners, normal, offset, stiffness and share. With r = x - Σ weight corner its gap is
normal·r + offset and its share of the area is linear in r too, so that its normal force has a
potential. Forces are made point by point first and then gathered node by node, from a list of the
points that press on a node in the order of their numbers: bit-identical for any number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.interfaces.coulomb import cut_slip, tangential
from lcmchain.jit import equation, kernel_part, routine

# Entries of a spring.
WEIGHT = 0  # of the four corners
NORMAL = 4
OFFSET = 7  # [m]
STIFFNESS = 8  # of the whole area of the point [N/m]
SHARE = 9  # of the area at r = 0; 1 exactly where no rim is near
HELD = 10  # further depth that the spring feels, see refresh.py [m]
LAST_DEPTH = 11  # depth without the one held, at the last refresh [m]
LAST_GAP = 12  # at the last step [m]
LAST_DAMPING = 13  # force at the last step [N]
SPRING_ENTRIES = 14

# Columns of the sums of the points of a chunk of nodes.
STORED = 0  # in the springs [J]
LOST = 1  # by sliding in this step [J]
DAMPED = 2  # by damping in this step [J]
BOOKED = 3  # what the last refresh put into the springs [J]
STEPS_ALLOWED = 4  # until the next refresh
FASTEST = 5  # speed of a node [m/s]
DEEPEST = 6  # gap over the largest one allowed, of the deepest point
DEEPEST_POINT = 7
SUM_COLUMNS = 8

# Entries of ``State.ply_counters``.
STEPS_LEFT = 0  # until the next refresh
REFRESHES_LEFT = 1  # until the next search among all facets
NORMAL_STEPS_LEFT = 2  # until the slopes of the facets are taken anew
LAST_STEPS = 3  # between the last two refreshes
TOO_DEEP = 4  # a point deeper than springs may be, plus one; 0 without
REFRESHES = 5  # made so far
PLY_COUNTERS = 6

# Entries of ``State.ply_clock``.
WAY = 0  # of the fastest node since the last search [m]
PLY_CLOCK = 1


@equation
def away_from_facet(position, facet_node, facet, spring, point):
    """Return r, the way from the weighted corners to a point [m]."""
    a, b = np.uint64(facet_node[facet, 0]), np.uint64(facet_node[facet, 1])
    c, d = np.uint64(facet_node[facet, 2]), np.uint64(facet_node[facet, 3])
    wa, wb, wc, wd = spring[0], spring[1], spring[2], spring[3]
    p = np.uint64(point)
    x, y, z = position[0], position[1], position[2]
    return (
        x[p] - (wa * x[a] + wb * x[b] + wc * x[c] + wd * x[d]),
        y[p] - (wa * y[a] + wb * y[b] + wc * y[c] + wd * y[d]),
        z[p] - (wa * z[a] + wb * z[b] + wc * z[c] + wd * z[d]),
    )


@equation
def share_at(spring, rim, r):
    """Return the share of a point at r, not below 0."""
    share = spring[SHARE]
    if share == 1.0:
        return share
    return max(share + dot((rim[0], rim[1], rim[2]), r), 0.0)


@equation
def gap_at(spring, r):
    """Return the gap [m] at r, and the normal."""
    normal = (spring[NORMAL], spring[NORMAL + 1], spring[NORMAL + 2])
    return dot(normal, r) + spring[OFFSET], normal


@equation
def normal_force(spring, rim, r):
    """Return force on the point [N], its size along the normal, stiffness [N/m] and energy [J]."""
    gap, normal = gap_at(spring, r)
    depth, held = max(-gap, 0.0), spring[HELD]
    stiffness = spring[STIFFNESS] * share_at(spring, rim, r)
    # the depth held before costs nothing: without any depth of its own a spring has no energy
    squares = 0.5 * (depth * depth - held * held)
    pressure = stiffness * depth
    force = scaled(pressure, normal)
    if spring[SHARE] != 1.0 and stiffness > 0.0:
        force = plus(-spring[STIFFNESS] * squares, (rim[0], rim[1], rim[2]), force)
    return force, pressure, stiffness, stiffness * squares


@routine
def force_on_point(data, position, facet, spring, rim, stick, anchor, force, point, rate):
    """Write the force on a point (3,) [N].

    Return the energy of its spring, and what sliding and damping took in this step [J].

    Parameters
    ----------
    spring : its last gap and damping are moved on.
    stick, anchor : (3,) elastic slip and its anchor [m], moved on; not read without friction.
    rate : damping over stiffness and last step, 0 at the start.
    """
    r = away_from_facet(position, data.facet_node, facet, spring, point)
    total, pressure, stiffness, stored = normal_force(spring, rim, r)
    gap, normal = gap_at(spring, r)
    closed = spring[LAST_GAP] - gap
    # no adhesion: damping takes no more than the pressure there is
    resists = max(rate * stiffness * closed, -pressure) if pressure > 0.0 else 0.0
    damped = 0.5 * (spring[LAST_DAMPING] + resists) * closed
    spring[LAST_GAP], spring[LAST_DAMPING] = gap, resists
    total = plus(resists, normal, total)
    law = data.law[data.ply[point], data.facet_ply[facet]]
    lost = 0.0
    if data.friction[law] > 0.0:
        way = tangential(r, normal)
        before = (stick[0], stick[1], stick[2])
        trial = plus(1.0, (anchor[0], anchor[1], anchor[2]), way)
        along = data.tangential_ratio[law] * stiffness
        after = cut_slip(trial, along, data.friction[law] * pressure)
        if pressure == 0.0:
            after = (0.0, 0.0, 0.0)
        total = plus(-along, after, total)
        # ½ k (b + a)·(t - b) - ½ k (a² - b²), what the motion loses and the spring does not keep
        lost = 0.5 * along * (dot(plus(1.0, before, after), plus(-1.0, after, trial)))
        stored += 0.5 * along * dot(after, after)
        for d in range(3):
            stick[d] = after[d]
            anchor[d] = after[d] - way[d]
    force[0], force[1], force[2] = total[0], total[1], total[2]
    return stored, lost, damped


@kernel_part
def forces_of_points(data, arrays, dt_last):
    """Write the force on every point, and the energies of every chunk of nodes."""
    for chunk in prange(arrays.ply_sums.shape[0]):
        forces_of_chunk(data, arrays, chunk, dt_last)


@routine
def forces_of_chunk(data, arrays, chunk, dt_last):
    """Write the force on every point of a chunk of nodes, and its energies."""
    stored, lost, damped = 0.0, 0.0, 0.0
    rate = data.damping_time / dt_last if dt_last > 0.0 else 0.0
    for point in range(arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]):
        facet = arrays.ply_facet[point]
        if facet >= 0:
            own_stored, own_lost, own_damped = force_on_point(
                data,
                arrays.position,
                facet,
                arrays.ply_spring[point],
                arrays.ply_rim[point],
                arrays.ply_stick[point],
                arrays.ply_anchor[point],
                arrays.ply_force[point],
                point,
                rate,
            )
            stored += own_stored
            lost += own_lost
            damped += own_damped
    arrays.ply_sums[chunk, STORED] = stored
    arrays.ply_sums[chunk, LOST] = lost
    arrays.ply_sums[chunk, DAMPED] = damped


@routine
def list_points(data, arrays):
    """List for every node the points whose facets it is a corner of, in their order."""
    start, item, weight = arrays.ply_start, arrays.ply_item, arrays.ply_weight
    facet_node, facets, spring = data.facet_node, arrays.ply_facet, arrays.ply_spring
    start[:] = 0
    for point in range(facets.size):
        facet = facets[point]
        if facet >= 0:
            for k in range(4):
                start[facet_node[facet, k] + 1] += 1
    for node in range(facets.size):
        start[node + 1] += start[node]
    total = start[facets.size]
    for point in range(facets.size - 1, -1, -1):
        facet = facets[point]
        if facet >= 0:
            for k in range(4):
                node = facet_node[facet, k]
                start[node + 1] -= 1
                place = start[node + 1]
                item[place] = point
                weight[place] = spring[point, WEIGHT + k]
    # filled from their ends, the lists now begin one entry further on
    for node in range(facets.size):
        start[node] = start[node + 1]
    start[facets.size] = total


@routine
def add_ply_forces(data, arrays, chunk, first, last):
    """Add the contact forces between plies to the nodes ``first`` to ``last`` of a chunk.

    Return the energy of the springs of these points, and what sliding and damping took [J].
    """
    start, item, weight = arrays.ply_start, arrays.ply_item, arrays.ply_weight
    ply_force, force = arrays.ply_force, arrays.force
    for node in range(first, last):
        x, y, z = 0.0, 0.0, 0.0
        if arrays.ply_facet[node] >= 0:
            x, y, z = ply_force[node, 0], ply_force[node, 1], ply_force[node, 2]
        for k in range(start[node], start[node + 1]):
            point, share = np.uint64(item[k]), weight[k]
            x -= share * ply_force[point, 0]
            y -= share * ply_force[point, 1]
            z -= share * ply_force[point, 2]
        force[0, node] += x
        force[1, node] += y
        force[2, node] += z
    sums = arrays.ply_sums[chunk]
    return sums[STORED], sums[LOST], sums[DAMPED]
