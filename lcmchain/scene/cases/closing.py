"""How two moulds from files close on a sheet: the stroke, from their surfaces alone.

The upper mould comes down along -z until the smallest distance between the surfaces is the wanted
gap. A step down by s shortens no distance by more than s, so that a step by what the distance is
too large never is too long; where moulds meet first is thus found from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.closest import TriangleTree, closest_places, triangle_tree
from lcmchain.tools.surfaces.surface import Surface

# Points of the upper mould are this far apart: in parts of the gap, or so far that there are at
# most about so many.
POINTS_PER_GAP = 2.0
MOST_POINTS = 100_000
CLOSE_ENOUGH = 1e-3  # of the gap
CHUNK = 10_000  # points that are looked at together


@dataclass(frozen=True)
class Closing:
    """How far the upper mould of two is from being closed.

    Parameters
    ----------
    lift : z [m] by which the upper mould as it stands in its file has to be moved up to be closed;
        negative where it has to come down.
    place : point [m] of the upper mould, closed, where the gap is smallest.
    slope : angle [rad] between the lower mould's surface there and the horizontal.
    """

    lift: float
    place: np.ndarray
    slope: float


class _Distance:
    """Smallest distance between the upper mould, lifted, and the lower one.

    Every point keeps a lower bound of its distance, which a move by s shortens by s: only points
    that may be the nearest are looked at.
    """

    def __init__(self, points: np.ndarray, tree: TriangleTree) -> None:
        self.points, self.tree = points, tree
        self.lift = 0.0
        self.bounds = np.zeros(len(points))
        self.point, self.triangle = 0, 0

    def at(self, lift: float) -> float:
        """Return the smallest distance [m] of the mould that is lifted by z [m]."""
        self.bounds -= abs(lift - self.lift)
        self.lift = lift
        smallest = math.inf
        order = np.argsort(self.bounds, kind="stable")
        for some in np.array_split(order, math.ceil(len(order) / CHUNK)):
            if self.bounds[some[0]] > smallest:
                break
            found = closest_places(self.tree, self.points[some] + [0.0, 0.0, lift])
            self.bounds[some] = found.distance
            first = int(np.argmin(found.distance))
            if found.distance[first] < smallest:
                smallest = float(found.distance[first])
                self.point, self.triangle = int(some[first]), int(found.triangle[first])
        return smallest


def close_moulds(upper: Surface, lower: Surface, gap: float) -> Closing:
    """Find where the upper mould, coming down along -z, is as near to the lower one as the gap.

    Parameters
    ----------
    upper, lower : the moulds as they stand in their files; normals do not matter.
    gap : smallest distance of the closed moulds [m].

    Raises
    ------
    InputError : the moulds pass each other without coming so near.
    """
    corners = lower.points[lower.triangles]
    points = _points_of(upper, gap)
    distance = _Distance(points, triangle_tree(corners))
    lift = float(corners[..., 2].max() - points[:, 2].min()) + gap
    lowest = float(corners[..., 2].min() - points[:, 2].max()) - gap
    left = distance.at(lift) - gap
    while left > CLOSE_ENOUGH * gap:
        # Two skins are nearer than the gap over twice the gap at least: this jumps over no contact.
        bold = lift - left - 1.5 * gap
        if bold < lowest:
            raise InputError(
                f"passes the lower mould without coming nearer than {1e3 * (left + gap):.3g} mm; "
                "name two moulds that face each other along z, in the same coordinates",
                file=upper.file,
            )
        safe, lift = lift, bold
        left = distance.at(lift) - gap
        if left < 0.0:
            xtol = CLOSE_ENOUGH * gap
            lift = float(brentq(lambda z: distance.at(z) - gap, bold, safe, xtol=xtol))
            break
    distance.at(lift)
    a, b, c = corners[distance.triangle]
    normal = np.cross(b - a, c - a)
    slope = math.acos(min(1.0, abs(normal[2]) / float(np.linalg.norm(normal))))
    return Closing(lift, points[distance.point] + [0.0, 0.0, lift], slope)


def _points_of(surface: Surface, gap: float) -> np.ndarray:
    """Return points (n, 3) of a surface, near to each other against the gap."""
    a, b, c = np.moveaxis(surface.points[surface.triangles], 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    # triangles are halves of squares whose sides are about half as long as the longest edge
    longest = max(gap / POINTS_PER_GAP, math.sqrt(8.0 * area / MOST_POINTS))
    waiting = surface.points[surface.triangles]
    centres = []
    while len(waiting):
        edges = np.linalg.norm(np.roll(waiting, -1, axis=1) - waiting, axis=2)
        is_long = edges.max(axis=1) > longest
        centres.append(waiting[~is_long].mean(axis=1))
        waiting, edges = waiting[is_long], edges[is_long]
        # halved at the longest edge, turned to be that from corner 0 to corner 1
        order = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(waiting, order[..., None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        waiting = np.concatenate((np.stack((a, middle, c), 1), np.stack((middle, b, c), 1)))
    return np.concatenate((*centres, surface.points[np.unique(surface.triangles)]))
