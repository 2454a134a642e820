"""Cut of the lattice with the outline, as in isosurface stuffing (Labelle & Shewchuk 2007).

Wherever the outline cuts a lattice edge, one end of that edge is moved along it onto the outline,
so that no edge crosses the outline any more; cells inside stay quadrilaterals, halved cells become
triangles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from shapely import contains_xy

from lcmchain.mesh.cells import (
    boundary_edges,
    cell_areas,
    cell_heights,
    corner_sines,
    piece_count,
    step_ratio,
)
from lcmchain.mesh.contours import Contours
from lcmchain.mesh.outline import cross
from lcmchain.mesh.seams import (
    COINCIDENT,
    CutEdges,
    Lattice,
    copies_at,
    line_cuts,
    part_at_seams,
    tip_at,
)

# An inside node is pulled outwards over up to this part of a cut lattice edge; only beyond it the
# outside node is pulled inwards. The whole edge, because cells shorter than the pitch would reduce
# the stable time step of the whole blank.
INSIDE_REACH = 1.0

OUTSIDE, INSIDE, ON_OUTLINE = 0, 1, 2


@dataclass(frozen=True)
class LatticeCells:
    """Lattice cells inside the outline, in fibre coordinates.

    positions : of all nodes [m], shape (nodes, 2): those of the lattice, columns * rows, and where
        darts and slits part the sheet copies of them.
    node_class : OUTSIDE, INSIDE or ON_OUTLINE, shape (nodes,).
    row_count : of the lattice. pitch : edge length of whole cells [m].
    faces : nodes of the cells, triangles repeat the last, shape (cells, 4).
    origin : lattice node at the lower left of the cells, shape (cells,).
    lattice_node : place in the lattice of each node, shape (nodes,).
    """

    positions: np.ndarray
    node_class: np.ndarray
    row_count: int
    pitch: float
    faces: np.ndarray
    origin: np.ndarray
    lattice_node: np.ndarray

    @cached_property
    def area(self) -> float:
        """Area of all cells [m2]."""
        return math.fsum(cell_areas(self.positions[self.faces]))

    @cached_property
    def piece_count(self) -> int:
        """Number of pieces that hang together over edges."""
        return piece_count(self.faces)

    @cached_property
    def heights(self) -> np.ndarray:
        """Smallest height of each cell, relative to the pitch."""
        return cell_heights(self.positions[self.faces]) / self.pitch

    @property
    def smallest_height(self) -> float:
        """The least of the heights, 0 without cells."""
        return float(self.heights.min()) if len(self.faces) else 0.0

    @property
    def weakest(self) -> int:
        """The cell with the smallest height, -1 without cells."""
        return int(np.argmin(self.heights)) if len(self.faces) else -1

    @cached_property
    def step_ratio(self) -> float:
        """Stable step of whole cells over that of cut ones, at least 1."""
        return step_ratio(self.positions, self.faces, self.pitch)


def cut_lattice(
    contours: Contours,
    x_lines: np.ndarray,
    y_lines: np.ndarray,
    pitch: float,
    corner_nodes: Mapping[int, tuple[int, int]] = MappingProxyType({}),
    reach: float = INSIDE_REACH,
) -> LatticeCells:
    """Cut the lattice with the contours and keep the cells inside.

    Parameters
    ----------
    contours : of the blank, in fibre coordinates.
    x_lines, y_lines : coordinates of the lattice lines [m].
    pitch : edge length of the cells [m].
    corner_nodes : column and row of the lattice nodes that take given vertices; the nearest takes
        the other corners.
    reach : part of a cut lattice edge over which its inside node moves outwards.
    """
    contours = contours.moved(
        lambda points: np.column_stack(
            [
                _pull_onto_lines(points[:, 0], x_lines, pitch),
                _pull_onto_lines(points[:, 1], y_lines, pitch),
            ]
        )
    )
    row_count = len(y_lines)
    lattice = _cut_edges(contours, x_lines, y_lines)
    if not contours.is_plain:
        lattice = part_at_seams(contours, lattice, x_lines, y_lines, pitch, corner_nodes)
    cuts, positions = lattice.cuts, lattice.positions
    node_class = np.where(lattice.is_inside, INSIDE, OUTSIDE)
    node_class[cuts.low[cuts.share < COINCIDENT]] = ON_OUTLINE
    node_class[cuts.high[cuts.share > 1.0 - COINCIDENT]] = ON_OUTLINE
    node_class[lattice.on_seams] = ON_OUTLINE
    for vertex in contours.corners():
        point = contours.vertex(vertex)
        tip = tip_at(contours, vertex, x_lines, y_lines, pitch) if not contours.is_plain else None
        if vertex in corner_nodes:
            column, row = corner_nodes[vertex]
        elif tip is not None:
            column, row = tip.nodes[0]
        elif _is_between(point, x_lines, y_lines):
            column, row = nearest_node(point, x_lines, y_lines)
        else:
            continue
        nodes = copies_at(lattice, column * row_count + row, point, pitch)
        node_class[nodes] = ON_OUTLINE
        positions[nodes] = point
    _move_onto_outline(positions, node_class, cuts, lattice.is_inside, reach)

    faces, origin = _cells_inside(lattice, positions, node_class, contours, pitch)
    if len(faces):
        is_free = np.ones(len(positions), dtype=bool)
        is_free[faces] = False
        tips = _fill_tips(contours, positions, is_free, faces, pitch)
        node_class[tips] = ON_OUTLINE
        faces = np.concatenate([faces, tips])
        origin = np.concatenate([origin, lattice.lattice_node[tips[:, 2]]])
    return LatticeCells(
        positions, node_class, row_count, pitch, faces, origin, lattice.lattice_node
    )


def _cut_edges(contours: Contours, x_lines: np.ndarray, y_lines: np.ndarray) -> Lattice:
    """Lattice with the edges of both directions that the contours cut, those along y first."""
    column_count, row_count = len(x_lines), len(y_lines)
    start, end = contours.points, contours.ends
    columns, upper, y_cuts = line_cuts(x_lines, y_lines, start, end)
    rows, right, x_cuts = line_cuts(y_lines, x_lines, start[:, ::-1], end[:, ::-1])
    is_inside = _inside_by_parity(columns, upper, column_count, row_count)
    columns, upper, y_cuts = _between(row_count, columns, upper, y_cuts)
    rows, right, x_cuts = _between(column_count, rows, right, x_cuts)
    low = np.concatenate([columns * row_count + upper - 1, (right - 1) * row_count + rows])
    high = np.concatenate([columns * row_count + upper, right * row_count + rows])
    share = np.concatenate(
        [
            (y_cuts - y_lines[upper - 1]) / (y_lines[upper] - y_lines[upper - 1]),
            (x_cuts - x_lines[right - 1]) / (x_lines[right] - x_lines[right - 1]),
        ]
    )
    position = np.column_stack(
        [np.concatenate([x_lines[columns], x_cuts]), np.concatenate([y_cuts, y_lines[rows]])]
    )
    return Lattice.whole(x_lines, y_lines, CutEdges(low, high, share, position), is_inside)


def _move_onto_outline(
    positions: np.ndarray,
    node_class: np.ndarray,
    cuts: CutEdges,
    is_inside: np.ndarray,
    reach: float,
) -> None:
    """Move one end of every cut lattice edge onto the cut, in place."""
    low, high = cuts.low, cuts.high
    # An edge with one end on the outline needs no cut; one with both ends on the same side is
    # cut twice, by a sliver narrower than the pitch, which cannot be resolved.
    open_ = (
        (node_class[low] != ON_OUTLINE)
        & (node_class[high] != ON_OUTLINE)
        & (is_inside[low] != is_inside[high])
    )
    low, high, share, position = (column[open_] for column in cuts)
    from_inside = np.where(is_inside[low], share, 1.0 - share)
    moves_inside = from_inside <= reach
    moved = np.where(moves_inside == is_inside[low], low, high)
    way = np.where(moves_inside, from_inside, 1.0 - from_inside)
    # A node that could move to several cuts takes the nearest; rounding removes noise from the ties
    # of a 45 degree edge, which all go to the column's cut, listed first.
    order = np.lexsort((np.arange(len(moved)), np.round(way, 6), moved))
    moved, position = moved[order], position[order]
    first = np.ones(len(moved), dtype=bool)
    first[1:] = moved[1:] != moved[:-1]
    positions[moved[first]] = position[first]
    node_class[moved[first]] = ON_OUTLINE


def _pull_onto_lines(values: np.ndarray, lines: np.ndarray, pitch: float) -> np.ndarray:
    """Remove the rounding noise of the rotation from vertices that lie on a lattice line."""
    upper = np.clip(np.searchsorted(lines, values), 1, len(lines) - 1)
    nearest = np.where(
        values - lines[upper - 1] < lines[upper] - values, lines[upper - 1], lines[upper]
    )
    return np.where(np.abs(values - nearest) < COINCIDENT * pitch, nearest, values)


def _inside_by_parity(
    columns: np.ndarray, upper: np.ndarray, column_count: int, row_count: int
) -> np.ndarray:
    """True for lattice nodes with an odd number of cuts above them in their column."""
    cut_count = np.zeros((column_count, row_count + 1), dtype=np.int64)
    np.add.at(cut_count, (columns, upper), 1)
    above = cut_count[:, ::-1].cumsum(axis=1)[:, ::-1] - cut_count
    return (above[:, :-1] % 2 == 1).ravel()


def _between(line_count: int, *columns: np.ndarray) -> list[np.ndarray]:
    """Leave out the cuts that lie beyond the first or last of the lines across."""
    across = columns[1]
    there = (across > 0) & (across < line_count)
    return [column[there] for column in columns]


def nearest_node(point: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray) -> tuple[int, int]:
    """Column and row of the lattice node next to a point."""
    return int(np.argmin(np.abs(x_lines - point[0]))), int(np.argmin(np.abs(y_lines - point[1])))


def _is_between(point: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray) -> bool:
    """Whether a point lies within the lattice, which may be a window of a larger one."""
    pairs = zip(point, (x_lines, y_lines), strict=True)
    return all(lines[0] <= value <= lines[-1] for value, lines in pairs)


def _cells_inside(
    lattice: Lattice,
    positions: np.ndarray,
    node_class: np.ndarray,
    contours: Contours,
    pitch: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Whole and halved cells inside the contours, and the lattice node each one starts from."""
    quads, start = lattice.quads, lattice.origin
    classes = node_class[quads]
    if lattice.beyond is not None:  # corners of a cell on the other side of a seam
        classes = np.where(lattice.beyond & (classes == INSIDE), OUTSIDE, classes)
    kept = (classes != OUTSIDE).sum(axis=1) >= 3
    quads, start, classes = quads[kept], start[kept], classes[kept]
    outside_count = (classes == OUTSIDE).sum(axis=1)
    on_count = (classes == ON_OUTLINE).sum(axis=1)

    whole = outside_count == 0
    # A node in the middle of a straight piece of the outline makes a whole cell a triangle.
    sines = corner_sines(positions[quads])
    flat_at = np.argmin(sines, axis=1)
    flat = whole & (on_count >= 3) & (sines.min(axis=1) < 1e-6)
    # One node outside: its neighbours lie on the outline, and the half beyond it is cut off.
    left_out = np.where(flat, flat_at, np.argmin(classes, axis=1))
    halved = flat | (outside_count == 1)
    around = (left_out[:, np.newaxis] + np.array([3, 1, 2, 2])) % 4
    triangles = np.take_along_axis(quads, around, axis=1)
    neighbours = np.take_along_axis(classes, around[:, :2], axis=1)
    halved &= (neighbours == ON_OUTLINE).all(axis=1)

    faces = np.where(halved[:, np.newaxis], triangles, quads)
    keep = halved | (whole & ~flat)
    faces, origin = faces[keep], start[keep]

    # With all nodes on the outline only the position tells whether the cell is inside.
    doubtful = np.flatnonzero((node_class[faces] == ON_OUTLINE).all(axis=1))
    if len(doubtful):
        corner = positions[faces[doubtful]]
        centre = (corner[:, 0] + corner[:, 1] + corner[:, 2]) / 3.0
        quad = faces[doubtful, 2] != faces[doubtful, 3]
        centre[quad] = corner[quad].mean(axis=1)
        real = contains_xy(contours.polygon, *centre.T) & (cell_heights(corner) > 1e-3 * pitch)
        faces, origin = (
            np.delete(faces, doubtful[~real], axis=0),
            np.delete(origin, doubtful[~real]),
        )
    return faces, origin


# --- tips of the outline --------------------------------------------------------------------------


# Relative to the pitch: closer than this a node lies on an edge of the outline.
ON_EDGE = 1e-6
# Tips further from all nodes belong to another part of the lattice.
TIP_REACH = 6.0
# A tip that would shorten the step by more than this stays cut off.
ACCEPTABLE_TIP_RATIO = 1.2
# Triangles lower than this part of the pitch are left out.
LEAST_TIP_HEIGHT = 0.05


def _fill_tips(
    contours: Contours,
    positions: np.ndarray,
    is_free: np.ndarray,
    faces: np.ndarray,
    pitch: float,
) -> np.ndarray:
    """Return triangles (tips, 4) between a boundary edge of the cells and a corner beyond it.

    The edge must join the two sides of the outline that meet in the corner. The corner takes the
    nearest lattice node that is free: ``positions`` is written.

    Parameters
    ----------
    contours : of the blank; ends and corners of slits are no tips.
    positions : lattice nodes [m]; is_free : which of them no cell has.
    faces : cells, shape (cells, 4). pitch : edge length of whole cells [m].
    """
    outline = contours.points
    vertices = [vertex for vertex in contours.corners() if vertex < len(outline)]
    used = positions[~is_free]
    low, high = used.min(axis=0), used.max(axis=0)
    lost = [
        vertex
        for vertex in vertices
        if (outline[vertex] > low - TIP_REACH * pitch).all()
        and (outline[vertex] < high + TIP_REACH * pitch).all()
        and not (np.abs(used - outline[vertex]) < ON_EDGE * pitch).all(axis=1).any()
    ]
    if not lost:
        return faces[:0]
    edges = boundary_edges(faces)
    filled, limit = faces, max(ACCEPTABLE_TIP_RATIO, step_ratio(positions, faces, pitch))
    free = np.flatnonzero(is_free)
    for vertex in lost[: len(free)]:
        corner = outline[vertex]
        sides = corner, outline[contours.before[vertex]], outline[contours.after[vertex]]
        ends = positions[edges]
        before = _is_on(ends, sides[1], corner, pitch)
        after = _is_on(ends, corner, sides[2], pitch)
        joins = np.flatnonzero((before & after[:, ::-1]).any(axis=1))
        if len(joins) != 1:
            continue
        first, last = edges[joins[0]] if before[joins[0], 0] else edges[joins[0], ::-1]
        node = int(free[np.argmin(((positions[free] - corner) ** 2).sum(axis=1))])
        old = positions[node].copy()
        positions[node] = corner
        # anticlockwise: before, corner, after
        triangle = np.array([[last, first, node, node]])
        trial = np.concatenate([filled, triangle])
        height = cell_heights(positions[triangle])[0]
        if height > LEAST_TIP_HEIGHT * pitch and step_ratio(positions, trial, pitch) <= limit:
            filled, free = trial, free[free != node]
        else:
            positions[node] = old
    return filled[len(faces) :]


def _is_on(points: np.ndarray, start: np.ndarray, end: np.ndarray, pitch: float) -> np.ndarray:
    """Whether points (..., 2) lie on the straight line between two others."""
    along = end - start
    length = float(np.hypot(*along))
    way = (points - start) @ along / length
    off = np.abs(cross(along, points - start)) / length
    return (off < ON_EDGE * pitch) & (way > -ON_EDGE * pitch) & (way < length + ON_EDGE * pitch)
