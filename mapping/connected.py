"""Layers of the sheet over a cell: its faces that hang together and show the cell one side."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import equation, routine


@routine
def number_layers(pairs, values, neighbours, slot):
    """Number the layers of the pairs of every cell, and sort them by face.

    Faces that share an edge and show the same side belong to one layer. The pairs of a cell follow
    each other; ``slot`` is -1 for every face, and is so afterwards.
    """
    parent = np.empty(256, dtype=np.int64)
    first = 0
    while first < len(pairs):
        end = first + 1
        while end < len(pairs) and pairs[end, 0] == pairs[first, 0]:
            end += 1
        if end - first > len(parent):
            parent = np.empty(2 * (end - first), dtype=np.int64)
        _sort_by_face(pairs, values, first, end)
        _number_layers_of_cell(pairs, first, end, neighbours, slot, parent)
        first = end


@equation
def _sort_by_face(pairs, values, first, end):
    for k in range(first + 1, end):
        j = k
        while j > first and (pairs[j - 1, 1] > pairs[j, 1]):
            for column in range(4):
                pairs[j - 1, column], pairs[j, column] = pairs[j, column], pairs[j - 1, column]
            for column in range(values.shape[1]):
                values[j - 1, column], values[j, column] = values[j, column], values[j - 1, column]
            j -= 1


@equation
def _number_layers_of_cell(pairs, first, end, neighbours, slot, parent):
    count = end - first
    for k in range(count):
        slot[pairs[first + k, 1]] = k
        parent[k] = k
    for k in range(count):
        for edge in range(4):
            other = neighbours[pairs[first + k, 1], edge]
            if other < 0 or slot[other] < 0:
                continue
            if pairs[first + slot[other], 2] == pairs[first + k, 2]:
                a, b = root(parent, k), root(parent, slot[other])
                parent[max(a, b)] = min(a, b)
    found = 0
    for k in range(count):
        slot[pairs[first + k, 1]] = -1
        if parent[k] == k:
            pairs[first + k, 3] = found
            found += 1
        else:
            pairs[first + k, 3] = pairs[first + root(parent, k), 3]


@equation
def root(parent, k):
    while parent[k] != k:
        k = parent[k]
    return k
