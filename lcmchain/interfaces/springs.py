"""Geometry of a point over a facet: projection, smooth surface, gap.

A facet is the bilinear face of an element. The surface that points feel is smooth: normals at the
corners, the mean of the facets around each, say how it curves between them, and it lies off the
facet by half of what the tangent planes of the corners do (exact for a quadratic surface). What the
corners' normals differ from that of the facet is kept by slopes in the facet's own frame, so that a
surface that turns as a whole needs no new ones.
Source: Boubekeur & Alexa, "Phong tessellation", ACM TOG 27 (2008), for the smooth surface;
Wriggers, "Computational Contact Mechanics", section 6.5, for the closest point.
"""

from __future__ import annotations

import math

from lcmchain.elements.vectors import cross, dot, plus, scaled
from lcmchain.jit import equation, ordered_span_routine

# Slopes of a facet: two for each corner.
SLOPES = 8
# Projection: iterations at most, and when a change of a facet coordinate is no change any more.
ITERATIONS, CONVERGED = 8, 1e-9
# Furthest facet coordinate beyond the middle at which weights are taken: half an edge outside.
FURTHEST = 2.0


@equation
def vector_of(array, i):
    """Return column i of (3, n)."""
    return (array[0, i], array[1, i], array[2, i])


@equation
def minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@equation
def unit(a):
    return scaled(1.0 / math.sqrt(dot(a, a)), a)


@equation
def tangential(a, normal):
    """Return a vector without its part along a normal."""
    return plus(-dot(a, normal), normal, a)


@equation
def turned(a, normal):
    """Return a vector of the same length without its part along a normal."""
    flat = tangential(a, normal)
    length2 = dot(flat, flat)
    factor = math.sqrt(dot(a, a) / length2) if length2 > 0.0 else 0.0
    return scaled(factor, flat)


@equation
def weighted(w, a, b, c, d):
    """Return the sum of four vectors with weights."""
    return (
        w[0] * a[0] + w[1] * b[0] + w[2] * c[0] + w[3] * d[0],
        w[0] * a[1] + w[1] * b[1] + w[2] * c[1] + w[3] * d[1],
        w[0] * a[2] + w[1] * b[2] + w[2] * c[2] + w[3] * d[2],
    )


@equation
def corners_of(position, facet_node, facet):
    """Return the positions of the corners of a facet [m]."""
    return (
        vector_of(position, facet_node[facet, 0]),
        vector_of(position, facet_node[facet, 1]),
        vector_of(position, facet_node[facet, 2]),
        vector_of(position, facet_node[facet, 3]),
    )


@equation
def frame_of(corners):
    """Return unit vectors e1, e2, n of a facet: two in its plane at the middle, and outwards."""
    p0, p1, p2, p3 = corners
    a1 = minus(plus(1.0, p1, p2), plus(1.0, p0, p3))
    a2 = minus(plus(1.0, p2, p3), plus(1.0, p0, p1))
    n = unit(cross(a1, a2))
    e1 = unit(a1)
    return e1, cross(n, e1), n


@equation
def shape(is_triangle, xi, eta):
    """Return the weights of the corners at facet coordinates.

    Those of a quadrilateral run from -1 to 1; a triangle has its own, 0 to 1 along its first and
    its third edge from the first corner.
    """
    if is_triangle:
        return (1.0 - xi - eta, xi, eta, 0.0)
    a, b, c, d = 1.0 - xi, 1.0 + xi, 1.0 - eta, 1.0 + eta
    return (0.25 * a * c, 0.25 * b * c, 0.25 * b * d, 0.25 * a * d)


@equation
def middle_of(is_triangle):
    """Return the facet coordinates of the middle."""
    return (1.0 / 3.0, 1.0 / 3.0) if is_triangle else (0.0, 0.0)


@equation
def coordinates_of(is_triangle, w0, w1, w2, w3):
    """Return the facet coordinates of weights of the corners."""
    if is_triangle:
        return w1, w2
    return w1 + w2 - w0 - w3, w2 + w3 - w0 - w1


@equation
def tangents(is_triangle, xi, eta, corners):
    """Return the derivatives of the position on a facet."""
    p0, p1, p2, p3 = corners
    if is_triangle:
        return minus(p1, p0), minus(p2, p0)
    a, b, c, d = 0.25 * (1.0 - xi), 0.25 * (1.0 + xi), 0.25 * (1.0 - eta), 0.25 * (1.0 + eta)
    return weighted((-c, c, d, -d), p0, p1, p2, p3), weighted((-a, -b, b, a), p0, p1, p2, p3)


@equation
def smooth_normal(frame, slopes, facet, w):
    """Return the unit normal of the smooth surface."""
    e1, e2, n = frame
    s1 = w[0] * slopes[facet, 0] + w[1] * slopes[facet, 2]
    s1 += w[2] * slopes[facet, 4] + w[3] * slopes[facet, 6]
    s2 = w[0] * slopes[facet, 1] + w[1] * slopes[facet, 3]
    s2 += w[2] * slopes[facet, 5] + w[3] * slopes[facet, 7]
    return unit(plus(s1, e1, plus(s2, e2, n)))


@equation
def corner_height(frame, slopes, facet, k, corner, x, normal):
    """Return how high the tangent plane of a corner lies over x along a normal [m]."""
    e1, e2, n = frame
    own = unit(plus(slopes[facet, 2 * k], e1, plus(slopes[facet, 2 * k + 1], e2, n)))
    return dot(minus(corner, x), own) * dot(own, normal)


@equation
def smooth_height(frame, slopes, facet, w, corners, x, normal):
    """Return how high the smooth surface lies over the facet at x along the normal [m]."""
    height = w[0] * corner_height(frame, slopes, facet, 0, corners[0], x, normal)
    height += w[1] * corner_height(frame, slopes, facet, 1, corners[1], x, normal)
    height += w[2] * corner_height(frame, slopes, facet, 2, corners[2], x, normal)
    height += w[3] * corner_height(frame, slopes, facet, 3, corners[3], x, normal)
    return 0.5 * height


@ordered_span_routine
def project(position, facet_node, slopes, facet, xi, eta, point):
    """Return the facet coordinates where a point [m] lies straight over the smooth surface.

    xi, eta : where to begin.
    """
    corners = corners_of(position, facet_node, facet)
    frame = frame_of(corners)
    is_triangle = facet_node[facet, 2] == facet_node[facet, 3]
    for _ in range(ITERATIONS):
        w = shape(is_triangle, xi, eta)
        x = weighted(w, corners[0], corners[1], corners[2], corners[3])
        a1, a2 = tangents(is_triangle, xi, eta, corners)
        normal = smooth_normal(frame, slopes, facet, w)
        away = minus(point, x)
        aside = plus(-dot(away, normal), normal, away)
        g11, g12, g22 = dot(a1, a1), dot(a1, a2), dot(a2, a2)
        r1, r2 = dot(a1, aside), dot(a2, aside)
        inverse = 1.0 / max(g11 * g22 - g12 * g12, 1e-12 * g11 * g22)
        change1 = inverse * (g22 * r1 - g12 * r2)
        change2 = inverse * (g11 * r2 - g12 * r1)
        # far away it need not be right, only on the right side
        xi = min(max(xi + change1, -8.0), 8.0)
        eta = min(max(eta + change2, -8.0), 8.0)
        if abs(change1) + abs(change2) < CONVERGED:
            break
    return xi, eta


@equation
def outside(is_triangle, xi, eta):
    """Return how far beyond each edge facet coordinates lie, in half edges; negative inside."""
    if is_triangle:
        return (-2.0 * eta, 2.0 * (xi + eta - 1.0), -8.0, -2.0 * xi)
    return (-1.0 - eta, xi - 1.0, eta - 1.0, -1.0 - xi)


@ordered_span_routine
def spring_at(position, facet_node, slopes, facet, xi, eta, point):
    """Return weights, normal, offset and gap of a point [m] over a facet, at facet coordinates.

    The gap is normal·(point - Σ weight corner) + offset; weights are not taken further outside
    than half an edge.
    """
    corners = corners_of(position, facet_node, facet)
    frame = frame_of(corners)
    is_triangle = facet_node[facet, 2] == facet_node[facet, 3]
    if is_triangle:
        xi, eta = min(max(xi, -0.5), 1.5), min(max(eta, -0.5), 1.5)
    else:
        xi = min(max(xi, -FURTHEST), FURTHEST)
        eta = min(max(eta, -FURTHEST), FURTHEST)
    w = shape(is_triangle, xi, eta)
    x = weighted(w, corners[0], corners[1], corners[2], corners[3])
    normal = smooth_normal(frame, slopes, facet, w)
    offset = -smooth_height(frame, slopes, facet, w, corners, x, normal)
    return w, normal, offset, dot(normal, minus(point, x)) + offset


@ordered_span_routine
def facet_slopes(position, facet_node, normals, facet, slopes, part):
    """Move the slopes of a facet to those for normals (node_count, 3) of the nodes, of any length.

    part : of the way from the present slopes; 1 takes the new ones as they are.
    """
    corners = corners_of(position, facet_node, facet)
    e1, e2, n = frame_of(corners)
    for k in range(4):
        node = facet_node[facet, k]
        own = (normals[node, 0], normals[node, 1], normals[node, 2])
        along = max(dot(own, n), 0.2 * math.sqrt(dot(own, own)))
        slopes[facet, 2 * k] += part * (dot(own, e1) / along - slopes[facet, 2 * k])
        slopes[facet, 2 * k + 1] += part * (dot(own, e2) / along - slopes[facet, 2 * k + 1])
