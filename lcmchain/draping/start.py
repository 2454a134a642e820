"""Where a net begins: its seed, the place of it, both directions there, and a steered line.

Without a steered line fibre 1 keeps its direction in the flat blank as far as the tangent plane has
it, turned by ``draping.angle``; fibre 2 lies a right angle less the pre-shear further. A steered
line takes the place of the geodesic along fibre 1: the nodes lie on a given curve, a bar apart. The
curve is the cubic spline through its points, each brought to the nearest point of the surface; the
points of the spline are brought there again. From the seed, the point of the curve nearest to its
place, the next node is where the curve first is a bar away: on a plane a chord of the curve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

from lcmchain.draping.net import ACCURACY, project_all, unit_normal
from lcmchain.draping.surface import ASKER, DrapedSurface, level, stroke_direction, touching_tool
from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.quantities.readable import millimetres
from lcmchain.scene import Scene
from lcmchain.tools.distance import gaps
from lcmchain.tools.table import ToolTable

# --- steered start line ---------------------------------------------------------------------------


#: Key of the curve in a scene.
KEY = "draping.start_line"
#: Points nearer to each other than this part of the edge length are one.
SAME_POINT = 1e-3
#: The curve is looked along in steps of this part of a bar.
LOOKED = 0.25
#: Distance over which its tangent is taken [parts of the edge length].
TANGENT = 1e-3
#: Accuracy of a node along the curve [parts of the edge length].
ALONG = 1e-12


@dataclass(frozen=True)
class SteeredLine:
    """A curve on a surface that a start line follows.

    at : place on the surface [m] (3,) at a length of the spline [m].
    length : of the spline [m]. seed : where the seed lies on it [m].
    place : of the seed [m] (3,). tangent : of the curve there, a unit vector (3,).
    key : of the scene entry.
    """

    at: Callable[[float], np.ndarray]
    length: float
    seed: float
    place: np.ndarray
    tangent: np.ndarray
    key: str

    @classmethod
    def through(
        cls,
        surface: DrapedSurface,
        points: Sequence[Sequence[float]],
        near: np.ndarray,
        edge_length: float,
        key: str = KEY,
    ) -> SteeredLine:
        """Return the curve through points, with the seed where it is nearest to a place.

        Parameters
        ----------
        points : in the order of growing fibre coordinate (n, 3) [m].
        near : place that the seed shall come to [m] (3,). edge_length : of the mesh [m].

        Raises
        ------
        InputError : a point has no nearest point of the surface, or two points are one.
        """
        given = np.array(points, dtype=float)
        placed = _projected(surface, given, edge_length, key)
        ways = np.linalg.norm(np.diff(placed, axis=0), axis=1)
        if ways.min() < SAME_POINT * edge_length:
            first = int(np.argmin(ways))
            raise InputError(
                f"has two points that are one on the surface, {millimetres(given[first], 1)} and "
                f"{millimetres(given[first + 1], 1)}; leave one of them out",
                key=key,
            )
        lengths = np.append(0.0, np.cumsum(ways))
        spline = CubicSpline(lengths, placed)

        def at(length: float) -> np.ndarray:
            return _projected(surface, spline(length)[None], edge_length, key)[0]

        seed = _nearest_length(at, lengths[-1], near, LOOKED * edge_length)
        low = max(seed - TANGENT * edge_length, 0.0)
        high = min(seed + TANGENT * edge_length, lengths[-1])
        tangent = at(high) - at(low)
        return cls(at, lengths[-1], seed, at(seed), tangent / np.linalg.norm(tangent), key)

    def nodes(self, lines: np.ndarray, origin: int) -> np.ndarray:
        """Return the places (lines.size, 3) [m] of nodes on the curve; nan beyond its ends.

        lines : fibre coordinates of the nodes [m], growing. origin : number of the seed.
        """
        places = np.full((lines.size, 3), np.nan)
        places[origin] = self.place
        for way in (1, -1):
            here, index = self.seed, origin
            while 0 <= index + way < lines.size:
                bar = abs(lines[index + way] - lines[index])
                found = self._a_bar_on(places[index], here, way, bar)
                if found is None:
                    break
                here, index = found, index + way
                places[index] = self.at(here)
        return places

    def _a_bar_on(self, start: np.ndarray, here: float, way: int, bar: float) -> float | None:
        """Return the first length beyond ``here`` at which the curve is a bar away, or None."""

        def beyond(length: float) -> float:
            return float(np.linalg.norm(self.at(length) - start)) - bar

        end = self.length if way > 0 else 0.0
        before = here
        while before != end:
            ahead = before + way * LOOKED * bar
            ahead = min(ahead, end) if way > 0 else max(ahead, end)
            if beyond(ahead) >= 0.0:
                return brentq(beyond, before, ahead, xtol=ALONG * bar)
            before = ahead
        return None


def _projected(
    surface: DrapedSurface, points: np.ndarray, edge_length: float, key: str
) -> np.ndarray:
    """Return the nearest points of the surface (n, 3) [m]."""
    placed = np.ascontiguousarray(points, dtype=float).copy()
    project_all(surface, placed, ACCURACY * edge_length)
    lost = ~np.isfinite(placed).all(axis=1)
    if lost.any():
        raise InputError(
            f"passes {millimetres(points[np.argmax(lost)], 1)}, which has no nearest point of the "
            "surface; give points nearer to it, or closer to each other",
            key=key,
        )
    return placed


def _nearest_length(
    at: Callable[[float], np.ndarray], length: float, place: np.ndarray, step: float
) -> float:
    """Return the length [m] at which a curve is nearest to a place."""

    def away(where: float) -> float:
        return float(np.linalg.norm(at(where) - place))

    count = max(2, int(np.ceil(length / step)) + 1)
    looked = np.linspace(0.0, length, count)
    distances = [away(where) for where in looked]
    best = int(np.argmin(distances))
    low, high = looked[max(best - 1, 0)], looked[min(best + 1, count - 1)]
    found = minimize_scalar(
        away, bounds=(low, high), method="bounded", options={"xatol": 1e-9 * step}
    )
    return float(found.x) if found.fun < distances[best] else float(looked[best])


# --- seed, place and directions -------------------------------------------------------------------


#: Nodes whose distance from a tool is the least one up to this part of the thickness touch first.
FIRST_TOUCH = 1e-3
#: Relative difference of distances that are the same but for rounding.
SAME_DISTANCE = 1e-9
#: Parts of the blank's size that the way from the seed to the surface is looked for.
LONGEST_WAY = 20.0
#: Steps of that search, and where it ends [parts of the edge length].
MOST_WAYPOINTS = 2000
ARRIVED = 1e-6


@dataclass(frozen=True)
class NetStart:
    """How a net begins.

    seed : material point of the flat blank [m] (2,). place : of it on the surface [m] (3,).
    side : 1 where the upper side of the sheet looks along the gradient of the level, else -1.
    direction_1, direction_2 : unit vectors of both fibres at the place (3,).
    line : curve that the start line along fibre 1 follows; None for a geodesic.
    """

    seed: np.ndarray
    place: np.ndarray
    side: float
    direction_1: np.ndarray
    direction_2: np.ndarray
    line: SteeredLine | None = None


def start_of(scene: Scene, surface: DrapedSurface, blank: BlankMesh, tools: ToolTable) -> NetStart:
    """Return how the net of a scene begins.

    Raises
    ------
    InputError : the seed has no place on the surface, or the steered line does not lie on it.
    """
    seed = seed_of(scene, blank, tools)
    place = place_of(scene, surface, tools, seed)
    line = None
    if scene.draping.start_line is not None:
        edge_length = scene.only_ply(ASKER).blank.edge_length
        line = SteeredLine.through(surface, scene.draping.start_line, place, edge_length)
        place = line.place
    fibre = blank.fibre_direction_1[0] if line is None else line.tangent
    draping = scene.draping
    frame = tangent_frame(surface, place, fibre, draping.angle, draping.pre_shear)
    return NetStart(seed, place, *frame, line)


def seed_of(scene: Scene, blank: BlankMesh, tools: ToolTable) -> np.ndarray:
    """Return the material point [m] (2,) where the net begins."""
    if scene.draping.seed is not None:
        return np.array(scene.draping.seed)
    nodes = blank.mid_surface_positions
    tool = touching_tool(scene, tools)
    if tool is None:
        return 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2]
    distance = gaps(tools, tool, np.ascontiguousarray(nodes), 0.0)
    least = distance.min() + FIRST_TOUCH * scene.only_ply(ASKER).thickness
    first = nodes[distance < least]
    middle = first.mean(axis=0)
    if gaps(tools, tool, middle[None], 0.0)[0] < least:
        return middle[:2]
    return _nearest(first, middle)[:2]


def _nearest(nodes: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the node nearest to a point; of several as near, the first by number."""
    away = np.linalg.norm(nodes - point, axis=1)
    # rounding must not choose between places that a symmetric tool touches at once
    return nodes[np.argmax(away <= away.min() * (1.0 + SAME_DISTANCE))]


def place_of(
    scene: Scene, surface: DrapedSurface, tools: ToolTable, seed: np.ndarray
) -> np.ndarray:
    """Return the place of the seed on the surface [m] (3,)."""
    accuracy = ACCURACY * scene.only_ply(ASKER).blank.edge_length
    if scene.draping.place is not None:
        edge_length = scene.only_ply(ASKER).blank.edge_length
        return nearest_place(surface, scene.draping.place, edge_length, "draping.place")
    start = np.append(seed, scene.only_ply(ASKER).blank.height)
    ahead = stroke_direction(scene, tools)
    for direction in (ahead, -ahead):
        point = _along(surface, start, direction, scene)[None]
        project_all(surface, point, accuracy)
        if np.isfinite(point).all():
            return point[0]
    raise InputError(
        f"{millimetres(start, 1)} of the flat blank has no place on the surface along the stroke; "
        "give another seed, or draping.place",
        key="draping.seed",
    )


def nearest_place(
    surface: DrapedSurface, place: Sequence[float], edge_length: float, key: str
) -> np.ndarray:
    """Return the point of the surface nearest to a place [m] (3,).

    Raises
    ------
    InputError : there is none; names the entry.
    """
    point = np.array([place], dtype=float)
    project_all(surface, point, ACCURACY * edge_length)
    if not np.isfinite(point).all():
        raise InputError("has no nearest point of the surface; give a place nearer to it", key=key)
    return point[0]


def _along(
    surface: DrapedSurface, start: np.ndarray, direction: np.ndarray, scene: Scene
) -> np.ndarray:
    """Return where a ray first meets the surface, or nan; steps are as long as the distance."""

    def level_at(way: float) -> float:
        return level(surface, *(start + way * direction))[0]

    way, found = 0.0, level_at(0.0)
    blank = scene.only_ply(ASKER).blank
    longest = LONGEST_WAY * max(blank.extent) + abs(surface.travel)
    for _ in range(MOST_WAYPOINTS):
        if abs(found) < ARRIVED * blank.edge_length:
            return start + way * direction
        step = abs(found)
        ahead = level_at(way + step)
        if ahead * found < 0.0:  # rounded edges make the level longer than the distance
            return start + brentq(level_at, way, way + step) * direction
        way, found = way + step, ahead
        if way > longest:
            break
    return np.full(3, np.nan)


def tangent_frame(
    surface: DrapedSurface,
    place: np.ndarray,
    fibre: np.ndarray,
    angle: float,
    pre_shear: float,
    key: str = "draping.seed",
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the side of the sheet's upper face, and both fibre directions at the seed.

    Parameters
    ----------
    fibre : direction that fibre 1 has in the tangent plane as far as that has it (3,).
    angle : turn of the net about the normal from there [rad]. pre_shear : of the net [rad].

    Raises
    ------
    InputError : the surface is perpendicular to the fibre.
    """
    gradient = np.array(unit_normal(surface, 1.0, tuple(place)))
    side = -1.0 if gradient[2] < 0.0 else 1.0
    normal = side * gradient
    tangent = fibre - (fibre @ normal) * normal
    size = np.linalg.norm(tangent)
    if size < 1e-6 or not normal.any():
        raise InputError(
            f"the surface at {millimetres(place, 1)} is perpendicular to fibre 1: its direction is "
            "not known there; give another seed",
            key=key,
        )
    tangent /= size
    across = np.cross(normal, tangent)
    second = angle - pre_shear
    return (
        side,
        math.cos(angle) * tangent + math.sin(angle) * across,
        math.cos(second) * across - math.sin(second) * tangent,
    )
