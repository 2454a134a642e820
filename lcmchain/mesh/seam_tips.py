"""Tips of seams: which lattice node takes the end of a slit, the apex of a dart, a sharp corner."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from lcmchain.mesh.contours import Contours

# Relative to the pitch: closer than this a point lies on a lattice line or node.
COINCIDENT = 1e-9
# A line that parts cells goes on a little beyond its end, so that no rounding joins the pieces.
BEYOND = 1e-3


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
