"""Contours of a blank: its rim, holes in it, and the seams that part it: darts and slits.

A dart is a wedge that is cut out from the rim; its sides are part of the rim. A slit is a cut
without a width: the sheet has two lips there, at the same place before forming.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely

from lcmchain.errors import InputError
from lcmchain.mesh.outline import (
    BlankShape,
    check_simple,
    cross,
    in_mm,
    outline_of,
    polygon_area,
)

# Relative to the size of the blank: a point this near to the rim lies on it. Coordinates in inches
# with four digits, or halves of a rounded size, miss it by more than a millionth.
ON_RIM = 2e-5
# Corners that turn by at least this angle get a node of their own.
CORNER_ANGLE = math.radians(15.0)
# Wedges that are cut out with a sharper angle are narrower than an element at their tip.
SHARP_ANGLE = math.radians(75.0)


@dataclass(frozen=True, eq=False)
class Contours:
    """Closed contours of a blank and the cuts in it, in the plane.

    Attributes
    ----------
    points : corners of all closed contours [m], shape (n, 2), the rim first. The rim, darts cut
        out, runs anticlockwise, holes run clockwise: the sheet lies on the left.
    starts : number of the first corner of each contour, and n at the end.
    slits : corners (k, 2) of each cut without a width [m].
    darts : rim, apex and rim (3, 2) of each dart [m], anticlockwise.
    """

    points: np.ndarray
    starts: tuple[int, ...]
    slits: tuple[np.ndarray, ...] = ()
    darts: tuple[np.ndarray, ...] = ()

    @classmethod
    def of_rim(cls, rim: np.ndarray) -> Contours:
        """Return the contours of a blank without holes and cuts."""
        return cls(rim, (0, len(rim)))

    @property
    def rings(self) -> list[np.ndarray]:
        """Corners of each closed contour, the rim first."""
        return [self.points[a:b] for a, b in zip(self.starts[:-1], self.starts[1:])]

    @property
    def rim(self) -> np.ndarray:
        """Corners of the rim."""
        return self.points[: self.starts[1]]

    @property
    def is_plain(self) -> bool:
        """Whether there is a rim and nothing else, as of a blank that is cut from a roll."""
        return len(self.starts) == 2 and not self.slits and not self.darts

    @property
    def seams(self) -> list[np.ndarray]:
        """Lines that part the sheet where they are narrower than elements: cuts and holes."""
        holes = [np.concatenate([ring, ring[:1]]) for ring in self.rings[1:]]
        return [*self.slits, *self.darts, *holes]

    def into_wedge(self, vertex: int) -> np.ndarray | None:
        """Return a line (2, 2) into the wedge of a dart or the sharp corner of a hole, at a corner.

        None for corners of the rim, and blunt ones.
        """
        point = self.points[vertex]
        if vertex < self.starts[1] and not any(np.array_equal(d[1], point) for d in self.darts):
            return None
        sides = self.points[[self.before[vertex], self.after[vertex]]] - point
        lengths = np.hypot(*sides.T)
        along = sides / lengths[:, None]
        if cross(along[1], along[0]) >= 0.0 or along[0] @ along[1] < math.cos(SHARP_ANGLE):
            return None
        return np.array([point, point + 0.5 * lengths.min() * along.sum(axis=0)])

    @cached_property
    def after(self) -> np.ndarray:
        """Number of the corner that follows each one, shape (n,)."""
        return np.concatenate(
            [np.roll(np.arange(a, b), -1) for a, b in zip(self.starts[:-1], self.starts[1:])]
        )

    @cached_property
    def before(self) -> np.ndarray:
        """Number of the corner that precedes each one, shape (n,)."""
        return np.argsort(self.after)

    @property
    def ends(self) -> np.ndarray:
        """Ends of the sides that begin at each corner [m], shape (n, 2)."""
        return self.points[self.after]

    @property
    def loop_count(self) -> int:
        """Number of closed boundaries of the sheet: a slit from the rim to a hole joins them."""
        size = float(np.ptp(self.rim, axis=0).max())
        begun = [
            sum(
                _distance(ring, slit[end]) <= ON_RIM * size
                for ring in self.rings
                for end in (0, -1)
            )
            for slit in self.slits
        ]
        return len(self.rings) + begun.count(0) - begun.count(2)

    @cached_property
    def area(self) -> float:
        """Area of the sheet [m2]."""
        return math.fsum(polygon_area(ring) for ring in self.rings)

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The sheet; slits have no area and are no part of it."""
        rim, *holes = self.rings
        return shapely.Polygon(rim, holes)

    @cached_property
    def lines(self) -> shapely.Geometry:
        """All that bounds the sheet: rim, holes and slits."""
        if len(self.starts) == 2 and not self.slits:
            return self.polygon.exterior
        return shapely.MultiLineString(
            [
                *(shapely.LinearRing(ring) for ring in self.rings),
                *(shapely.LineString(slit) for slit in self.slits),
            ]
        )

    def vertex(self, number: int) -> np.ndarray:
        """Return a corner; those of slits are counted behind those of closed contours."""
        if number < len(self.points):
            return self.points[number]
        return np.concatenate(self.slits)[number - len(self.points)]

    def turned(self, rotation: np.ndarray) -> Contours:
        """Return the contours in other axes; rotation (2, 2)."""
        return self.moved(lambda points: points @ rotation.T)

    def shifted(self, shift: np.ndarray) -> Contours:
        """Return the contours shifted in the plane."""
        return self.moved(lambda points: points + shift)

    def moved(self, change: Callable[[np.ndarray], np.ndarray]) -> Contours:
        """Return the contours with all corners changed by a function of (k, 2)."""
        return replace(
            self,
            points=change(self.points),
            slits=tuple(change(slit) for slit in self.slits),
            darts=tuple(change(dart) for dart in self.darts),
        )

    def corners(self) -> list[int]:
        """Corners that need a node of their own, the blunt ones first, ends of slits last.

        Where two corners want the same node the sharper one, being later, keeps it.
        """
        into = self.points - self.points[self.before]
        onward = self.ends - self.points
        turn = np.abs(np.arctan2(cross(into, onward), (into * onward).sum(axis=1)))
        order = np.argsort(turn, kind="stable")
        found: list[int] = order[turn[order] >= CORNER_ANGLE].tolist()
        first = len(self.points)
        for slit in self.slits:
            into, onward = np.diff(slit, axis=0)[:-1], np.diff(slit, axis=0)[1:]
            turn = np.abs(np.arctan2(cross(into, onward), (into * onward).sum(axis=1)))
            found += (first + 1 + np.flatnonzero(turn >= CORNER_ANGLE)).tolist()
            found += [first, first + len(slit) - 1]
            first += len(slit)
        return found


class Drawn(NamedTuple):
    """Contours as a drawing gives them.

    rim : corners of the outermost contour [m]. holes : of each contour inside it.
    slits : of each open line on the layer of slits.
    left_out : what was not read, in words; empty for none.
    """

    rim: np.ndarray
    holes: tuple[np.ndarray, ...]
    slits: tuple[np.ndarray, ...]
    left_out: str


def contours_of(blank: BlankShape) -> tuple[Contours, str]:
    """Return the contours of a blank, and the scene key that gave its outline.

    Raises
    ------
    InputError : as :func:`lcmchain.mesh.outline.outline_of` and :func:`with_cuts`.
    """
    rim, key = outline_of(blank)
    if not any(blank.cuts.values()):
        return Contours.of_rim(rim), key
    arrays = {
        name: [np.array(entry, dtype=float).reshape(-1, 2) for entry in entries]
        for name, entries in blank.cuts.items()
    }
    return with_cuts(rim, **arrays, key="blank"), key


def with_cuts(
    rim: np.ndarray,
    holes: Sequence[np.ndarray],
    darts: Sequence[np.ndarray],
    slits: Sequence[np.ndarray],
    *,
    key: str,
) -> Contours:
    """Return the contours of a blank with all that is cut out of it.

    Parameters
    ----------
    rim : corners [m], anticlockwise. holes : corners of each, either way round.
    darts : point of the rim, apex and point of the rim of each (3, 2).
    slits : corners of each (k, 2). key : scene entry of the blank, for messages.

    Raises
    ------
    InputError : a hole, dart or slit that is not in the sheet, crosses or touches another one or
        the rim, or parts the sheet in two; names its entry.
    """
    size = float(np.ptp(rim, axis=0).max())
    wedges = []
    for number, dart in enumerate(darts):
        rim, wedge = _cut_dart(rim, dart, size, f"{key}.darts[{number}]")
        wedges.append(wedge)
    if darts:
        check_simple(rim, f"{key}.darts")
    rings = [rim]
    for number, hole in enumerate(holes):
        rings.append(_checked_hole(rim, hole, size, f"{key}.holes[{number}]"))
    for (one, first), (other, second) in combinations(enumerate(rings[1:]), 2):
        if shapely.Polygon(first).distance(shapely.Polygon(second)) <= ON_RIM * size:
            raise InputError(
                f"touches or crosses {key}.holes[{one}] near {in_mm(second[0])}; leave some "
                "elements between them, or make them one hole",
                key=f"{key}.holes[{other}]",
            )
    points = np.concatenate(rings)
    starts = tuple(np.cumsum([0, *map(len, rings)]).tolist())
    sheet = Contours(points, starts, darts=tuple(wedges))
    cuts = _checked_slits(sheet, slits, size, key)
    return replace(sheet, slits=tuple(cuts))


# --- darts ----------------------------------------------------------------------------------------


def _cut_dart(
    rim: np.ndarray, dart: np.ndarray, size: float, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """Cut a wedge out of the rim; return the rim and the wedge, anticlockwise."""
    apex = dart[1]
    polygon = shapely.Polygon(rim)
    if not shapely.contains_xy(polygon, *apex) or _distance(rim, apex) <= ON_RIM * size:
        raise InputError(
            f"has its apex, the second point, at {in_mm(apex)}, which is not inside the outline; "
            "give a point of the rim, the apex, and another point of the rim",
            key=key,
        )
    if abs(cross(dart[0] - apex, dart[2] - apex)) <= 1e-9 * size**2:
        raise InputError(
            f"has no width at {in_mm(apex)}: its three points lie on one line; a cut without a "
            "width is an entry of slits",
            key=key,
        )
    if cross(dart[1] - dart[0], dart[2] - dart[0]) < 0.0:
        dart = dart[::-1]
    # Anticlockwise the wedge runs rim, apex, rim; the rim itself runs from its last point to its
    # first, so the new rim runs first, apex, last the other way: last of the rim before the cut.
    first_side, first = _on_rim(rim, apex, dart[2], size, key)
    last_side, last = _on_rim(rim, apex, dart[0], size, key)
    wedge = np.array([last, apex, first])
    count = len(rim)
    kept = [rim[(last_side + 1 + k) % count] for k in range((first_side - last_side) % count)]
    if first_side == last_side:
        along = rim[(first_side + 1) % count] - rim[first_side]
        if (last - first) @ along > 0.0:  # the mouth lies within one side
            kept = [rim[(last_side + 1 + k) % count] for k in range(count)]
    line = np.array([last, *kept, first, apex])
    away = np.hypot(*(np.roll(line, -1, axis=0) - line).T)
    line = line[away > 1e-9 * size]  # corners of the rim at which the dart begins
    return line, wedge


def _on_rim(
    rim: np.ndarray, apex: np.ndarray, point: np.ndarray, size: float, key: str
) -> tuple[int, np.ndarray]:
    """Side of the rim that a leg of a dart meets first, and where."""
    start, along = rim, np.roll(rim, -1, axis=0) - rim
    # A point that stands just before the rim is on it.
    leg = point - apex
    reach = 1.0 + ON_RIM * size / float(np.hypot(*leg))
    across = cross(along, leg)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = cross(along, start - apex) / across
        part = cross(leg, start - apex) / across
    length = np.hypot(*along.T)
    slack = 1e-9 * size / length
    meets = (across != 0.0) & (way > 1e-9) & (way <= reach) & (part >= -slack) & (part <= 1 + slack)
    if not meets.any():
        raise InputError(
            f"does not reach the rim: its point {in_mm(point)} lies "
            f"{1e3 * _distance(rim, point):.3g} mm inside the outline; move it onto the rim, as to "
            f"{in_mm(_foot(rim, point))}, or beyond",
            key=key,
        )
    side = int(np.argmin(np.where(meets, way, np.inf)))
    if (meets & (way > way[side] + ON_RIM * size / np.hypot(*leg))).any():
        raise InputError(
            f"crosses the rim or another dart between its apex {in_mm(apex)} and {in_mm(point)}; "
            "give points of the rim, and leave some elements between darts",
            key=key,
        )
    at = float(np.clip(part[side], 0.0, 1.0))
    if np.hypot(*(point - (start[side] + at * along[side]))) <= 1e-9 * size:
        return side, point  # with the digits of the scene
    return side, start[side] + at * along[side]


# --- holes and slits ------------------------------------------------------------------------------


def _checked_hole(rim: np.ndarray, hole: np.ndarray, size: float, key: str) -> np.ndarray:
    """Return the corners of a hole clockwise; it must lie in the sheet."""
    if not np.isfinite(hole).all():
        raise InputError("has a coordinate that is not a finite number", key=key)
    if len(hole) > 1 and np.array_equal(hole[0], hole[-1]):
        hole = hole[:-1]  # written as a closed polygon
    if len(hole) < 3:
        raise InputError(f"needs at least three different points, got {len(hole)}", key=key)
    check_simple(hole, key)
    sheet, opening = shapely.Polygon(rim), shapely.Polygon(hole)
    if not sheet.intersects(opening):
        raise InputError(
            f"lies outside the outline, near {in_mm(hole[0])}; holes lie within it",
            key=key,
        )
    out = ~shapely.contains_xy(sheet, *hole.T)
    if (
        out.any()
        or not sheet.contains(opening)
        or sheet.exterior.distance(opening) <= ON_RIM * size
    ):
        at = hole[int(np.argmax(out))] if out.any() else _nearest(sheet.exterior, opening)
        raise InputError(
            f"touches or crosses the outline near {in_mm(at)}; leave some elements between them, "
            "or cut the hole out of the outline",
            key=key,
        )
    return np.ascontiguousarray(hole[::-1] if polygon_area(hole) > 0.0 else hole)


def _checked_slits(
    sheet: Contours, slits: Sequence[np.ndarray], size: float, key: str
) -> list[np.ndarray]:
    """Return the parts of the slits that lie in the sheet; each must leave it in one piece."""
    found: list[np.ndarray] = []
    joined = list(range(len(sheet.rings)))  # contours that slits connect have the same number
    for number, slit in enumerate(slits):
        entry = f"{key}.slits[{number}]"
        line = _checked_slit(sheet, slit, size, entry)
        for other, before in enumerate(found):
            gap = shapely.LineString(before).distance(shapely.LineString(line))
            if gap <= ON_RIM * size:
                raise InputError(
                    f"touches or crosses {key}.slits[{other}]; leave some elements between them, "
                    "or give one line",
                    key=entry,
                )
        begun = [
            joined[ring]
            for ring, corners in enumerate(sheet.rings)
            for end in (0, -1)
            if _distance(corners, line[end]) <= ON_RIM * size
        ]
        if len(begun) == 2 and begun[0] == begun[1]:
            raise InputError(
                "divides the blank in two: with both its ends it reaches the rim, or holes that "
                "are cut open to it; let one end lie inside, or give two blanks as [[plies]] with "
                "outlines of their own",
                key=entry,
            )
        if len(begun) == 2:
            joined = [begun[0] if ring == begun[1] else ring for ring in joined]
        found.append(line)
    return found


def _checked_slit(sheet: Contours, slit: np.ndarray, size: float, key: str) -> np.ndarray:
    """Return the part of a slit that lies in the sheet."""
    if not np.isfinite(slit).all():
        raise InputError("has a coordinate that is not a finite number", key=key)
    if (np.hypot(*np.diff(slit, axis=0).T) <= 1e-9 * size).any():
        raise InputError(f"repeats a point near {in_mm(slit[0])}; remove it", key=key)
    line = shapely.LineString(slit)
    if not line.is_simple or line.is_ring:
        raise InputError(
            f"crosses itself or is closed, near {in_mm(slit[0])}; a closed cut is an entry of "
            "holes",
            key=key,
        )
    there = sheet.polygon.intersection(line)
    parts = [part for part in shapely.get_parts(there) if part.length > ON_RIM * size]
    if not parts:
        raise InputError(f"lies outside the blank, near {in_mm(slit[0])}", key=key)
    if len(parts) > 1:
        raise InputError(
            f"crosses the rim or a hole near {in_mm(np.array(parts[0].coords[-1]))} and comes "
            "back; give two slits",
            key=key,
        )
    found = shapely.get_coordinates(parts[0])
    for corner in slit:  # with the digits of the scene
        near = np.hypot(*(found - corner).T) <= 1e-12 * size
        found[near] = corner
    along = np.hypot(*np.diff(found, axis=0).T)
    found = found[np.append(True, along > 1e-9 * size)]
    for end in (0, -1):
        for ring in sheet.rings:
            if 1e-12 * size < _distance(ring, found[end]) <= ON_RIM * size:
                found[end] = _foot(ring, found[end])  # the rest would be a bridge of microns
    lengths = [_touching(ring, found, size) for ring in sheet.rings]
    if max(lengths) > ON_RIM * size:
        raise InputError("runs along the rim or a hole; remove it, or move it inside", key=key)
    return found


def _touching(ring: np.ndarray, line: np.ndarray, size: float) -> float:
    """Length along which a line runs on a contour [m]."""
    wide = shapely.LinearRing(ring).buffer(ON_RIM * size)
    return float(shapely.LineString(line).intersection(wide).length) - 100.0 * ON_RIM * size


def _distance(ring: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point from a contour [m]."""
    return float(shapely.LinearRing(ring).distance(shapely.Point(point)))


def _foot(ring: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the point of a contour that is nearest to another one [m], (2,)."""
    line = shapely.LinearRing(ring)
    return np.array(line.interpolate(line.project(shapely.Point(point))).coords[0])


def _nearest(line: shapely.Geometry, other: shapely.Geometry) -> np.ndarray:
    """Point of a line that is nearest to something else."""
    return shapely.get_coordinates(shapely.shortest_line(line, other))[0]
