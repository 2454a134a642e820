"""Numbering of nodes and elements, line by line across the sheet."""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.cut import Cells


def number_by_lines(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Positions, and faces in the new node numbers.

    Lines of the lattice follow each other along the sheet's longer side: a step that goes through
    the sheet in this order (``lcmchain/solver/schedule.py``) has few lines on hand at a time.
    """
    used = np.unique(cells.faces)
    along_rows = _has_shorter_rows(used, cells.row_count)
    used = used[_line_order(used, cells.row_count, along_rows)]
    number = np.full(len(cells.positions), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    faces = number[cells.faces[_line_order(cells.origin, cells.row_count, along_rows)]]
    return cells.positions[used], faces


def _has_shorter_rows(nodes: np.ndarray, row_count: int) -> bool:
    """Tell whether the sheet has no more columns than rows: rows are then the shorter lines."""
    column, row = np.divmod(nodes, row_count)
    return bool(np.ptp(column) <= np.ptp(row))


def _line_order(nodes: np.ndarray, row_count: int, along_rows: bool) -> np.ndarray:
    """Order of lattice nodes row by row, or column by column."""
    column, row = np.divmod(nodes, row_count)
    return np.lexsort((column, row) if along_rows else (row, column))
