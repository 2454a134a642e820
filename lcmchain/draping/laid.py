"""A net with the mesh of a blank on it: its lines, the places of the nodes, several as one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcmchain.draping.net import ACCURACY, lay_net, project_all
from lcmchain.draping.start import NetStart
from lcmchain.draping.surface import DrapedSurface
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.mesh.sheet_mesh import NO_NODE
from lcmchain.scene.draping import FOLDED

#: Parts of the edge length: coordinates nearer than this are one line; no lines inside the net lie
#: nearer to each other than that.
SAME_LINE = 1e-6
LEAST_SPACING = 0.05


class NetLines(NamedTuple):
    """Coordinates along fibre 1 and 2 from the seed [m], growing, and the seed's numbers."""

    u: np.ndarray
    v: np.ndarray
    i0: int
    j0: int


def fibre_coordinates(blank: BlankMesh, seed: np.ndarray) -> np.ndarray:
    """Return the coordinates (pair_count, 2) of the blank's nodes along its fibres from a seed."""
    axes = np.stack([blank.fibre_direction_1[0, :2], blank.fibre_direction_2[0, :2]])
    return (blank.mid_surface_positions[:, :2] - seed) @ axes.T


def net_lines(blank: BlankMesh, coordinates: np.ndarray, edge_length: float) -> NetLines:
    """Return lines through the blank's lattice and the seed, which cover all nodes.

    Nodes that were pulled onto the outline lie between lines.
    """
    faces = blank.faces[~blank.is_triangle]
    edges = np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])
    found = []
    for axis in (0, 1):
        values = coordinates[edges, axis]
        across = np.abs(values[:, 1] - values[:, 0]) < SAME_LINE * edge_length
        found.append(_lines(values[across, 0], coordinates[:, axis], edge_length))
    (u, i0), (v, j0) = found
    return NetLines(u, v, i0, j0)


def _lines(values: np.ndarray, nodes: np.ndarray, edge_length: float) -> tuple[np.ndarray, int]:
    """Return the lines of one family, and the number of the one through the seed, at zero."""
    lines = _distinct(np.sort(values), SAME_LINE * edge_length)
    lines = _distinct(lines, LEAST_SPACING * edge_length)
    near = np.abs(lines) < LEAST_SPACING * edge_length
    ends = np.array([min(nodes.min(), 0.0), max(nodes.max(), 0.0)])
    lines = np.concatenate([lines[~near], [0.0]])
    covered = (lines.min() - ends[0] < SAME_LINE * edge_length,
               ends[1] - lines.max() < SAME_LINE * edge_length)  # fmt: skip
    lines = np.sort(np.concatenate([lines, ends[~np.array(covered)]]))
    return lines, int(np.searchsorted(lines, 0.0))


def _distinct(values: np.ndarray, spacing: float) -> np.ndarray:
    """Leave out sorted values that follow another one within a spacing."""
    kept: list[float] = []
    for value in values.tolist():
        if not kept or value - kept[-1] > spacing:
            kept.append(value)
    return np.array(kept)


def places_between(
    lines: NetLines, places: np.ndarray, coordinates: np.ndarray, edge_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (n, 3) [m] of nodes by their coordinates, and which lie between lines.

    Between lines they are bilinear in the four nodes around; nan where one that counts has no
    place.
    """
    i, s = _cell_and_share(lines.u, coordinates[:, 0], edge_length)
    j, t = _cell_and_share(lines.v, coordinates[:, 1], edge_length)
    total = np.zeros((len(coordinates), 3))
    for di, share_u in ((0, 1.0 - s), (1, s)):
        for dj, share_v in ((0, 1.0 - t), (1, t)):
            weight = (share_u * share_v)[:, None]
            corner = places[np.minimum(i + di, lines.u.size - 1),
                            np.minimum(j + dj, lines.v.size - 1)]  # fmt: skip
            total += np.where(weight == 0.0, 0.0, weight * corner)
    between = ((s > 0.0) & (s < 1.0)) | ((t > 0.0) & (t < 1.0))
    return total, between


def _cell_and_share(
    lines: np.ndarray, values: np.ndarray, edge_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the line below each value, and the share of the way to the next one."""
    below = np.clip(np.searchsorted(lines, values, side="right") - 1, 0, max(lines.size - 2, 0))
    above = np.minimum(below + 1, lines.size - 1)
    width = np.where(above > below, lines[above] - lines[below], 1.0)
    share = (values - lines[below]) / width
    near = SAME_LINE * edge_length / width
    share = np.where(np.abs(share) <= near, 0.0, share)
    return below, np.where(np.abs(share - 1.0) <= near, 1.0, share)


@dataclass(frozen=True)
class LaidNet:
    """A net on a surface, and the mesh of the ply or course that lies on it.

    name : of the course, else of the ply. start : how the net begins.
    mesh : undeformed mid-surface. positions : of its nodes [m] (node_count, 3), nan without a
        place.
    coordinates : of its nodes along both fibres from the seed [m] (node_count, 2).
    net_places : of the net [m] (U, V, 3); net_status : what became of its nodes (U, V);
    net_lengths : of the bars along fibre 1 (U - 1,) and 2 (V - 1,) [m].
    strip : where the edges of a course lie across fibre 1 [m]; None for a whole ply.
    outline : of a course in the flat blank [m] (n, 2); None for a whole ply.
    """

    name: str
    start: NetStart
    mesh: MidSurfaceMesh
    positions: np.ndarray
    coordinates: np.ndarray
    net_places: np.ndarray
    net_status: np.ndarray
    net_lengths: tuple[np.ndarray, np.ndarray]
    strip: tuple[float, float] | None = None
    outline: np.ndarray | None = None


def lay(
    surface: DrapedSurface,
    blank: BlankMesh,
    begin: NetStart,
    edge_length: float,
    name: str,
    strip: tuple[float, float] | None = None,
    outline: np.ndarray | None = None,
) -> LaidNet:
    """Lay the net of a blank, and place its mesh on it."""
    coordinates = fibre_coordinates(blank, begin.seed)
    lines = net_lines(blank, coordinates, edge_length)
    accuracy = ACCURACY * edge_length
    steered = np.full((lines.u.size, 3), np.nan)
    if begin.line is not None:
        steered = begin.line.nodes(lines.u, lines.i0)
    places, status = lay_net(
        surface, begin.side, tuple(begin.place), tuple(begin.direction_1),
        tuple(begin.direction_2), lines.u, lines.v, lines.i0, lines.j0, math.cos(FOLDED), accuracy,
        steered,
    )  # fmt: skip
    positions, between = places_between(lines, places, coordinates, edge_length)
    inside = positions[between]
    project_all(surface, inside, accuracy)
    positions[between] = inside
    return LaidNet(
        name, begin, MidSurfaceMesh.of_blank(blank), positions, coordinates, places, status,
        (np.diff(lines.u), np.diff(lines.v)), strip, outline,
    )  # fmt: skip


def joined(meshes: Sequence[MidSurfaceMesh]) -> MidSurfaceMesh:
    """Return meshes as one, without common nodes."""
    if len(meshes) == 1:
        return meshes[0]
    counts = np.cumsum([0, *(mesh.node_count for mesh in meshes[:-1])])
    pairs = list(zip(meshes, counts, strict=True))
    faces = [
        np.where(mesh.sheet_faces == NO_NODE, NO_NODE, mesh.sheet_faces + n) for mesh, n in pairs
    ]
    return MidSurfaceMesh(
        np.concatenate([mesh.node_positions for mesh in meshes]),
        np.concatenate([mesh.elements + n for mesh, n in pairs]),
        np.concatenate(faces),
        np.concatenate([mesh.fibre_direction_1 for mesh in meshes]),
        np.concatenate([mesh.fibre_direction_2 for mesh in meshes]),
        meshes[0].thickness,
    )
