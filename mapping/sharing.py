"""Shares of the faces' contents, evened out among the cells that overlap the same faces.

Cells tile every triangle of the sheet, so that its content goes to them wholly. But over an edge
between two triangles that lean to each other the cells are seen from two sides: by turns one gets a
strip twice and another gets it not at all. On a coarse mesh of a sharp bend single cells then hold
a tenth more or less fibre than lies over them. Here the shares are scaled by turns until each cell
holds about what the sheet has over its own area, and each face has given what it had: mass moves
between neighbours and none is lost or made.

Source: R. Sinkhorn, "Diagonal equivalence to matrices with prescribed row and column sums",
American Mathematical Monthly 74 (1967) 402. It is stopped early: evening out goes as far as
neighbours of neighbours, and leaves folds and stretched regions their content.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.gradients import normal_gradients
from lcmchain.mapping.intersection import Overlaps
from lcmchain.mapping.surface import Surface

# Turns of scaling cells, then faces.
SWEEPS = 10


def even_shares(
    surface: Surface,
    normals: np.ndarray,
    found: Overlaps,
    content: np.ndarray,
    covered_areas: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Even out the shares of the faces' contents; return them, and the share that was moved.

    Parameters
    ----------
    normals : unit normals of the cells, shape (C, 3).
    content : share of each face that goes to the cell of each pair, shape (K,).
    covered_areas : of the cells [m2], shape (C,).
    """
    upper = surface.normals * surface.winding.side[:, None]
    leaning = _leaning(
        found.cell, found.face, found.place, content, surface.areas, upper,
        normal_gradients(surface.gradient_stencil, upper), normals, len(covered_areas),
    )  # fmt: skip
    even = content.copy()
    _sweep(found.cell, found.face, even, surface.areas, leaning * covered_areas, SWEEPS)
    moved = np.abs(even - content) @ surface.areas[found.face]
    total = content @ surface.areas[found.face]
    return even, float(0.5 * moved / total) if total > 0.0 else 0.0


@routine
def _leaning(cell, face, place, content, areas, upper, gradients, normals, cell_count):
    """Area of sheet over a unit of area of each cell, shape (C,): more than 1 where it leans.

    The sheet is taken as smooth: its facets lean against those of a finer mesh of the same surface
    without having more area.
    """
    area, footprint = np.zeros(cell_count), np.zeros(cell_count)
    for k in range(len(cell)):
        c, f = cell[k], face[k]
        x = upper[f, 0] + gradients[0, f, 0] * place[k, 0] + gradients[0, f, 1] * place[k, 1]
        y = upper[f, 1] + gradients[1, f, 0] * place[k, 0] + gradients[1, f, 1] * place[k, 1]
        z = upper[f, 2] + gradients[2, f, 0] * place[k, 0] + gradients[2, f, 1] * place[k, 1]
        along = abs(x * normals[c, 0] + y * normals[c, 1] + z * normals[c, 2])
        length = np.sqrt(x * x + y * y + z * z)
        share = content[k] * areas[f]
        area[c] += share
        footprint[c] += share * along / length if length > 0.0 else share
    for c in range(cell_count):
        area[c] = area[c] / footprint[c] if footprint[c] > 0.0 else 1.0
    return area


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
