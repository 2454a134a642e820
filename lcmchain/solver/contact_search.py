"""Which nodes can touch which tool before the next search."""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.jit import kernel, routine, span_routine
from lcmchain.state import CONTACT_GROUP, NODE_CHUNK
from lcmchain.tools.span_distance import DISTANCE_ROWS, GAP, SPAN, span_distances


@kernel
def find_near_nodes(arrays, tools, reach):
    """Mark in ``arrays.near`` the nodes nearer to a tool than ``reach`` (tool_count,) [m]."""
    node_count = arrays.mass.size
    for chunk in prange(arrays.chunk_sums.shape[0]):
        first = chunk * NODE_CHUNK
        last = min(first + NODE_CHUNK, node_count)
        work = np.empty(DISTANCE_ROWS * SPAN)
        for tool in range(tools.kind.size):
            mark_near_nodes(arrays, tools, tool, reach[tool], first, last, work)


@span_routine
def mark_near_nodes(arrays, tools, tool, reach, first, last, work):
    position, near = arrays.position, arrays.near[tool, first:last]
    span_distances(
        tools,
        tool,
        position[0, first:last],
        position[1, first:last],
        position[2, first:last],
        arrays.tool_travel[tool],
        work,
    )
    for i in range(last - first):
        near[i] = 1 if work[GAP * SPAN + i] < reach else 0


@routine
def group_near_nodes(near, near_group):
    """Mark the groups of nodes of which one is near, ``near_group`` (tool_count, group_count)."""
    node_count = near.shape[1]
    for tool in range(near_group.shape[0]):
        for group in range(near_group.shape[1]):
            first = group * CONTACT_GROUP
            found = 0
            for node in range(first, min(first + CONTACT_GROUP, node_count)):
                found |= near[tool, node]
            near_group[tool, group] = found
