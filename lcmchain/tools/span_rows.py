"""Spans of 16 neighbouring nodes: rows of one array, one number of each node in a row.

Loops of one length over rows of one array are what the compiler turns into packed instructions
without asking which arrays may overlap.
"""

from __future__ import annotations

from lcmchain.elements.blocks import LANES
from lcmchain.jit import equation
from lcmchain.packs import PACK

#: Nodes of a span, as many as a block has lanes.
SPAN = LANES
#: Spans of a chunk of nodes, the work that one thread does at a time; chunks are numbered body by
#: body, and the last one of a body may be shorter.
SPANS_OF_CHUNK = 8
NODE_CHUNK = SPANS_OF_CHUNK * SPAN
#: Packs of nodes in a chunk.
PACKS_OF_CHUNK = NODE_CHUNK // PACK


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
