"""Spans of 16 neighbouring nodes: rows of one scratch array, and the ways in and out of them.

Loops of one length over rows of one array are what the compiler turns into packed instructions
without asking which arrays may overlap. Nodes are neighbours in memory as well, so that rows are
copied by whole vectors; of the last span, which may have fewer nodes, number by number.
"""

from __future__ import annotations

from lcmchain.elements.blocks import LANES
from lcmchain.elements.lane_runs import copy_lanes, number_at, put_number_at
from lcmchain.jit import equation, span_part

#: Nodes of a span, as many as a block has lanes.
SPAN = LANES
#: Spans of a chunk of nodes, the work that one thread does at a time; chunks are numbered body by
#: body, and the last one of a body may be shorter.
SPANS_OF_CHUNK = 8
NODE_CHUNK = SPANS_OF_CHUNK * SPAN


@span_part
def load_row(values, first, count, row, work):
    """Write what the nodes of a span have into a row; the last one's for those that are missing.

    values : C-contiguous, read in the order of memory from ``first`` on.
    """
    if count == SPAN:
        copy_lanes(values, first, first, SPAN, work, row * SPAN)  # type: ignore[call-arg]
    else:
        for i in range(SPAN):
            place = first + min(i, count - 1)
            work[row * SPAN + i] = number_at(values, place)  # type: ignore[call-arg]


@span_part
def load_rows(values, first, count, row, work):
    """Write the three components (3, node_count) of the nodes of a span into rows."""
    step = values.shape[1]
    for d in range(3):
        load_row(values, first + d * step, count, row + d, work)


@span_part
def store_row(work, row, values, first, count):
    """Write a row back to the nodes of the span."""
    if count == SPAN:
        begin = row * SPAN
        copy_lanes(work, begin, begin, SPAN, values, first)  # type: ignore[call-arg]
    else:
        for i in range(count):
            number = work[row * SPAN + i]
            put_number_at(values, first + i, number)  # type: ignore[call-arg]


@span_part
def store_rows(work, row, values, first, count):
    """Write rows back to the three components (3, node_count) of the nodes of the span."""
    step = values.shape[1]
    for d in range(3):
        store_row(work, row + d, values, first + d * step, count)


@equation
def vector_at(work, row, i):
    """Return three rows at a node."""
    return (work[row * SPAN + i], work[(row + 1) * SPAN + i], work[(row + 2) * SPAN + i])


@equation
def put_vector(work, row, i, a):
    """Write a vector to three rows at a node."""
    work[row * SPAN + i] = a[0]
    work[(row + 1) * SPAN + i] = a[1]
    work[(row + 2) * SPAN + i] = a[2]
