"""Elements in blocks of 16 lanes, and nodes in spans of 16.

The constants of elements lie in flat arrays ``[(block * rows + row) * 16 + lane]``, what is worked
out for a span of neighbouring nodes in rows of one scratch array. One loop of one length over the
lanes of such rows is what the compiler turns into packed instructions, without asking which arrays
may overlap.

Elements and nodes are mostly numbered along the rows of a mesh. What 16 neighbours read by indices
then lies in one run of memory, or in two, where a row ends or a block. Both are loaded whole, and
each lane takes its number from one of them: a few instructions in place of 16 times index, load and
store. Where there are more runs, as in meshes without rows, the indices are followed one by one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.compilation.processor import aligned
from lcmchain.jit import equation, span_part
from lcmchain.packs import PACK, load_indexed, load_three, load_two, store_three

LANES = 16
# Indices read from arrays are taken as unsigned: for a signed one every access first asks whether
# it counts from the end. A row further on is then so many unsigned lanes away.
NEXT_ROW = np.uint64(LANES)
SECOND_ROW = np.uint64(2 * LANES)
#: Numbers behind all corner forces, for nodes that find nothing in a slot, in any of three rows.
EMPTY_ROWS = 2 * LANES + 1
# Constants that differ by less than this part of their scale are taken for the same: far above what
# rounding makes of a regular mesh, far below what any result shows.
SAME = 1e-12
# After so many blocks that no other is like, no further ones are compared.
MOST_ALONE = 16


def in_blocks(rows: np.ndarray) -> np.ndarray:
    """Return rows (E, R) as a flat array ``[(block*R + row)*16 + lane]``; the last is repeated."""
    element_count, row_count = rows.shape
    block_count = -(-element_count // LANES)
    padding = np.repeat(rows[-1:], block_count * LANES - element_count, axis=0)
    padded = np.concatenate([rows, padding])
    return np.ascontiguousarray(
        padded.reshape(block_count, LANES, row_count).transpose(0, 2, 1)
    ).ravel()


def from_blocks(data: np.ndarray, row_count: int, element_count: int) -> np.ndarray:
    """Return the inverse of :func:`in_blocks`, (E, R)."""
    block_count = -(-element_count // LANES)
    blocks = data.reshape(block_count, row_count, LANES).transpose(0, 2, 1)
    return blocks.reshape(block_count * LANES, row_count)[:element_count]


class SharedBlocks(NamedTuple):
    """Rows of constants in blocks, of which equal ones lie in memory once.

    values : (distinct_count * rows * 16,). start : (block_count,) int32, where each block begins.

    A regular mesh has one block of constants instead of one for every 16 elements: what stays in
    the cache is left to the numbers that change.
    """

    values: np.ndarray
    start: np.ndarray


def in_shared_blocks(rows: np.ndarray, scale: np.ndarray) -> SharedBlocks:
    """Return rows (E, R) in blocks that are shared where they are the same up to :data:`SAME`.

    The sharing ends where too few blocks are alike: then each of the others has its own place.

    Parameters
    ----------
    scale : (R,) to which the differences of a column are compared, above 0.
    """
    blocks = in_blocks(rows).reshape(-1, rows.shape[1] * LANES)
    allowed = np.repeat(scale * SAME, LANES)
    kept: list[int] = []
    place = np.zeros(len(blocks), dtype=np.int32)
    left = np.arange(len(blocks))
    alone = 0
    while left.size and alone < MOST_ALONE:
        alike = (np.abs(blocks[left] - blocks[left[0]]) <= allowed).all(axis=1)
        alone += int(alike.sum() == 1)
        place[left[alike]] = len(kept)
        kept.append(left[0])
        left = left[~alike]
    place[left] = np.arange(len(kept), len(kept) + left.size)
    values = aligned(blocks[[*kept, *left]]).ravel()
    return SharedBlocks(values, place * np.int32(blocks.shape[1]))


def own_blocks(rows: np.ndarray) -> SharedBlocks:
    """Return rows (E, R) in blocks of which each has its own place."""
    values = aligned(in_blocks(rows))
    size = rows.shape[1] * LANES
    return SharedBlocks(values, np.arange(values.size // size, dtype=np.int32) * np.int32(size))


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
