"""Which boxes of a set touch each of many boxes."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine
from lcmchain.mesh.search import STACK, BoxTree, box_tree, items_in_box


def tree_of(low: np.ndarray, high: np.ndarray) -> BoxTree:
    """Build the tree of boxes with these corners [m], both of shape (B, 3)."""
    return box_tree(np.stack([low, high], axis=1))


def touching(tree: BoxTree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the tree that touch each of Q boxes, ascending: (start (Q + 1,), numbers)."""
    queries = np.concatenate([low, high], axis=1)
    counts = np.empty(len(queries), dtype=np.int64)
    _count(tree, queries, counts)
    start = np.concatenate([[0], np.cumsum(counts)])
    numbers = np.empty(start[-1], dtype=np.int64)
    _gather(tree, queries, start, numbers)
    return start, numbers


@routine
def _count(tree, queries, counts):
    stack = np.empty(STACK, np.int64)
    for q in range(len(queries)):
        counts[q] = -items_in_box(tree, queries[q], stack, stack[:0])


@routine
def _gather(tree, queries, start, numbers):
    stack = np.empty(STACK, np.int64)
    for q in range(len(queries)):
        own = numbers[start[q] : start[q + 1]]
        items_in_box(tree, queries[q], stack, own)
        own.sort()
