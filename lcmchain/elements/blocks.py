"""Layout of elements in blocks of 16 lanes, in flat arrays ``[(block * rows + row) * 16 + lane]``.

One loop over the lanes of a block around straight-line code is what the compiler turns into packed
instructions.
"""

from __future__ import annotations

import numpy as np

LANES = 16


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
