"""Lattice along the two fibre directions, laid so that it fits the outline.

Several positions of the lattice are tried. In each the corners of the outline are given to lattice
nodes, the lattice is cut with the outline (:mod:`lcmchain.mesh.cut`), and the best cells stay. They
are numbered line by line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
import shapely

from lcmchain.mesh.cells import boundary_edges, cut_nodes
from lcmchain.mesh.contours import Contours
from lcmchain.mesh.cut import INSIDE_REACH, ON_OUTLINE, LatticeCells, cut_lattice, nearest_node
from lcmchain.mesh.outline import whole_number
from lcmchain.mesh.seams import COINCIDENT, tip_at

# Pitch may deviate by this factor from the edge length to fit diagonals to the outline.
DIAGONAL_FIT = 1.25

# Cells between lattice lines through a hole or slit are at least this long, relative to the pitch.
SHORTEST_CELL = 0.9

# Positions of the lattice relative to the outline, in units of the pitch, and as many as are tried
# where they give a whole mesh.
SHIFTS = (0.0, 0.5, 0.2, 0.4, 0.6, 0.8)
USUAL_VARIANTS = 4

# A second way to cut: inside nodes are pulled out over less of a cut edge.
SHORT_REACH = 0.7

# Step of whole cells over that of cut ones: enough to stop the search for a better position, and
# the most that is accepted before coverage of the outline counts.
GOOD_RATIO = 1.1
ACCEPTABLE_RATIO = 1.2

# The same of the smallest height of a cell, relative to the pitch, and of the part of the area.
ACCEPTABLE_HEIGHT = 0.25
ACCEPTABLE_MISSING = 1e-2


def best_lattice(contours: Contours, edge_length: float) -> LatticeCells:
    """Cells of the best of several positions of the lattice under the contours.

    Only a position that the outline's edges do not prescribe is varied. The first ones are
    symmetric to the middle of the outline and are taken if they are good.
    """
    if contours.is_plain:
        rim = contours.rim
        pitch = _pitch_fitting_diagonals(rim, edge_length)
        if pitch is not None:
            lines = [_uniform_lines(rim[:, axis], rim[0, axis], pitch) for axis in range(2)]
            return _cut(contours, lines, pitch, INSIDE_REACH)

    area = contours.area
    best: LatticeCells | None = None
    best_rank: tuple[float, ...] = ()
    for number, (lines, reach) in enumerate(_variants(contours, edge_length)):
        if number >= USUAL_VARIANTS and best_rank < (False, False, True):
            break  # whole, and the others would hardly be better
        cells = _cut(contours, lines, edge_length, reach)
        missing = abs(cells.area - area) / area
        missing = 0.0 if missing < 1e-9 else missing
        rank = (
            cells.piece_count != 1 or cells.smallest_height <= 0.0,
            missing > ACCEPTABLE_MISSING,
            cells.step_ratio > ACCEPTABLE_RATIO,
            cells.smallest_height < ACCEPTABLE_HEIGHT,
            missing,
            cells.step_ratio,
            -cells.smallest_height,
        )
        if best is None or rank < best_rank:
            best, best_rank = cells, rank
        if not any(rank[:5]) and cells.step_ratio <= GOOD_RATIO:
            break
    assert best is not None  # there is a variant at least
    return best


def _cut(contours: Contours, lines: list[np.ndarray], pitch: float, reach: float) -> LatticeCells:
    """Cut a lattice, with the best nodes at the corners."""
    x_lines, y_lines = lines
    corner_nodes = _choose_corner_nodes(contours, x_lines, y_lines, pitch, reach)
    return cut_lattice(contours, x_lines, y_lines, pitch, corner_nodes, reach)


def _variants(contours: Contours, edge_length: float) -> Iterator[tuple[list[np.ndarray], float]]:
    """Yield lattice lines in both directions and the reach of inside nodes, the usual ones first.

    Nodes that reach less far follow details that are narrower than two cells.
    """
    anchors = [_aligned_edges(contours, axis, edge_length) for axis in range(2)]
    shifts = list(product(*((0.0,) if len(anchor) else SHIFTS for anchor in anchors)))
    shifts.sort(key=lambda pair: sum(part not in (0.0, 0.5) for part in pair))
    usual = [shift for shift in shifts if set(shift) <= {0.0, 0.5}]
    pairs = [*product((INSIDE_REACH, SHORT_REACH), usual)]
    pairs += [
        (reach, shift)
        for reach in (INSIDE_REACH, SHORT_REACH)
        for shift in shifts
        if shift not in usual
    ]
    for reach, shift in pairs:
        lines = []
        for axis, anchor in enumerate(anchors):
            values = contours.rim[:, axis]
            if len(anchor):
                lines.append(_anchored_lines(values, anchor, edge_length))
            else:
                through = 0.5 * (values.min() + values.max()) + shift[axis] * edge_length
                lines.append(_uniform_lines(values, through, edge_length))
        yield lines, reach


def _pitch_fitting_diagonals(outline: np.ndarray, edge_length: float) -> float | None:
    """Pitch whose diagonal divides all sides of an outline under 45 degrees; None if none does."""
    along = np.roll(outline, -1, axis=0) - outline
    lengths = np.hypot(*along.T)
    if (np.abs(np.abs(along[:, 0]) - np.abs(along[:, 1])) > COINCIDENT * lengths).any():
        return None
    diagonal = math.sqrt(2.0) * edge_length
    shortest = lengths.min()
    counts = np.arange(
        max(1, math.ceil(shortest / (diagonal * DIAGONAL_FIT))),
        math.floor(shortest / diagonal * DIAGONAL_FIT) + 1,
    )
    if len(counts) == 0:
        return None
    diagonals = shortest / counts
    ratios = lengths / diagonals[:, np.newaxis]
    fits = (np.abs(ratios - np.round(ratios)) < 1e-6).all(axis=1)
    if not fits.any():
        return None
    mismatch = np.where(fits, np.abs(np.log(diagonals / diagonal)), np.inf)
    return float(diagonals[np.argmin(mismatch)] / math.sqrt(2.0))


def _aligned_edges(contours: Contours, axis: int, edge_length: float) -> np.ndarray:
    """Coordinates of sides and slits across an axis, at least half an edge length apart.

    The sides of the rim come first. A hole or slit whose line would make the cells beside it
    shorter is cut instead.
    """
    rim = contours.starts[1]
    kept: list[float] = []
    for value in _across(contours.points[:rim], contours.ends[:rim], axis, edge_length):
        if not kept or value - kept[-1] >= 0.5 * edge_length:
            kept.append(value)
    inner = [(contours.points[rim:], contours.ends[rim:])]
    inner += [(slit[:-1], slit[1:]) for slit in contours.slits]
    for start, end in inner:
        for value in _across(start, end, axis, edge_length):
            if all(_fits(abs(value - other) / edge_length) for other in kept):
                kept.append(value)
    return np.sort(kept)


def _across(start: np.ndarray, end: np.ndarray, axis: int, edge_length: float) -> list[float]:
    """Sorted coordinates of the sides across an axis that are as long as an edge."""
    along = np.abs(end - start)
    aligned = (along[:, axis] <= COINCIDENT * edge_length) & (along[:, 1 - axis] >= edge_length)
    return [float(value) for value in np.sort(start[aligned, axis])]


def _fits(edges: float) -> bool:
    """Whether whole cells of about an edge length fill a distance, in edge lengths."""
    return edges / max(1, whole_number(edges)) > SHORTEST_CELL


def _uniform_lines(values: np.ndarray, through: float, pitch: float) -> np.ndarray:
    """Lattice lines at multiples of the pitch, reaching beyond all values on both sides."""
    first = math.floor((values.min() - through) / pitch) - 1
    last = math.ceil((values.max() - through) / pitch) + 1
    return through + pitch * np.arange(first, last + 1)


def _anchored_lines(values: np.ndarray, anchors: np.ndarray, edge_length: float) -> np.ndarray:
    """Lattice lines through all anchors, evenly spaced between them, reaching beyond all values."""
    below = math.ceil((anchors[0] - values.min()) / edge_length - COINCIDENT) + 1
    above = math.ceil((values.max() - anchors[-1]) / edge_length - COINCIDENT) + 1
    parts = [anchors[0] - edge_length * np.arange(below, 0, -1)]
    for start, end in zip(anchors[:-1], anchors[1:]):
        count = max(1, whole_number((end - start) / edge_length))
        parts.append(np.linspace(start, end, count, endpoint=False))
    parts.append(anchors[-1] + edge_length * np.arange(above + 1))
    return np.concatenate(parts)


# --- nodes that take the corners of the outline ---------------------------------------------------


# Nodes up to this far from a corner may take it, and cells up to twice as far tell how well; in
# units of the pitch. The window of the lattice in which it is tried reaches further.
NEAR = 1.5
WINDOW = 6
# A node that shortens the step by no more than this is not improved upon.
GOOD_CORNER_RATIO = 1.08
# Cells lower than this part of the pitch are as good as inverted.
LEAST_HEIGHT = 0.05


def _choose_corner_nodes(
    contours: Contours, x_lines: np.ndarray, y_lines: np.ndarray, pitch: float, reach: float
) -> dict[int, tuple[int, int]]:
    """Return a lattice node (column, row) for every corner vertex of the contours.

    Each corner in turn, the sharpest first, takes the node near it with which the cells around it
    leave the longest time step, the nearest one of equals.
    """
    chosen: dict[int, tuple[int, int]] = {}
    for vertex in reversed(contours.corners()):
        point = contours.vertex(vertex)
        column, row = nearest_node(point, x_lines, y_lines)
        first = max(column - WINDOW, 0), max(row - WINDOW, 0)
        lines = (
            x_lines[first[0] : column + WINDOW + 1],
            y_lines[first[1] : row + WINDOW + 1],
        )
        taken = set(chosen.values())
        best = None
        candidates = _nodes_near(point, x_lines, y_lines, (column, row), pitch)
        if not contours.is_plain:
            tip = tip_at(contours, vertex, x_lines, y_lines, pitch)
            candidates = candidates if tip is None else tip.nodes
        for candidate in candidates:
            if candidate in taken:
                continue
            tried = {
                v: (c - first[0], r - first[1])
                for v, (c, r) in (chosen | {vertex: candidate}).items()
                if 0 <= c - first[0] < len(lines[0]) and 0 <= r - first[1] < len(lines[1])
            }
            cells = cut_lattice(contours, *lines, pitch, tried, reach)
            rank = _rank_of_corner(cells, point, contours.lines, pitch)
            if best is None or rank < best:
                best, chosen_node = rank, candidate
            if not any(rank[:3]) and rank[3] <= GOOD_CORNER_RATIO:
                break
        if best is not None:
            chosen[vertex] = chosen_node
    return chosen


def _nodes_near(
    point: np.ndarray,
    x_lines: np.ndarray,
    y_lines: np.ndarray,
    middle: tuple[int, int],
    pitch: float,
) -> list[tuple[int, int]]:
    """Lattice nodes near a point, the nearest first."""
    found = []
    for shift in product(range(-2, 3), repeat=2):
        column, row = middle[0] + shift[0], middle[1] + shift[1]
        if 0 <= column < len(x_lines) and 0 <= row < len(y_lines):
            way = float(np.hypot(x_lines[column] - point[0], y_lines[row] - point[1])) / pitch
            if way <= NEAR:
                found.append((round(way, 6), column, row))
    if min(found)[0] == 0.0:
        return [min(found)[1:]]  # a corner on a node stays there
    return [(column, row) for _, column, row in sorted(found)]


def _rank_of_corner(
    cells: LatticeCells, point: np.ndarray, ring: shapely.Geometry, pitch: float
) -> tuple[bool, bool, int, float]:
    """How bad the cells around a corner are: not there, inverted, off the outline, slow."""
    if not (cells.positions[np.unique(cells.faces)] == point).all(axis=1).any():
        return True, True, 0, np.inf
    near = np.hypot(*(cells.positions - point).T) < 2.0 * NEAR * pitch
    is_near = near[cells.faces].any(axis=1)
    sound = cells.heights > LEAST_HEIGHT
    edges = boundary_edges(cells.faces)
    edges = edges[near[edges].all(axis=1) & (cells.node_class[edges] == ON_OUTLINE).all(axis=1)]
    middles = cells.positions[edges].mean(axis=1)
    off = shapely.distance(ring, shapely.points(middles)) > 1e-6 * pitch
    faces = cells.faces[sound]
    ratio = cut_nodes(cells.positions[faces], faces, pitch).ratio
    slowest = float(ratio[near[: len(ratio)]].max(initial=0.0))
    return False, not sound[is_near].all(), int(off.sum()), round(slowest, 6)


# --- numbering line by line across the sheet ------------------------------------------------------


# Stretch of elements within which the cut ones come last: long beside the blocks in which kernels
# take elements, short beside what a step has on hand at a time.
STRETCH = 256
# Difference of opposite edges, relative to the pitch, up to which a cell counts as uncut.
UNCUT = 1e-9


def number_by_lines(cells: LatticeCells) -> tuple[np.ndarray, np.ndarray]:
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
