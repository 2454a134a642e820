"""Tool profiles: plane curves of straight lines and tangent arcs that bound a solid.

Every analytic tool but the plane is such a curve in a half-plane (r, z), revolved about the local
z axis, or in a plane (x, z), extruded along the local y axis. A profile is given the way a drawing
gives it: corner points and fillet radii. The distance to a line or an arc is elementary, so the
signed distance of the tool is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.errors import InputError

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


def build_profile(
    points: Sequence[Sequence[float]],
    fillet_radii: Sequence[float] | None,
    *,
    solid: str,
    revolved: bool,
    key: str = "shape",
) -> Profile:
    """Make a profile from corner points and fillet radii.

    An end of the path that lies on the axis of a revolved profile closes there; the path closes
    where its last point is its first; any other end goes on to infinity along its line, or, towards
    the axis of a revolved profile, up to the axis. A fillet at an end on the axis rounds the tip.

    Parameters
    ----------
    points : corner points (r, z) or (x, z) [m] in the order of travel, at least two.
    fillet_radii : radius [m] of the arc that rounds each corner; None or empty for sharp corners.
    solid : "left" or "right": side of the direction of travel on which the solid lies, seen with
        r (or x) to the right and z upwards.
    revolved : True for a profile revolved about z.
    key : scene key named in errors.

    Raises
    ------
    InputError
        if points coincide, a radius is negative or does not fit between its neighbours, a revolved
        profile crosses the axis, or the path crosses itself.
    """
    corners = [(float(x), float(z)) for x, z in points]
    radii = [float(radius) for radius in fillet_radii or ()] or [0.0] * len(corners)
    size = _check_points(corners, radii, solid, revolved, key)

    closed = len(corners) > 3 and math.dist(corners[0], corners[-1]) <= COINCIDENT * size
    if closed:
        radii[0] = max(radii[0], radii.pop())
        corners.pop()
    if revolved:
        corners, radii, closed = _without_axis_lines(corners, radii, closed)

    start_infinite = end_infinite = False
    if not closed:
        start_infinite = not (revolved and corners[0][0] == 0.0)
        end_infinite = not (revolved and corners[-1][0] == 0.0)
        if radii[0] and start_infinite or radii[-1] and end_infinite:
            raise InputError(
                "the first and last point of an open profile cannot have a fillet, because the "
                "profile goes on to infinity there: set their radius to 0",
                key=f"{key}.fillet_radii",
            )
        if revolved:
            start_infinite, end_infinite = _end_on_axis(
                corners, radii, start_infinite, end_infinite, size
            )
    pieces = _pieces(corners, radii, closed, start_infinite, end_infinite, key)
    _check_crossings(pieces, closed, size, key)
    return Profile(tuple(pieces), solid == "left", closed, revolved)


def _check_points(corners, radii, solid, revolved, key) -> float:
    if len(corners) < 2:
        raise InputError("a profile needs at least two points", key=f"{key}.points")
    if len(radii) != len(corners):
        raise InputError(
            f"{len(radii)} radii for {len(corners)} points; give one per point (0 = sharp corner)",
            key=f"{key}.fillet_radii",
        )
    if not np.isfinite(corners).all() or not np.isfinite(radii).all():
        raise InputError("points and fillet radii must be finite numbers", key=f"{key}.points")
    if solid not in ("left", "right"):
        raise InputError(f'"{solid}" is not a side; use "left" or "right"', key=f"{key}.solid")
    size = float(np.ptp(corners, axis=0).max())
    for i, radius in enumerate(radii):
        if radius < 0.0:
            raise InputError(
                f"must not be negative, is {radius:g} m", key=f"{key}.fillet_radii[{i}]"
            )
    for i, (first, second) in enumerate(zip(corners[:-1], corners[1:])):
        if math.dist(first, second) <= COINCIDENT * size:
            raise InputError(
                f"points {i} and {i + 1} are the same point {_text(first)}; remove one",
                key=f"{key}.points[{i + 1}]",
            )
    if revolved:
        for i, (r, z) in enumerate(corners):
            if r < -COINCIDENT * size:
                raise InputError(
                    f"r = {r:g} m is negative; a revolved profile lies in r >= 0",
                    key=f"{key}.points[{i}]",
                )
            if abs(r) <= COINCIDENT * size:
                corners[i] = (0.0, z)
        if all(r == 0.0 for r, _ in corners):
            raise InputError("all points lie on the axis; give some r > 0", key=f"{key}.points")
    return size


def _without_axis_lines(corners, radii, closed):
    """Drop lines that run along the axis of revolution: they bound nothing."""
    if closed:
        for i, (corner, before) in enumerate(zip(corners, [corners[-1], *corners])):
            if corner[0] == before[0] == 0.0:  # the path opens here, where it leaves the axis
                corners, radii, closed = corners[i:] + corners[:i], radii[i:] + radii[:i], False
                break
    while not closed and corners[0][0] == corners[1][0] == 0.0:
        corners, radii = corners[1:], radii[1:]
    while not closed and corners[-1][0] == corners[-2][0] == 0.0:
        corners, radii = corners[:-1], radii[:-1]
    return corners, radii, closed


def _end_on_axis(corners, radii, start_infinite, end_infinite, size):
    """Let an open end that heads for the axis of revolution stop there."""
    for at_start in (True, False):
        infinite = start_infinite if at_start else end_infinite
        end, neighbour = (corners[0], corners[1]) if at_start else (corners[-1], corners[-2])
        inward = neighbour[0] - end[0]
        if not infinite or inward <= COINCIDENT * size:
            continue
        on_axis = (0.0, end[1] - (neighbour[1] - end[1]) * end[0] / inward)
        if at_start:
            corners[0], start_infinite = on_axis, False
        else:
            corners[-1], end_infinite = on_axis, False
    return start_infinite, end_infinite


def _pieces(corners, radii, closed, start_infinite, end_infinite, key) -> list[Line | Arc]:
    count = len(corners)
    arcs: list[Arc | None] = []
    cut = []  # length that each fillet takes from the lines on both sides
    for i, (corner, radius) in enumerate(zip(corners, radii)):
        before, after = corners[i - 1], corners[(i + 1) % count]
        at_tip = not closed and i in (0, count - 1)
        if at_tip:  # round the tip between the line and its mirror image
            neighbour = corners[1] if i == 0 else corners[-2]
            mirrored = (-neighbour[0], neighbour[1])
            before, after = (mirrored, neighbour) if i == 0 else (neighbour, mirrored)
        if at_tip and radius == 0.0:
            arcs.append(None)
            cut.append(0.0)
            continue
        arc, length = _fillet(before, corner, after, radius, i, key)
        if at_tip and arc is not None:
            pole = (0.0, arc.at(0.5)[1])
            start, end = (pole, arc.end) if i == 0 else (arc.start, pole)
            arc = Arc(start, end, (0.0, arc.centre[1]), arc.radius, 0.5 * arc.sweep)
        arcs.append(arc)
        cut.append(length)

    pieces: list[Line | Arc] = []
    for i in range(count):
        if arcs[i] is not None:
            pieces.append(arcs[i])
        j = (i + 1) % count
        if j == 0 and not closed:
            break
        from_infinity = start_infinite and i == 0
        to_infinity = end_infinite and j == count - 1
        available = math.dist(corners[i], corners[j])
        needed = cut[i] + cut[j]
        unlimited = from_infinity or to_infinity
        if needed > available * (1.0 + COINCIDENT) and not unlimited:
            worst = i if radii[i] >= radii[j] else j
            raise InputError(
                f"the fillet of radius {radii[worst]:g} m at {_text(corners[worst])} does not fit: "
                f"the line to its neighbour is {available:g} m long, the fillets on it need "
                f"{needed:g} m; reduce the radius",
                key=f"{key}.fillet_radii[{worst}]",
            )
        start = corners[i] if arcs[i] is None else arcs[i].end
        end = corners[j] if arcs[j] is None else arcs[j].start
        if unlimited:
            # The fillet may begin beyond the given point, which only fixes the direction.
            tx = (corners[j][0] - corners[i][0]) / available
            tz = (corners[j][1] - corners[i][1]) / available
            length = max(available, needed)
            if from_infinity:
                start = (end[0] - length * tx, end[1] - length * tz)
            if to_infinity:
                if from_infinity:
                    start = corners[i]
                end = (start[0] + length * tx, start[1] + length * tz)
        elif needed >= available * (1.0 - COINCIDENT):
            continue  # two fillets meet, or one takes the whole line
        pieces.append(Line(start, end, from_infinity, to_infinity))
    return pieces


def _fillet(before, corner, after, radius, index, key) -> tuple[Arc | None, float]:
    """Arc tangent to both lines at a corner, and the length that it takes of each line."""
    ux, uz = _unit(corner, before)
    vx, vz = _unit(corner, after)
    turn = -ux * vz + uz * vx  # sine of the change of direction, positive to the left
    cosine = ux * vx + uz * vz
    if abs(turn) < COINCIDENT:
        if cosine > 0.0:
            raise InputError(
                f"the profile turns back on itself at {_text(corner)}; move this point",
                key=f"{key}.points[{index}]",
            )
        return None, 0.0  # straight on: nothing to round
    if radius == 0.0:
        return None, 0.0
    half = 0.5 * math.acos(max(-1.0, min(1.0, cosine)))
    length = radius / math.tan(half)
    bx, bz = ux + vx, uz + vz
    to_centre = radius / math.sin(half) / math.hypot(bx, bz)
    return (
        Arc(
            start=(corner[0] + length * ux, corner[1] + length * uz),
            end=(corner[0] + length * vx, corner[1] + length * vz),
            centre=(corner[0] + to_centre * bx, corner[1] + to_centre * bz),
            radius=radius,
            sweep=math.copysign(math.pi - 2.0 * half, turn),
        ),
        length,
    )


def _check_crossings(pieces, closed, size, key) -> None:
    """Reject a path that crosses itself, which leaves open what is solid."""
    polylines = []
    for piece in pieces:
        if isinstance(piece, Line):
            (x0, z0), (x1, z1), (tx, tz) = piece.start, piece.end, piece.tangent
            far = 1e3 * (size + piece.length)
            back, ahead = far * piece.start_infinite, far * piece.end_infinite
            polylines.append([(x0 - back * tx, z0 - back * tz), (x1 + ahead * tx, z1 + ahead * tz)])
        else:
            polylines.append([piece.at(k / 8) for k in range(9)])
    for i, first in enumerate(polylines):
        for j in range(i + 2, len(polylines)):
            if closed and i == 0 and j == len(polylines) - 1:
                continue
            for a, b in zip(first[:-1], first[1:]):
                for c, d in zip(polylines[j][:-1], polylines[j][1:]):
                    if _cross(a, b, c, d):
                        raise InputError(
                            f"the profile crosses itself between {_text(a)}-{_text(b)} and "
                            f"{_text(c)}-{_text(d)} (open ends go on to infinity); move its points",
                            key=f"{key}.points",
                        )


def _cross(a, b, c, d) -> bool:
    def side(p, q, s):
        return (q[0] - p[0]) * (s[1] - p[1]) - (q[1] - p[1]) * (s[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0


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


def _unit(start, end) -> tuple[float, float]:
    length = math.dist(start, end)
    return ((end[0] - start[0]) / length, (end[1] - start[1]) / length)


def _text(point) -> str:
    return f"({point[0]:g}, {point[1]:g}) m"
