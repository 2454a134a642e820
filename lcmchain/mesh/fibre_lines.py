"""Lines of mesh edges along the fibres of a sheet."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.mesh.sheet_mesh import NO_NODE, SheetMesh

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

    Of several edges within :data:`LARGEST_ANGLE` of a fibre the one nearest to it counts.

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
