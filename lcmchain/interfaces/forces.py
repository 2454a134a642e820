"""Contact forces between plies in a step.

Every point over a facet has a spring that stays as it is until the next refresh: weights of the
facet's corners, normal, offset, stiffness and share. With r = x - Σ weight corner its gap is
normal·r + offset and its share of the area is linear in r too, so that its normal force has a
potential. To it come the forces of the interface's laws (:mod:`lcmchain.interfaces.law`).

What a point has lies in rows of its span of 16 nodes: one loop over the nodes of a span, which
compiles to vectors, makes their forces. A span none of whose points is near enough to act rests: of
its points the gap alone is made. Each chunk of nodes then takes the forces of those points that act
on it from a list, in the order of their numbers: bit-identical for any number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.blocks import (
    NEXT_ROW,
    NODE_CHUNK,
    SECOND_ROW,
    SPAN,
    SPANS_OF_CHUNK,
    put_vector,
    vector_at,
)
from lcmchain.elements.vectors import dot, plus
from lcmchain.interfaces.rows import (
    AREA,
    DAMPED_ENERGY,
    FORCE,
    HALF,
    HELD,
    INTERFACE,
    LAST_DAMPING,
    LAST_GAP,
    LOST_ENERGY,
    MOVED,
    NORMAL,
    OFFSET,
    REACH,
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
from lcmchain.jit import (
    equation,
    kernel_part,
    ordered_span_routine,
    span_part,
    span_routine,
    standalone_routine,
)

# Halves of spans in a chunk of nodes.
HALVES_OF_CHUNK = NODE_CHUNK // HALF

# Rows of the scratch of a span: ways, and gaps without the depth held [m].
GAP, WAY_ROWS = 3, 4

# Columns of the sums of the points of a chunk of nodes.
STORED = 0  # in the springs and laws [J]
LOST = 1  # by sliding and parting in this step [J]
DAMPED = 2  # by damping in this step [J]
BOOKED = 3  # what the last refresh put into the springs [J]
STEPS_ALLOWED = 4  # until the next refresh
FASTEST = 5  # at which a point goes towards or away from a ply [m/s]
DEEPEST = 6  # gap over the largest one allowed, of the deepest point
DEEPEST_POINT = 7
APPROACH = 8  # the speed that counts for the steps until the next search [m/s]
SUM_COLUMNS = 9

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
APPROACHED = 1  # the same of those points alone that face nothing [m]
LAST_APPROACH = 2  # way of the fastest of these in a step, at the last refresh [m]
PLY_CLOCK = 3


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
def load_ways(vectors, corner, first, count, rows, ways):
    """Write to ``ways`` the way from the weighted corners to each point of a span."""
    for i in range(count):
        point = np.uint64(first + i)
        a, b = np.uint64(corner[point, 0]), np.uint64(corner[point, 1])
        c, d = np.uint64(corner[point, 2]), np.uint64(corner[point, 3])
        wa, wb = rows[WEIGHT * SPAN + i], rows[(WEIGHT + 1) * SPAN + i]
        wc, wd = rows[(WEIGHT + 2) * SPAN + i], rows[(WEIGHT + 3) * SPAN + i]
        for k in range(3):
            x = vectors[k]
            on_facet = wa * x[a] + wb * x[b] + wc * x[c] + wd * x[d]
            ways[k * SPAN + i] = x[point] - on_facet


@span_part
def find_gaps(rows, ways):
    """Write the gaps of a span behind its ways; return a bit for each point near enough to act."""
    found = 0
    for i in range(SPAN):
        gap = dot(vector_at(rows, NORMAL, i), vector_at(ways, 0, i)) + rows[OFFSET * SPAN + i]
        ways[GAP * SPAN + i] = gap
        found |= (1 << i) if gap < rows[REACH * SPAN + i] else 0
    return found


@span_part
def put_rows(source, row, factor, rows, into, count):
    """Write some rows times a factor into others."""
    for k in range(count * SPAN):
        rows[into * SPAN + k] = factor * source[row * SPAN + k]


@span_part
def forces_of_span(laws, interface, rows, rate, time):
    """Make the forces of the points of a span, all on one interface."""
    values, starts = all_parameters(laws, interface), memory_rows(laws)
    for lane in range(SPAN):
        force_in_lane(laws, values, starts, rows, lane, rate, time)


@span_part
def row_sum(rows, row):
    """Return the sum of a row."""
    total = 0.0
    for i in range(SPAN):
        total += rows[row * SPAN + i]
    return total


@span_routine
def force_of_point(laws, rows, at, rate, time):
    """Make the force of one point; ``at`` is its place in the first row."""
    values = all_parameters(laws, int(rows[at + INTERFACE * SPAN]))
    force_in_lane(laws, values, memory_rows(laws), rows, at, rate, time)


@ordered_span_routine
def leave_rest(laws, rows, at, time):
    """Let the laws of a point that rested keep what they would, had they been asked all the time.

    Out of its reach a point has no force, and what its laws keep goes with its last way alone. The
    rows have its present way and how much that has changed in the last step.
    """
    way = vector_at(rows, WAY, at)
    put_vector(rows, WAY, at, plus(-1.0, vector_at(rows, MOVED, at), way))
    force_of_point(laws, rows, at, 0.0, time)
    put_vector(rows, WAY, at, way)


@kernel_part
def forces_of_points(plies, arrays, dt_last):
    """Write the force on every point, and the energies of every chunk of nodes."""
    for chunk in prange(arrays.ply_sums.shape[0]):
        ways = np.zeros(WAY_ROWS * SPAN)
        forces_of_chunk(plies, arrays, chunk, dt_last, ways)


@ordered_span_routine
def forces_of_chunk(plies, arrays, chunk, dt_last, ways):
    """Write the force on every point of a chunk of nodes, and its energies.

    ways : scratch for the ways and gaps of a span.
    """
    data, laws = plies.data, plies.laws
    rate = data.damping_time / dt_last if dt_last > 0.0 else 0.0
    stored, lost, damped = 0.0, 0.0, 0.0
    begin, end = arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]
    for place in range(SPANS_OF_CHUNK):
        span, first = chunk * SPANS_OF_CHUNK + place, begin + place * SPAN
        low, high = arrays.ply_interface[span, 0], arrays.ply_interface[span, 1]
        if low > high:
            continue
        count = min(SPAN, end - first)
        rows = arrays.ply_rows[span * data.row_size : (span + 1) * data.row_size]
        halves = arrays.ply_acts[2 * span : 2 * span + 2]
        load_ways(arrays.position, arrays.ply_corner, first, count, rows, ways)
        near = find_gaps(rows, ways)
        rested = not (halves[0] or halves[1])
        halves[0], halves[1] = near % (1 << HALF) > 0, near >> HALF > 0
        # the step in which points part still has to say what that took
        if near == 0 and rested:
            put_rows(ways, GAP, 1.0, rows, LAST_GAP, 1)
            continue
        put_rows(ways, 0, 1.0, rows, WAY, 3)
        if rested or any_uses_sliding(laws):
            load_ways(arrays.velocity, arrays.ply_corner, first, count, rows, ways)
            put_rows(ways, 0, dt_last, rows, MOVED, 3)
        if rested:
            for i in range(count):
                leave_rest(laws, rows, i, dt_last)
        if low == high:
            forces_of_span(laws, low, rows, rate, dt_last)
        else:
            for i in range(count):
                force_of_point(laws, rows, i, rate, dt_last)
        stored += row_sum(rows, STORED_ENERGY)
        lost += row_sum(rows, LOST_ENERGY)
        damped += row_sum(rows, DAMPED_ENERGY)
    arrays.ply_sums[chunk, STORED] = stored
    arrays.ply_sums[chunk, LOST] = lost
    arrays.ply_sums[chunk, DAMPED] = damped


@ordered_span_routine
def list_points(data, arrays):
    """List for every chunk of nodes the points that press on them, in their order.

    And for every point the corners of its facet, for every span the lowest and the highest number
    of the interfaces that its points are on; the lowest is above the highest where none is.
    """
    start, facets, rows = arrays.ply_start, arrays.ply_facet, arrays.ply_rows
    corner, interface = arrays.ply_corner, arrays.ply_interface
    interface[:, 0], interface[:, 1] = data.interface_count, NONE
    start[:] = 0
    for point in range(facets.size):
        facet = facets[point]
        for k in range(4):
            corner[point, k] = data.facet_node[facet, k] if facet >= 0 else point
        if facet >= 0:
            span = data.lane[point] // SPAN
            number = data.interface[data.ply[point], data.facet_ply[facet]]
            interface[span, 0] = min(interface[span, 0], number)
            interface[span, 1] = max(interface[span, 1], number)
            for k in range(4):
                start[data.lane[corner[point, k]] // NODE_CHUNK + 1] += 1
    for chunk in range(start.size - 1):
        start[chunk + 1] += start[chunk]
    # filled up from its start, the list of a chunk ends where that of the next one begins
    for point in range(facets.size):
        if facets[point] >= 0:
            at = row_start(data, point)
            for k in range(4):
                node = corner[point, k]
                chunk = data.lane[node] // NODE_CHUNK
                item = start[chunk]
                start[chunk] += 1
                arrays.ply_half[item] = data.lane[point] // HALF
                arrays.ply_place[item] = at + FORCE * SPAN
                arrays.ply_node[item] = node
                arrays.ply_weight[item] = rows[at + (WEIGHT + k) * SPAN]
    for chunk in range(start.size - 1, 0, -1):
        start[chunk] = start[chunk - 1]
    start[0] = 0
    for chunk in range(start.size - 1):
        end = start[chunk + 1]
        for item in range(end - 1, start[chunk] - 1, -1):
            goes_on = item + 1 < end and arrays.ply_half[item] == arrays.ply_half[item + 1]
            arrays.ply_following[item] = arrays.ply_following[item + 1] if goes_on else item + 1


@standalone_routine
def add_ply_forces(plies, arrays, chunk, first, last):
    """Add the contact forces between plies to the nodes ``first`` to ``last`` of a chunk.

    Return the energy of the springs of these points, and what sliding and damping took [J].
    """
    add_own_forces(plies.data, arrays, chunk, first, last)
    add_forces_on_facets(arrays, arrays.ply_start[chunk], arrays.ply_start[chunk + 1])
    sums = arrays.ply_sums[chunk]
    return sums[STORED], sums[LOST], sums[DAMPED]


@span_part
def add_own_forces(data, arrays, chunk, first, last):
    """Add the forces on the points of a chunk."""
    rows = arrays.ply_rows
    force_x, force_y, force_z = arrays.force[0], arrays.force[1], arrays.force[2]
    for half in range(chunk * HALVES_OF_CHUNK, (chunk + 1) * HALVES_OF_CHUNK):
        if arrays.ply_acts[half]:
            begin = first + (half - chunk * HALVES_OF_CHUNK) * HALF
            at = half // 2 * data.row_size + half % 2 * HALF + FORCE * SPAN
            for i in range(min(HALF, last - begin)):
                node, place = np.uint64(begin + i), np.uint64(at + i)
                force_x[node] += rows[place]
                force_y[node] += rows[place + NEXT_ROW]
                force_z[node] += rows[place + SECOND_ROW]


@span_part
def add_forces_on_facets(arrays, begin, end):
    """Take the items of a list of points off the nodes that they press on."""
    rows, weight = arrays.ply_rows, arrays.ply_weight
    force_x, force_y, force_z = arrays.force[0], arrays.force[1], arrays.force[2]
    item = begin
    while item < end:
        following = arrays.ply_following[item]
        if arrays.ply_acts[arrays.ply_half[item]]:
            for k in range(item, following):
                place, node = np.uint64(arrays.ply_place[k]), np.uint64(arrays.ply_node[k])
                part = weight[k]
                force_x[node] -= part * rows[place]
                force_y[node] -= part * rows[place + NEXT_ROW]
                force_z[node] -= part * rows[place + SECOND_ROW]
        item = following
