"""Flat blank: a fibre-aligned mesh of solid-shell hexahedra inside a rectangle or polygon.

A lattice is laid along the two fibre directions. Lattice lines run exactly through outline edges
that are parallel to a fibre, and under 45 degrees the cell diagonals are fitted to the outline's
sides. What does not fit is cut as in isosurface stuffing (Labelle & Shewchuk 2007): wherever the
outline cuts a lattice edge, one end of that edge is moved along it onto the outline, so that no
edge crosses the outline any more; cells inside stay quadrilaterals, halved cells become triangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.errors import InputError

MAXIMUM_ELEMENT_COUNT = 2_000_000
MAXIMUM_PERTURBATION = 0.25

# Largest relative difference of the meshed area from the outline's that is accepted.
AREA_TOLERANCE = 0.02

# Relative to the pitch: closer than this a point lies on a lattice line or node.
COINCIDENT = 1e-9

# An inside node is pulled outwards over up to this part of a cut lattice edge; only beyond it the
# outside node is pulled inwards. Above one half, because cells shorter than the pitch would reduce
# the stable time step of the whole blank.
INSIDE_REACH = 0.7

# Outline vertices that turn by at least this angle get a node of their own.
CORNER_ANGLE = math.radians(15.0)

# Pitch may deviate by this factor from the edge length to fit diagonals to the outline.
DIAGONAL_FIT = 1.25

# Node pairs and elements are numbered in compact patches of this many.
PATCH = 128

# Smallest height of a cell, relative to the pitch: enough to stop the search for a better lattice
# position, and the least that is accepted before coverage of the outline counts.
GOOD_HEIGHT = 0.5
ACCEPTABLE_HEIGHT = 0.25

OUTSIDE, INSIDE, ON_OUTLINE = 0, 1, 2


@dataclass(frozen=True)
class BlankMesh:
    """Hexahedral mesh of the undeformed blank with its fibre directions.

    Attributes
    ----------
    node_positions : positions [m], shape (node_count, 3); the first half is the bottom face, node
        ``i + pair_count`` lies above node ``i``.
    elements : node numbers in VTK hexahedron order, shape (element_count, 8); node 0 to node 1
        points along fibre 1. Triangles at a cut edge repeat their last node: the first two nodes
        are the cut edge, bottom (n0, n1, n2, n2).
    fibre_direction_1, fibre_direction_2 : unit vectors, shape (element_count, 3).
    thickness : initial thickness [m].
    outline_area : area inside the prescribed outline [m2]; nan where no outline was prescribed.
    """

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    outline_area: float = math.nan

    @property
    def node_count(self) -> int:
        return len(self.node_positions)

    @property
    def pair_count(self) -> int:
        """Number of pairs of a bottom node and the top node above it."""
        return len(self.node_positions) // 2

    @property
    def element_count(self) -> int:
        return len(self.elements)

    @property
    def faces(self) -> np.ndarray:
        """Mid-surface faces in pair numbering, shape (element_count, 4)."""
        return self.elements[:, :4]

    @property
    def is_triangle(self) -> np.ndarray:
        """True for halved cells, shape (element_count,)."""
        return self.elements[:, 2] == self.elements[:, 3]

    @property
    def mid_surface_positions(self) -> np.ndarray:
        """Positions of the mid-surface nodes [m], shape (pair_count, 3)."""
        return 0.5 * (
            self.node_positions[: self.pair_count] + self.node_positions[self.pair_count :]
        )

    @property
    def element_areas(self) -> np.ndarray:
        """Initial mid-surface area of every element [m2], shape (element_count,)."""
        corner = self.mid_surface_positions[self.faces][..., :2]
        return 0.5 * _cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])

    @property
    def area(self) -> float:
        """Initial mid-surface area [m2]."""
        return math.fsum(self.element_areas)


def build_blank(
    blank_spec, thickness: float, *, perturbation: float = 0.0, seed: int = 0
) -> BlankMesh:
    """Mesh a flat blank along its fibres.

    Parameters
    ----------
    blank_spec : the scene's blank: ``size`` (width, height) about the origin or ``outline``
        (vertices x, y) [m], ``edge_length`` [m], ``fibre_angle`` from x to fibre 1 [rad] and
        ``height``, the z of the mid-surface [m].
    thickness : initial thickness [m].
    perturbation : largest in-plane displacement of the nodes that are not on the outline, as a
        fraction of the edge length, at most 0.25 (for studies of mesh sensitivity).
    seed : selects the perturbation; the same seed gives the same mesh.

    Raises
    ------
    InputError
        An outline that intersects itself or encloses no area, a blank with fewer than two elements
        across or more than two million in all, an outline too narrow for the edge length.
    """
    edge_length = float(blank_spec.edge_length)
    if not (math.isfinite(edge_length) and edge_length > 0.0):
        raise InputError(f"must be positive, got {edge_length:g} m", key="blank.edge_length")
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise InputError(f"must be positive, got {thickness:g} m", key="material.thickness")
    if not 0.0 <= perturbation <= MAXIMUM_PERTURBATION:
        raise InputError(
            f"perturbation must lie between 0 and {MAXIMUM_PERTURBATION:g} of the edge length, "
            f"got {perturbation:g}"
        )
    outline, outline_key = _outline_of(blank_spec)
    area = polygon_area(outline)
    _check_element_count(outline, area, edge_length)

    to_fibres = _rotation(-float(blank_spec.fibre_angle))
    to_scene = to_fibres.T
    cells = _best_lattice(outline @ to_fibres.T, edge_length)
    _check_coverage(cells, area, edge_length, to_scene, outline_key)

    positions, faces, is_free = _number_in_patches(cells)
    if perturbation > 0.0:
        shift = np.random.default_rng(seed).uniform(-1.0, 1.0, positions.shape)
        positions = positions + perturbation * edge_length * shift * is_free[:, np.newaxis]
    positions = positions @ to_scene.T
    _check_jacobians(positions, faces)

    pair_count = len(positions)
    nodes = np.empty((2 * pair_count, 3))
    nodes[:pair_count, :2] = nodes[pair_count:, :2] = positions
    nodes[:pair_count, 2] = blank_spec.height - 0.5 * thickness
    nodes[pair_count:, 2] = blank_spec.height + 0.5 * thickness
    return BlankMesh(
        node_positions=nodes,
        elements=np.hstack([faces, faces + pair_count]),
        fibre_direction_1=_constant_direction(to_scene[:, 0], len(faces)),
        fibre_direction_2=_constant_direction(to_scene[:, 1], len(faces)),
        thickness=float(thickness),
        outline_area=area,
    )


def polygon_area(outline: np.ndarray) -> float:
    """Area enclosed by a polygon [m2], positive when its vertices run anticlockwise.

    Parameters
    ----------
    outline : vertices [m], shape (vertex_count, 2), not repeated at the end.
    """
    local = outline - outline[0]
    return 0.5 * math.fsum(_cross(local, np.roll(local, -1, axis=0)))


# --- Outline -------------------------------------------------------------------------------------


def _outline_of(blank_spec) -> tuple[np.ndarray, str]:
    """Vertices of the blank, anticlockwise, and the scene key that gave them."""
    if getattr(blank_spec, "outline", None) is None:
        width, height = (float(length) for length in blank_spec.size)
        if not (math.isfinite(width) and math.isfinite(height) and min(width, height) > 0.0):
            raise InputError(f"must be positive, got {width:g} m x {height:g} m", key="blank.size")
        x, y = 0.5 * width, 0.5 * height
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), "blank.size"
    key = "blank.outline"
    outline = np.array(blank_spec.outline, dtype=float).reshape(-1, 2)
    if not np.isfinite(outline).all():
        raise InputError("has a coordinate that is not a finite number", key=key)
    if len(outline) > 1 and np.array_equal(outline[0], outline[-1]):
        outline = outline[:-1]  # written as a closed polygon
    if len(outline) < 3:
        raise InputError(f"needs at least three different points, got {len(outline)}", key=key)
    _check_simple(outline, key)
    if polygon_area(outline) < 0.0:
        outline = outline[::-1]
    return np.ascontiguousarray(outline), key


def _check_simple(outline: np.ndarray, key: str) -> None:
    """Raise InputError where the polygon repeats a point, touches or crosses itself."""
    vertex_count = len(outline)
    start, end = outline, np.roll(outline, -1, axis=0)
    along = end - start
    size = np.ptp(outline, axis=0).max()
    lengths = np.hypot(*along.T)
    if (lengths <= 1e-12 * size).any():
        repeated = int(np.argmin(lengths))
        raise InputError(
            f"point {repeated + 2 if repeated + 1 < vertex_count else 1} repeats the point before "
            f"it, {_place(start[repeated])}; remove one of them",
            key=key,
        )
    for first in range(vertex_count):
        # Neighbouring edges share a point; they may only not fold back onto each other.
        following = (first + 1) % vertex_count
        folded = (
            abs(_cross(along[first], along[following]))
            <= 1e-12 * lengths[first] * lengths[following]
            and along[first] @ along[following] < 0.0
        )
        if folded:
            raise InputError(f"folds back onto itself at {_place(end[first])}", key=key)
        others = np.arange(first + 2, vertex_count - (first == 0))
        if len(others) == 0:
            continue
        meets = _segments_meet(start[first], end[first], start[others], end[others])
        if meets.any():
            other = int(others[np.argmax(meets)])
            raise InputError(
                f"intersects itself: the edge from point {first + 1} {_place(start[first])} meets "
                f"the edge from point {other + 1} {_place(start[other])}; give the points in the "
                "order in which one walks around the blank",
                key=key,
            )


def _segments_meet(p: np.ndarray, q: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """True where the segment p-q has a point in common with the segments a-b."""
    tolerance = 1e-12 * np.hypot(*(q - p)) * np.hypot(*(b - a).T)
    side_a, side_b = _cross(q - p, a - p), _cross(q - p, b - p)
    side_p, side_q = _cross(b - a, p - a), _cross(b - a, q - a)
    separated = (
        (np.minimum(side_a, side_b) > tolerance)
        | (np.maximum(side_a, side_b) < -tolerance)
        | (np.minimum(side_p, side_q) > tolerance)
        | (np.maximum(side_p, side_q) < -tolerance)
    )
    boxes_apart = (
        (np.minimum(a, b) > np.maximum(p, q)) | (np.maximum(a, b) < np.minimum(p, q))
    ).any(axis=1)
    return ~(separated | boxes_apart)


def _check_element_count(outline: np.ndarray, area: float, edge_length: float) -> None:
    key = "blank.edge_length"
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, np.newaxis]
    width = min(np.ptp(outline @ normal) for normal in normals)
    if edge_length > width:
        raise InputError(
            f"{edge_length:g} m is larger than the blank, which is {width:g} m wide; "
            f"choose {width / 10.0:.2g} m or less",
            key=key,
        )
    if _whole_number(width / edge_length) < 2:
        raise InputError(
            f"{edge_length:g} m leaves fewer than two elements across the blank, which is "
            f"{width:g} m wide; choose {width / 10.0:.2g} m or less",
            key=key,
        )
    estimate = area / edge_length**2
    if estimate > MAXIMUM_ELEMENT_COUNT:
        smallest = math.sqrt(area / MAXIMUM_ELEMENT_COUNT)
        raise InputError(
            f"{edge_length:g} m would make about {estimate:.2g} elements, more than the "
            f"{MAXIMUM_ELEMENT_COUNT} that are allowed; choose {smallest:.2g} m or more",
            key=key,
        )


# --- Lattice -------------------------------------------------------------------------------------


class _Cells(NamedTuple):
    """Lattice cells inside the outline, in fibre coordinates."""

    positions: np.ndarray  # of all lattice nodes [m], shape (columns * rows, 2)
    node_class: np.ndarray  # OUTSIDE, INSIDE or ON_OUTLINE, shape (columns * rows,)
    row_count: int
    faces: np.ndarray  # lattice nodes of the cells, triangles repeat the last, shape (cells, 4)
    origin: np.ndarray  # lattice node at the lower left of the cells, shape (cells,)
    area: float  # [m2]
    piece_count: int  # pieces that hang together over edges
    smallest_height: float  # of a cell, relative to the edge length
    weakest: int  # cell with the smallest height


def _best_lattice(outline: np.ndarray, edge_length: float) -> _Cells:
    """Cells of the best of several positions of the lattice under the outline.

    Only a position that the outline's edges do not prescribe is varied. The first ones are
    symmetric to the middle of the outline and are taken if they are good.
    """
    area = polygon_area(outline)
    pitch = _pitch_fitting_diagonals(outline, edge_length)
    if pitch is not None:
        lines = [_uniform_lines(outline[:, axis], outline[0, axis], pitch) for axis in range(2)]
        return _cut_lattice(outline, *lines, pitch)

    anchors = [_aligned_edges(outline, axis, edge_length) for axis in range(2)]
    quick = area / edge_length**2 > 100_000
    steps = (0.0, 0.5) if quick else (0.0, 0.5, 0.2, 0.4, 0.6, 0.8)
    shifts = product(*((0.0,) if len(anchor) else steps for anchor in anchors))
    best = best_rank = None
    for shift in sorted(shifts, key=lambda pair: sum(part not in (0.0, 0.5) for part in pair)):
        lines = []
        for axis in range(2):
            values = outline[:, axis]
            if len(anchors[axis]):
                lines.append(_anchored_lines(values, anchors[axis], edge_length))
            else:
                middle = 0.5 * (values.min() + values.max())
                lines.append(
                    _uniform_lines(values, middle + shift[axis] * edge_length, edge_length)
                )
        cells = _cut_lattice(outline, *lines, edge_length)
        missing = abs(cells.area - area) / area
        missing = 0.0 if missing < 1e-9 else missing
        rank = (
            cells.piece_count != 1,
            cells.smallest_height < ACCEPTABLE_HEIGHT,
            missing,
            -cells.smallest_height,
        )
        if best is None or rank < best_rank:
            best, best_rank = cells, rank
        if cells.piece_count == 1 and missing == 0.0 and cells.smallest_height >= GOOD_HEIGHT:
            break
    return best


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


def _aligned_edges(outline: np.ndarray, axis: int, edge_length: float) -> np.ndarray:
    """Coordinates of the outline's edges across an axis, at least half an edge length apart."""
    end = np.roll(outline, -1, axis=0)
    along = np.abs(end - outline)
    aligned = (along[:, axis] <= COINCIDENT * edge_length) & (along[:, 1 - axis] >= edge_length)
    kept: list[float] = []
    for value in np.sort(outline[aligned, axis]):
        if not kept or value - kept[-1] >= 0.5 * edge_length:
            kept.append(float(value))
    return np.array(kept)


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
        count = max(1, _whole_number((end - start) / edge_length))
        parts.append(np.linspace(start, end, count, endpoint=False))
    parts.append(anchors[-1] + edge_length * np.arange(above + 1))
    return np.concatenate(parts)


def _cut_lattice(
    outline: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray, pitch: float
) -> _Cells:
    """Cut the lattice with the outline and keep the cells inside."""
    outline = np.column_stack(
        [
            _pull_onto_lines(outline[:, 0], x_lines, pitch),
            _pull_onto_lines(outline[:, 1], y_lines, pitch),
        ]
    )
    column_count, row_count = len(x_lines), len(y_lines)
    grid = np.meshgrid(x_lines, y_lines, indexing="ij")
    positions = np.column_stack([part.ravel() for part in grid])

    columns, upper, y_cuts = _line_cuts(x_lines, y_lines, outline)
    rows, right, x_cuts = _line_cuts(y_lines, x_lines, outline[:, ::-1])
    is_inside = _inside_by_parity(columns, upper, column_count, row_count)
    # Cut lattice edges of both directions: their two nodes and the cut between them.
    low = np.concatenate([columns * row_count + upper - 1, (right - 1) * row_count + rows])
    high = np.concatenate([columns * row_count + upper, right * row_count + rows])
    part = np.concatenate(
        [
            (y_cuts - y_lines[upper - 1]) / (y_lines[upper] - y_lines[upper - 1]),
            (x_cuts - x_lines[right - 1]) / (x_lines[right] - x_lines[right - 1]),
        ]
    )
    cut = np.column_stack(
        [np.concatenate([x_lines[columns], x_cuts]), np.concatenate([y_cuts, y_lines[rows]])]
    )
    node_class = np.where(is_inside, INSIDE, OUTSIDE)

    on_low, on_high = part < COINCIDENT, part > 1.0 - COINCIDENT
    node_class[low[on_low]] = ON_OUTLINE
    node_class[high[on_high]] = ON_OUTLINE
    for corner in _corners(outline):
        node = _nearest_node(corner, x_lines, y_lines)
        node_class[node] = ON_OUTLINE
        positions[node] = corner

    # An edge with one end on the outline needs no cut; one with both ends on the same side is
    # cut twice, by a sliver narrower than the pitch, which cannot be resolved.
    open_ = (
        (node_class[low] != ON_OUTLINE)
        & (node_class[high] != ON_OUTLINE)
        & (is_inside[low] != is_inside[high])
    )
    low, high, part, cut = low[open_], high[open_], part[open_], cut[open_]
    from_inside = np.where(is_inside[low], part, 1.0 - part)
    moves_inside = from_inside <= INSIDE_REACH
    moved = np.where(moves_inside == is_inside[low], low, high)
    reach = np.where(moves_inside, from_inside, 1.0 - from_inside)
    # Of several cuts that a node could move to it takes the nearest; rounding removes noise from
    # the ties of a 45 degree edge, which all go to the column's cut, listed first.
    order = np.lexsort((np.arange(len(moved)), np.round(reach, 6), moved))
    moved, cut = moved[order], cut[order]
    first = np.ones(len(moved), dtype=bool)
    first[1:] = moved[1:] != moved[:-1]
    positions[moved[first]] = cut[first]
    node_class[moved[first]] = ON_OUTLINE

    faces, origin = _cells_inside(positions, node_class, column_count, row_count, outline, pitch)
    heights = _heights(positions[faces]) / pitch
    corner = positions[faces]
    areas = 0.5 * _cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    return _Cells(
        positions=positions,
        node_class=node_class,
        row_count=row_count,
        faces=faces,
        origin=origin,
        area=math.fsum(areas),
        piece_count=_piece_count(faces),
        smallest_height=float(heights.min(initial=np.inf)) if len(faces) else 0.0,
        weakest=int(np.argmin(heights)) if len(faces) else -1,
    )


def _pull_onto_lines(values: np.ndarray, lines: np.ndarray, pitch: float) -> np.ndarray:
    """Remove the rounding noise of the rotation from vertices that lie on a lattice line."""
    upper = np.clip(np.searchsorted(lines, values), 1, len(lines) - 1)
    nearest = np.where(
        values - lines[upper - 1] < lines[upper] - values, lines[upper - 1], lines[upper]
    )
    return np.where(np.abs(values - nearest) < COINCIDENT * pitch, nearest, values)


def _line_cuts(
    lines: np.ndarray, cross_lines: np.ndarray, outline: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cuts of the outline with lattice lines: line, number of the cross line above, coordinate.

    A vertex on a line counts with the edge that lies above it only, so that the parity is right.
    """
    start, end = outline, np.roll(outline, -1, axis=0)
    first = np.searchsorted(lines, np.minimum(start[:, 0], end[:, 0]))
    last = np.searchsorted(lines, np.maximum(start[:, 0], end[:, 0]))
    counts = last - first
    edge = np.repeat(np.arange(len(outline)), counts)
    line = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + first[edge]
    run = end[edge, 0] - start[edge, 0]
    value = start[edge, 1] + (lines[line] - start[edge, 0]) / run * (end[edge, 1] - start[edge, 1])
    return line, np.searchsorted(cross_lines, value), value


def _inside_by_parity(
    columns: np.ndarray, upper: np.ndarray, column_count: int, row_count: int
) -> np.ndarray:
    """True for lattice nodes with an odd number of cuts above them in their column."""
    cut_count = np.zeros((column_count, row_count), dtype=np.int64)
    np.add.at(cut_count, (columns, upper), 1)
    above = cut_count[:, ::-1].cumsum(axis=1)[:, ::-1] - cut_count
    return (above % 2 == 1).ravel()


def _corners(outline: np.ndarray) -> np.ndarray:
    """Vertices of the outline that need a node of their own, the blunt ones first.

    Where two corners want the same node the sharper one, being later, keeps it.
    """
    before = outline - np.roll(outline, 1, axis=0)
    after = np.roll(outline, -1, axis=0) - outline
    turn = np.abs(np.arctan2(_cross(before, after), (before * after).sum(axis=1)))
    order = np.argsort(turn, kind="stable")
    return outline[order[turn[order] >= CORNER_ANGLE]]


def _nearest_node(point: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray) -> int:
    column = int(np.argmin(np.abs(x_lines - point[0])))
    row = int(np.argmin(np.abs(y_lines - point[1])))
    return column * len(y_lines) + row


def _cells_inside(
    positions: np.ndarray,
    node_class: np.ndarray,
    column_count: int,
    row_count: int,
    outline: np.ndarray,
    pitch: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Whole and halved cells inside the outline, and the lattice node each one starts from."""
    column, row = np.meshgrid(np.arange(column_count - 1), np.arange(row_count - 1), indexing="ij")
    start = (column * row_count + row).ravel()
    quads = np.column_stack([start, start + row_count, start + row_count + 1, start + 1])
    quads = quads[(node_class[quads] != OUTSIDE).sum(axis=1) >= 3]
    classes = node_class[quads]
    outside_count = (classes == OUTSIDE).sum(axis=1)
    on_count = (classes == ON_OUTLINE).sum(axis=1)

    whole = outside_count == 0
    # A node in the middle of a straight piece of the outline makes a whole cell a triangle.
    sines = _corner_sines(positions[quads])
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
    faces, origin = faces[keep], quads[keep, 0]

    # With all nodes on the outline only the position tells whether the cell is inside.
    doubtful = np.flatnonzero((node_class[faces] == ON_OUTLINE).all(axis=1))
    if len(doubtful):
        corner = positions[faces[doubtful]]
        centre = (corner[:, 0] + corner[:, 1] + corner[:, 2]) / 3.0
        quad = faces[doubtful, 2] != faces[doubtful, 3]
        centre[quad] = corner[quad].mean(axis=1)
        real = _contains(outline, centre) & (_heights(corner) > 1e-3 * pitch)
        faces, origin = (
            np.delete(faces, doubtful[~real], axis=0),
            np.delete(origin, doubtful[~real]),
        )
    return faces, origin


def _contains(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """True for points inside the polygon."""
    inside = np.zeros(len(points), dtype=bool)
    for start, end in zip(outline, np.roll(outline, -1, axis=0)):
        spans = (start[1] > points[:, 1]) != (end[1] > points[:, 1])
        if spans.any():
            x = start[0] + (points[:, 1] - start[1]) / (end[1] - start[1]) * (end[0] - start[0])
            inside ^= spans & (points[:, 0] < x)
    return inside


def _corner_products(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cross product and lengths of the two edges at every corner, shape (cells, 4) each."""
    after = np.roll(corner, -1, axis=1) - corner
    before = corner - np.roll(corner, 1, axis=1)
    return _cross(before, after), np.hypot(*before.T).T, np.hypot(*after.T).T


def _corner_sines(corner: np.ndarray) -> np.ndarray:
    products, before, after = _corner_products(corner)
    lengths = before * after
    return np.divide(products, lengths, out=np.ones_like(lengths), where=lengths > 0.0)


def _heights(corner: np.ndarray) -> np.ndarray:
    """Smallest height of cells [m], negative when inverted, shape (cells,).

    Quadrilateral: smallest corner area over the longer of the two edges there. Triangle: twice
    the area over the longest edge.
    """
    products, before, after = _corner_products(corner)
    longer = np.maximum(before, after)
    quadrilateral = np.divide(products, longer, out=np.zeros_like(longer), where=longer > 0.0)
    is_triangle = (corner[:, 2] == corner[:, 3]).all(axis=1)
    longest = np.maximum(longer.max(axis=1), np.finfo(float).tiny)
    return np.where(is_triangle, products[:, 1] / longest, quadrilateral.min(axis=1))


def _piece_count(faces: np.ndarray) -> int:
    """Number of pieces of the mesh that hang together over common edges."""
    if len(faces) == 0:
        return 0
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    face = np.repeat(np.arange(len(faces)), 4)
    real = edges[:, 0] != edges[:, 1]
    edges, face = np.sort(edges[real], axis=1), face[real]
    number = np.unique(edges[:, 0] * (faces.max() + 1) + edges[:, 1], return_inverse=True)[1]
    size = len(faces)
    graph = coo_array(
        (np.ones(len(face), dtype=np.int8), (face, size + number)),
        shape=(size + number.max() + 1,) * 2,
    )
    return int(connected_components(graph, directed=False, return_labels=False))


# --- Numbering and checks ------------------------------------------------------------------------


def _number_in_patches(cells: _Cells) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


def _check_coverage(
    cells: _Cells, area: float, edge_length: float, to_scene: np.ndarray, key: str
) -> None:
    advice = f"choose a smaller blank.edge_length than {edge_length:g} m"
    if len(cells.faces) == 0 or cells.piece_count != 1:
        raise InputError(
            f"is in places narrower than two elements, the mesh falls into {cells.piece_count} "
            f"pieces; {advice}",
            key=key,
        )
    if cells.smallest_height <= 0.0:
        place = to_scene @ cells.positions[cells.faces[cells.weakest]].mean(axis=0)
        raise InputError(
            f"cannot be meshed near {_place(place)}, an element would be inverted; {advice}",
            key=key,
        )
    difference = cells.area / area - 1.0
    if abs(difference) > AREA_TOLERANCE:
        raise InputError(
            f"has details that elements of this size cannot follow: the meshed area differs by "
            f"{100.0 * difference:+.1f} %; {advice}",
            key=key,
        )


def _check_jacobians(positions: np.ndarray, faces: np.ndarray) -> None:
    heights = _heights(positions[faces])
    if not (heights > 0.0).all():
        element = int(np.argmin(heights))
        raise InputError(
            f"element {element} near {_place(positions[faces[element]].mean(axis=0))} is inverted "
            "in the undeformed blank; use a smaller perturbation or another blank.edge_length"
        )


def _rotation(angle: float) -> np.ndarray:
    """Rotation matrix, exact for multiples of 90 degrees."""
    cosine, sine = math.cos(angle), math.sin(angle)
    quarter = math.remainder(angle, 0.5 * math.pi)
    if abs(quarter) < 1e-12:
        cosine, sine = float(round(cosine)), float(round(sine))
    return np.array([[cosine, -sine], [sine, cosine]])


def _constant_direction(direction: np.ndarray, element_count: int) -> np.ndarray:
    directions = np.zeros((element_count, 3))
    directions[:, :2] = direction
    return directions


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _whole_number(value: float) -> int:
    return math.floor(value + 0.5)


def _place(point: np.ndarray) -> str:
    return f"({1e3 * point[0]:.4g}, {1e3 * point[1]:.4g}) mm"
