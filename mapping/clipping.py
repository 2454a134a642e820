"""Overlap of a polygon with a triangle in a plane.

The triangle has its first corner at the origin, the second at (length, 0) and the third at
(tip_x, tip_y), tip_y > 0.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import equation

# Two polygons and the corners that each can have: the four of a cell and one per edge of the
# triangle, doubled where the cell has a reflex corner. One array for both: the compiler counts
# references to every array that it hands to a function.
WORK = (2, 24, 2)


@equation
def clip(work, count, length, tip_x, tip_y):
    """Clip a polygon, counter-clockwise, by the triangle (Sutherland and Hodgman 1974).

    Returns the area of what remains and its centroid. A reflex corner of the polygon leaves edges
    that run to and fro and enclose nothing. A polygon inside of the triangle is measured as it is,
    and a side of the triangle that has it on its outside ends the matter.

    work : shape :data:`WORK`; the first ``count`` corners of its first polygon are the given ones.
    """
    low_1, low_2, low_3 = np.inf, np.inf, np.inf
    high_1, high_2, high_3 = -np.inf, -np.inf, -np.inf
    for k in range(count):
        x, y = work[0, k, 0], work[0, k, 1]
        right = (tip_x - length) * y - tip_y * (x - length)
        left = tip_y * x - tip_x * y
        low_1, high_1 = min(low_1, y), max(high_1, y)
        low_2, high_2 = min(low_2, right), max(high_2, right)
        low_3, high_3 = min(low_3, left), max(high_3, left)
    of = 0
    if high_1 <= 0.0 or high_2 <= 0.0 or high_3 <= 0.0:
        count = 0
    # A side that cuts nothing off leaves the polygon as it is.
    if low_1 < 0.0:
        count, of = cut(work, of, count, 0.0, 0.0, 1.0), 1 - of
    if low_2 < 0.0:
        count, of = cut(work, of, count, length, -tip_y, tip_x - length), 1 - of
    if low_3 < 0.0:
        count, of = cut(work, of, count, 0.0, tip_y, -tip_x), 1 - of
    return area_and_centroid(work, of, count)


@equation
def area_and_centroid(work, of, count):
    if count < 3:
        return 0.0, 0.0, 0.0
    area, mx, my = 0.0, 0.0, 0.0
    ax, ay = work[of, 0, 0], work[of, 0, 1]
    bx, by = work[of, 1, 0] - ax, work[of, 1, 1] - ay
    for k in range(2, count):
        cx, cy = work[of, k, 0] - ax, work[of, k, 1] - ay
        part = bx * cy - by * cx
        area += part
        mx += part * (bx + cx)
        my += part * (by + cy)
        bx, by = cx, cy
    if area <= 0.0:
        return 0.0, 0.0, 0.0
    return 0.5 * area, ax + mx / (3.0 * area), ay + my / (3.0 * area)


@equation
def cut(work, of, count, from_x, a, b):
    """Write what lies where a (x - from_x) + b y >= 0 to the other polygon; return its corners."""
    if count < 3:
        return 0
    px, py = work[of, count - 1, 0], work[of, count - 1, 1]
    before = a * (px - from_x) + b * py
    left = 0
    for k in range(count):
        x, y = work[of, k, 0], work[of, k, 1]
        here = a * (x - from_x) + b * y
        if (here > 0.0 and before < 0.0) or (here < 0.0 and before > 0.0):
            share = before / (before - here)
            work[1 - of, left, 0] = px + share * (x - px)
            work[1 - of, left, 1] = py + share * (y - py)
            left += 1
        if here >= 0.0:
            work[1 - of, left, 0], work[1 - of, left, 1] = x, y
            left += 1
        px, py, before = x, y, here
    return left
