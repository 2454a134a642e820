"""Geometry of searches: closest point of a triangle, and a tree of boxes around faces of a mesh.

The closest point is the one function of all searches and distance fields. The tree tells what lies
in a box or near a point: a complete binary tree over the faces in the order of a space-filling
curve (Morton). It is filled and asked in compiled code and needs memory in proportion to the faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine, strict_equation


@strict_equation
def closest_point_of_triangle(corners, x, y, z):
    """Closest point of a triangle and what it lies on: 0 inside, 1-3 corner, 4-6 edge k to k + 1.

    Source: Ericson, Real-Time Collision Detection (2005), section 5.1.5.

    Parameters
    ----------
    corners : of the triangle [m], shape (3, 3).
    x, y, z : point [m].

    Returns
    -------
    closest point (x, y, z) [m], and the number of the face, corner or edge that it lies on.
    """
    abx = corners[1, 0] - corners[0, 0]
    aby = corners[1, 1] - corners[0, 1]
    abz = corners[1, 2] - corners[0, 2]
    acx = corners[2, 0] - corners[0, 0]
    acy = corners[2, 1] - corners[0, 1]
    acz = corners[2, 2] - corners[0, 2]
    px, py, pz = x - corners[0, 0], y - corners[0, 1], z - corners[0, 2]
    d1 = abx * px + aby * py + abz * pz
    d2 = acx * px + acy * py + acz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return corners[0, 0], corners[0, 1], corners[0, 2], 1
    px, py, pz = x - corners[1, 0], y - corners[1, 1], z - corners[1, 2]
    d3 = abx * px + aby * py + abz * pz
    d4 = acx * px + acy * py + acz * pz
    if d3 >= 0.0 and d4 <= d3:
        return corners[1, 0], corners[1, 1], corners[1, 2], 2
    px, py, pz = x - corners[2, 0], y - corners[2, 1], z - corners[2, 2]
    d5 = abx * px + aby * py + abz * pz
    d6 = acx * px + acy * py + acz * pz
    if d6 >= 0.0 and d5 <= d6:
        return corners[2, 0], corners[2, 1], corners[2, 2], 3
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w, feature = d1 / (d1 - d3), 0.0, 4
    else:
        vb = d5 * d2 - d1 * d6
        if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            v, w, feature = 0.0, d2 / (d2 - d6), 6
        else:
            va = d3 * d6 - d5 * d4
            if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                v, feature = 1.0 - w, 5
            else:
                v, w, feature = vb / (va + vb + vc), vc / (va + vb + vc), 0
    return (
        corners[0, 0] + v * abx + w * acx,
        corners[0, 1] + v * aby + w * acy,
        corners[0, 2] + v * abz + w * acz,
        feature,
    )


# --- tree of boxes --------------------------------------------------------------------------------


# Items of a leaf: fewer make the tree deeper than their tests are worth.
LEAF = 4

# Deepest tree that the stack of a search can hold.
STACK = 128


class BoxTree(NamedTuple):
    """Boxes of a tree; node k has the children 2k and 2k + 1, the leaves are the last half.

    order : item numbers in the order of the leaves, shape (N,).
    first : first place in ``order`` of each leaf, shape (leaf_count + 1,).
    boxes : lower and upper corner [m] of each node, shape (2 leaf_count, 6).
    item_boxes : of the items in the order of the leaves, shape (N, 6).
    """

    order: np.ndarray
    first: np.ndarray
    boxes: np.ndarray
    item_boxes: np.ndarray


def box_tree(corners: np.ndarray) -> BoxTree:
    """Build the tree of items with the corners [m] (N, K, 3)."""
    count = len(corners)
    leaf_count = 1
    while leaf_count * LEAF < count:
        leaf_count *= 2
    item_boxes = np.empty((count, 6))
    _bound(corners, item_boxes)
    order = order_along_curve(0.5 * (item_boxes[:, :3] + item_boxes[:, 3:]))
    item_boxes = item_boxes[order]
    first = (np.arange(leaf_count + 1) * count) // leaf_count
    boxes = np.empty((2 * leaf_count, 6))
    _fill(first, item_boxes, boxes)
    return BoxTree(order, first, boxes, item_boxes)


def order_along_curve(places: np.ndarray) -> np.ndarray:
    """Return the order of places [m] (N, 3) along Morton's space-filling curve.

    Neighbours in this order are close to each other in space.
    """
    low, high = bounding_box(places)
    extent = float((high - low).max(initial=0.0)) or 1.0
    codes = np.empty(len(places), dtype=np.uint64)
    _curve(places, low, 2.0**20 / extent, codes)
    return np.argsort(codes, kind="stable")


@routine
def bounding_box(places):
    """Return the least and the largest coordinates of places (N, 3), each of shape (3,)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for p in range(len(places)):
        for axis in range(3):
            low[axis], high[axis] = (
                min(low[axis], places[p, axis]),
                max(high[axis], places[p, axis]),
            )
    return low, high


@routine
def _curve(places, low, scale, codes):
    for p in range(len(places)):
        code = np.uint64(0)
        for axis in range(3):
            step = np.uint64(min((places[p, axis] - low[axis]) * scale, 1048575.0))
            # Each bit of a coordinate moves to every third bit of the code.
            step = (step | (step << np.uint64(32))) & np.uint64(0x001F00000000FFFF)
            step = (step | (step << np.uint64(16))) & np.uint64(0x001F0000FF0000FF)
            step = (step | (step << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
            step = (step | (step << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
            step = (step | (step << np.uint64(2))) & np.uint64(0x1249249249249249)
            code |= step << np.uint64(axis)
        codes[p] = code


@routine
def _bound(corners, boxes):
    for item in range(len(corners)):
        for axis in range(3):
            low, high = corners[item, 0, axis], corners[item, 0, axis]
            for k in range(1, corners.shape[1]):
                low, high = min(low, corners[item, k, axis]), max(high, corners[item, k, axis])
            boxes[item, axis], boxes[item, 3 + axis] = low, high


@routine
def _fill(first, item_boxes, boxes):
    leaf_count = len(first) - 1
    for node in range(2 * leaf_count - 1, -1, -1):
        boxes[node, :3], boxes[node, 3:] = np.inf, -np.inf
        if node >= leaf_count:
            for k in range(first[node - leaf_count], first[node - leaf_count + 1]):
                enclose(boxes[node], item_boxes[k])
        elif node > 0:
            enclose(boxes[node], boxes[2 * node])
            enclose(boxes[node], boxes[2 * node + 1])


@equation
def enclose(box, other):
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@routine
def items_in_box(tree, box, stack, found):
    """Write the items whose boxes a box (6,) touches to ``found``; return their number.

    Where ``found`` is too small, the number is returned with a minus sign.
    """
    order, first, boxes, item_boxes = tree.order, tree.first, tree.boxes, tree.item_boxes
    leaf_count = len(first) - 1
    low_x, low_y, low_z, high_x, high_y, high_z = box[0], box[1], box[2], box[3], box[4], box[5]
    stack[0] = 1
    height, count = 1, 0
    while height > 0:
        height -= 1
        node = stack[height]
        if not (
            boxes[node, 0] <= high_x and low_x <= boxes[node, 3]
            and boxes[node, 1] <= high_y and low_y <= boxes[node, 4]
            and boxes[node, 2] <= high_z and low_z <= boxes[node, 5]
        ):  # fmt: skip
            continue
        if node < leaf_count:
            stack[height], stack[height + 1] = 2 * node + 1, 2 * node
            height += 2
            continue
        for k in range(first[node - leaf_count], first[node - leaf_count + 1]):
            if not (
                item_boxes[k, 0] <= high_x and low_x <= item_boxes[k, 3]
                and item_boxes[k, 1] <= high_y and low_y <= item_boxes[k, 4]
                and item_boxes[k, 2] <= high_z and low_z <= item_boxes[k, 5]
            ):  # fmt: skip
                continue
            if count < len(found):
                found[count] = order[k]
            count += 1
    return count if count <= len(found) else -count


@equation
def distance2_to_box(box, x, y, z):
    """Square of the distance of a point from a box, 0 inside."""
    dx = max(box[0] - x, 0.0, x - box[3])
    dy = max(box[1] - y, 0.0, y - box[4])
    dz = max(box[2] - z, 0.0, z - box[5])
    return dx * dx + dy * dy + dz * dz
