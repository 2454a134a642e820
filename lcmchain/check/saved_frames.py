"""Whether the saved frames of a run fit into the memory of this machine."""

from __future__ import annotations

import os

from lcmchain.errors import InputError
from lcmchain.fields.table import FIELD_OF_VARIABLE
from lcmchain.model import Model

#: Numbers per node of a frame: positions, displacements and their like.
NUMBERS_PER_NODE = 9


def frame_bytes(model: Model) -> int:
    """Return about how much memory one saved frame takes with all of its fields."""
    on_faces = len(FIELD_OF_VARIABLE) * model.element_count
    return 8 * (on_faces + NUMBERS_PER_NODE * model.node_count)


def require_frames_fit(frame_count: int, model: Model, memory: int | None = None) -> None:
    """Stop when the frames of a run are larger than the memory [bytes], by default this machine's.

    Raises
    ------
    InputError : names process.frames, what they take, and how many fit into half of the memory.
    """
    memory = _physical_memory() if memory is None else memory
    needed = frame_count * frame_bytes(model)
    if needed <= memory:
        return
    fitting = max(memory // (2 * frame_bytes(model)), 2)
    raise InputError(
        f"{frame_count:,} frames of {model.element_count:,} elements take about "
        f"{needed / 1e9:.3g} GB, more than the {memory / 1e9:.3g} GB of this machine; save "
        f"{fitting:,} frames or fewer",
        key="process.frames",
    )


def _physical_memory() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not told by this system
        return 2**63
