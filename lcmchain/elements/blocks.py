"""Layout of elements in blocks of 16 lanes, in flat arrays ``[(block * rows + row) * 16 + lane]``.

One loop over the lanes of a block around straight-line code is what the compiler turns into packed
instructions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LANES = 16
# Constants that differ by less than this part of their scale are taken for the same: far above what
# rounding makes of a regular mesh, far below what any result shows.
SAME = 1e-12


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

    Parameters
    ----------
    scale : (R,) to which the differences of a column are compared, above 0.
    """
    blocks = in_blocks(rows).reshape(-1, rows.shape[1] * LANES)
    coarse = np.round(blocks / np.repeat(scale * SAME, LANES))
    _, first, which = np.unique(coarse, axis=0, return_index=True, return_inverse=True)
    # in the order in which they are met first
    order = np.argsort(first)
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    start = place[which.reshape(-1)] * np.int32(blocks.shape[1])
    return SharedBlocks(np.ascontiguousarray(blocks[first[order]]).ravel(), start)


def own_blocks(rows: np.ndarray) -> SharedBlocks:
    """Return rows (E, R) in blocks of which each has its own place."""
    values = in_blocks(rows)
    size = rows.shape[1] * LANES
    return SharedBlocks(values, np.arange(values.size // size, dtype=np.int32) * np.int32(size))
