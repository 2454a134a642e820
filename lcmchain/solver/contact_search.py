"""Which nodes can touch which tool before the next search."""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.blocks import PACKS_OF_CHUNK
from lcmchain.jit import kernel, span_routine, uncounted_routine
from lcmchain.packs import PACK, load_vector, store
from lcmchain.tools.pack_distance import DISTANCE_PACKS, pack_distance


@kernel
def find_near_nodes(arrays, tools, reach):
    """Mark in ``arrays.near`` the nodes nearer to a tool than ``reach`` (tool_count,) [m]."""
    for place in prange(arrays.chunk_order.size):
        chunk = arrays.chunk_order[place]
        first, last = arrays.chunk_start[chunk], arrays.chunk_start[chunk + 1]
        work = np.empty(DISTANCE_PACKS * PACK)
        for tool in range(tools.kind.size):
            mark_near_nodes(arrays, tools, tool, reach[tool], first, last, work)


@span_routine
def mark_near_nodes(arrays, tools, tool, reach, first, last, work):
    near, travel = arrays.near[tool], arrays.tool_travel[tool]
    for begin in range(first, last, PACK):
        count = min(PACK, last - begin)
        position = load_vector(arrays.position, begin, count)
        gap, _ = pack_distance(tools, tool, position, travel, work, 0)
        store(work, 0, gap)
        for i in range(count):
            near[begin + i] = 1 if work[i] < reach else 0


@uncounted_routine
def find_near_packs(near, chunk_start, near_pack, tools_near):
    """Mark the packs of nodes of which one is near to a tool, and count these tools.

    Parameters
    ----------
    near : (tool_count, node_count), of the last search. near_pack : (pack_count, tool_count).
    tools_near : (pack_count,). Every chunk of nodes has as many packs, of which the last ones may
        be empty.
    """
    tools_near[:] = 0
    for number in range(tools_near.size):
        chunk = number // PACKS_OF_CHUNK
        first = chunk_start[chunk] + number % PACKS_OF_CHUNK * PACK
        for tool in range(near.shape[0]):
            found = 0
            for node in range(first, min(first + PACK, chunk_start[chunk + 1])):
                found |= near[tool, node]
            near_pack[number, tool] = found
            tools_near[number] += found
