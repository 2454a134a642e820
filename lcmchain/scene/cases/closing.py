"""How two moulds from files close on a sheet: stroke and positions from their surfaces alone.

The upper mould comes down along -z until the smallest distance between the surfaces is the wanted
gap. A step down by s shortens no distance by more than s, so that a step by what the distance is
too large never is too long; where moulds meet first is thus found from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.surface import Surface

# Pieces of the surfaces are at most this long: in parts of the gap, or so long that there are at
# most so many.
PIECE_PER_GAP = 0.5
MOST_PIECES = 100_000
CLOSE_ENOUGH = 1e-3  # of the gap
NEAR_PIECES = 6  # that are looked at exactly
CHUNK = 20_000  # points at a time


@dataclass(frozen=True)
class Closing:
    """How far the upper mould of two is from being closed.

    Parameters
    ----------
    lift : z [m] by which the upper mould as it stands in its file has to be moved up to be closed;
        negative where it has to come down.
    place : point [m] of the upper mould, closed, where the gap is smallest.
    slope : angle [rad] of the lower mould's surface there.
    """

    lift: float
    place: np.ndarray
    slope: float


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
    length = _piece_length((upper, lower), gap)
    fixed = _pieces(lower, length)
    points = np.concatenate(
        (_pieces(upper, length).mean(axis=1), upper.points[np.unique(upper.triangles)])
    )
    search = _Search(fixed, cKDTree(fixed.mean(axis=1)), length, far=gap + 4.0 * length)
    bounds = np.zeros(len(points))  # no point is nearer than this
    lift = float(fixed[..., 2].max() - points[:, 2].min()) + gap
    lowest = float(fixed[..., 2].min() - points[:, 2].max()) - gap
    nearest: tuple[float, np.ndarray, int]

    def excess(new_lift: float) -> float:
        """Return what the distance is larger than the gap."""
        nonlocal lift, bounds, nearest
        bounds -= abs(new_lift - lift)
        lift = new_lift
        nearest = search.smallest(points + np.array([0.0, 0.0, lift]), bounds)
        return nearest[0] - gap

    tolerance = CLOSE_ENOUGH * gap
    left = excess(lift)
    while left > tolerance:
        safe = lift
        # Two skins are nearer than the gap over twice the gap at least: this jumps over no contact.
        bold = safe - left - 1.5 * gap
        if bold < lowest:
            raise InputError(
                f"passes the lower mould without coming nearer than {1e3 * nearest[0]:.3g} mm; "
                "name two moulds that face each other along z, in the same coordinates",
                file=upper.file,
            )
        left = excess(bold)
        if left < 0.0:
            excess(float(brentq(excess, bold, safe, xtol=tolerance)))
            break
    _, point, piece = nearest
    a, b, c = fixed[piece]
    normal = np.cross(b - a, c - a)
    return Closing(lift, point, math.acos(min(1.0, abs(normal[2]) / float(np.linalg.norm(normal)))))


@dataclass(frozen=True)
class _Search:
    """Distances to a surface in pieces (n, 3, 3) [m], of which none is longer than ``length``.

    Beyond ``far`` a distance is a lower bound, from the centres of the pieces.
    """

    pieces: np.ndarray
    tree: cKDTree
    length: float
    far: float

    def smallest(self, points: np.ndarray, bounds: np.ndarray) -> tuple[float, np.ndarray, int]:
        """Return the smallest distance of points (n, 3), its point and piece.

        ``bounds`` (n) are lower bounds of the distances; those that are looked at get better.
        """
        best, point, piece = math.inf, 0, 0
        order = np.argsort(bounds, kind="stable")
        for some in np.array_split(order, math.ceil(len(order) / CHUNK)):
            if bounds[some[0]] > best:
                break
            bounds[some], nearest = self.distances(points[some])
            first = int(np.argmin(bounds[some]))
            if bounds[some[first]] < best:
                best, point, piece = bounds[some[first]], int(some[first]), int(nearest[first])
        return float(best), points[point], piece

    def distances(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distance and nearest piece of every point."""
        distance, piece = self.tree.query(points)
        near = np.flatnonzero(distance <= self.far)
        distance -= self.length  # no piece reaches farther from its centre
        if len(near):
            count = min(NEAR_PIECES, len(self.pieces))
            _, candidates = self.tree.query(points[near], k=np.arange(1, count + 1))
            exact = _distances(points[near][:, None], self.pieces[candidates])
            column = np.argmin(exact, axis=1)
            rows = np.arange(len(near))
            distance[near], piece[near] = exact[rows, column], candidates[rows, column]
        return distance, piece


def _piece_length(surfaces: tuple[Surface, ...], gap: float) -> float:
    area = sum(
        0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        for a, b, c in (np.moveaxis(s.points[s.triangles], 1, 0) for s in surfaces)
    )
    # halves of squares whose sides are about half as long as the longest edge allowed
    return max(PIECE_PER_GAP * gap, math.sqrt(8.0 * area / MOST_PIECES))


def _pieces(surface: Surface, longest: float) -> np.ndarray:
    """Return triangles (n, 3, 3), halved at their longest edges until none is longer."""
    waiting, done = surface.points[surface.triangles], []
    while len(waiting):
        edges = np.linalg.norm(np.roll(waiting, -1, axis=1) - waiting, axis=2)
        long = edges.max(axis=1) > longest
        done.append(waiting[~long])
        waiting, edges = waiting[long], edges[long]
        # turned so that the longest edge is that from corner 0 to corner 1
        order = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(waiting, order[..., None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        waiting = np.concatenate((np.stack((a, middle, c), 1), np.stack((middle, b, c), 1)))
    return np.concatenate(done)


def _distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return distances of points (..., 3) to triangles (..., 3, 3)."""
    a, b, c = np.moveaxis(corners, -2, 0)
    sides = [_to_segment(points, p, q) for p, q in ((a, b), (b, c), (c, a))]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    height = np.einsum("...i,...i", points - a, normal)
    inside = np.ones(height.shape, dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("...i,...i", np.cross(q - p, points - p), normal) >= 0.0
    return np.where(inside, np.abs(height), np.minimum.reduce(sides))


def _to_segment(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    along = end - start
    share = np.einsum("...i,...i", points - start, along) / np.einsum("...i,...i", along, along)
    foot = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(points - foot, axis=-1)
