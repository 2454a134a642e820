"""Share of a point's area that lies over the facets of the other ply, at rims.

A point stands for the area around it. Where a rim runs through this area, only the part over the
facets carries: the stiffness of the point is taken times its share. The area is sampled, four
samples in the quarter of every element around the point, each of them covered from 0 to 1 while the
rim runs through its own part. The share is linear in how far the plies have slid since the spring
was made, and the force that goes with it, -½ k gap² ∂share/∂x, is part of the spring: what is left
to be booked at the next refresh is small of second order.
"""

from __future__ import annotations

import math

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.interfaces.springs import corners_of, frame_of, minus, vector_of, weighted
from lcmchain.jit import equation, inlined_routine, ordered_span_routine

# Distances to two rim edges that meet in a corner count as the same up to this part.
TIE = 1e-6
# Samples in a quarter of an element, as parts of its edges from the corner at the point.
NEAR, FAR = 0.125, 0.375
# Samples of a point lie nearer to it than this multiple of its longest edge, with the part of a rim
# that covers them in part, also where elements are sheared.
AREA_REACH = 1.1


@equation
def sample_weights(corner, a, b):
    """Return weights of an element's corners at the parts a, b of the edges from one of them."""
    own, along, across, aside = (1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b
    if corner == 0:
        return (own, along, across, aside)
    if corner == 1:
        return (aside, own, along, across)
    if corner == 2:
        return (across, aside, own, along)
    return (along, across, aside, own)


@ordered_span_routine
def signed_distance(position, rim, first, last, origin, e1, e2, u, v):
    """Return the distance of (u, v) from the nearest rim edge [m] and its direction inwards.

    Positive inside. u, v : coordinates along e1, e2 from the origin.
    """
    best, best_off, found, grad_u, grad_v = math.inf, -1.0, math.inf, 0.0, 0.0
    for k in range(first, last):
        start = minus(vector_of(position, rim[k, 0]), origin)
        end = minus(vector_of(position, rim[k, 1]), origin)
        su, sv = dot(start, e1), dot(start, e2)
        du, dv = dot(end, e1) - su, dot(end, e2) - sv
        length2 = du * du + dv * dv
        if length2 <= 0.0:
            continue
        length = math.sqrt(length2)
        part = min(max(((u - su) * du + (v - sv) * dv) / length2, 0.0), 1.0)
        fu, fv = u - su - part * du, v - sv - part * dv
        distance = math.sqrt(fu * fu + fv * fv)
        across = (du * (v - sv) - dv * (u - su)) / length
        # at a corner of the rim the edge that faces the point says on which side it lies
        tie = TIE * length
        if distance < best - tie or (distance < best + tie and abs(across) > best_off):
            best, best_off = min(distance, best), abs(across)
            side = 1.0 if across >= 0.0 else -1.0
            found = side * distance
            if distance > tie:
                grad_u, grad_v = side * fu / distance, side * fv / distance
            else:
                grad_u, grad_v = -dv / length, du / length
    return found, grad_u, grad_v


@inlined_routine
def share_over(position, data, point, facet):
    """Return the share of a point over the facets, and its gradient along the facet [1/m]."""
    first, last = data.rim_start[facet], data.rim_start[facet + 1]
    if first == last:
        return 1.0, (0.0, 0.0, 0.0)
    corners = corners_of(position, data.facet_node, facet)
    e1, e2, _ = frame_of(corners)
    # further from all rims than its area reaches, a point lies over the facets or beside them
    away = minus(vector_of(position, point), corners[0])
    u, v = dot(away, e1), dot(away, e2)
    distance, _, _ = signed_distance(position, data.rim, first, last, corners[0], e1, e2, u, v)
    if abs(distance) > AREA_REACH * data.spacing[point]:
        return 1.0 if distance > 0.0 else 0.0, (0.0, 0.0, 0.0)
    share, share_u, share_v = 0.0, 0.0, 0.0
    for k in range(data.ring.shape[1]):
        around = data.ring[point, k]
        if around < 0:
            continue
        own = corners_of(position, data.facet_node, around)
        corner = data.ring_corner[point, k]
        size = 0.25 * data.facet_edge[around]
        part = 0.25 * data.ring_part[point, k]  # of a sample
        for sample in range(4):
            a = NEAR if sample % 2 == 0 else FAR
            b = NEAR if sample < 2 else FAR
            w = sample_weights(corner, a, b)
            away = minus(weighted(w, own[0], own[1], own[2], own[3]), corners[0])
            u, v = dot(away, e1), dot(away, e2)
            distance, grad_u, grad_v = signed_distance(
                position, data.rim, first, last, corners[0], e1, e2, u, v
            )
            covered = 0.5 + distance / size
            if covered >= 1.0:
                share += part
            elif covered > 0.0:
                share += part * covered
                share_u += part * grad_u / size
                share_v += part * grad_v / size
    # up to rounding: a rim of the point on the rim of the facets
    if share > 1.0 - 1e-9:
        return 1.0, (0.0, 0.0, 0.0)
    return share, plus(share_u, e1, scaled(share_v, e2))
