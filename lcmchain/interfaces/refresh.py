"""What happens to the springs between plies now and then: facets, springs and slips anew.

Springs are frozen at the middle of their time: at the positions that the nodes will have half an
interval later. Taken where the nodes are, the normals of a curved interface would lag behind the
sliding by half of it, and push it or brake it.

Springs are renewed when the fastest of the points that press, or soon will, has slid by a part of
an edge. What that changes in the energy they store is booked. It is taken half a step before: the
energy ½ v₋·M v₊ + U that central differences conserve changes by ΔU - ½ dt v₋·Δf, which is ΔU
there.

The depth of a point that presses goes to zero: at each refresh a part of it is added to an offset
that the spring feels as further depth (augmented Lagrange multipliers, as for tools in
:mod:`lcmchain.effects.contact_depth`). Without it a stack under pressure is thinner by the depth of
each interface, a tenth of a ply at 0.5 MPa. Depths and offsets are averaged over the points around:
points of both faces are held, more than meshes that do not match can follow one by one, and what
they cannot follow would grow.

The slopes of the facets' corners, which say how the smooth surface curves, follow more slowly, by a
part of the way now and then. Taken anew they hold what the plies' vibrations were at that moment,
answer these with a delay, and feed them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from lcmchain.elements.blocks import SPAN, put_vector, vector_at
from lcmchain.elements.vectors import cross, dot, plus, scaled
from lcmchain.interfaces.forces import (
    APPROACH,
    APPROACHED,
    BOOKED,
    DEEPEST,
    DEEPEST_POINT,
    FASTEST,
    LAST_APPROACH,
    LAST_STEPS,
    NORMAL_STEPS_LEFT,
    REFRESHES,
    REFRESHES_LEFT,
    STEPS_ALLOWED,
    STEPS_LEFT,
    TOO_DEEP,
    WAY_SINCE_SEARCH,
    leave_rest,
    list_points,
)
from lcmchain.interfaces.law import carried, load_memory, memory_size, store_memory
from lcmchain.interfaces.rims import share_over
from lcmchain.interfaces.rows import (
    AREA,
    BASELINE,
    HELD,
    INTERFACE,
    LAST_DAMPING,
    LAST_DEPTH,
    LAST_GAP,
    MOVED,
    NORMAL,
    OFFSET,
    PATH,
    REACH,
    RIM,
    SHARE,
    SLIP,
    START,
    STIFFNESS,
    WAY,
    WEIGHT,
    all_parameters,
    memory_rows,
    row_start,
    spring_energy,
    sum_of_laws,
    touch_of,
)
from lcmchain.interfaces.search import (
    GIVEN_UP,
    HELD_FACING,
    HELD_GAPING,
    ON_EDGE,
    beyond_edges,
    build_grid,
    cost_of,
    furthest_outside,
    is_around,
    is_triangle,
    looks_at,
    nearest_facet,
    no_grid,
    walk,
)
from lcmchain.interfaces.springs import (
    coordinates_of,
    corners_of,
    facet_slopes,
    frame_of,
    minus,
    smooth_normal,
    spring_at,
    tangential,
    turned,
    unit,
    vector_of,
)
from lcmchain.interfaces.surfaces import NONE
from lcmchain.jit import equation, inlined_routine, kernel_part, ordered_span_routine, routine

# Steps between two refreshes: at most, and by how much they may grow from one to the next.
MOST_STEPS, GROWTH = 100, 2
# Refreshes between two searches among all facets, at most; and the way of the fastest point, as a
# part of the reach of the search, after which it is due.
REFRESHES_PER_SEARCH, SEARCH_WAY = 20, 0.5
# Steps between two refreshes at most, where plies may meet that nothing joins: a pressure that
# comes on at once moves them before their speed tells it. 1 bar moves 1 kg/m² by half a millimetre
# in 20 steps of 5 µs.
MOST_STEPS_APART = 20
# The largest part of a depth that goes at a refresh.
LARGEST_PART = 0.2
# How much faster than depths go to zero offsets become those of the points around.
SMOOTHING = 2.0
# Points slide on a ply that they press, or on which a law acts, or that is nearer than this part of
# half the thickness of the thinner one. Plies that lie loosely on each other press here and there
# and now and then; counted by that alone, they would hardly slide.
TOUCHING = 0.2


@routine
def refresh(data, laws, arrays, dt_last, dt):
    """Renew all springs, and return what that puts into them [J]."""
    counters, clock = arrays.ply_counters, arrays.ply_clock
    if counters[NORMAL_STEPS_LEFT] <= 0:
        renew_slopes(data, arrays, data.slope_part if counters[REFRESHES] > 0 else 1.0)
        counters[NORMAL_STEPS_LEFT] = data.slope_steps
    for point in range(arrays.mass.size):
        at = row_start(data, point)
        arrays.ply_held[point, 0] = arrays.ply_rows[at + LAST_DEPTH * SPAN]
        arrays.ply_held[point, 1] = arrays.ply_rows[at + HELD * SPAN]
    arrays.ply_touching[:] = arrays.ply_facet
    look_ahead(arrays, 0.5 * counters[LAST_STEPS] * dt)
    everywhere = counters[REFRESHES_LEFT] <= 0 or clock[WAY_SINCE_SEARCH] > SEARCH_WAY * data.reach
    if everywhere:
        grid = build_grid(arrays.ply_ahead, data, arrays.ply_slope)
        counters[REFRESHES_LEFT] = REFRESHES_PER_SEARCH
        clock[WAY_SINCE_SEARCH], clock[APPROACHED] = 0.0, 0.0
    else:
        grid = no_grid()
    first, second, third, fourth, fifth, sixth = laws
    apart = are_apart(data, arrays.ply_touching)
    renew_points(
        data, first, second, third, fourth, fifth, sixth,
        arrays, everywhere, grid, apart, dt_last, dt,
    )  # fmt: skip
    list_points(data, arrays)
    for span in range(arrays.ply_interface.shape[0]):
        arrays.ply_acts[span] = arrays.ply_interface[span, 0] <= arrays.ply_interface[span, 1]

    booked, steps, fastest, deepest = 0.0, float(MOST_STEPS), 0.0, 0.0
    approached = 0.0
    for chunk in range(arrays.ply_sums.shape[0]):
        sums = arrays.ply_sums[chunk]
        booked += sums[BOOKED]
        steps = min(steps, sums[STEPS_ALLOWED])
        fastest = max(fastest, sums[FASTEST])
        approached = max(approached, sums[APPROACH] * dt)
        if sums[DEEPEST] > max(deepest, 1.0):
            deepest = sums[DEEPEST]
            counters[TOO_DEEP] = int(sums[DEEPEST_POINT]) + 1
    steps = min(steps, GROWTH * counters[LAST_STEPS] + 1.0)
    if apart:
        steps = min(steps, float(MOST_STEPS_APART))
    counters[REFRESHES_LEFT] -= 1
    # two plies that come towards each other are found before they touch
    way = approached + max(approached - clock[LAST_APPROACH], 0.0)
    until_search = (SEARCH_WAY * data.nearest - clock[APPROACHED]) / max(way, 1e-30)
    if until_search < steps:
        steps = until_search
        counters[REFRESHES_LEFT] = 0
    counters[LAST_STEPS] = max(int(steps), 1)
    counters[STEPS_LEFT] = counters[LAST_STEPS]
    clock[LAST_APPROACH] = approached
    clock[APPROACHED] += way * counters[LAST_STEPS]
    counters[NORMAL_STEPS_LEFT] -= counters[LAST_STEPS]
    counters[REFRESHES] += 1
    clock[WAY_SINCE_SEARCH] += fastest * counters[LAST_STEPS] * dt
    return booked


@routine
def are_apart(data, facing):
    """Tell whether plies may meet that no points join, directly or by plies between them.

    facing : (node_count,) facet that each point faces, -1 without.
    """
    plies = data.interface.shape[0]
    group = np.arange(plies)
    for point in range(facing.size):
        if facing[point] >= 0:
            own, other = group[data.ply[point]], group[data.facet_ply[facing[point]]]
            if own != other:
                for ply in range(plies):
                    if group[ply] == other:
                        group[ply] = own
    for ply in range(plies):
        for other in range(ply):
            if data.interface[ply, other] >= 0 and group[ply] != group[other]:
                return True
    return False


@ordered_span_routine
def look_ahead(arrays, time):
    """Write where the nodes will be after a time [s]."""
    for d in range(3):
        for node in range(arrays.mass.size):
            way = time * arrays.velocity[d, node]
            arrays.ply_ahead[d, node] = arrays.position[d, node] + way


@routine
def renew_slopes(data, arrays, part):
    """Take the normals of the nodes, and move the slopes of the facets' corners on to theirs.

    part : of the way, 1 at the start.
    """
    position, normals = arrays.position, arrays.ply_normal
    rim_normals = np.empty_like(normals)
    for node in range(normals.shape[0]):
        x = vector_of(position, node)
        total = (0.0, 0.0, 0.0)
        for k in range(data.ring.shape[1]):
            facet = data.ring[node, k]
            if facet < 0:
                continue
            corner = data.ring_corner[node, k]
            following, before = (corner + 1) % 4, (corner + 3) % 4
            if data.facet_node[facet, following] == data.facet_node[facet, corner]:
                following = (corner + 2) % 4  # the repeated node of a triangle
            if data.facet_node[facet, before] == data.facet_node[facet, corner]:
                before = (corner + 2) % 4
            a = minus(vector_of(position, data.facet_node[facet, following]), x)
            b = minus(vector_of(position, data.facet_node[facet, before]), x)
            total = plus(1.0, cross(a, b), total)
        total = unit(total)
        normals[node, 0], normals[node, 1], normals[node, 2] = total[0], total[1], total[2]
    # at a rim this is the normal half way to the nodes inside: on from theirs, as far again
    for node in range(normals.shape[0]):
        count = 0
        total = (0.0, 0.0, 0.0)
        for k in range(data.inner.shape[1]):
            other = data.inner[node, k]
            if other >= 0:
                count += 1
                total = plus(1.0, (normals[other, 0], normals[other, 1], normals[other, 2]), total)
        for d in range(3):
            rim_normals[node, d] = normals[node, d]
            if count > 0:
                rim_normals[node, d] += normals[node, d] - total[d] / count
    for facet in range(data.facet_node.shape[0]):
        facet_slopes(position, data.facet_node, rim_normals, facet, arrays.ply_slope, part)


@kernel_part
def renew_points(
    data, first, second, third, fourth, fifth, sixth,
    arrays, everywhere, grid, apart, dt_last, dt,
):  # fmt: skip
    """Renew the springs of all points; booked energy, allowed steps and depths go to the sums."""
    for chunk in prange(arrays.ply_sums.shape[0]):
        laws = (first, second, third, fourth, fifth, sixth)
        renew_chunk(data, laws, arrays, everywhere, grid, apart, dt_last, dt, chunk)


@ordered_span_routine
def renew_chunk(data, laws, arrays, everywhere, grid, apart, dt_last, dt, chunk):
    """Renew the springs of a chunk of nodes."""
    sums = arrays.ply_sums[chunk]
    sums[BOOKED], sums[FASTEST], sums[DEEPEST], sums[APPROACH] = 0.0, 0.0, 0.0, 0.0
    sums[STEPS_ALLOWED] = float(MOST_STEPS)
    for point in range(arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]):
        renew_point(data, laws, arrays, everywhere, grid, dt_last, dt, point, sums)
        if arrays.ply_facet[point] < 0:
            # the outer face of a stack meets nothing, unless there are plies apart from it
            outside = arrays.ply_touching[data.partner[point]] >= 0
            if apart or not outside:
                across, along = approach(data, arrays, point)
                searched = across + along * (data.nearest / data.reach)
                sums[APPROACH] = max(sums[APPROACH], searched)
                if not outside:
                    sums[FASTEST] = max(sums[FASTEST], across + along)


@inlined_routine
def renew_point(data, laws, arrays, everywhere, grid, dt_last, dt, point, sums):
    """Find the facet of a point, freeze its spring, and carry what the laws keep over."""
    position, held = arrays.ply_ahead, arrays.ply_facet[point]
    rows, at = arrays.ply_rows, row_start(data, point)
    if held < 0 and not everywhere:
        return
    none = (0.0, 0.0, 0.0)
    presses = False
    before = touch_of(rows, at, none, none, dt_last)
    if held >= 0:
        before = close_spring(data, laws, arrays, rows, at, point, held, dt_last, sums)
        presses = before.gap < rows[at + HELD * SPAN]

    facet, most, spring = find_facet(data, arrays, everywhere, presses, grid, point)
    w, normal, offset, gap = spring
    share, slope = 1.0, none
    if facet >= 0:
        share, slope = share_over(position, data, point, facet)
        # what hangs down beyond a rim is beside the other ply, not in it
        below = -gap > data.depth[data.ply[point], data.facet_ply[facet]]
        if most > ON_EDGE and (share <= 0.0 or below):
            facet = NONE
    arrays.ply_facet[point] = facet
    if facet < 0:
        for row in range(memory_rows(laws)[6]):
            if row < SLIP or row > PATH:  # how far it has slid is not forgotten
                rows[at + row * SPAN] = 0.0
        return

    ply, other = data.ply[point], data.facet_ply[facet]
    interface = data.interface[ply, other]
    for k in range(4):
        rows[at + (WEIGHT + k) * SPAN] = w[k]
    put_vector(rows, NORMAL, at, normal)
    put_vector(rows, RIM, at, slope)
    rows[at + SHARE * SPAN] = 1.0
    if share != 1.0:
        ahead = way_to_facet(position, data.facet_node, facet, rows, at, point)
        rows[at + SHARE * SPAN] = share - dot(slope, ahead)
    r = way_to_facet(arrays.position, data.facet_node, facet, rows, at, point)
    gap = dot(normal, r) + offset
    if most <= ON_EDGE:
        # held, it may go on through a thin ply, whose facet goes on pushing it back
        deepest = max(data.depth[ply, ply], data.depth[other, other])
        sums[DEEPEST], sums[DEEPEST_POINT] = deeper(
            sums[DEEPEST], sums[DEEPEST_POINT], -gap / deepest, point
        )
    # what is found inside another ply starts there without force, and only comes out of it
    lies = max(-gap, 0.0)
    fresh = held < 0 or data.facet_ply[held] != other
    baseline = lies if fresh else min(rows[at + BASELINE * SPAN], lies)
    depth, offset_held = -(gap + baseline), 0.0
    if presses and not fresh:
        offset_held = held_offset(data, arrays, point, other, depth, dt)
    rows[at + BASELINE * SPAN] = baseline
    rows[at + LAST_DEPTH * SPAN] = depth
    rows[at + HELD * SPAN] = offset_held
    rows[at + OFFSET * SPAN] = offset + baseline - offset_held
    rows[at + STIFFNESS * SPAN] = 0.5 * data.penalty[interface] * data.area[point]
    rows[at + AREA * SPAN] = 0.5 * data.area[point]
    rows[at + REACH * SPAN] = data.near[ply, other] if offset_held == 0.0 else math.inf
    rows[at + INTERFACE * SPAN] = interface
    start, _ = way_along(arrays.position, data, arrays.ply_slope, facet, rows, at, point)
    put_vector(rows, START, at, start)
    if not presses or fresh:
        rows[at + LAST_DAMPING * SPAN] = 0.0

    look_at_motion(data, arrays, rows, at, point, facet, depth + offset_held, dt_last, dt, sums)

    after = touch_of(rows, at, r, none, dt_last)
    carry_over(laws, all_parameters(laws, interface), rows, at, before, after, fresh)
    if within_reach(rows, at, after.gap):
        sums[BOOKED] += energy_before(
            laws, arrays.position, arrays.velocity, data.facet_node, facet, rows, at, dt_last, point
        )


@inlined_routine
def close_spring(data, laws, arrays, rows, at, point, held, dt_last, sums):
    """Book out what the spring of a point stores, and how far the point has slid on it.

    Return the point as the laws see it on that spring, at the present positions.
    """
    r = way_to_facet(arrays.position, data.facet_node, held, rows, at, point)
    before = touch_of(rows, at, r, (0.0, 0.0, 0.0), dt_last)
    if rests(data, arrays, point):  # the renewed spring may have it within its reach
        v = way_to_facet(arrays.velocity, data.facet_node, held, rows, at, point)
        put_vector(rows, WAY, at, r)
        put_vector(rows, MOVED, at, scaled(dt_last, v))
        leave_rest(laws, rows, at, dt_last)
    if within_reach(rows, at, before.gap):
        sums[BOOKED] -= energy_before(
            laws, arrays.position, arrays.velocity, data.facet_node, held, rows, at, dt_last, point
        )
    if touches(data, rows, at, before.gap, point, held):
        slip, path = slip_of(arrays.position, data, arrays.ply_slope, held, rows, at, point)
        put_vector(rows, SLIP, at, slip)
        rows[at + PATH * SPAN] = path
    return before


@inlined_routine
def look_at_motion(data, arrays, rows, at, point, facet, depth, dt_last, dt, sums):
    """Find how many steps a spring may stay as it is, and how fast the point comes near a ply.

    depth : of the point, with what is held [m].
    """
    ply, other = data.ply[point], data.facet_ply[facet]
    normal = vector_at(rows, NORMAL, at)
    # until the point has slid far enough, while it presses
    relative = way_to_facet(arrays.velocity, data.facet_node, facet, rows, at, point)
    speed = tangential(relative, normal)
    allowed = data.slide * data.facet_edge[facet] / max(math.sqrt(dot(speed, speed)), 1e-30)
    closing = -dot(relative, normal)
    sums[FASTEST] = max(sums[FASTEST], abs(closing))
    if data.inner[point, 0] >= 0:
        # a rim that slides comes over points of the other ply, which may be at rest
        sums[FASTEST] = max(sums[FASTEST], approach_along(data, point, speed))
    apart = -depth
    rows[at + LAST_GAP * SPAN] = apart + dt_last * closing
    if apart > data.near[ply, other]:
        allowed = max(allowed, (apart - data.near[ply, other]) / max(closing, 1e-30))
    sums[STEPS_ALLOWED] = min(sums[STEPS_ALLOWED], allowed / dt)


@equation
def within_reach(rows, at, gap):
    """Tell whether a point may have stored energy in its last step; one with a depth held may.

    gap : that the laws see now [m].
    """
    return min(gap, rows[at + LAST_GAP * SPAN]) < rows[at + REACH * SPAN]


@equation
def rests(data, arrays, point):
    """Tell whether the span of a point rested in the last step."""
    return not arrays.ply_acts[data.lane[point] // SPAN]


@inlined_routine
def approach(data, arrays, point):
    """Return the speeds at which a point that faces nothing may come near a ply [m/s].

    The one is that across its own ply. Along it, a point is found beyond a rim as soon as its
    own area reaches it: what makes half an edge of way counts as the reach of the search.
    """
    partner = data.partner[point]
    across = minus(vector_of(arrays.position, point), vector_of(arrays.position, partner))
    v, normal = vector_of(arrays.velocity, point), unit(across)
    return abs(dot(v, normal)), approach_along(data, point, tangential(v, normal))


@equation
def approach_along(data, point, v):
    """Return what a velocity along the plies [m/s] counts for the search."""
    slower = data.reach / (0.5 * data.spacing[point])
    return slower * math.sqrt(dot(v, v))


@ordered_span_routine
def carry_over(laws, values, rows, at, before, after, fresh):
    """Carry the memory of all laws over from the touch before to the one after."""
    first, second, third, fourth, fifth, sixth = laws
    starts = memory_rows(laws)
    carry_one(first, values[0], rows, at + starts[0] * SPAN, before, after, fresh)
    carry_one(second, values[1], rows, at + starts[1] * SPAN, before, after, fresh)
    carry_one(third, values[2], rows, at + starts[2] * SPAN, before, after, fresh)
    carry_one(fourth, values[3], rows, at + starts[3] * SPAN, before, after, fresh)
    carry_one(fifth, values[4], rows, at + starts[4] * SPAN, before, after, fresh)
    carry_one(sixth, values[5], rows, at + starts[5] * SPAN, before, after, fresh)


@equation
def carry_one(law, values, rows, place, before, after, fresh):
    """Carry the memory of a law over."""
    if fresh:
        for k in range(memory_size(law)):
            rows[place + k * SPAN] = 0.0
    memory = load_memory(law, rows, place)
    if fresh:
        memory = carried(law, values, memory, after, after, 0.0)
    else:
        memory = carried(law, values, memory, before, after, 1.0)
    store_memory(law, memory, rows, place)


@inlined_routine
def find_facet(data, arrays, everywhere, presses, grid, point):
    """Return the facet that a point faces, or -1, how far beyond its edges it lies, and its spring.

    The spring as of :func:`.springs.spring_at`.
    """
    position, slopes = arrays.ply_ahead, arrays.ply_slope
    x, ply = vector_of(position, point), data.ply[point]
    facet, cost, most = arrays.ply_facet[point], math.inf, 0.0
    spring = ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)
    inside = False
    if facet >= 0:
        at = row_start(data, point)
        w0, w1 = arrays.ply_rows[at + WEIGHT * SPAN], arrays.ply_rows[at + (WEIGHT + 1) * SPAN]
        w2, w3 = (
            arrays.ply_rows[at + (WEIGHT + 2) * SPAN],
            arrays.ply_rows[at + (WEIGHT + 3) * SPAN],
        )
        xi, eta = coordinates_of(is_triangle(data, facet), w0, w1, w2, w3)
        facet, xi, eta = walk(position, data, slopes, facet, xi, eta, x)
        beside, hanging = beyond_edges(data, facet, xi, eta)
        most = max(beside, hanging)
        furthest = furthest_outside(data, point, facet)
        leaves = beside > HELD_GAPING or hanging > furthest
        leaves = leaves or (data.facet_ply[facet] == ply and is_around(data, point, facet))
        spring = spring_at(position, data.facet_node, slopes, facet, xi, eta, x)
        _, normal, _, gap = spring
        reach = GIVEN_UP * data.far[ply, data.facet_ply[facet]]
        facing = looks_at(position, data, point, normal, HELD_FACING)
        if leaves or gap > reach or not facing:
            facet = NONE
        else:
            # no ply has room between the two
            inside = most <= ON_EDGE and (presses or gap < data.thinnest)
            cost = cost_of(data, gap, beside, hanging, furthest)
    if everywhere and not inside:
        other, other_xi, other_eta, other_cost = nearest_facet(position, data, slopes, point, grid)
        if other_cost < cost:
            facet = other
            most = max(*beyond_edges(data, facet, other_xi, other_eta))
            spring = spring_at(position, data.facet_node, slopes, facet, other_xi, other_eta, x)
    return facet, most, spring


@inlined_routine
def held_offset(data, arrays, point, other, depth, dt):
    """Return the offset of a point that presses, at a depth without its offset [m]."""
    total_depth, total_held, count = 0.0, 0.0, 0
    for k in range(data.ring.shape[1]):
        facet = data.ring[point, k]
        if facet >= 0:
            for c in range(4):
                node = data.facet_node[facet, c]
                touching = arrays.ply_touching[node]
                if touching >= 0 and data.facet_ply[touching] == other:
                    total_depth += arrays.ply_held[node, 0]
                    total_held += arrays.ply_held[node, 1]
                    count += 1
    held, ply = arrays.ply_held[point, 1], data.ply[point]
    # the smaller of two depths: an offset that follows each of them would feed a vibration
    lasting = min(depth, total_depth / count)
    relative = 1.0 + data.stiffening * max(depth + held, 0.0)
    steps = max(data.depth_steps, data.depth_time[ply, other] / dt)
    share = arrays.ply_counters[LAST_STEPS] / steps
    part = min(relative * share, LARGEST_PART)
    change = min(SMOOTHING * share, LARGEST_PART) * (total_held / count - held)
    if depth < 0.0:
        change += part * depth
    elif lasting > data.depth_left * data.depth[ply, other]:
        change += part * lasting
    # neither the offset nor the pressure may become negative
    return max(held + max(change, -(depth + held)), 0.0)


@equation
def deeper(deepest, deepest_point, depth, point):
    """Return the deeper of two points."""
    if depth > deepest:
        return depth, float(point)
    return deepest, deepest_point


@equation
def way_to_facet(vectors, facet_node, facet, rows, at, point):
    """Return a vector (3, node_count) at a point, less the weighted ones of its facet's corners."""
    total = vector_of(vectors, point)
    for k in range(4):
        corner = vector_of(vectors, facet_node[facet, k])
        total = plus(-rows[at + (WEIGHT + k) * SPAN], corner, total)
    return total


@equation
def touches(data, rows, at, gap, point, facet):
    """Tell whether a point lies on its facet, for its slip, at a gap that the laws see [m]."""
    ply, other = data.ply[point], data.facet_ply[facet]
    near = max(data.near[ply, other], TOUCHING * data.depth[ply, other])
    return gap < max(rows[at + HELD * SPAN], near)


@ordered_span_routine
def way_along(position, data, slopes, facet, rows, at, point):
    """Return the way to a point along its facet as that lies now [m], and the normal there.

    By the normal of the spring, which is frozen, a facet that turns would seem to slide: the smooth
    surface lies off it.
    """
    facet_node = data.facet_node
    first, second = rows[at + WEIGHT * SPAN], rows[at + (WEIGHT + 1) * SPAN]
    third, fourth = rows[at + (WEIGHT + 2) * SPAN], rows[at + (WEIGHT + 3) * SPAN]
    frame = frame_of(corners_of(position, facet_node, facet))
    normal = smooth_normal(frame, slopes, facet, (first, second, third, fourth))
    way = way_to_facet(position, facet_node, facet, rows, at, point)
    return tangential(way, normal), normal


@ordered_span_routine
def slip_of(position, data, slopes, facet, rows, at, point):
    """Return how far a point that touches its facet has slid by now: vector and path [m]."""
    way, normal = way_along(position, data, slopes, facet, rows, at, point)
    slid = minus(way, turned(vector_at(rows, START, at), normal))
    slip = plus(1.0, slid, turned(vector_at(rows, SLIP, at), normal))
    return slip, rows[at + PATH * SPAN] + math.sqrt(dot(slid, slid))


@ordered_span_routine
def energy_before(laws, position, velocity, facet_node, facet, rows, at, dt_last, point):
    """Return the energy of the spring and the laws of a point half a step before [J]."""
    r = way_to_facet(position, facet_node, facet, rows, at, point)
    v = way_to_facet(velocity, facet_node, facet, rows, at, point)
    moved = (dt_last * v[0], dt_last * v[1], dt_last * v[2])
    touch = touch_of(rows, at, plus(-0.5, moved, r), moved, dt_last)
    values = all_parameters(laws, int(rows[at + INTERFACE * SPAN]))
    starts = memory_rows(laws)
    return spring_energy(rows, at, touch) + sum_of_laws(laws, values, starts, rows, at, touch)[2]
