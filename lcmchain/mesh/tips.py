"""Tips of the outline that no lattice cell reaches: one triangle each, if the step allows it."""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.cells import boundary_edges, cell_heights
from lcmchain.mesh.contours import Contours
from lcmchain.mesh.outline import cross
from lcmchain.mesh.step_measure import step_ratio

# Relative to the pitch: closer than this a node lies on an edge of the outline.
ON_EDGE = 1e-6
# Tips further from all nodes belong to another part of the lattice.
REACH = 6.0
# A tip that would shorten the step by more than this stays cut off.
ACCEPTABLE_RATIO = 1.2
# Triangles lower than this part of the pitch are left out.
LEAST_HEIGHT = 0.05


def fill_tips(
    contours: Contours,
    positions: np.ndarray,
    is_free: np.ndarray,
    faces: np.ndarray,
    pitch: float,
) -> np.ndarray:
    """Return triangles (tips, 4) between a boundary edge of the cells and a corner beyond it.

    The edge must join the two sides of the outline that meet in the corner. The corner takes the
    nearest lattice node that is free: ``positions`` is written.

    Parameters
    ----------
    contours : of the blank; ends and corners of slits are no tips.
    positions : lattice nodes [m]; is_free : which of them no cell has.
    faces : cells, shape (cells, 4). pitch : edge length of whole cells [m].
    """
    outline = contours.points
    vertices = [vertex for vertex in contours.corners() if vertex < len(outline)]
    used = positions[~is_free]
    low, high = used.min(axis=0), used.max(axis=0)
    lost = [
        vertex
        for vertex in vertices
        if (outline[vertex] > low - REACH * pitch).all()
        and (outline[vertex] < high + REACH * pitch).all()
        and not (np.abs(used - outline[vertex]) < ON_EDGE * pitch).all(axis=1).any()
    ]
    if not lost:
        return faces[:0]
    edges = boundary_edges(faces)
    filled, limit = faces, max(ACCEPTABLE_RATIO, step_ratio(positions, faces, pitch))
    free = np.flatnonzero(is_free)
    for vertex in lost[: len(free)]:
        corner = outline[vertex]
        sides = corner, outline[contours.before[vertex]], outline[contours.after[vertex]]
        ends = positions[edges]
        before = _is_on(ends, sides[1], corner, pitch)
        after = _is_on(ends, corner, sides[2], pitch)
        joins = np.flatnonzero((before & after[:, ::-1]).any(axis=1))
        if len(joins) != 1:
            continue
        first, last = edges[joins[0]] if before[joins[0], 0] else edges[joins[0], ::-1]
        node = int(free[np.argmin(((positions[free] - corner) ** 2).sum(axis=1))])
        old = positions[node].copy()
        positions[node] = corner
        # anticlockwise: before, corner, after
        triangle = np.array([[last, first, node, node]])
        trial = np.concatenate([filled, triangle])
        height = cell_heights(positions[triangle])[0]
        if height > LEAST_HEIGHT * pitch and step_ratio(positions, trial, pitch) <= limit:
            filled, free = trial, free[free != node]
        else:
            positions[node] = old
    return filled[len(faces) :]


def _is_on(points: np.ndarray, start: np.ndarray, end: np.ndarray, pitch: float) -> np.ndarray:
    """Whether points (..., 2) lie on the straight line between two others."""
    along = end - start
    length = float(np.hypot(*along))
    way = (points - start) @ along / length
    off = np.abs(cross(along, points - start)) / length
    return (off < ON_EDGE * pitch) & (way > -ON_EDGE * pitch) & (way < length + ON_EDGE * pitch)
