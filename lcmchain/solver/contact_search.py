"""Which nodes can touch which tool before the next search."""

from __future__ import annotations

from numba import prange

from lcmchain.jit import kernel, routine
from lcmchain.state import NODE_CHUNK
from lcmchain.tools.distance import signed_distance


@kernel
def find_near_nodes(arrays, tools, reach):
    """Mark in ``arrays.near`` the nodes nearer to a tool than ``reach`` (tool_count,) [m]."""
    node_count = arrays.mass.size
    for chunk in prange(arrays.chunk_sums.shape[0]):
        first = chunk * NODE_CHUNK
        last = min(first + NODE_CHUNK, node_count)
        for tool in range(tools.kind.size):
            mark_near_nodes(arrays, tools, tool, reach[tool], first, last)


@routine
def mark_near_nodes(arrays, tools, tool, reach, first, last):
    position = arrays.position
    travel = arrays.tool_travel[tool]
    for node in range(first, last):
        gap, _, _, _ = signed_distance(
            tools, tool, position[0, node], position[1, node], position[2, node], travel
        )
        arrays.near[tool, node] = 1 if gap < reach else 0
