"""Which facet a point faces: a walk from the last one, and a search among all facets in a grid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.elements.vectors import dot
from lcmchain.interfaces.springs import (
    corners_of,
    frame_of,
    middle_of,
    minus,
    outside,
    project,
    spring_at,
    vector_of,
    weighted,
)
from lcmchain.interfaces.surfaces import NONE
from lcmchain.jit import equation, inlined_routine, routine

# A point lies on a facet up to this far beyond its edge, in half edges: rounding.
ON_EDGE = 1e-7
# Facets that a walk may cross, until the next search.
LONGEST_WALK = 16
# Facet normal and the way from the point's other face to the point look at each other: -cos of at
# most 66 degrees to take up a facet. A facet that is held turns away at 90 degrees.
FACING, HELD_FACING = 0.4, 0.0
# Beyond an edge with a neighbour, that one is faced, up to what gapes between them, in half edges;
# a facet that is held is kept a little further.
GAPING, HELD_GAPING = 0.05, 0.2
# A facet that is held is given up at this multiple of the distance at which it is taken up.
GIVEN_UP = 1.3
# A ply touches itself beyond so many edges of the point and of the facet, and half thicknesses.
CREASE_EDGES, CREASE_THICKNESSES = 1.25, 4.0
# Cells of the grid for each facet, at most; their size in widest edges, beside the reach.
CELLS_PER_FACET, CELL_SIZE = 4, 0.6
# Cells along an axis beyond which places are no numbers any more.
FAR = 1e15
# Points face a facet from beside it, up to this part of the widest edge.
BESIDE, BESIDE_A_RIM = 0.1, 0.8
# What is left out before a point is projected: facets whose middle lies further aside than this
# multiple of their radius, at rims with what points may lie beside them, and further off than they
# curve: by at most this part of the radius, and away from rims by this multiple of what their
# corners and the slopes there tell.
ASIDE, CURVED, CURVED_BY_SLOPES = 1.1, 0.35, 2.0
# What a half edge beside a facet counts, in gaps of half the thickness of the thinnest ply.
BESIDE_COST = 4.0


@equation
def is_triangle(data, facet):
    return data.facet_node[facet, 2] == data.facet_node[facet, 3]


@inlined_routine
def beyond_edges(data, facet, xi, eta):
    """Return how far facet coordinates lie beyond edges with a neighbour, and beyond rims.

    In half edges, the largest of each; negative inside.
    """
    beyond = outside(is_triangle(data, facet), xi, eta)
    beside, hanging = -math.inf, -math.inf
    for k in range(4):
        if data.neighbour[facet, k] >= 0:
            beside = max(beside, beyond[k])
        else:
            hanging = max(hanging, beyond[k])
    return beside, hanging


@inlined_routine
def walk(position, data, slopes, facet, xi, eta, point):
    """Follow a point [m] over the edges of facets; return facet and facet coordinates.

    xi, eta : where to begin on the facet.
    """
    last = NONE
    xi, eta = project(position, data.facet_node, slopes, facet, xi, eta, point)
    for _ in range(LONGEST_WALK):
        beyond = outside(is_triangle(data, facet), xi, eta)
        most, following = ON_EDGE, NONE
        for k in range(4):
            across = data.neighbour[facet, k]
            if across >= 0 and across != last and beyond[k] > most:
                most, following = beyond[k], across
        if following < 0:
            break
        last, facet = facet, following
        xi, eta = middle_of(is_triangle(data, facet))
        xi, eta = project(position, data.facet_node, slopes, facet, xi, eta, point)
    return facet, xi, eta


@inlined_routine
def furthest_outside(data, point, facet):
    """Return how far outside a rim a point can still lie with a part of its area over the facet."""
    return ON_EDGE + 1.5 * data.spacing[point] / data.facet_edge[facet]


@inlined_routine
def looks_at(position, data, point, normal, facing):
    """Tell whether a point's side of its ply looks at a surface of this normal."""
    across = minus(vector_of(position, point), vector_of(position, data.partner[point]))
    return dot(across, normal) < -facing * math.sqrt(dot(across, across))


@equation
def is_around(data, point, facet):
    """Tell whether a facet lies near a point on the undeformed ply, on either face of it.

    Such facets come face to face with the point in the crease of a fold, sharper than elements are.
    """
    place = data.place
    x = vector_of(place, point)
    first = minus(x, vector_of(place, data.facet_node[facet, 0]))
    opposite = minus(x, vector_of(place, data.facet_node[facet, 2]))
    near = CREASE_EDGES * (data.spacing[point] + data.facet_edge[facet])
    near += CREASE_THICKNESSES * data.depth[data.ply[point], data.ply[point]]
    return min(dot(first, first), dot(opposite, opposite)) < near * near


@equation
def cost_of(data, gap, beside, hanging, furthest):
    """Return what speaks against a facet at a gap [m], with a point beyond its edges [half edges].

    beside, hanging : beyond edges with a neighbour and beyond rims. furthest : see
    :func:`furthest_outside`. A point keeps to a ply beyond whose rim it hangs while another one is
    further off than that is thick.
    """
    cost = abs(gap) / data.thinnest + BESIDE_COST * max(beside, 0.0)
    return cost + max(hanging, 0.0) / furthest


class Grid(NamedTuple):
    """Facets sorted into cells, for a search among all of them.

    low : (3,) lower corner of the first cell [m]. size : of the cells [m].
    cells : (3,) how many there are along x, y, z.
    start : (cell_count + 1,) where the facets of each cell begin in ``entry``.
    middle, outwards : (facet_count, 3) middles of the facets [m] and their normals.
    radius : (facet_count,) from its middle to the furthest corner [m]. curved : (facet_count,) how
        far the smooth surface may lie off the plane at its middle [m].
    """

    low: np.ndarray
    size: float
    cells: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    middle: np.ndarray
    outwards: np.ndarray
    radius: np.ndarray
    curved: np.ndarray


@routine
def no_grid():
    """Return a grid for a refresh without a search."""
    numbers, none = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    return Grid(np.zeros(3), 1.0, numbers, numbers, numbers, none, none, np.zeros(0), np.zeros(0))


@equation
def margin_of(data, facet):
    """Return how far from a facet points can lie that face it [m]: at rims also beside it."""
    at_rim = data.rim_start[facet] != data.rim_start[facet + 1]
    return data.reach + (BESIDE_A_RIM if at_rim else BESIDE) * data.widest


@equation
def extent_of(position, data, facet, d):
    """Return the least and the largest coordinate of a facet along an axis [m]."""
    least, most = math.inf, -math.inf
    for k in range(4):
        x = position[d, data.facet_node[facet, k]]
        least, most = min(least, x), max(most, x)
    return least, most


@equation
def curved_by(data, slopes, facet, radius, warp):
    """Return how far a smooth surface may lie off the plane at the middle of its facet [m].

    radius : of the facet, warp : of its corners off the plane [m].
    """
    most = CURVED * radius
    # beyond a rim points see it further outside than its corners are
    if data.rim_start[facet] == data.rim_start[facet + 1]:
        steepest = 0.0
        for k in range(4):
            slope = abs(slopes[facet, 2 * k]) + abs(slopes[facet, 2 * k + 1])
            steepest = max(steepest, slope)
        most = min(most, CURVED_BY_SLOPES * (warp + steepest * radius))
    return most


@routine
def build_grid(position, data, slopes):
    """Sort the facets into cells: into all that points can lie in which face them."""
    low = np.full(3, math.inf)
    high = np.full(3, -math.inf)
    widest = 0.0
    for facet in range(data.facet_node.shape[0]):
        margin = margin_of(data, facet)
        for d in range(3):
            least, most = extent_of(position, data, facet, d)
            low[d], high[d] = min(low[d], least - margin), max(high[d], most + margin)
            widest = max(widest, most - least)
    size = CELL_SIZE * widest + data.reach
    count = np.empty(3, dtype=np.int64)
    limit = max(CELLS_PER_FACET * data.facet_node.shape[0], 8)
    while True:
        total = 1.0
        for d in range(3):
            # of places that are no numbers any more, which a guard finds after these steps; below
            # zero where none of them is one
            wide = (high[d] - low[d]) / size
            count[d] = int(wide) + 1 if 0.0 <= wide < FAR else 1
            total *= count[d]
        if total <= limit:
            break
        size *= 1.3
    start = np.zeros(count[0] * count[1] * count[2] + 1, dtype=np.int64)
    first = np.empty(3, dtype=np.int64)
    last = np.empty(3, dtype=np.int64)
    entry = np.empty(0, dtype=np.int64)
    for turn in range(2):  # count, then write
        for facet in range(data.facet_node.shape[0]):
            margin = margin_of(data, facet)
            for d in range(3):
                least, most = extent_of(position, data, facet, d)
                first[d] = int((least - margin - low[d]) / size)
                last[d] = min(int((most + margin - low[d]) / size), count[d] - 1)
                first[d] = max(first[d], 0)
            for i in range(first[0], last[0] + 1):
                for j in range(first[1], last[1] + 1):
                    for k in range(first[2], last[2] + 1):
                        cell = (i * count[1] + j) * count[2] + k
                        if turn == 0:
                            start[cell + 1] += 1
                        else:
                            start[cell] -= 1
                            entry[start[cell]] = facet
        if turn == 0:
            for cell in range(start.size - 1):
                start[cell + 1] += start[cell]
            entry = np.empty(start[start.size - 1], dtype=np.int64)
            # each cell is filled from its end, and its start ends where it belongs
            for cell in range(start.size - 1):
                start[cell] = start[cell + 1]
    facets = data.facet_node.shape[0]
    middle, outwards = np.empty((facets, 3)), np.empty((facets, 3))
    radius, curved = np.empty(facets), np.empty(facets)
    quarter = (0.25, 0.25, 0.25, 0.25)
    for facet in range(facets):
        corners = corners_of(position, data.facet_node, facet)
        _, _, normal = frame_of(corners)
        centre = weighted(quarter, corners[0], corners[1], corners[2], corners[3])
        furthest, warp = 0.0, 0.0
        for k in range(4):
            way = minus(corners[k], centre)
            furthest = max(furthest, dot(way, way))
            warp = max(warp, abs(dot(way, normal)))
        radius[facet] = math.sqrt(furthest)
        curved[facet] = curved_by(data, slopes, facet, radius[facet], warp)
        for d in range(3):
            middle[facet, d], outwards[facet, d] = centre[d], normal[d]
    return Grid(low, size, count, start, entry, middle, outwards, radius, curved)


@inlined_routine
def nearest_facet(position, data, slopes, point, grid):
    """Return the facet that a point faces, or -1, its coordinates and its cost.

    The cost is the gap over the reach, and much more for a point beside the facet; the same cost
    goes to the first facet.
    """
    x = vector_of(position, point)
    cell = 0
    for d in range(3):
        i = int((x[d] - grid.low[d]) / grid.size)
        i = max(0, min(i, grid.cells[d] - 1))
        cell = cell * grid.cells[d] + i
    found, found_xi, found_eta, least = NONE, 0.0, 0.0, math.inf
    ply = data.ply[point]
    across = minus(x, vector_of(position, data.partner[point]))
    thickness = math.sqrt(dot(across, across))
    for k in range(grid.start[cell + 1] - 1, grid.start[cell] - 1, -1):
        facet = grid.entry[k]
        other = data.facet_ply[facet]
        if data.interface[ply, other] < 0 or (other == ply and is_around(data, point, facet)):
            continue
        middle = (grid.middle[facet, 0], grid.middle[facet, 1], grid.middle[facet, 2])
        outwards = (grid.outwards[facet, 0], grid.outwards[facet, 1], grid.outwards[facet, 2])
        away = minus(x, middle)
        height = dot(away, outwards)
        radius = grid.radius[facet]
        aside = ASIDE * radius
        if data.rim_start[facet] != data.rim_start[facet + 1]:
            aside += data.spacing[point]
        curved = grid.curved[facet]
        if height > data.far[ply, other] + curved or -height > data.depth[ply, other] + curved:
            continue
        if dot(away, away) - height * height > aside * aside:
            continue
        if dot(across, outwards) > -0.5 * FACING * thickness:
            continue
        xi, eta = middle_of(is_triangle(data, facet))
        xi, eta = project(position, data.facet_node, slopes, facet, xi, eta, x)
        beside, hanging = beyond_edges(data, facet, xi, eta)
        furthest = furthest_outside(data, point, facet)
        if beside > GAPING or hanging > furthest:
            continue
        _, normal, _, gap = spring_at(position, data.facet_node, slopes, facet, xi, eta, x)
        if gap > data.far[ply, other] or -gap > data.depth[ply, other]:
            continue
        cost = cost_of(data, gap, beside, hanging, furthest)
        if cost < least and looks_at(position, data, point, normal, FACING):
            found, found_xi, found_eta, least = facet, xi, eta, cost
    return found, found_xi, found_eta, least
