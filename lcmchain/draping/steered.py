"""A steered start line: nodes of a net along a given curve on the surface, a bar apart.

The curve is the cubic spline through its points, each brought to the nearest point of the surface,
and the spline's points are again. From the seed, the point of the curve nearest to its place, the
next node is where the curve first is a bar away: on a plane a chord of the curve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

from lcmchain.draping.net import ACCURACY, project_all
from lcmchain.draping.surface import DrapedSurface
from lcmchain.errors import InputError
from lcmchain.quantities.readable import millimetres

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

        seed = _nearest(at, lengths[-1], near, LOOKED * edge_length)
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


def _nearest(
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
