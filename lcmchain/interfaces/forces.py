"""Contact forces between plies in a step.

Every point over a facet has a spring that stays as it is until the next refresh: weights of the
facet's corners, normal, offset, stiffness and share. With r = x - Σ weight corner its gap is
normal·r + offset and its share of the area is linear in r too, so that its normal force has a
potential. To it come the forces of the interface's laws (:mod:`lcmchain.interfaces.law`).

What a point has lies in rows of its span of 16 nodes: one loop over the nodes of a span, which
compiles to vectors, makes their forces. These are then gathered node by node, from a list of the
points that press on a node in the order of their numbers: bit-identical for any number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.vectors import plus
from lcmchain.interfaces.rows import (
    AREA,
    DAMPED_ENERGY,
    FORCE,
    HELD,
    INTERFACE,
    LAST_DAMPING,
    LAST_GAP,
    LOST_ENERGY,
    MOVED,
    RIM,
    STORED_ENERGY,
    WAY,
    WEIGHT,
    all_parameters,
    any_uses_sliding,
    memory_rows,
    row_start,
    spring_energy,
    store_memories,
    sum_of_laws,
    touch_of,
)
from lcmchain.interfaces.surfaces import NONE
from lcmchain.jit import equation, kernel_part, ordered_span_routine, span_part, span_routine
from lcmchain.tools.span_rows import SPAN, SPANS_OF_CHUNK, put_vector, vector_at

# Columns of the sums of the points of a chunk of nodes.
STORED = 0  # in the springs and laws [J]
LOST = 1  # by sliding and parting in this step [J]
DAMPED = 2  # by damping in this step [J]
BOOKED = 3  # what the last refresh put into the springs [J]
STEPS_ALLOWED = 4  # until the next refresh
FASTEST = 5  # at which a point goes towards or away from a ply [m/s]
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
WAY_SINCE_SEARCH = 0  # of the fastest point since the last search [m]
PLY_CLOCK = 1


@equation
def force_in_lane(laws, values, starts, rows, at, rate, time):
    """Write force and energies of a point, and move its memory on.

    Parameters
    ----------
    values, starts : of the laws, :func:`all_parameters` and :func:`memory_rows`.
    rate : damping over stiffness and last step, 0 at the start.
    """
    r, moved = vector_at(rows, WAY, at), vector_at(rows, MOVED, at)
    touch = touch_of(rows, at, r, moved, time)
    energy = spring_energy(rows, at, touch)
    closed = touch.last_gap - touch.gap
    # no adhesion: damping takes no more than the pressure there is
    resists = max(rate * touch.stiffness * closed, -touch.pressure)
    resists = resists if touch.pressure > 0.0 else 0.0
    last_damping = rows[at + LAST_DAMPING * SPAN]
    force, tension, stored, lost, memories = sum_of_laws(laws, values, starts, rows, at, touch)
    store_memories(laws, memories, starts, rows, at)
    force = plus(touch.pressure + resists - tension, touch.normal, force)
    # all that is stored goes with the share: what it changes along the facet is a force as well
    stored += energy
    whole = rows[at + AREA * SPAN]
    per_share = stored * whole / touch.area if touch.area > 0.0 else 0.0
    force = plus(-per_share, vector_at(rows, RIM, at), force)
    put_vector(rows, FORCE, at, force)
    rows[at + STORED_ENERGY * SPAN] = stored
    rows[at + LOST_ENERGY * SPAN] = lost
    rows[at + DAMPED_ENERGY * SPAN] = 0.5 * (last_damping + resists) * closed
    rows[at + LAST_GAP * SPAN] = touch.gap - rows[at + HELD * SPAN]
    rows[at + LAST_DAMPING * SPAN] = resists


@span_part
def load_ways(position, corner, first, count, rows, row):
    """Write to three rows the way from the weighted corners to each point of a span."""
    for i in range(count):
        point = np.uint64(first + i)
        a, b = np.uint64(corner[point, 0]), np.uint64(corner[point, 1])
        c, d = np.uint64(corner[point, 2]), np.uint64(corner[point, 3])
        wa, wb = rows[WEIGHT * SPAN + i], rows[(WEIGHT + 1) * SPAN + i]
        wc, wd = rows[(WEIGHT + 2) * SPAN + i], rows[(WEIGHT + 3) * SPAN + i]
        for k in range(3):
            x = position[k]
            on_facet = wa * x[a] + wb * x[b] + wc * x[c] + wd * x[d]
            rows[(row + k) * SPAN + i] = x[point] - on_facet


@span_part
def forces_of_span(laws, interface, rows, rate, time):
    """Make the forces of the points of a span, all on one interface."""
    values, starts = all_parameters(laws, interface), memory_rows(laws)
    for lane in range(SPAN):
        force_in_lane(laws, values, starts, rows, lane, rate, time)


@span_routine
def force_of_point(laws, interface, rows, lane, rate, time):
    """Make the force of one point, in a span of points on several interfaces."""
    values, starts = all_parameters(laws, interface), memory_rows(laws)
    force_in_lane(laws, values, starts, rows, lane, rate, time)


@kernel_part
def forces_of_points(data, first, second, third, fourth, fifth, sixth, arrays, dt_last):
    """Write the force on every point, and the energies of every chunk of nodes.

    first to sixth : the laws, one by one, as a parallel loop takes no tuple of tuples.
    """
    for chunk in prange(arrays.ply_sums.shape[0]):
        laws = (first, second, third, fourth, fifth, sixth)
        forces_of_chunk(data, laws, arrays, chunk, dt_last)


@ordered_span_routine
def forces_of_chunk(data, laws, arrays, chunk, dt_last):
    """Write the force on every point of a chunk of nodes, and its energies."""
    rate = data.damping_time / dt_last if dt_last > 0.0 else 0.0
    size = memory_rows(laws)[6] * SPAN
    stored, lost, damped = 0.0, 0.0, 0.0
    begin, end = arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]
    for place in range(SPANS_OF_CHUNK):
        span, first = chunk * SPANS_OF_CHUNK + place, begin + place * SPAN
        low, high = arrays.ply_interface[span, 0], arrays.ply_interface[span, 1]
        if low > high:
            continue
        count = min(SPAN, end - first)
        rows = arrays.ply_rows[span * size : (span + 1) * size]
        load_ways(arrays.position, arrays.ply_corner, first, count, rows, WAY)
        if any_uses_sliding(laws):
            load_ways(arrays.velocity, arrays.ply_corner, first, count, rows, MOVED)
            for i in range(3 * SPAN):
                rows[MOVED * SPAN + i] *= dt_last
        if low == high:
            forces_of_span(laws, low, rows, rate, dt_last)
        else:
            for i in range(count):
                interface = int(rows[INTERFACE * SPAN + i])
                force_of_point(laws, interface, rows, i, rate, dt_last)
        for i in range(count):
            for d in range(3):
                arrays.ply_force[first + i, d] = rows[(FORCE + d) * SPAN + i]
            stored += rows[STORED_ENERGY * SPAN + i]
            lost += rows[LOST_ENERGY * SPAN + i]
            damped += rows[DAMPED_ENERGY * SPAN + i]
    arrays.ply_sums[chunk, STORED] = stored
    arrays.ply_sums[chunk, LOST] = lost
    arrays.ply_sums[chunk, DAMPED] = damped


@ordered_span_routine
def list_points(data, arrays):
    """List for every node the points whose facets it is a corner of, in their order.

    And for every point the corners, for every span the lowest and the highest number of the
    interfaces that its points are on; the lowest is above the highest where none is.
    """
    start, item, weight = arrays.ply_start, arrays.ply_item, arrays.ply_weight
    facet_node, facets, rows = data.facet_node, arrays.ply_facet, arrays.ply_rows
    corner, interface = arrays.ply_corner, arrays.ply_interface
    interface[:, 0], interface[:, 1] = data.interface_count, NONE
    for point in range(facets.size):
        facet = facets[point]
        span = data.lane[point] // SPAN
        for k in range(4):
            corner[point, k] = point
            if facet >= 0:
                corner[point, k] = facet_node[facet, k]
        if facet >= 0:
            number = data.interface[data.ply[point], data.facet_ply[facet]]
            interface[span, 0] = min(interface[span, 0], number)
            interface[span, 1] = max(interface[span, 1], number)
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
                weight[place] = rows[row_start(data, point) + (WEIGHT + k) * SPAN]
    # filled from their ends, the lists now begin one entry further on
    for node in range(facets.size):
        start[node] = start[node + 1]
    start[facets.size] = total


@ordered_span_routine
def add_ply_forces(data, arrays, chunk, first, last):
    """Add the contact forces between plies to the nodes ``first`` to ``last`` of a chunk.

    Return the energy of the springs of these points, and what sliding and damping took [J].
    """
    start, item, weight = arrays.ply_start, arrays.ply_item, arrays.ply_weight
    ply_force, force = arrays.ply_force, arrays.force
    for node in range(first, last):
        begin, end = start[node], start[node + 1]
        x, y, z, nothing = 0.0, 0.0, 0.0, 0.0
        if arrays.ply_facet[node] >= 0:
            x, y, z = ply_force[node, 0], ply_force[node, 1], ply_force[node, 2]
        elif begin == end:
            continue
        for k in range(begin, end):
            point, share = np.uint64(item[k]), weight[k]
            x -= share * ply_force[point, 0]
            y -= share * ply_force[point, 1]
            z -= share * ply_force[point, 2]
            nothing -= share * ply_force[point, 3]
        force[0, node] += x
        force[1, node] += y
        # the fourth number lets the compiler take all four at once
        force[2, node] += z + nothing
    sums = arrays.ply_sums[chunk]
    return sums[STORED], sums[LOST], sums[DAMPED]
