"""Choice of the lattice nodes that take the corners of the outline."""

from __future__ import annotations

from itertools import product

import numpy as np
import shapely

from lcmchain.mesh.cells import boundary_edges
from lcmchain.mesh.contours import Contours
from lcmchain.mesh.cut import ON_OUTLINE, Cells, cut_lattice, nearest_node
from lcmchain.mesh.seam_tips import tip_at
from lcmchain.mesh.step_measure import cut_nodes

# Nodes up to this far from a corner may take it, and cells up to twice as far tell how well; in
# units of the pitch. The window of the lattice in which it is tried reaches further.
NEAR = 1.5
WINDOW = 6
# A node that shortens the step by no more than this is not improved upon.
GOOD_RATIO = 1.08
# Cells lower than this part of the pitch are as good as inverted.
LEAST_HEIGHT = 0.05


def choose_corner_nodes(
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
            rank = _rank(cells, point, contours.lines, pitch)
            if best is None or rank < best:
                best, chosen_node = rank, candidate
            if not any(rank[:3]) and rank[3] <= GOOD_RATIO:
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


def _rank(
    cells: Cells, point: np.ndarray, ring: shapely.Geometry, pitch: float
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
