"""Contact forces between plies in a step.

Every point over a facet has a spring that stays as it is until the next refresh: weights of the
facet's corners, normal, offset, stiffness and share. With r = x - Σ weight corner its gap is
normal·r + offset and its share of the area is linear in r too, so that its normal force has a
potential. To it come the forces of the interface's laws (:mod:`lcmchain.interfaces.law`).

What a point has lies in rows of its span of 16 nodes: one loop over the nodes of a span, which
compiles to vectors, makes their forces. A span none of whose points is near enough to act rests: of
its points the gap alone is made. Each chunk of nodes then takes the forces that act on it from a
list of points, in the order of their numbers: bit-identical for any number of threads. A run of
that list is what one point presses on in the chunk; of a point that is not near the run is left
out.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.blocks import (
    NODE_CHUNK,
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
        load_ways(arrays.position, arrays.ply_corner, first, count, rows, ways)
        near = find_gaps(rows, ways)
        rested = not arrays.ply_acts[span]
        arrays.ply_acts[span] = near > 0
        # the step in which points part still has to say what that took
        if near == 0 and rested:
            put_rows(ways, GAP, 1.0, rows, LAST_GAP, 1)
            arrays.ply_near[first : first + count] = 0
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
        hand_over_forces(arrays, rows, first, count, near)
        stored += row_sum(rows, STORED_ENERGY)
        lost += row_sum(rows, LOST_ENERGY)
        damped += row_sum(rows, DAMPED_ENERGY)
    arrays.ply_sums[chunk, STORED] = stored
    arrays.ply_sums[chunk, LOST] = lost
    arrays.ply_sums[chunk, DAMPED] = damped


@span_part
def hand_over_forces(arrays, rows, first, count, near):
    """Write the forces on those points of a span that are near enough to act to where nodes look.

    near : a bit for each point.
    """
    for i in range(count):
        point, acts = first + i, near >> i & 1
        arrays.ply_near[point] = acts
        if acts:
            force = vector_at(rows, FORCE, i)
            for d in range(3):
                arrays.ply_force[point, d] = force[d]


@ordered_span_routine
def list_points(data, arrays):
    """List for every chunk of nodes the points that press on them, in their order.

    And for every point the corners of its facet, for every span the lowest and the highest number
    of the interfaces that its points are on; the lowest is above the highest where none is.
    """
    facets, rows, corner = arrays.ply_facet, arrays.ply_rows, arrays.ply_corner
    start, run_start, interface = arrays.ply_start, arrays.ply_run_start, arrays.ply_interface
    interface[:, 0], interface[:, 1] = data.interface_count, NONE
    arrays.ply_near[:] = 0
    start[:], run_start[:] = 0, 0
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
                chunk = data.lane[corner[point, k]] // NODE_CHUNK
                start[chunk + 1] += 1
                run_start[chunk + 1] += begins_run(data, corner, point, k)
    for chunk in range(start.size - 1):
        start[chunk + 1] += start[chunk]
        run_start[chunk + 1] += run_start[chunk]
    # filled up from its start, the list of a chunk ends where that of the next one begins
    for point in range(facets.size):
        if facets[point] >= 0:
            at = row_start(data, point)
            for k in range(4):
                node = corner[point, k]
                chunk = data.lane[node] // NODE_CHUNK
                item = start[chunk]
                start[chunk] += 1
                arrays.ply_node[item] = node
                arrays.ply_weight[item] = rows[at + (WEIGHT + k) * SPAN]
                if begins_run(data, corner, point, k):
                    run = run_start[chunk]
                    run_start[chunk] += 1
                    arrays.ply_run_point[run] = point
                    arrays.ply_run_item[run] = item
    # the last run ends where the lists do
    last = start.size - 2
    arrays.ply_run_item[run_start[last]] = start[last]
    for chunk in range(start.size - 1, 0, -1):
        run_start[chunk] = run_start[chunk - 1]
    run_start[0] = 0


@equation
def begins_run(data, corner, point, k):
    """Tell whether no earlier corner of a point's facet lies in the chunk of its k-th one."""
    chunk = data.lane[corner[point, k]] // NODE_CHUNK
    for earlier in range(k):
        if data.lane[corner[point, earlier]] // NODE_CHUNK == chunk:
            return False
    return True


@standalone_routine
def add_ply_forces(plies, arrays, chunk, first, last):
    """Add the contact forces between plies to the nodes ``first`` to ``last`` of a chunk.

    Return the energy of the springs of these points, and what sliding and damping took [J].
    """
    add_own_forces(arrays, first, last)
    add_forces_on_facets(arrays, arrays.ply_run_start[chunk], arrays.ply_run_start[chunk + 1])
    sums = arrays.ply_sums[chunk]
    return sums[STORED], sums[LOST], sums[DAMPED]


@span_part
def add_own_forces(arrays, first, last):
    """Add the forces on the points of a chunk."""
    force_x, force_y, force_z = arrays.force[0], arrays.force[1], arrays.force[2]
    for node in range(first, last):
        if arrays.ply_near[node]:
            force_x[node] += arrays.ply_force[node, 0]
            force_y[node] += arrays.ply_force[node, 1]
            force_z[node] += arrays.ply_force[node, 2]


@span_part
def add_forces_on_facets(arrays, begin, end):
    """Take the forces of points off the nodes that they press on, run by run."""
    force_x, force_y, force_z = arrays.force[0], arrays.force[1], arrays.force[2]
    for run in range(begin, end):
        point = np.uint64(arrays.ply_run_point[run])
        if arrays.ply_near[point]:
            force = (
                arrays.ply_force[point, 0],
                arrays.ply_force[point, 1],
                arrays.ply_force[point, 2],
            )
            for item in range(arrays.ply_run_item[run], arrays.ply_run_item[run + 1]):
                node, weight = np.uint64(arrays.ply_node[item]), arrays.ply_weight[item]
                force_x[node] -= weight * force[0]
                force_y[node] -= weight * force[1]
                force_z[node] -= weight * force[2]
