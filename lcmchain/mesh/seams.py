"""Lattice parted along seams: darts, slits and holes, where they are narrower than its cells.

A lattice edge that a slit crosses has both ends in the sheet, and a cell that it crosses is in the
sheet on either side of it; so it is near the apex of a dart and in a sharp corner of a hole. Such a
cell is taken once for each piece of the sheet in it, with nodes of its own: pieces of neighbouring
cells have nodes in common where they meet along the edge between them (phantom nodes, Hansbo and
Hansbo 2004). Each piece is then cut at the seam as cells at an outline are
(:mod:`lcmchain.mesh.cut`), and neither side knows of the other.

A seam ends within a cell: at the end of a slit, the apex of a dart, a sharp corner of a hole. One
lattice node takes this tip, and beyond it the pieces join again.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.cluster.hierarchy import DisjointSet

from lcmchain.mesh.contours import Contours

# Relative to the pitch: closer than this a point lies on a lattice line or node.
COINCIDENT = 1e-9
# A line that parts cells goes on a little beyond its end, so that no rounding joins the pieces.
BEYOND = 1e-3
# Relative to the pitch: a piece of a cell this near to a point touches it.
TOUCHING = 1e-7


# --- tips: which lattice node takes the end of a seam ---------------------------------------------


class Tip(NamedTuple):
    """End of a seam inside the sheet.

    nodes : column and row of the lattice nodes that may take it, the better ones first.
    behind, ahead : those of the edge by which the seam enters its last cell, and of the one by
        which it would leave it.
    extension : line (2, 2) from the tip through the edge ahead; None where it meets a contour.
    """

    nodes: list[tuple[int, int]]
    behind: list[tuple[int, int]]
    ahead: list[tuple[int, int]]
    extension: np.ndarray | None

    def extension_for(self, node: tuple[int, int] | None) -> np.ndarray | None:
        """Return the line by which the seam parts cells beyond its tip if a node takes the tip."""
        node = self.nodes[0] if node is None else node
        if node in self.ahead and (node not in self.behind or self.nodes[0] in self.ahead):
            return self.extension
        return None


def tip_at(
    contours: Contours, vertex: int, x_lines: np.ndarray, y_lines: np.ndarray, pitch: float
) -> Tip | None:
    """Return how a seam ends at a corner of the contours; None for corners where none does.

    Where the pieces on either side of a seam join, at the last lattice edge that parts them, one of
    its two nodes takes the tip. That is the edge by which the seam enters the cell of its tip, or
    the one by which it would leave it, better the nearer one: a node that were drawn through most
    of the cell would invert it.
    """
    line = _line_from(contours, vertex)
    if line is None:
        return None
    lines = (x_lines, y_lines)
    tip, inward = line[0], line[0] - line[1]
    entry: tuple[int, int, float, np.ndarray] | None = None
    for start, end in zip(line[:-1], line[1:]):
        entry = _first_crossing(start, end - start, lines, pitch, 1.0)
        if entry is not None:
            break
    if entry is None:
        return None
    if vertex < len(contours.points) and not _passes(contours, vertex, entry, lines):
        return None
    behind = _ends_of(entry, lines, pitch)
    leave = _first_crossing(tip, inward, lines, pitch, np.inf)
    if leave is None:
        return Tip(behind, behind, [], None)
    beyond = BEYOND * pitch * inward / np.hypot(*inward)
    extension = np.array([tip, leave[3] + beyond])
    if not contours.polygon.covers(shapely.LineString(extension)):
        return Tip(behind, behind, [], None)
    ahead = _ends_of(leave, lines, pitch)
    is_nearer = np.hypot(*(leave[3] - tip)) < np.hypot(*(entry[3] - tip))
    nodes = dict.fromkeys([*ahead, *behind] if is_nearer else [*behind, *ahead])
    return Tip(list(nodes), behind, ahead, extension)


def _first_crossing(
    start: np.ndarray,
    along: np.ndarray,
    lines: tuple[np.ndarray, np.ndarray],
    pitch: float,
    reach: float,
) -> tuple[int, int, float, np.ndarray] | None:
    """Axis and number of the first lattice line that a ray meets, where along it, and place."""
    found = []
    for axis in (0, 1):
        if abs(along[axis]) <= COINCIDENT * pitch:
            continue
        way = (lines[axis] - start[axis]) / along[axis]
        slack = COINCIDENT * pitch / abs(along[axis])
        ahead = np.flatnonzero((way >= -slack) & (way <= reach + slack))
        if len(ahead):
            number = int(ahead[np.argmin(way[ahead])])
            found.append((float(way[number]), axis, number))
    if not found:
        return None
    way, axis, number = min(found)
    place = start + way * along
    return axis, number, float(place[1 - axis]), place


def _ends_of(
    crossing: tuple[int, int, float, np.ndarray], lines: tuple[np.ndarray, np.ndarray], pitch: float
) -> list[tuple[int, int]]:
    """Column and row of the nodes of the lattice edge at a crossing; one where it is at a node."""
    axis, number, across, _ = crossing
    upper = int(np.clip(np.searchsorted(lines[1 - axis], across), 1, len(lines[1 - axis]) - 1))
    pair = [upper - 1, upper]
    on = [other for other in pair if abs(lines[1 - axis][other] - across) <= 1e-6 * pitch]
    return [(number, other) if axis == 0 else (other, number) for other in on or pair]


def _line_from(contours: Contours, vertex: int) -> np.ndarray | None:
    """Line of a seam from its tip outward; None for corners that are no tips."""
    if vertex < len(contours.points):
        return contours.into_wedge(vertex)
    first = len(contours.points)
    for slit in contours.slits:
        last = first + len(slit) - 1
        if vertex in (first, last):
            line = slit if vertex == first else slit[::-1]
            rings = shapely.MultiLineString([shapely.LinearRing(ring) for ring in contours.rings])
            size = float(np.ptp(contours.rim, axis=0).max())
            on_rim = rings.distance(shapely.Point(line[0])) < 1e-9 * size
            return None if on_rim else line
        first = last + 1
    return None


def _passes(
    contours: Contours,
    vertex: int,
    entry: tuple[int, int, float, np.ndarray],
    lines: tuple[np.ndarray, np.ndarray],
) -> bool:
    """Whether both sides of a wedge cross the lattice edge that its middle crosses."""
    axis, number, middle, _ = entry
    apex = contours.points[vertex]
    upper = int(np.clip(np.searchsorted(lines[1 - axis], middle), 1, len(lines[1 - axis]) - 1))
    low, high = lines[1 - axis][[upper - 1, upper]]
    for side in (contours.before[vertex], contours.after[vertex]):
        along = contours.points[side] - apex
        if along[axis] == 0.0:
            return False
        way = (lines[axis][number] - apex[axis]) / along[axis]
        across = apex[1 - axis] + way * along[1 - axis]
        if not (way >= 0.0 and low <= across <= high):
            return False
    return True


# --- the lattice, whole and parted ----------------------------------------------------------------


class CutEdges(NamedTuple):
    """Lattice edges that the contours cut, those along y first."""

    low: np.ndarray  # node before the cut, shape (cuts,)
    high: np.ndarray  # node behind it
    share: np.ndarray  # of the edge that lies before the cut [1]
    position: np.ndarray  # of the cut [m], shape (cuts, 2)


class Lattice(NamedTuple):
    """Nodes and cells before they are moved onto the contours.

    positions : of the nodes [m], shape (nodes, 2). is_inside : shape (nodes,).
    quads : nodes of the cells (cells, 4). origin : lattice node at the lower left (cells,).
    lattice_node : place in the lattice of each node (nodes,).
    cuts : of the edges by the contours.
    beyond : corners of a cell on the other side of a seam (cells, 4); None without seams.
    on_seams : nodes that lie on a contour next to a seam.
    copies : of lattice nodes at seams, each with the pieces of cells that it belongs to.
    """

    positions: np.ndarray
    is_inside: np.ndarray
    quads: np.ndarray
    origin: np.ndarray
    lattice_node: np.ndarray
    cuts: CutEdges
    beyond: np.ndarray | None
    on_seams: np.ndarray
    copies: dict[int, list[tuple[int, list[shapely.Geometry]]]]

    @classmethod
    def whole(
        cls, x_lines: np.ndarray, y_lines: np.ndarray, cuts: CutEdges, is_inside: np.ndarray
    ) -> Lattice:
        """Return a lattice without seams."""
        column_count, row_count = len(x_lines), len(y_lines)
        grid = np.meshgrid(x_lines, y_lines, indexing="ij")
        column, row = np.meshgrid(
            np.arange(column_count - 1), np.arange(row_count - 1), indexing="ij"
        )
        start = (column * row_count + row).ravel()
        quads = np.column_stack([start, start + row_count, start + row_count + 1, start + 1])
        return cls(
            positions=np.column_stack([part.ravel() for part in grid]),
            is_inside=is_inside,
            quads=quads,
            origin=start,
            lattice_node=np.arange(column_count * row_count),
            cuts=cuts,
            beyond=None,
            on_seams=np.empty(0, dtype=np.int64),
            copies={},
        )


def line_cuts(
    lines: np.ndarray, cross_lines: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cuts of straight sides with lattice lines: line, number of the cross line above, coordinate.

    A vertex on a line counts with the side that lies above it only, so that the parity is right.
    """
    first = np.searchsorted(lines, np.minimum(start[:, 0], end[:, 0]))
    last = np.searchsorted(lines, np.maximum(start[:, 0], end[:, 0]))
    counts = last - first
    edge = np.repeat(np.arange(len(start)), counts)
    line = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + first[edge]
    run = end[edge, 0] - start[edge, 0]
    value = start[edge, 1] + (lines[line] - start[edge, 0]) / run * (end[edge, 1] - start[edge, 1])
    return line, np.searchsorted(cross_lines, value), value


def copies_at(lattice: Lattice, node: int, point: np.ndarray, pitch: float) -> list[int]:
    """Return the nodes at a place of the lattice that are to lie on a point of a contour.

    One, or where a seam parts the sheet there those of the sides that have the point.
    """
    if node not in lattice.copies:
        return [node]
    there = shapely.Point(point)
    copies = lattice.copies[node]
    touching = [
        copy
        for copy, pieces in copies
        if any(piece.distance(there) < TOUCHING * pitch for piece in pieces)
    ]
    if touching:
        return touching
    nearest = min(copies, key=lambda c: min((p.distance(there) for p in c[1]), default=np.inf))
    return [nearest[0]]


def part_at_seams(
    contours: Contours,
    lattice: Lattice,
    x_lines: np.ndarray,
    y_lines: np.ndarray,
    pitch: float,
    corner_nodes: Mapping[int, tuple[int, int]],
) -> Lattice:
    """Return the lattice with a cell, and nodes, for each piece of the sheet in it along seams.

    Parameters
    ----------
    contours : in fibre coordinates. lattice : without seams.
    x_lines, y_lines : coordinates of the lattice lines [m]. pitch : edge length [m].
    corner_nodes : column and row of the nodes that take given corners of the contours.
    """
    parts = _Parts(contours, lattice, (x_lines, y_lines), pitch, corner_nodes)
    return parts.parted() if parts.of_cell else lattice


class _Piece(NamedTuple):
    """Piece of the sheet in a cell: the cell's column and row, its shape, corners in it."""

    cell: tuple[int, int]
    shape: shapely.Geometry
    has_corner: np.ndarray  # (4,)


class _Stretch(NamedTuple):
    """Part of a lattice edge that lies in the sheet, between two parts of the edge [1]."""

    low: float
    high: float
    pieces: tuple[int, int]  # on either side; -1 for a cell that no seam crosses, -2 for none


class _Parts:
    """The pieces of cells along the seams, and which nodes they have in common."""

    def __init__(
        self,
        contours: Contours,
        lattice: Lattice,
        lines: tuple[np.ndarray, np.ndarray],
        pitch: float,
        corner_nodes: Mapping[int, tuple[int, int]],
    ):
        self.contours, self.lattice, self.lines, self.pitch = contours, lattice, lines, pitch
        self.row_count = len(lines[1])
        self.extensions = []
        for vertex in contours.corners():
            tip = tip_at(contours, vertex, *lines, pitch)
            longer = None if tip is None else tip.extension_for(corner_nodes.get(vertex))
            if longer is not None:
                self.extensions.append(longer)
        self.slits = _long_slits(contours, self.extensions, pitch)
        self.pieces: list[_Piece] = []
        self.of_cell: dict[tuple[int, int], list[int]] = {}
        seams = (*contours.seams, *self.extensions)
        for cell in _cells_at(seams, *lines, pitch):
            found = list(self._pieces_in(cell))
            self.of_cell[cell] = list(range(len(self.pieces), len(self.pieces) + len(found)))
            self.pieces += found
        self.crossings = self._crossings()

    # --- pieces of cells --------------------------------------------------------------------------

    def _pieces_in(self, cell: tuple[int, int]) -> Iterator[_Piece]:
        column, row = cell
        (x0, x1), (y0, y1) = self.lines[0][column : column + 2], self.lines[1][row : row + 2]
        box = shapely.box(x0, y0, x1, y1)
        inside = self.contours.polygon.intersection(box)
        if inside.is_empty or inside.area <= 0.0:
            return
        shapes = [part for part in shapely.get_parts(inside) if part.area > 0.0]
        if self.slits is not None:
            margin = 0.5 * self.pitch
            near = shapely.clip_by_rect(
                self.slits, x0 - margin, y0 - margin, x1 + margin, y1 + margin
            )
            if not near.is_empty:
                noded = shapely.unary_union([*(shape.boundary for shape in shapes), near])
                faces = shapely.polygonize(shapely.get_parts(noded)).geoms
                shapes = [
                    face
                    for face in faces
                    if inside.contains(face.representative_point()) and face.area > 0.0
                ]
        corners = shapely.points([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        for shape in shapes:
            yield _Piece(cell, shape, shapely.distance(shape, corners) < TOUCHING * self.pitch)

    # --- edges ------------------------------------------------------------------------------------

    def _crossings(self) -> dict[tuple[int, int, int], list[float]]:
        """Coordinates at which contours meet lattice edges, by axis, line and cross line above."""
        starts, ends = [self.contours.points], [self.contours.ends]
        for slit in (*self.contours.slits, *self.extensions):
            starts.append(slit[:-1])
            ends.append(slit[1:])
        start, end = np.concatenate(starts), np.concatenate(ends)
        found = defaultdict(list)
        for axis in (0, 1):
            lines, other = self.lines[axis], self.lines[1 - axis]
            turned = [start[:, ::-1], end[:, ::-1]] if axis else [start, end]
            for line, upper, value in zip(*line_cuts(lines, other, *turned)):
                found[axis, int(line), int(upper)].append(float(value))
            # sides along a lattice line begin and end on it
            for point in np.concatenate([start, end]):
                line = int(np.searchsorted(lines, point[axis]))
                if line < len(lines) and lines[line] == point[axis]:
                    upper = int(np.searchsorted(other, point[1 - axis]))
                    found[axis, line, upper].append(float(point[1 - axis]))
        return found

    def _edges(self) -> list[tuple[int, int, int]]:
        """Axis, line and cross line above of the edges around the cells at seams."""
        edges = set()
        for column, row in self.of_cell:
            edges |= {(0, column, row + 1), (0, column + 1, row + 1)}
            edges |= {(1, row, column + 1), (1, row + 1, column + 1)}
        return sorted(edges)

    def _beside(self, edge: tuple[int, int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
        """Cells (column, row) before and behind an edge."""
        axis, line, upper = edge
        if axis == 0:
            return (line - 1, upper - 1), (line, upper - 1)
        return (upper - 1, line - 1), (upper - 1, line)

    def _stretches(self, edge: tuple[int, int, int]) -> list[_Stretch]:
        """Parts of an edge that lie in the sheet."""
        axis, line, upper = edge
        along = self.lines[1 - axis]
        low, high = float(along[upper - 1]), float(along[upper])
        parts = sorted((value - low) / (high - low) for value in self.crossings.get(edge, ()))
        parts = [0.0, *(p for p in parts if COINCIDENT < p < 1.0 - COINCIDENT), 1.0]
        sides = self._beside(edge)
        found: list[_Stretch] = []
        for first, last in zip(parts[:-1], parts[1:]):
            if last - first <= COINCIDENT:
                continue
            middle = low + 0.5 * (first + last) * (high - low)
            at = float(self.lines[axis][line])
            point = shapely.Point((at, middle) if axis == 0 else (middle, at))
            if not self.contours.polygon.contains(point):
                continue
            if self.slits is not None and self.slits.distance(point) < COINCIDENT * self.pitch:
                continue
            pieces = (self._piece_at(sides[0], point), self._piece_at(sides[1], point))
            if found and found[-1].high == first and found[-1].pieces == pieces:
                if not self._is_slit_at(edge, low + first * (high - low)):
                    found[-1] = found[-1]._replace(high=last)
                    continue
            found.append(_Stretch(first, last, pieces))
        return found

    def _is_slit_at(self, edge: tuple[int, int, int], value: float) -> bool:
        """Whether a slit crosses an edge at a coordinate."""
        if self.slits is None:
            return False
        at = float(self.lines[edge[0]][edge[1]])
        point = shapely.Point((at, value) if edge[0] == 0 else (value, at))
        return bool(self.slits.distance(point) < COINCIDENT * self.pitch)

    def _piece_at(self, cell: tuple[int, int], point: shapely.Point) -> int:
        """Piece of a cell beside a point of its edge; -1 where no seam crosses it, -2 off all."""
        if not (0 <= cell[0] < len(self.lines[0]) - 1 and 0 <= cell[1] < self.row_count - 1):
            return -2
        if cell not in self.of_cell:
            return -1
        numbers = self.of_cell[cell]
        away = [self.pieces[number].shape.distance(point) for number in numbers]
        if not numbers or min(away) > TOUCHING * self.pitch:
            return -2
        return numbers[int(np.argmin(away))]

    # --- nodes ------------------------------------------------------------------------------------

    #: Corners at the low and the high end of an edge, of the cells before and behind it.
    CORNERS = (((1, 2), (0, 3)), ((3, 2), (0, 1)))

    def _nodes_of(self, cell: tuple[int, int]) -> tuple[int, int, int, int]:
        first = cell[0] * self.row_count + cell[1]
        return first, first + self.row_count, first + self.row_count + 1, first + 1

    def _ends(self, edge: tuple[int, int, int]) -> tuple[int, int]:
        """Lattice nodes at the low and the high end of an edge."""
        axis, line, upper = edge
        if axis == 0:
            return line * self.row_count + upper - 1, line * self.row_count + upper
        return (upper - 1) * self.row_count + line, upper * self.row_count + line

    def parted(self) -> Lattice:
        """Return the lattice with the pieces in place of their cells."""
        edges = {edge: self._stretches(edge) for edge in self._edges()}
        same = DisjointSet([(p, k) for p in range(len(self.pieces)) for k in range(4)])
        for edge, stretches in edges.items():
            for stretch in stretches:
                for end, node in enumerate(self._ends(edge)):
                    meeting = [
                        (piece, self.CORNERS[edge[0]][side][end]) if piece >= 0 else (-1, node)
                        for side, piece in enumerate(stretch.pieces)
                        if piece != -2
                    ]
                    for corner in meeting:
                        same.add(corner)
                    for corner in meeting[1:]:
                        same.merge(meeting[0], corner)
        return self._with_copies(edges, same)

    def _with_copies(
        self, edges: dict[tuple[int, int, int], list[_Stretch]], same: DisjointSet
    ) -> Lattice:
        old = self.lattice
        at_node: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for number, piece in enumerate(self.pieces):
            for corner, node in enumerate(self._nodes_of(piece.cell)):
                at_node[node].append((number, corner))
        is_inside = old.is_inside.tolist()
        lattice_node = old.lattice_node.tolist()
        numbers: dict[tuple[int, int], int] = {}  # node of the corner of a piece
        copies: dict[int, list[tuple[int, list[shapely.Geometry]]]] = {}
        on_seams: list[int] = []
        places = shapely.points(old.positions[list(at_node)]) if at_node else []
        on_line = shapely.distance(self.contours.lines, places) < COINCIDENT * self.pitch
        for (node, corners), on_contour in zip(at_node.items(), on_line):
            groups: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
            for pair in corners:
                groups[same[pair]].append(pair)
            base = same[(-1, node)] if (-1, node) in same else None
            is_taken = base is not None or self._has_other_cell(node)
            copies[node] = []
            for root, group in groups.items():
                there = any(self.pieces[p].has_corner[k] for p, k in group)
                if root == base:
                    number = node
                elif there and not is_taken:
                    number, is_taken = node, True
                    is_inside[node] = old.is_inside[node]
                else:
                    number = len(lattice_node)
                    lattice_node.append(node)
                    is_inside.append(bool(old.is_inside[node]) and there)
                for pair in group:
                    numbers[pair] = number
                copies[node].append((number, [self.pieces[p].shape for p, _ in group]))
                if there and on_contour:
                    on_seams.append(number)
        at_seam = np.zeros(len(old.quads), dtype=bool)
        for column, row in self.of_cell:
            at_seam[column * (self.row_count - 1) + row] = True
        quads = [[numbers[p, k] for k in range(4)] for p in range(len(self.pieces))]
        beyond = [~piece.has_corner for piece in self.pieces]
        kept = int((~at_seam).sum())
        return Lattice(
            positions=old.positions[lattice_node],
            is_inside=np.array(is_inside),
            quads=np.concatenate(
                [old.quads[~at_seam], np.array(quads, dtype=np.int64).reshape(-1, 4)]
            ),
            origin=np.concatenate(
                [
                    old.origin[~at_seam],
                    np.array([self._nodes_of(p.cell)[0] for p in self.pieces], dtype=np.int64),
                ]
            ),
            lattice_node=np.array(lattice_node),
            cuts=self._cuts(edges, numbers),
            beyond=np.concatenate(
                [np.zeros((kept, 4), dtype=bool), np.array(beyond, dtype=bool).reshape(-1, 4)]
            ),
            on_seams=np.array(on_seams, dtype=np.int64),
            copies=copies,
        )

    def _has_other_cell(self, node: int) -> bool:
        """Whether a cell that no seam crosses has a lattice node."""
        column, row = divmod(node, self.row_count)
        return any(
            0 <= c < len(self.lines[0]) - 1
            and 0 <= r < self.row_count - 1
            and (c, r) not in self.of_cell
            for c in (column - 1, column)
            for r in (row - 1, row)
        )

    def _cuts(
        self,
        edges: dict[tuple[int, int, int], list[_Stretch]],
        numbers: dict[tuple[int, int], int],
    ) -> CutEdges:
        """Return the cut edges, those around cells at seams cut once for each stretch."""
        old = self.lattice.cuts
        present = {self._ends(edge) for edge in edges}
        kept = np.array(
            [pair not in present for pair in zip(old.low.tolist(), old.high.tolist())], bool
        )
        low, high, share, position = [], [], [], []
        for edge, stretches in edges.items():
            axis, line, _ = edge
            at = float(self.lines[axis][line])
            for stretch in stretches:
                ends = []
                for end, node in enumerate(self._ends(edge)):
                    side = next((s for s, p in enumerate(stretch.pieces) if p >= 0), None)
                    if side is None:
                        ends.append(node)
                    else:
                        corner = self.CORNERS[axis][side][end]
                        ends.append(numbers[stretch.pieces[side], corner])
                for where in (stretch.low, stretch.high):
                    if where in (0.0, 1.0):
                        continue
                    value = self._coordinate(edge, where)
                    low.append(ends[0])
                    high.append(ends[1])
                    share.append(where)
                    position.append((at, value) if axis == 0 else (value, at))
        return CutEdges(
            np.concatenate([old.low[kept], np.array(low, dtype=np.int64)]),
            np.concatenate([old.high[kept], np.array(high, dtype=np.int64)]),
            np.concatenate([old.share[kept], np.array(share, dtype=float)]),
            np.concatenate([old.position[kept], np.array(position, dtype=float).reshape(-1, 2)]),
        )

    def _coordinate(self, edge: tuple[int, int, int], where: float) -> float:
        """Coordinate of the crossing at a share of an edge, with the digits of the contour."""
        along = self.lines[1 - edge[0]]
        low, high = float(along[edge[2] - 1]), float(along[edge[2]])
        value = low + where * (high - low)
        return min(self.crossings[edge], key=lambda crossing: abs(crossing - value))


def _long_slits(
    contours: Contours, extensions: Sequence[np.ndarray], pitch: float
) -> shapely.Geometry | None:
    """Slits as they part cells: longer at tips, and where they end on a contour; None without."""
    if not contours.slits and not extensions:
        return None
    rings = shapely.MultiLineString([shapely.LinearRing(ring) for ring in contours.rings])
    found = list(extensions)
    for slit in contours.slits:
        line = slit.copy()
        for end, inner in ((0, 1), (-1, -2)):
            if rings.distance(shapely.Point(slit[end])) < TOUCHING * pitch:
                way = slit[end] - slit[inner]
                line[end] = slit[end] + BEYOND * pitch * way / np.hypot(*way)
        found.append(line)
    return shapely.MultiLineString(found)


def _cells_at(
    seams: Sequence[np.ndarray], x_lines: np.ndarray, y_lines: np.ndarray, pitch: float
) -> list[tuple[int, int]]:
    """Column and row of the lattice cells that lines touch, in order."""
    found: set[tuple[int, int]] = set()
    for line in seams:
        seam = shapely.LineString(line).buffer(1e-6 * pitch)
        low, high = line.min(axis=0) - 1e-6 * pitch, line.max(axis=0) + 1e-6 * pitch
        columns = _range(x_lines, low[0], high[0])
        rows = _range(y_lines, low[1], high[1])
        column, row = (part.ravel() for part in np.meshgrid(columns, rows, indexing="ij"))
        boxes = shapely.box(x_lines[column], y_lines[row], x_lines[column + 1], y_lines[row + 1])
        shapely.prepare(seam)
        touched = shapely.intersects(seam, boxes)
        found |= set(zip(column[touched].tolist(), row[touched].tolist()))
    return sorted(found)


def _range(lines: np.ndarray, low: float, high: float) -> np.ndarray:
    """Cells between lattice lines that reach into a range."""
    first = max(int(np.searchsorted(lines, low)) - 1, 0)
    last = min(int(np.searchsorted(lines, high)), len(lines) - 1)
    return np.arange(first, max(last, first))
