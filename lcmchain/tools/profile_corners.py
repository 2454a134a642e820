"""Profiles from corner points and fillet radii, the way a drawing gives them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lcmchain.errors import InputError
from lcmchain.tools.profiles import COINCIDENT, Arc, Line, Profile


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
        here = arcs[i]
        if here is not None:
            pieces.append(here)
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
        there = arcs[j]
        start = corners[i] if here is None else here.end
        end = corners[j] if there is None else there.start
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
    # The cosine of lines that nearly turn back is rounded to one; the sine is not.
    half = 0.5 * (math.acos(max(-1.0, min(1.0, cosine))) or math.atan2(abs(turn), cosine))
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


def _unit(start, end) -> tuple[float, float]:
    length = math.dist(start, end)
    return ((end[0] - start[0]) / length, (end[1] - start[1]) / length)


def _text(point) -> str:
    return f"({point[0]:g}, {point[1]:g}) m"
