"""Which boxes of a set touch a given box, by a tree of boxes in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation

#: Boxes per leaf of the tree, and bits per axis of the curve that they are sorted along.
LEAF = 4
BITS = 20
#: Depth of the tree, and so of the stack of a search, that no mesh reaches.
DEEPEST = 64


class BoxTree(NamedTuple):
    """Complete binary tree of boxes: the children of node i are 2i and 2i + 1, the root is 1.

    low, high : corners of the boxes of the nodes [m], shape (2 leaf_count, 3).
    own_low, own_high : of the boxes in the order of the leaves [m], shape (leaf_count LEAF, 3).
    number : of each box in the order of the leaves, -1 where a place is empty.
    """

    low: np.ndarray
    high: np.ndarray
    own_low: np.ndarray
    own_high: np.ndarray
    number: np.ndarray


def box_tree(low: np.ndarray, high: np.ndarray) -> BoxTree:
    """Build the tree of boxes with these corners [m], both of shape (B, 3).

    Neighbours along a Z-order curve share a leaf.
    Source: Lauterbach et al., "Fast BVH construction on GPUs", Computer Graphics Forum 28 (2009).
    """
    count = len(low)
    centres = 0.5 * (low + high)
    size = max(float(np.ptp(centres, axis=0).max()), np.finfo(float).tiny)
    cell = ((centres - centres.min(axis=0)) / size * (2**BITS - 1)).astype(np.int64)
    code = np.zeros(count, dtype=np.int64)
    for bit in range(BITS):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    leaf_count = 1
    while leaf_count * LEAF < count:
        leaf_count *= 2
    # spread evenly over the leaves; an empty place has a box that touches nothing
    place = np.arange(count) * (leaf_count * LEAF) // count
    number = np.full(leaf_count * LEAF, -1, dtype=np.int64)
    number[place] = np.argsort(code, kind="stable")
    own_low = np.where(number[:, None] < 0, np.inf, low[number])
    own_high = np.where(number[:, None] < 0, -np.inf, high[number])
    node_low = np.zeros((2 * leaf_count, 3))
    node_high = np.zeros((2 * leaf_count, 3))
    node_low[leaf_count:] = own_low.reshape(leaf_count, LEAF, 3).min(axis=1)
    node_high[leaf_count:] = own_high.reshape(leaf_count, LEAF, 3).max(axis=1)
    first = leaf_count
    while first > 1:
        children = slice(first, 2 * first)
        first //= 2
        node_low[first : 2 * first] = node_low[children].reshape(first, 2, 3).min(axis=1)
        node_high[first : 2 * first] = node_high[children].reshape(first, 2, 3).max(axis=1)
    return BoxTree(node_low, node_high, own_low, own_high, number)


def touching(tree: BoxTree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the tree that touch each of Q boxes, ascending: (start (Q + 1,), numbers)."""
    low, high = np.ascontiguousarray(low), np.ascontiguousarray(high)
    counts = np.zeros(len(low), dtype=np.int64)
    nothing = np.zeros(0, dtype=np.int64)
    _search(*tree, low, high, counts, nothing, nothing)
    start = np.concatenate([[0], np.cumsum(counts)])
    numbers = np.empty(start[-1], dtype=np.int64)
    _search(*tree, low, high, counts, start, numbers)
    return start, numbers


@strict_equation
def _search(low, high, own_low, own_high, number, query_low, query_high, counts, start, numbers):
    """Count what touches each query, and write it down where there is a place for it."""
    leaf_count = low.shape[0] // 2
    write = len(numbers) > 0
    stack = np.zeros(DEEPEST, np.int64)
    for q in range(query_low.shape[0]):
        found = 0
        stack[0] = 1
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if not touch(low[node], high[node], query_low[q], query_high[q]):
                continue
            if node < leaf_count:
                stack[waiting], stack[waiting + 1] = 2 * node, 2 * node + 1
                waiting += 2
                continue
            first = (node - leaf_count) * LEAF
            for k in range(first, first + LEAF):
                if touch(own_low[k], own_high[k], query_low[q], query_high[q]):
                    if write:
                        numbers[start[q] + found] = number[k]
                    found += 1
        if write:
            numbers[start[q] : start[q + 1]].sort()
        counts[q] = found


@strict_equation
def touch(low, high, other_low, other_high):
    """Whether two boxes have a point in common."""
    return (
        low[0] <= other_high[0]
        and high[0] >= other_low[0]
        and low[1] <= other_high[1]
        and high[1] >= other_low[1]
        and low[2] <= other_high[2]
        and high[2] >= other_low[2]
    )
