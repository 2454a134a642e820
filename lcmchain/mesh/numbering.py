"""Numbering of nodes and elements, in compact patches of the sheet."""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.cut import ON_OUTLINE, Cells

# Node pairs and elements are numbered in compact patches of this many.
PATCH = 128


def number_in_patches(cells: Cells) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, faces in the new node numbers, and which nodes are not on the outline.

    Consecutive nodes and elements are neighbours in the sheet, so that the working set of a chunk
    stays in the cache.
    """
    used = np.unique(cells.faces)
    used = used[_patch_order(used, cells.row_count)]
    number = np.full(len(cells.positions), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    faces = number[cells.faces[_patch_order(cells.origin, cells.row_count)]]
    return cells.positions[used], faces, cells.node_class[used] != ON_OUTLINE


def _patch_order(nodes: np.ndarray, row_count: int) -> np.ndarray:
    """Order of lattice nodes in which every consecutive chunk of PATCH is a compact patch.

    Recursive bisection across the longer side, always at a multiple of PATCH; row by row inside
    a patch.
    """
    column, row = np.divmod(nodes, row_count)
    patches = []
    pending = [np.arange(len(nodes))]
    while pending:
        part = pending.pop()
        if len(part) <= PATCH:
            patches.append(part[np.lexsort((column[part], row[part]))])
            continue
        along, across = column[part], row[part]
        if np.ptp(along) < np.ptp(across):
            along, across = across, along
        half = PATCH * max(1, round(len(part) / (2 * PATCH)))
        # All keys differ, so the two parts do not depend on how the partition is found.
        order = np.argpartition(along * (across.max() + 1) + across, half)
        pending += [part[order[half:]], part[order[:half]]]
    return np.concatenate(patches)
