"""Numbering of nodes and elements, line by line across the sheet."""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.cut import Cells

# Stretch of elements within which the cut ones come last: long beside the blocks in which kernels
# take elements, short beside what a step has on hand at a time.
STRETCH = 256
# Difference of opposite edges, relative to the pitch, up to which a cell counts as uncut.
UNCUT = 1e-9


def number_by_lines(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Positions, and faces in the new node numbers.

    Lines of the lattice follow each other along the sheet's longer side: a step that goes through
    the sheet in this order (``lcmchain/solver/schedule.py``) has few lines on hand at a time.
    Among elements that follow each other the cut ones come last: a block of elements that are all
    parallelograms is spared what others need (``lcmchain/elements/solid_shell/kernel.py``).
    """
    used = np.unique(cells.faces)
    places = cells.lattice_node[used]
    along_rows = _has_shorter_rows(places, cells.row_count)
    used = used[_line_order(places, cells.row_count, along_rows)]
    number = np.full(len(cells.positions), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    faces = cells.faces[_line_order(cells.origin, cells.row_count, along_rows)]
    faces = faces[_cut_last(cells.positions[faces], cells.pitch)]
    return cells.positions[used], number[faces]


def _has_shorter_rows(nodes: np.ndarray, row_count: int) -> bool:
    """Tell whether the sheet has no more columns than rows: rows are then the shorter lines."""
    column, row = np.divmod(nodes, row_count)
    return bool(np.ptp(column) <= np.ptp(row))


def _line_order(nodes: np.ndarray, row_count: int, along_rows: bool) -> np.ndarray:
    """Order of lattice nodes row by row, or column by column."""
    column, row = np.divmod(nodes, row_count)
    return np.lexsort((column, row) if along_rows else (row, column))


def _cut_last(corners: np.ndarray, pitch: float) -> np.ndarray:
    """Order of faces (F, 4, 2) in which the parallelograms come first within each stretch."""
    warped = corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3]
    is_cut = np.linalg.norm(warped, axis=1) > UNCUT * pitch
    return np.lexsort((is_cut, np.arange(len(corners)) // STRETCH))
