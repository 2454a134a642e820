"""Overlap of a polygon with a triangle in a plane.

The triangle has its first corner at the origin, the second at (length, 0) and the third at
(tip_x, tip_y), tip_y > 0.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import equation

# Corners that a clipped cell can have: its own four and one per edge of the triangle, doubled
# where the cell has a reflex corner.
WORK = (24, 2)


@equation
def clip(polygon, count, length, tip_x, tip_y, work_1, work_2):
    """Clip a polygon (count, 2), counter-clockwise, by the triangle (Sutherland and Hodgman 1974).

    Returns the area of what remains and its centroid. A reflex corner of the polygon leaves edges
    that run to and fro and enclose nothing. A polygon inside of the triangle is measured as it is,
    and a side of the triangle that has it on its outside ends the matter.

    work_1, work_2 : scratch of shape :data:`WORK`.
    """
    low_1, low_2, low_3 = polygon[0, 1], np.inf, np.inf
    high_1, high_2, high_3 = polygon[0, 1], -np.inf, -np.inf
    for k in range(count):
        x, y = polygon[k, 0], polygon[k, 1]
        right = (tip_x - length) * y - tip_y * (x - length)
        left = tip_y * x - tip_x * y
        low_1, high_1 = min(low_1, y), max(high_1, y)
        low_2, high_2 = min(low_2, right), max(high_2, right)
        low_3, high_3 = min(low_3, left), max(high_3, left)
    if high_1 <= 0.0 or high_2 <= 0.0 or high_3 <= 0.0:
        return 0.0, 0.0, 0.0
    if low_1 >= 0.0 and low_2 >= 0.0 and low_3 >= 0.0:
        return area_and_centroid(polygon, count)
    count = cut(polygon, count, 0.0, 0.0, 1.0, work_1)
    count = cut(work_1, count, length, -tip_y, tip_x - length, work_2)
    count = cut(work_2, count, 0.0, tip_y, -tip_x, work_1)
    return area_and_centroid(work_1, count)


@equation
def area_and_centroid(polygon, count):
    if count < 3:
        return 0.0, 0.0, 0.0
    area, mx, my = 0.0, 0.0, 0.0
    ax, ay = polygon[0, 0], polygon[0, 1]
    bx, by = polygon[1, 0] - ax, polygon[1, 1] - ay
    for k in range(2, count):
        cx, cy = polygon[k, 0] - ax, polygon[k, 1] - ay
        part = bx * cy - by * cx
        area += part
        mx += part * (bx + cx)
        my += part * (by + cy)
        bx, by = cx, cy
    if area <= 0.0:
        return 0.0, 0.0, 0.0
    return 0.5 * area, ax + mx / (3.0 * area), ay + my / (3.0 * area)


@equation
def cut(polygon, count, from_x, a, b, kept):
    """Keep what lies where a (x - from_x) + b y >= 0; return the number of corners."""
    if count < 3:
        return 0
    px, py = polygon[count - 1, 0], polygon[count - 1, 1]
    before = a * (px - from_x) + b * py
    left = 0
    for k in range(count):
        x, y = polygon[k, 0], polygon[k, 1]
        here = a * (x - from_x) + b * y
        if (here > 0.0 and before < 0.0) or (here < 0.0 and before > 0.0):
            share = before / (before - here)
            kept[left, 0], kept[left, 1] = px + share * (x - px), py + share * (y - py)
            left += 1
        if here >= 0.0:
            kept[left, 0], kept[left, 1] = x, y
            left += 1
        px, py, before = x, y, here
    return left
