"""Which nodes can touch which tool before the next search."""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.jit import kernel, span_routine, uncounted_routine
from lcmchain.tools.span_distance import DISTANCE_ROWS, GAP, span_distances
from lcmchain.tools.span_rows import SPAN, SPANS_OF_CHUNK


@kernel
def find_near_nodes(arrays, tools, reach):
    """Mark in ``arrays.near`` the nodes nearer to a tool than ``reach`` (tool_count,) [m]."""
    for place in prange(arrays.chunk_order.size):
        chunk = arrays.chunk_order[place]
        first, last = arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]
        work = np.empty(DISTANCE_ROWS * SPAN)
        for tool in range(tools.kind.size):
            mark_near_nodes(arrays, tools, tool, reach[tool], first, last, work)


@span_routine
def mark_near_nodes(arrays, tools, tool, reach, first, last, work):
    position, near = arrays.position, arrays.near[tool]
    travel = arrays.tool_travel[tool]
    for begin in range(first, last, SPAN):
        end = min(begin + SPAN, last)
        span_distances(tools, tool, position, begin, end - begin, travel, work)
        for i in range(end - begin):
            near[begin + i] = 1 if work[GAP * SPAN + i] < reach else 0


@uncounted_routine
def find_near_spans(near, chunk_start, near_span):
    """Mark the spans of nodes of which one is near, ``near_span`` (tool_count, span_count).

    Every chunk of nodes has as many spans, of which the last ones may be empty.
    """
    for tool in range(near_span.shape[0]):
        for span in range(near_span.shape[1]):
            chunk = span // SPANS_OF_CHUNK
            first = chunk_start[chunk] + span % SPANS_OF_CHUNK * SPAN
            found = 0
            for node in range(first, min(first + SPAN, chunk_start[chunk + 1])):
                found |= near[tool, node]
            near_span[tool, span] = found
