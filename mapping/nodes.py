"""Fields at the nodes of a target: values of the sheet at the place closest to each node."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.mapping.search import closest_points
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import MappedFields, carried
from lcmchain.mapping.weights import MappingWeights, Status


def transfer_to_nodes(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry every field of the sheet to the nodes of the target, shape (N,) each.

    Values are those of the sheet at the closest place of the layer that the cells around the node
    take from; beyond the edge of the sheet those at its edge. Contents are not kept: nodes have no
    area. Not a number where no cell around a node is mapped.

    weights : of the cells of the target.
    """
    normals = None if target.is_solid else _around_nodes(target, target.surface.normals)
    return carried(sheet, node_weights(sheet, target, weights), normals)


def node_weights(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappingWeights:
    """One weight for each node near the sheet: the face with the closest place on it."""
    surface = sheet.surface
    sides = weights.average_matrix @ (surface.normals * surface.winding.side[:, None])
    mapped = np.where(weights.mapped, 1.0, 0.0)
    reached = _around_nodes(target, np.repeat(mapped[:, None], 3, axis=1))[:, 0] > 0.0
    nodes = np.flatnonzero(reached)
    # Nodes of a mapped cell may lie a little farther off than its centroid.
    farthest = weights.maximum_distance + 2.0 * target.cell_radius
    directions = _around_nodes(target, sides)[nodes]
    closest = closest_points(surface, target.points[nodes], farthest, directions)
    found = closest.face >= 0
    node, face = nodes[found], closest.face[found]
    offset = closest.foot[found] - surface.centroids[face]
    status = np.full(len(target.points), Status.UNMAPPED, dtype=np.int8)
    status[node] = np.where(closest.beside[found], Status.EXTRAPOLATED, Status.PROJECTED)
    distance = np.full(len(target.points), np.nan)
    distance[node] = closest.distance[found]
    return replace(
        weights,
        cell=node,
        face=face,
        average=np.ones(len(node)),
        content=np.zeros(len(node)),
        place=np.einsum("nui,ni->nu", surface.frames[face], offset),
        status=status,
        coverage=(status == Status.PROJECTED).astype(float),
        distance=distance,
        cell_area=np.zeros(len(target.points)),
        conservative=False,
        **({"solid_thickness": np.zeros(0)} if hasattr(weights, "solid_thickness") else {}),
    )


def _around_nodes(target: TargetMesh, vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 3) along the sum of those (C, 3) of the cells around each node, else 0."""
    used = target.corners >= 0
    cell, _ = np.nonzero(used)
    node = target.corners[used]
    summed = np.stack(
        [np.bincount(node, vectors[cell, i], minlength=len(target.points)) for i in range(3)],
        axis=1,
    )
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return summed / np.where(length > 0.0, length, 1.0)
