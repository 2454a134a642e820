"""The cells around each node laid flat beside each other, so that vectors of them can be added.

Only lengths and angles within the sheet enter: a sheet that is rolled up along its mesh lines has
the same unfolding as the flat one. Around a node whose angles do not sum to a full turn (the top
of a dome) the cells are spread evenly over it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine


def flat_corners(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Corners of cells in their own planes [m], shape (C, 4, 2); the first axis along a side.

    corners (C, 4, 3), normals (C, 3). A warped quadrilateral is projected onto its mean plane.
    """
    first, second = plane_axes(corners, normals)
    away = corners - corners[:, :1]
    return np.stack(
        [np.einsum("cai,ci->ca", away, first), np.einsum("cai,ci->ca", away, second)], axis=2
    )


def plane_axes(corners: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors in the planes of cells, each (C, 3), the first along the first side."""
    side = corners[:, 1] - corners[:, 0]
    side = side - np.einsum("ci,ci->c", side, normals)[:, None] * normals
    first = side / np.linalg.norm(side, axis=1)[:, None]
    return first, np.cross(normals, first)


class Unfolding(NamedTuple):
    """How the cells around nodes lie in the nodes' planes.

    turns (C, 4, 2, 2) : matrices that take vectors of a cell's plane into that of a corner's node.
        They turn, and mirror where a cell runs the other way round than the first at the node.
    angle (N,) : sum of the cells' angles at each node; 2 pi where the cells close around it.
    inward (N, 2) : direction from the rim into the sheet at nodes of the rim, 0 elsewhere.
    """

    turns: np.ndarray
    angle: np.ndarray
    inward: np.ndarray


def unfold(cells: np.ndarray, flat: np.ndarray, node_count: int) -> Unfolding:
    """Lay the cells (C, 4), with corners (C, 4, 2) in their own planes, around their nodes."""
    count = np.where(cells[:, 3] >= 0, 4, 3)
    cell, corner = np.nonzero(cells >= 0)
    order = np.argsort(cells[cell, corner], kind="stable")
    cell, corner = cell[order], corner[order]
    start = np.searchsorted(cells[cell, corner], np.arange(node_count + 1))
    following, before = (corner + 1) % count[cell], (corner - 1) % count[cell]
    here = flat[cell, corner]
    ahead, behind = flat[cell, following] - here, flat[cell, before] - here
    first = np.arctan2(ahead[:, 1], ahead[:, 0])
    crossed = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    angle = np.arctan2(crossed, np.einsum("ki,ki->k", ahead, behind)) % (2.0 * np.pi)
    at, mirrored, total, closed = _walk(start, cells[cell, following], cells[cell, before], angle)
    # A mirrored corner begins, in its node's plane, with its second side.
    turn = np.where(mirrored, at + first + angle, at - first)
    cosine, sine = np.cos(turn), np.sin(turn)
    sign = np.where(mirrored, -1.0, 1.0)
    turns = np.zeros((len(cells), 4, 2, 2))
    turns[cell, corner] = np.stack([cosine, -sign * sine, sine, sign * cosine], axis=1).reshape(
        -1, 2, 2
    )
    inward = np.stack([np.cos(0.5 * total), np.sin(0.5 * total)], axis=1)
    inward[closed] = 0.0
    return Unfolding(turns, np.where(closed, 2.0 * np.pi, total), inward)


@routine
def _walk(start, following, before, angle):
    """Angle at which each corner begins around its node, and whether it is mirrored.

    Also the sum of the angles at each node, and whether its cells close around it.
    """
    sums = np.zeros(len(start) - 1)
    closes = np.zeros(len(start) - 1, dtype=np.bool_)
    at = np.zeros(len(angle))
    mirrored = np.zeros(len(angle), dtype=np.bool_)
    visited = np.zeros(len(angle), dtype=np.bool_)
    for node in range(len(start) - 1):
        low, high = start[node], start[node + 1]
        closed = True
        total = 0.0
        left = high - low
        while left > 0:
            # Begin at a side that belongs to one corner only, else anywhere.
            begin, edge = -1, -1
            for k in range(low, high):
                if visited[k]:
                    continue
                if begin < 0:
                    begin, edge = k, following[k]
                for side in (following[k], before[k]):
                    shared = 0
                    for m in range(low, high):
                        if following[m] == side or before[m] == side:
                            shared += 1
                    if shared == 1:
                        if closed:
                            begin, edge = k, side
                        closed = False
            k = begin
            while k >= 0:
                visited[k] = True
                left -= 1
                at[k] = total
                mirrored[k] = before[k] == edge
                total += angle[k]
                edge = following[k] if mirrored[k] else before[k]
                k = -1
                for m in range(low, high):
                    if not visited[m] and (following[m] == edge or before[m] == edge):
                        k = m
                        break
        if closed and total > 0.0:
            for k in range(low, high):
                middle = (at[k] + 0.5 * angle[k]) * (2.0 * np.pi / total)
                at[k] = middle - 0.5 * angle[k]
        sums[node], closes[node] = total, closed
    return at, mirrored, sums, closes
