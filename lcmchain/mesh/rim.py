"""The rim of a mesh as a line: pieces along it, and which way it faces."""

from __future__ import annotations

import numpy as np

from lcmchain.errors import InputError


def outward(cells: np.ndarray, points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the outward normal of the rim at some nodes, by the length that is theirs, (3,) [m].

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
    part = 0.5 * (on_rim * inside[first] + on_rim * inside[second])
    along = part @ (points[second] - points[first])
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
    found = []
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
        found.append(np.sort(line[piece]))
    return found


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
