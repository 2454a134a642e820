"""One net with the mesh that is placed on it, and several of them as one mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.draping.lines import fibre_coordinates, net_lines, places_between
from lcmchain.draping.net import ACCURACY, lay_net, project_all
from lcmchain.draping.start import NetStart
from lcmchain.draping.surface import DrapedSurface
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.mesh.sheet_mesh import NO_NODE
from lcmchain.scene.draping import FOLDED


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
