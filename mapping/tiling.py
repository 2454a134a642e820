"""How much of a cell the faces over it tile, laid along its normal onto its tangent plane."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.clipping import WORK, clip
from lcmchain.mapping.intersection import Overlaps
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import CellPolygons


def coverage_of_planes(
    surface: Surface, cells: CellPolygons, found: Overlaps, chosen: np.ndarray
) -> np.ndarray:
    """Share of some cells that the faces over them tile, laid along the cells' normals.

    chosen : ascending numbers of cells, shape (P,).
    """
    first = np.searchsorted(found.cell, chosen)
    end = np.searchsorted(found.cell, chosen, side="right")
    shares = np.empty(len(chosen))
    _lay_on_cells(
        chosen, first, end, found.face, cells.start, cells.corners, cells.normals, cells.areas,
        surface.first_triangle, surface.triangle_corners, shares,
    )  # fmt: skip
    return shares


@routine
def _lay_on_cells(
    chosen, first, end, face_of, start, corners, normals, areas, first_triangle, triangles, shares
):  # fmt: skip
    work = np.empty(WORK)
    for p in range(len(chosen)):
        c = chosen[p]
        cell, normal = corners[start[c] : start[c + 1]], normals[c]
        covered = 0.0
        for k in range(first[p], end[p]):
            for t in range(first_triangle[face_of[k]], first_triangle[face_of[k] + 1]):
                covered += area_under(triangles[t], cell, normal, work)
        shares[p] = covered / areas[c]


@routine
def area_under(triangle, cell, normal, work):
    """Area of a cell under a triangle that is laid along the cell's normal onto its plane."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ux, uy, uz = (
        triangle[1, 0] - triangle[0, 0],
        triangle[1, 1] - triangle[0, 1],
        triangle[1, 2] - triangle[0, 2],
    )
    along = ux * nx + uy * ny + uz * nz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    if length == 0.0:
        return 0.0
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    dx, dy, dz = (
        triangle[2, 0] - triangle[0, 0],
        triangle[2, 1] - triangle[0, 1],
        triangle[2, 2] - triangle[0, 2],
    )
    tip_x, tip_y = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
    turned = tip_y < 0.0  # it shows its back: seen in a mirror, both are counter-clockwise again
    if tip_y == 0.0:
        return 0.0
    for k in range(len(cell)):
        x, y, z = (
            cell[k, 0] - triangle[0, 0],
            cell[k, 1] - triangle[0, 1],
            cell[k, 2] - triangle[0, 2],
        )
        to = len(cell) - 1 - k if turned else k
        across = x * vx + y * vy + z * vz
        work[0, to, 0] = x * ux + y * uy + z * uz
        work[0, to, 1] = -across if turned else across
    return clip(work, len(cell), length, tip_x, abs(tip_y))[0]
