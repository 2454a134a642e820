"""Smallest gap between a tool and a flat blank: over its whole surface, not only at nodes.

A signed distance changes by no more than the way: an element face whose corners are farther than
the smallest gap found, by more than its size, need not be looked at. On the others the distance is
sampled, and the smallest sample followed downhill.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lcmchain.mesh.blank import BlankMesh

#: Samples along each side of a face, and halvings of their spacing on the way downhill.
SAMPLES = 5
HALVINGS = 12
#: No place of a triangle is farther from its corners than this part of its longest side.
FARTHEST = 0.58

Distance = Callable[[np.ndarray], np.ndarray]


def smallest_gap(
    distance: Distance,
    blank: BlankMesh,
    vertices: np.ndarray | None = None,
    offset: float = 0.0,
) -> tuple[float, np.ndarray]:
    """Return the smallest signed distance [m] of the blank to a tool, and its place [m].

    Parameters
    ----------
    distance : exact signed distances [m] of points [m], shape [point_count, 3], to the tool.
    vertices : of a tool's surface mesh [m], shape [vertex_count, 3]: sharp ones may reach between
        all samples.
    offset : 0 for the faces of the blank; else the distance is that to its mid-surface less this
        [m], and the place lies there.
    """
    nodes = blank.mid_surface_positions if offset else blank.node_positions
    at_nodes = distance(nodes)
    gap, place = _least(at_nodes, nodes)
    both = np.concatenate([blank.elements[:, :4], blank.elements[:, 4:]])
    faces = blank.faces if offset else both
    found = _over_faces(distance, nodes[faces], at_nodes[faces].min(axis=1), gap)
    candidates = [(gap, place), found]
    if vertices is not None:
        candidates.append(_at_vertices(vertices, nodes, blank, min(gap, found[0])))
    gap, place = min(candidates, key=lambda candidate: candidate[0])
    return gap - offset, place


def _least(gaps: np.ndarray, places: np.ndarray) -> tuple[float, np.ndarray]:
    first = int(np.argmin(gaps))
    return float(gaps[first]), places[first]


def _over_faces(
    distance: Distance, corners: np.ndarray, at_corners: np.ndarray, gap: float
) -> tuple[float, np.ndarray]:
    """Least distance over faces with corners [face_count, 4, 3] that can beat a gap [m]."""
    sides = corners[:, :, None] - corners[:, None]
    reach = FARTHEST * np.linalg.norm(sides, axis=3).max(axis=(1, 2))
    near = at_corners - reach < gap
    corners, reach = corners[near], reach[near]
    if len(corners) == 0:
        return np.inf, np.zeros(3)

    def at(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1)
        return np.einsum("fk,fki->fi", weights, corners)

    best = np.full(len(corners), np.inf)
    s, t = np.zeros(len(corners)), np.zeros(len(corners))
    steps = np.linspace(0.0, 1.0, SAMPLES)
    for new_s, new_t in np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2):
        new_s, new_t = np.full(len(corners), new_s), np.full(len(corners), new_t)
        best, s, t = _better(distance(at(new_s, new_t)), best, new_s, new_t, s, t)
    step = 1.0 / (SAMPLES - 1)
    for _ in range(HALVINGS):
        step *= 0.5
        for along, across in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)):
            new_s = np.clip(s + step * along, 0.0, 1.0)
            new_t = np.clip(t + step * across, 0.0, 1.0)
            best, s, t = _better(distance(at(new_s, new_t)), best, new_s, new_t, s, t)
    return _least(best, at(s, t))


def _better(found, best, new_s, new_t, s, t):
    better = found < best
    return (
        np.where(better, found, best),
        np.where(better, new_s, s),
        np.where(better, new_t, t),
    )


def _at_vertices(
    vertices: np.ndarray, nodes: np.ndarray, blank: BlankMesh, gap: float
) -> tuple[float, np.ndarray]:
    """Least distance of vertices over or under the blank to its faces; negative between them.

    nodes : of both faces, or of the mid-surface.
    """
    import shapely

    bottom, top = nodes[:, 2].min(), nodes[:, 2].max()
    height = np.maximum(vertices[:, 2] - top, bottom - vertices[:, 2])
    near = height < gap
    vertices, height = vertices[near], height[near]
    faces = shapely.polygons(blank.mid_surface_positions[blank.faces][:, :, :2])
    over = shapely.STRtree(faces).query(shapely.points(vertices[:, :2]), predicate="intersects")[0]
    if len(over) == 0:
        return np.inf, np.zeros(3)
    gap, place = _least(height[over], vertices[over])
    return gap, np.append(place[:2], np.clip(place[2], bottom, top))
