"""What a point of contact has, in rows of its span, and how the laws of its interface see it.

Nodes of a chunk are taken in spans of 16 neighbours. Everything that a spring between plies keeps
lies in rows of 16 numbers, span by span, the memory of the laws behind what all springs have:
``rows[(span * row_count + row) * 16 + lane]``.
"""

from __future__ import annotations

from typing import Any

from lcmchain.elements.blocks import SPAN, vector_at
from lcmchain.elements.vectors import dot, plus
from lcmchain.interfaces.law import (
    Touch,
    load_memory,
    memory_size,
    parameters,
    respond,
    store_memory,
    uses_sliding,
)
from lcmchain.interfaces.springs import tangential
from lcmchain.jit import equation

# Rows of a point; of vectors the first of three.
WEIGHT = 0  # of the four corners
NORMAL = 4
OFFSET = 7  # [m]
STIFFNESS = 8  # of the whole area of the point [N/m]
SHARE = 9  # of the area at r = 0; 1 exactly where no rim is near
RIM = 10  # gradient of the share along r [1/m]
HELD = 13  # further depth that the spring feels, see refresh.py [m]
LAST_DEPTH = 14  # depth without the one held, at the last refresh [m]
LAST_GAP = 15  # at the last step [m]
LAST_DAMPING = 16  # force at the last step [N]
BASELINE = 17  # depth in the other ply at which the spring has no force [m]
AREA = 18  # half of what the point stands for [m²]
INTERFACE = 19  # number of the interface
REACH = 20  # gap below which it acts; infinite for one with a depth that is held [m]
WAY = 21  # r [m]
MOVED = 24  # change of r in the last step [m]
FORCE = 27  # on the point [N]
STORED_ENERGY = 30  # [J]
LOST_ENERGY = 31  # in this step [J]
DAMPED_ENERGY = 32  # in this step [J]
SLIP = 33  # on other plies when the spring was made, turned with the surface [m]
PATH = 36  # length of the way that it slid [m]
START = 37  # along the facet when the spring was made [m]
SPRING_ROWS = 40  # then the memory of the laws


def row_count(laws: tuple[Any, ...]) -> int:
    """Return how many rows a span has with these laws."""
    return SPRING_ROWS + sum(memory_size(law) for law in laws)


@equation
def memory_rows(laws):
    """Return the first row of the memory of each law, and the number of rows."""
    first, second, third, fourth, fifth, sixth = laws
    a = SPRING_ROWS
    b = a + memory_size(first)
    c = b + memory_size(second)
    d = c + memory_size(third)
    e = d + memory_size(fourth)
    f = e + memory_size(fifth)
    return a, b, c, d, e, f, f + memory_size(sixth)


@equation
def all_parameters(laws, interface):
    """Return the parameters of all laws for an interface."""
    first, second, third, fourth, fifth, sixth = laws
    return (
        parameters(first, interface),
        parameters(second, interface),
        parameters(third, interface),
        parameters(fourth, interface),
        parameters(fifth, interface),
        parameters(sixth, interface),
    )


@equation
def any_uses_sliding(laws):
    """Tell whether a law asks for how far a point has moved in the last step."""
    first, second, third, fourth, fifth, sixth = laws
    few = uses_sliding(first) or uses_sliding(second) or uses_sliding(third)
    return few or uses_sliding(fourth) or uses_sliding(fifth) or uses_sliding(sixth)


@equation
def row_start(data, point):
    """Return where a point lies in the first row of its span."""
    lane = data.lane[point]
    return lane // SPAN * data.row_size + lane % SPAN


@equation
def share_at(rows, at, r):
    """Return the share of a point's area at r; below 0 beyond the rim."""
    return rows[at + SHARE * SPAN] + dot(vector_at(rows, RIM, at), r)


@equation
def touch_of(rows, at, r, moved, time):
    """Return a point as the laws see it; ``at`` is its place in the first row."""
    normal = vector_at(rows, NORMAL, at)
    share = max(share_at(rows, at, r), 0.0)
    gap = dot(normal, r) + rows[at + OFFSET * SPAN]
    held = rows[at + HELD * SPAN]
    stiffness = rows[at + STIFFNESS * SPAN] * share
    return Touch(
        gap + held,
        rows[at + LAST_GAP * SPAN] + held,
        stiffness * max(-gap, 0.0),
        stiffness,
        rows[at + AREA * SPAN] * share,
        normal,
        tangential(r, normal),
        tangential(moved, normal),
        time,
    )


@equation
def spring_energy(rows, at, touch):
    """Return the energy of the spring that keeps the plies apart [J]."""
    held = rows[at + HELD * SPAN]
    depth = max(held - touch.gap, 0.0)
    # the depth held before costs nothing: without any depth of its own a spring has no energy
    return 0.5 * touch.stiffness * (depth * depth - held * held)


@equation
def sum_of_laws(laws, values, starts, rows, at, touch):
    """Return force [N], tension [N], energy stored and lost [J] of all laws, and their memories.

    values, starts : of the laws, :func:`all_parameters` and :func:`memory_rows`. The memories are
    those after the step; in the rows they stay as they are.
    """
    first, second, third, fourth, fifth, sixth = laws
    total = ((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    total, a = _with_law(first, values[0], rows, at + starts[0] * SPAN, touch, total)
    total, b = _with_law(second, values[1], rows, at + starts[1] * SPAN, touch, total)
    total, c = _with_law(third, values[2], rows, at + starts[2] * SPAN, touch, total)
    total, d = _with_law(fourth, values[3], rows, at + starts[3] * SPAN, touch, total)
    total, e = _with_law(fifth, values[4], rows, at + starts[4] * SPAN, touch, total)
    total, f = _with_law(sixth, values[5], rows, at + starts[5] * SPAN, touch, total)
    force, tension, stored, lost = total
    return force, tension, stored, lost, (a, b, c, d, e, f)


@equation
def _with_law(law, values, rows, place, touch, total):
    """Add what a law answers to force, tension, stored and lost energy; return its memory too."""
    force, tension, stored, lost, memory = respond(
        law, values, load_memory(law, rows, place), touch
    )
    added = (plus(1.0, total[0], force), total[1] + tension, total[2] + stored, total[3] + lost)
    return added, memory


@equation
def store_memories(laws, memories, starts, rows, at):
    """Write the memories of all laws into the rows of a point."""
    first, second, third, fourth, fifth, sixth = laws
    store_memory(first, memories[0], rows, at + starts[0] * SPAN)
    store_memory(second, memories[1], rows, at + starts[1] * SPAN)
    store_memory(third, memories[2], rows, at + starts[2] * SPAN)
    store_memory(fourth, memories[3], rows, at + starts[3] * SPAN)
    store_memory(fifth, memories[4], rows, at + starts[4] * SPAN)
    store_memory(sixth, memories[5], rows, at + starts[5] * SPAN)
