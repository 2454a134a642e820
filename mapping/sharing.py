"""Shares of the faces' contents, evened out among the cells that overlap the same faces.

Cells tile every triangle of the sheet, so that its content goes to them wholly. But over an edge
between two triangles that lean to each other the cells are seen from two sides: by turns one gets a
strip twice and another gets it not at all. On a coarse mesh of a sharp bend single cells then hold
a tenth more or less fibre than lies over them. Here the shares are scaled by turns, those of a cell
to the area of the cell, those of a face to what it had: mass moves between neighbours and none is
lost or made.

Source: R. Sinkhorn, "Diagonal equivalence to matrices with prescribed row and column sums",
American Mathematical Monthly 74 (1967) 402. It is stopped early: evening out goes as far as
neighbours of neighbours, and leaves folds and stretched regions their content.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.intersection import Overlaps

# Turns of scaling cells, then faces.
SWEEPS = 10


def even_shares(
    found: Overlaps, content: np.ndarray, face_areas: np.ndarray, covered_areas: np.ndarray
) -> tuple[np.ndarray, float]:
    """Even out the shares of the faces' contents; return them, and the share that was moved.

    Parameters
    ----------
    content : share of each face that goes to the cell of each pair, shape (K,).
    face_areas : [m2], shape (F,).
    covered_areas : of the cells [m2], shape (C,).
    """
    even = content.copy()
    _sweep(found.cell, found.face, even, face_areas, covered_areas, SWEEPS)
    moved = np.abs(even - content) @ face_areas[found.face]
    total = content @ face_areas[found.face]
    return even, float(0.5 * moved / total) if total > 0.0 else 0.0


@routine
def _sweep(cell, face, content, face_areas, wanted, sweeps):
    """Scale the shares of all cells, then those of all faces, by turns."""
    given = np.zeros(len(face_areas))
    for k in range(len(face)):
        given[face[k]] += content[k]
    of_cell, of_face = np.empty(len(wanted)), np.empty(len(face_areas))
    for _ in range(sweeps):
        of_cell[:] = 0.0
        for k in range(len(face)):
            of_cell[cell[k]] += content[k] * face_areas[face[k]]
        for c in range(len(wanted)):
            of_cell[c] = wanted[c] / of_cell[c] if of_cell[c] > 0.0 and wanted[c] > 0.0 else 1.0
        of_face[:] = 0.0
        for k in range(len(face)):
            content[k] *= of_cell[cell[k]]
            of_face[face[k]] += content[k]
        for f in range(len(of_face)):
            of_face[f] = given[f] / of_face[f] if of_face[f] > 0.0 else 1.0
        for k in range(len(face)):
            content[k] *= of_face[face[k]]
