"""Whether the saved frames of a run fit into the memory of this machine."""

from __future__ import annotations

import os

from lcmchain.errors import InputError
from lcmchain.fields.table import BETWEEN_PLIES, FIELD_OF_VARIABLE, FIELDS
from lcmchain.interfaces.in_frames import FRAME_ROWS

#: Numbers per node of a frame: positions, displacements and their like.
NUMBERS_PER_NODE = 9


def frame_bytes(element_count: int, node_count: int, *, is_stack: bool = False) -> int:
    """Return about how much memory one saved frame takes with all of its fields."""
    between = sum(len(FIELDS[name].variables) for name in BETWEEN_PLIES)
    of_elements = len(FIELD_OF_VARIABLE) - between
    of_nodes = NUMBERS_PER_NODE
    if is_stack:  # as they come, as fields of each ply, and as those of the whole stack
        of_nodes += 3 * FRAME_ROWS
    return 8 * (of_elements * element_count + of_nodes * node_count)


def require_frames_fit(
    frame_count: int,
    element_count: int,
    node_count: int,
    memory: int | None = None,
    *,
    is_stack: bool = False,
) -> None:
    """Stop when the frames of a run are larger than the memory [bytes], by default this machine's.

    Raises
    ------
    InputError : names process.frames, what they take, and how many fit into half of the memory.
    """
    memory = physical_memory() if memory is None else memory
    one = frame_bytes(element_count, node_count, is_stack=is_stack)
    needed = frame_count * one
    if needed <= memory:
        return
    fitting = max(memory // (2 * one), 2)
    raise InputError(
        f"{frame_count:,} frames of {element_count:,} elements take about "
        f"{needed / 1e9:.3g} GB, more than the {memory / 1e9:.3g} GB of this machine; save "
        f"{fitting:,} frames or fewer",
        key="process.frames",
    )


def physical_memory() -> int:
    """Return the memory of this machine [bytes]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not told by this system
        return 2**63
