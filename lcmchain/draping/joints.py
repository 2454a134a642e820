"""Joints between neighbouring courses: gaps and overlaps on the formed surface.

At every node of the upper edge of a course the nearest point of the next one's lower edge is
looked for, a line through its nodes. The distance is a gap where that point lies outside of the
course, and an overlap, negative, where it lies inside. Between nodes the edges are chords: over a
curved edge of radius R they lie up to h²/8R off, for the edge length h.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lcmchain.draping.drape import Draped
from lcmchain.draping.laid import LaidNet

#: Parts of the bars' length: nodes nearer to the edge of a strip lie on it.
ON_EDGE = 1e-6
#: Places of the nearest point beyond an end of the other edge, in parts of its last piece.
BEYOND = 1e-6


@dataclass(frozen=True)
class Joint:
    """The joint between two courses, node by node along the upper edge of the first.

    below, above : names of the courses. nominal : gap in the flat blank [m], negative where the
        strips overlap.
    nodes : numbers of the nodes in the mesh of all courses (n,).
    along : coordinate of the nodes along fibre 1 in the flat blank, from the seed of the first
        course [m] (n,). places : of the nodes [m] (n, 3).
    gap : to the edge of the other course [m] (n,), negative for an overlap; nan beyond its ends.
    """

    below: str
    above: str
    nominal: float
    nodes: np.ndarray
    along: np.ndarray
    places: np.ndarray
    gap: np.ndarray

    @property
    def extremes(self) -> tuple[float, float] | None:
        """Least and largest gap [m]; None where the edges are not beside each other."""
        known = self.gap[np.isfinite(self.gap)]
        return (float(known.min()), float(known.max())) if known.size else None

    def in_words(self) -> str:
        """Say how wide the joint is."""
        if self.extremes is None:
            return "the edges are not beside each other"
        flat = f"; {_from_to(self.nominal, self.nominal)} in the flat blank"
        return _from_to(*self.extremes) + flat


def _from_to(least: float, most: float) -> str:
    """Say gaps [m] in words, in mm; negative ones are overlaps."""
    low, high = round(1e3 * least, 2) + 0.0, round(1e3 * most, 2) + 0.0
    if low == high == 0.0:
        return "butt joint"
    if low < 0.0 < high:
        return f"overlap up to {-low:.2f} mm and gap up to {high:.2f} mm"
    what, first, last = ("gap", low, high) if high > 0.0 else ("overlap", -high, -low)
    first, last = sorted((first + 0.0, last + 0.0))
    if first == 0.0:
        return f"{what} up to {last:.2f} mm"
    if first == last:
        return f"{what} of {first:.2f} mm"
    return f"{what} of {first:.2f} to {last:.2f} mm"


def joints_of(draped: Draped) -> list[Joint]:
    """Return the joints between neighbouring courses; empty for a ply of one piece."""
    first = np.cumsum([0, *(net.mesh.node_count for net in draped.courses)])
    return [
        _joint(below, above, int(number))
        for (below, above), number in zip(pairwise(draped.courses), first, strict=False)
    ]


def _joint(below: LaidNet, above: LaidNet, first: int) -> Joint:
    """Return a joint; first : number of the first node of the lower course."""
    assert below.strip is not None and above.strip is not None
    own, other = _edge(below, below.strip[1]), _edge(above, above.strip[0])
    places = below.positions[own]
    inside = _middles(below)[own]
    gap = _signed_distance(places, inside, above.positions[other])
    return Joint(
        below.name,
        above.name,
        above.strip[0] - below.strip[1],
        first + own,
        below.coordinates[own, 0],
        places,
        gap,
    )


def _edge(net: LaidNet, at: float) -> np.ndarray:
    """Return the nodes on an edge of a strip, by growing coordinate along fibre 1."""
    across = net.mesh.fibre_direction_2[0]
    heights = net.mesh.node_positions @ across
    length = min(float(bars.min()) for bars in net.net_lengths)
    on_edge = np.flatnonzero(np.abs(heights - at) < ON_EDGE * length)
    return on_edge[np.argsort(net.coordinates[on_edge, 0])]


def _middles(net: LaidNet) -> np.ndarray:
    """Return the mean of the middles of the faces around each node [m] (node_count, 3)."""
    faces = net.mesh.elements
    middles = net.positions[faces].mean(axis=1)
    total, count = np.zeros_like(net.positions), np.zeros(net.mesh.node_count)
    for corner in range(4):
        np.add.at(total, faces[:, corner], middles)
        np.add.at(count, faces[:, corner], 1.0)
    return total / count[:, None]


def _signed_distance(places: np.ndarray, inside: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return distances of places (n, 3) from a line (m, 3) [m], negative where it is inside.

    inside : points of the course beside the places (n, 3).
    """
    gap = np.full(len(places), np.nan)
    if len(line) < 2:
        return gap
    start, way = line[:-1], np.diff(line, axis=0)
    share = ((places[:, None] - start) * way).sum(-1) / (way * way).sum(-1)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * way
    distance = np.linalg.norm(places[:, None] - nearest, axis=-1)
    distance = np.where(np.isnan(distance), np.inf, distance)
    rows, best = np.arange(len(places)), np.argmin(distance, axis=1)
    before_it = (best == 0) & (share[rows, best] < -BEYOND)
    behind_it = (best == len(way) - 1) & (share[rows, best] > 1.0 + BEYOND)
    known = np.isfinite(distance[rows, best]) & ~before_it & ~behind_it
    outward = ((nearest[rows, best] - places) * (places - inside)).sum(-1)
    gap[known] = (np.sign(outward) * distance[rows, best])[known]
    return gap
