"""Numbers of 16 neighbours, loaded by vectors where their indices count up.

Elements and nodes are mostly numbered along the rows of a mesh. What 16 neighbours read then lies
in one run of memory, or in two, where a row ends or a block. Both are loaded whole, and each lane
takes its number from one of them: a few instructions in place of 16 times index, load and store.
Where there are more runs, as in meshes without rows, the indices are followed one by one.
"""

from __future__ import annotations

import numpy as np

from lcmchain.elements.blocks import LANES
from lcmchain.jit import equation, span_part
from lcmchain.packs import PACK, load_indexed, load_three, load_two, store_three

#: Numbers that describe the runs of 16 indices.
RUN_COLUMNS = 3
#: First run of indices that are in no two runs.
SCATTERED = -1


def find_runs(indices: np.ndarray) -> np.ndarray:
    """Return where the runs of 16 indices (..., 16) begin, (..., 3) int32.

    For the first lane, as if the run began there: of the first run and of the second one; then the
    first lane of the second run. :data:`SCATTERED` where there are more runs, or where one as long
    as all lanes would begin before 0 or end behind the largest index of all.
    """
    start = indices.astype(np.int64) - np.arange(LANES)
    first, second = start[..., 0], start[..., -1]
    turns = np.diff(start, axis=-1) != 0
    turn = np.where(turns.any(axis=-1), turns.argmax(axis=-1) + 1, LANES)
    low, high = np.minimum(first, second), np.maximum(first, second)
    in_two = (turns.sum(axis=-1) <= 1) & (low >= 0) & (high + LANES <= indices.max(initial=0) + 1)
    return np.stack([np.where(in_two, first, SCATTERED), second, turn], axis=-1).astype(np.int32)


@span_part
def load_vectors(values, step, indices, place, runs, k, out, row):
    """Write three components of 16 indexed places to three rows of ``out``.

    Parameters
    ----------
    values : C-contiguous, of any shape, read in the order of memory: at an index, ``step`` numbers
        behind it, and as many behind that. indices : of which those from ``place`` on are taken.
    runs, k : :func:`find_runs` of the indices, and which 16 of them. out : written from ``row`` on.
    """
    for half in range(LANES // PACK):
        vector = vector_of_lanes(values, step, indices, place, runs, k, half)
        store_three(out, LANES, row + half * PACK, vector)


@equation
def vector_of_lanes(values, step, indices, place, runs, k, half):
    """Return three components of 8 of 16 indexed places as packs: the lower or the upper half.

    The parameters are those of :func:`load_vectors`; half : 0 or 1.
    """
    first, shift = runs[k * RUN_COLUMNS], half * PACK
    if first >= 0:
        first, second = first + shift, runs[k * RUN_COLUMNS + 1] + shift
        turn = runs[k * RUN_COLUMNS + 2] - shift
        if turn >= PACK:
            return load_three(values, step, first)
        if turn <= 0:
            return load_three(values, step, second)
        return (
            load_two(values, first, second, turn),
            load_two(values, first + step, second + step, turn),
            load_two(values, first + 2 * step, second + 2 * step, turn),
        )
    at = place + shift
    return (
        load_indexed(values, 0, indices, at),
        load_indexed(values, step, indices, at),
        load_indexed(values, 2 * step, indices, at),
    )
