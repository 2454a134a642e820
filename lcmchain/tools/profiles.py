"""Tool profiles: plane curves of straight lines and tangent arcs that bound a solid.

Every analytic tool but the plane is such a curve in a half-plane (r, z), revolved about the local z
axis, or in a plane (x, z), extruded along the local y axis. The distance to a line or an arc is
elementary, so the signed distance of the tool is exact.

Most of a sheet faces the level parts of its tools: holders, dies, moulds. Where nothing else of the
tool can be nearer, the distance is a difference of heights (:func:`level_part`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

#: Relative length below which two points of a profile are one, and an angle [rad] is zero.
COINCIDENT = 1e-9

#: Change of the unit normal up to which a joint counts as tangent: above the rounding of a fillet,
#: so far below COINCIDENT that the widened neighbours still meet a thousand lengths away.
SMOOTH = 1e-11

#: Columns of a segment row. Line: LINE, anchor, tangent, first and last abscissa, outward normal.
#: Arc: ARC, centre, direction of its middle, cosine of half its sweep, radius, +1 convex or -1.
SEGMENT_COLUMNS = 9
LINE = 0.0
ARC = 1.0

#: Columns of a corner row: position, bisector of the outward normals.
CORNER_COLUMNS = 4


@dataclass(frozen=True)
class Line:
    """Straight part of a profile; the point at an infinite end only lies on the line."""

    start: tuple[float, float]
    end: tuple[float, float]
    start_infinite: bool = False
    end_infinite: bool = False

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @property
    def tangent(self) -> tuple[float, float]:
        """Unit vector in the direction of travel."""
        return (
            (self.end[0] - self.start[0]) / self.length,
            (self.end[1] - self.start[1]) / self.length,
        )


@dataclass(frozen=True)
class Arc:
    """Circular part of a profile from `start` to `end`; `sweep` is positive counter-clockwise."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float]
    radius: float
    sweep: float

    def at(self, share: float) -> tuple[float, float]:
        """Point at a share (0 ... 1) of the sweep."""
        angle = share * self.sweep
        x, z = self.start[0] - self.centre[0], self.start[1] - self.centre[1]
        cosine, sine = math.cos(angle), math.sin(angle)
        return (
            self.centre[0] + cosine * x - sine * z,
            self.centre[1] + sine * x + cosine * z,
        )

    def tangent(self, share: float) -> tuple[float, float]:
        """Unit vector in the direction of travel at a share (0 ... 1) of the sweep."""
        x, z = self.at(share)
        turn = math.copysign(1.0 / self.radius, self.sweep)
        return (-turn * (z - self.centre[1]), turn * (x - self.centre[0]))


@dataclass(frozen=True)
class Profile:
    """Curve that divides the profile plane into solid and free space.

    Parameters
    ----------
    pieces : lines and arcs in the order of travel.
    solid_left : True where the solid lies on the left of the direction of travel.
    closed : True where the last piece ends at the start of the first.
    revolved : True where the curve lives in the half-plane r >= 0 and is revolved about z.
    """

    pieces: tuple[Line | Arc, ...]
    solid_left: bool
    closed: bool
    revolved: bool

    def segments(self) -> np.ndarray:
        """Rows of `SEGMENT_COLUMNS` numbers for the compiled distance, shape [segment_count, 9]."""
        smooth_start, smooth_end = self._smooth_ends()
        rows = np.zeros((len(self.pieces), SEGMENT_COLUMNS))
        for row, piece, from_start, from_end in zip(rows, self.pieces, smooth_start, smooth_end):
            if isinstance(piece, Line):
                # At a tangent joint each side is widened a little, so that rounding leaves no gap
                # between them through which a point could miss both.
                widening = COINCIDENT * piece.length
                first = -math.inf if piece.start_infinite else -widening * from_start
                last = math.inf if piece.end_infinite else piece.length + widening * from_end
                row[:] = LINE, *piece.start, *piece.tangent, first, last, *self._outward(piece, 0.0)
            else:
                middle = piece.at(0.5)
                row[:8] = (
                    ARC,
                    *piece.centre,
                    (middle[0] - piece.centre[0]) / piece.radius,
                    (middle[1] - piece.centre[1]) / piece.radius,
                    math.cos(min(0.5 * abs(piece.sweep) + COINCIDENT, math.pi)),
                    piece.radius,
                    1.0 if (piece.sweep > 0.0) == self.solid_left else -1.0,
                )
        return rows

    def corners(self) -> np.ndarray:
        """Points where the normal jumps, with the bisector of the normals, shape [count, 4].

        The sign of the distance of a point whose closest point is a corner is the side of the
        bisector on which it lies (Baerentzen & Aanaes 2005, in the plane).
        """
        rows = []
        for before, after in self._joints():
            bisector = _bisector(self._outward(before, 1.0), self._outward(after, 0.0))
            rows.append((*before.end, *bisector))
        if not self.closed:
            first, last = self.pieces[0], self.pieces[-1]
            rows.append((*first.start, *self._axis_bisector(first, at_end=False)))
            rows.append((*last.end, *self._axis_bisector(last, at_end=True)))
        kept = [row for row in rows if row[2] != 0.0 or row[3] != 0.0]
        return np.array(kept, dtype=float).reshape(-1, CORNER_COLUMNS)

    def polyline(self, reach: float, angle_step: float = math.radians(4.0)) -> np.ndarray:
        """Points along the profile for drawing, shape [point_count, 2].

        Parameters
        ----------
        reach : length [m] of infinite lines beyond their last point.
        angle_step : largest angle [rad] between two points of an arc.
        """
        points: list[tuple[float, float]] = []
        for piece in self.pieces:
            if isinstance(piece, Line):
                (x0, z0), (x1, z1), (tx, tz) = piece.start, piece.end, piece.tangent
                back, ahead = reach * piece.start_infinite, reach * piece.end_infinite
                points.append((x0 - back * tx, z0 - back * tz))
                points.append((x1 + ahead * tx, z1 + ahead * tz))
            else:
                count = max(2, math.ceil(abs(piece.sweep) / angle_step))
                points.extend(piece.at(k / count) for k in range(count + 1))
        curve = np.array(points)
        if self.revolved:
            curve[:, 0] = np.maximum(curve[:, 0], 0.0)
        steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
        return curve[np.concatenate(([True], steps > COINCIDENT * steps.max()))]

    def _joints(self) -> list[tuple[Line | Arc, Line | Arc]]:
        joints = list(zip(self.pieces[:-1], self.pieces[1:]))
        if self.closed:
            joints.append((self.pieces[-1], self.pieces[0]))
        return joints

    def _outward(self, piece: Line | Arc, share: float) -> tuple[float, float]:
        tx, tz = piece.tangent if isinstance(piece, Line) else piece.tangent(share)
        return (tz, -tx) if self.solid_left else (-tz, tx)

    def _axis_bisector(self, piece: Line | Arc, *, at_end: bool) -> tuple[float, float]:
        """Bisector at the tip that an end on the axis makes with its mirror image; zero if none."""
        if not self.revolved or not _on_axis(piece, at_end=at_end):
            return (0.0, 0.0)
        nr, nz = self._outward(piece, float(at_end))
        return _bisector((nr, nz), (-nr, nz))

    def _smooth_ends(self) -> tuple[list[bool], list[bool]]:
        """Tell for each piece whether it is continued smoothly before its start, after its end."""
        joints = self._joints()
        smooth = [
            _bisector(self._outward(before, 1.0), self._outward(after, 0.0)) == (0.0, 0.0)
            for before, after in joints
        ]
        count = len(self.pieces)
        smooth_end = [smooth[i] if i < len(smooth) else True for i in range(count)]
        smooth_start = [smooth_end[i - 1] if i > 0 or self.closed else True for i in range(count)]
        if not self.closed:
            smooth_start[0] = self._axis_bisector(self.pieces[0], at_end=False) == (0.0, 0.0)
            smooth_end[-1] = self._axis_bisector(self.pieces[-1], at_end=True) == (0.0, 0.0)
        return smooth_start, smooth_end


def _bisector(first, second) -> tuple[float, float]:
    """Unit bisector of two outward normals; zero where they agree (no corner)."""
    if math.dist(first, second) < SMOOTH:
        return (0.0, 0.0)
    x, z = first[0] + second[0], first[1] + second[1]
    length = math.hypot(x, z)
    return (x / length, z / length)


def _on_axis(piece, *, at_end: bool) -> bool:
    if isinstance(piece, Line) and (piece.end_infinite if at_end else piece.start_infinite):
        return False
    return (piece.end if at_end else piece.start)[0] == 0.0


# Columns of the level part of a profile: it lies between two abscissas [m], at a height [m]; its
# normal is +1 or -1. A point between the abscissas is nearer to it than to anything else where it
# is less far from it than from either of them, and than the depth [m].
BEGIN = 0
END = 1
HEIGHT = 2
NORMAL = 3
DEPTH = 4
LEVEL_PART_COLUMNS = 5

#: No level part: ends before it begins.
NO_LEVEL_PART = (math.inf, -math.inf, 0.0, 1.0, 0.0)


def level_part(segments: np.ndarray, corners: np.ndarray, *, revolved: bool) -> np.ndarray:
    """Return the widest level part of a profile (:data:`LEVEL_PART_COLUMNS`,).

    Parameters
    ----------
    segments, corners : of the profile, see :class:`Profile`.
    revolved : whether abscissas are distances from an axis.
    """
    level = (segments[:, 0] == LINE) & (segments[:, 7] == 0.0)
    heights = segments[level, 2]
    steep = [_extent(row) for row in segments[~level]] + [(x, x) for x in corners[:, 0]]
    widest, best = 0.0, np.array(NO_LEVEL_PART)
    for row in segments[level]:
        apart = np.abs(heights - row[2])
        depth = 0.5 * apart[apart > 0.0].min(initial=math.inf)
        first, last = _extent(row)
        if revolved:
            first = max(first, 0.0)
        for begin, end in [*sorted(steep), (last, math.inf)]:
            width = min(begin, last) - first
            if width > widest:
                # nothing is nearer beyond the axis
                start = -math.inf if revolved and first == 0.0 else first
                widest, best = width, np.array((start, min(begin, last), row[2], row[8], depth))
            first = max(first, end)
    return best


def _extent(segment: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest abscissa of a line or an arc [m]."""
    if segment[0] == LINE:
        x0, tx = segment[1], segment[3]
        ends = [x0 if tx == 0.0 else x0 + tx * abscissa for abscissa in segment[5:7]]
        return min(ends), max(ends)
    x0, radius = segment[1], segment[6]
    middle, half = math.atan2(segment[4], segment[3]), math.acos(segment[5])
    angles = [middle - half, middle + half]
    # where the arc turns back
    angles += [turn for turn in math.pi * np.arange(-2, 3) if abs(turn - middle) <= half]
    places = [x0 + radius * math.cos(angle) for angle in angles]
    return min(places), max(places)


# --- Triangles of revolved and extruded profiles, for pictures ----------------------------------


#: Triangles around the axis of a revolved tool.
CIRCUMFERENCE = 72


def profile_surface(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate a revolved or extruded profile; normals point away from the solid.

    Parameters
    ----------
    profile : in the local frame of the tool.
    reach : length [m] of infinite ends and of an extrusion, to either side.

    Returns
    -------
    points [m], shape [point_count, 3], and triangles, shape [triangle_count, 3].
    """
    return _revolved(profile, reach) if profile.revolved else _extruded(profile, reach)


def _revolved(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    angle = np.linspace(0.0, 2.0 * math.pi, CIRCUMFERENCE, endpoint=False)
    ring = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    points: np.ndarray = np.empty((len(curve), CIRCUMFERENCE, 3))
    points[:, :, :2] = curve[:, None, :1] * ring
    points[:, :, 2] = curve[:, None, 1]
    points = points.reshape(-1, 3)
    index = np.arange(len(points)).reshape(len(curve), CIRCUMFERENCE)
    return points, _strips(index, np.roll(index, -1, axis=1), profile, points)


def _extruded(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    points: np.ndarray = np.empty((len(curve), 2, 3))
    points[:, :, 0] = curve[:, None, 0]
    points[:, :, 1] = (-reach, reach)
    points[:, :, 2] = curve[:, None, 1]
    index = np.arange(2 * len(curve)).reshape(len(curve), 2)
    points = points.reshape(-1, 3)
    return points, _strips(index[:, :1], index[:, 1:], profile, points)


def _strips(near, far, profile: Profile, points) -> np.ndarray:
    """Two triangles between consecutive points of the profile; the normal is on its free side."""
    if profile.closed:
        near, far = np.concatenate((near, near[:1])), np.concatenate((far, far[:1]))
    a, b, c, d = near[:-1].ravel(), near[1:].ravel(), far[1:].ravel(), far[:-1].ravel()
    # Travel, then the way across, turn by the right-hand rule to the left side of the travel.
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    if profile.solid_left:
        faces = faces[:, ::-1]
    p, q, r = (points[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
    return faces[area > 1e-14 * area.max()]  # none at the poles, where a ring is a point


def _polyline_reach(profile: Profile, reach: float) -> float:
    """Length of infinite ends: the box, seen from wherever the given points of the profile lie."""
    ends = [value for piece in profile.pieces for value in (*piece.start, *piece.end)]
    return reach + 2.0 * max(map(abs, ends))
