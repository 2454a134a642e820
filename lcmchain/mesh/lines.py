"""Lines on the mesh of a sheet: along the fibres, along its rim, and where a plane cuts it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh.sheet_mesh import NO_NODE, SheetMesh

# --- along the fibres -----------------------------------------------------------------------------


# Edges within this angle of a fibre follow it: those of a blank whose nodes are moved aside do, its
# diagonals and meshes that cross the fibres do not.
LARGEST_ANGLE = math.radians(30.0)


class FibreLines(NamedTuple):
    """Neighbours along the fibres of every node of the mid-surface.

    before, after : (2, mid_count) nodes of the mid-surface against and along fibre 1 and 2, -1 for
        none.
    """

    before: np.ndarray
    after: np.ndarray


def fibre_lines(mesh: SheetMesh) -> FibreLines:
    """Return the lines of edges along the fibres of the undeformed mesh."""
    return lines_along(
        mesh.mid_surface(mesh.node_positions),
        mesh.sheet_faces,
        (mesh.fibre_direction_1, mesh.fibre_direction_2),
    )


def lines_along(
    points: np.ndarray, faces: np.ndarray, fibres: tuple[np.ndarray, np.ndarray]
) -> FibreLines:
    """Return the lines of edges along two fibre families on an undeformed surface.

    The edge nearest to a fibre counts where several lie within :data:`LARGEST_ANGLE` of it.

    Parameters
    ----------
    points : (n, 3) [m]. faces : nodes (F, 3 or 4), -1 or the last node again closes a triangle.
    fibres : unit vectors (F, 3) of either family.
    """
    start, end, element = _edges(faces)
    direction = points[end] - points[start]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    before = np.full((2, len(points)), NO_NODE, dtype=np.int32)
    after = before.copy()
    for family, fibre in enumerate(fibres):
        cosine = np.einsum("ed,ed->e", direction, fibre[element])
        # the nearest comes last and is the one that stays
        order = np.argsort(np.abs(cosine), kind="stable")
        order = order[np.abs(cosine[order]) > math.cos(LARGEST_ANGLE)]
        turned = cosine[order] < 0.0
        first = np.where(turned, end[order], start[order])
        last = np.where(turned, start[order], end[order])
        after[family, first] = last
        before[family, last] = first
        # an edge that only one of its nodes has chosen is no part of a line
        for ends, back in ((after[family], before[family]), (before[family], after[family])):
            there = ends != NO_NODE
            there[there] = back[ends[there]] == np.flatnonzero(there)
            ends[~there] = NO_NODE
    return FibreLines(before, after)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return start and end nodes of all edges of all faces, and the faces; -1 closes a face."""
    first = np.where(faces == NO_NODE, faces[:, :1], faces)
    second = np.roll(first, -1, axis=1)
    element = np.broadcast_to(np.arange(len(faces))[:, None], faces.shape)
    has_length = first != second
    return first[has_length], second[has_length], element[has_length]


# --- along the rim --------------------------------------------------------------------------------


def outward(cells: np.ndarray, points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the outward normal of the rim at some nodes, times their length of the rim, (3,) [m].

    Each node of the rim has half of the edges beside it; nodes inside have none.

    Parameters
    ----------
    cells : (C, 4) nodes of a flat mesh, anticlockwise in the plane, -1 behind a triangle.
    points : (N, 3) [m]. nodes : (n,).
    """
    following = np.roll(cells, -1, axis=1)
    following = np.where(following < 0, cells[:, :1], following)
    there = cells.ravel() >= 0
    first, second = cells.ravel()[there], following.ravel()[there]
    count = len(points)
    on_rim = ~np.isin(first * count + second, second * count + first)
    inside = np.zeros(count, dtype=bool)
    inside[nodes] = True
    share = 0.5 * (on_rim * inside[first] + on_rim * inside[second])
    along = share @ (points[second] - points[first])
    return np.array([along[1], -along[0], 0.0])


def pieces_along(
    edges: np.ndarray, points: np.ndarray, count: int, width: float, *, key: str
) -> list[np.ndarray]:
    """Return the nodes (n,) of pieces of a closed boundary, evenly along it.

    The boundary begins at its corner with the smallest x + y; the middles of the pieces lie at odd
    multiples of half their distance from there.

    Parameters
    ----------
    edges : (E, 2) of the boundary. points : (N, 3) [m]. width : length of each piece [m].
    key : scene entry, for messages.

    Raises
    ------
    InputError : the pieces overlap, or one has no node.
    """
    line = in_order(edges, points)
    steps = np.linalg.norm(np.diff(points[np.append(line, line[0])], axis=0), axis=1)
    length = float(steps.sum())
    if count * width > length * (1.0 + 1e-9):
        raise InputError(
            f"{count} pieces of {1e3 * width:.4g} mm do not fit on a boundary of "
            f"{1e3 * length:.4g} mm; give fewer, or a smaller width",
            key=f"{key}.count",
        )
    at = np.append(0.0, np.cumsum(steps[:-1]))
    pieces = []
    for number in range(count):
        middle = (number + 0.5) * length / count
        away = np.abs((at - middle + 0.5 * length) % length - 0.5 * length)
        piece = np.flatnonzero(away <= 0.5 * width * (1.0 + 1e-6))
        if piece.size == 0:
            raise InputError(
                f"piece {number + 1} of {1e3 * width:.4g} mm has no node of the mesh; give a width "
                "of an element's edge at least",
                key=f"{key}.width",
            )
        pieces.append(np.sort(line[piece]))
    return pieces


def in_order(edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the nodes of a closed boundary one after the other, anticlockwise."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    nodes = np.array(sorted(neighbours))
    first = int(nodes[np.argmin(np.round(points[nodes, 0] + points[nodes, 1], 12))])
    line, before = [first], -1
    while len(line) < len(edges):
        here = line[-1]
        onward = next(node for node in neighbours[here] if node != before)
        line.append(onward)
        before = here
    x, y = points[line, 0], points[line, 1]
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0.0:
        line = [line[0], *line[:0:-1]]
    return np.array(line)


# --- cuts by a plane, or by any level of a function on nodes --------------------------------------


class CutPolygons(NamedTuple):
    """Polygons that are cut, and the ends of their cuts.

    polygons : (P,) numbers of the polygons that are crossed twice.
    ends : (P, 2) numbers of the two ends of each cut; polygons that share a cut edge share one.
    nodes : (n, 2) the nodes of the edge that each end lies on. share : (n,) its way along it, 0 at
        the first node.
    """

    polygons: np.ndarray
    ends: np.ndarray
    nodes: np.ndarray
    share: np.ndarray

    def places(self, points: np.ndarray) -> np.ndarray:
        """Return the ends (n, 3) between nodes at some points."""
        first, second = points[self.nodes[:, 0]], points[self.nodes[:, 1]]
        return first + self.share[:, None] * (second - first)


def cut_polygons(polygons: np.ndarray, height: np.ndarray) -> CutPolygons:
    """Cut polygons where a height over nodes changes its sign; 0 counts as above.

    Parameters
    ----------
    polygons : (P, k) nodes in order; one with fewer repeats its last. height : of the nodes.
    """
    sides = np.stack([polygons, np.roll(polygons, -1, axis=1)], axis=2)
    above = height >= 0.0
    crossed = above[sides[..., 0]] != above[sides[..., 1]]
    cut = np.flatnonzero(crossed.sum(axis=1) == 2)
    edges = np.sort(sides[cut][crossed[cut]], axis=1)
    nodes, number = np.unique(edges, axis=0, return_inverse=True)
    share = height[nodes[:, 0]] / (height[nodes[:, 0]] - height[nodes[:, 1]])
    return CutPolygons(cut, number.reshape(-1, 2), nodes, share)
