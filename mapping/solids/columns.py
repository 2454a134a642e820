"""The sheet as a slab: every face is a column along the normals of its nodes, without gaps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.mapping.solids.boxes import tree_of
from lcmchain.mapping.solids.reach import own_reach, upright_reach
from lcmchain.mapping.solids.tetrahedra import HEXAHEDRON, WEDGE, Solids, solids
from lcmchain.mapping.surface import COINCIDENCE, Surface
from lcmchain.mesh.search import BoxTree


@dataclass(frozen=True)
class Columns:
    """Columns over the faces of a sheet.

    Parameters
    ----------
    points : nodes of the sheet, repeated ones merged [m], shape (N, 3).
    normals : unit normals of these nodes, shape (N, 3).
    faces : their numbers, shape (F, 4); a triangle repeats its last node.
    is_quadrilateral : shape (F,).
    below, above : ends of the columns along the normals of the nodes [m], shape (N,); ``below``
        is negative unless a column starts over the sheet.
    """

    points: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    is_quadrilateral: np.ndarray
    below: np.ndarray
    above: np.ndarray

    @cached_property
    def solids(self) -> Solids:
        """The columns as solid cells."""
        low = self.points + self.below[:, None] * self.normals
        high = self.points + self.above[:, None] * self.normals
        corners = np.concatenate([low[self.faces], high[self.faces]], axis=1)
        wedge = np.concatenate([low[self.faces[:, :3]], high[self.faces[:, :3]]], axis=1)
        triangle = ~self.is_quadrilateral
        corners[triangle, :6] = wedge[triangle]
        corners[triangle, 6:] = wedge[triangle, 5:]
        return solids(corners, np.where(triangle, WEDGE, HEXAHEDRON))

    @cached_property
    def tree(self) -> BoxTree:
        """Tree of the boxes around the columns."""
        return tree_of(self.solids.low, self.solids.high)

    @cached_property
    def face_normals(self) -> np.ndarray:
        """Unit normals of the faces, shape (F, 3)."""
        across = self.area_vectors(np.zeros(len(self.faces)))
        return across / np.linalg.norm(across, axis=1)[:, None]

    @cached_property
    def centroids(self) -> np.ndarray:
        """Means of the corners of the faces [m], shape (F, 3)."""
        x = self.points[self.faces]
        return np.where(self.is_quadrilateral[:, None], x.mean(axis=1), x[:, :3].mean(axis=1))

    @cached_property
    def directors(self) -> np.ndarray:
        """Normals of each face's corners, per height over the face, shape (F, 4, 3).

        Where the sheet bends, the normal of a node leans against its faces.
        """
        x = self.points[self.faces]
        across = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
        across /= np.linalg.norm(across, axis=1)[:, None]
        m = self.normals[self.faces]
        return m / np.einsum("fki,fi->fk", m, across)[:, :, None]

    @cached_property
    def at_outline(self) -> np.ndarray:
        """Whether a face has a node on the outline of the sheet, shape (F,)."""
        edges = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2)
        edges = np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)
        unique, count = np.unique(edges, axis=0, return_counts=True)
        outline = np.zeros(len(self.points), dtype=bool)
        outline[unique[count == 1]] = True
        return outline[self.faces].any(axis=1)

    def area_vectors(self, height: np.ndarray) -> np.ndarray:
        """Half the cross product of the diagonals of each column at a height [m2], shape (F, 3).

        height : over the face, along its normal [m], shape (F,).
        """
        x = self.points[self.faces]
        if np.any(height):
            x = x + height[:, None, None] * self.directors
        return 0.5 * np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])

    def areas(self, height: np.ndarray) -> np.ndarray:
        """Area of each column at a height over its face [m2], shape (F,)."""
        return np.linalg.norm(self.area_vectors(height), axis=1)


def columns_of(surface: Surface, reach: float, body: np.ndarray | None = None) -> Columns:
    """Extrude a sheet along the normals of its nodes as far as its own region reaches.

    Parameters
    ----------
    reach : largest length of a column on either side [m].
    body : number of the ply of each face, shape (F,): plies share no nodes, and a ply does not
        limit the columns of another one.
    """
    faces = _closed(surface)
    body = np.zeros(len(faces), dtype=np.int64) if body is None else body
    points, faces = _merged(surface, faces, body)
    normals = node_normals(points, faces)
    lengths = np.full((len(points), 2), reach)
    for ply in np.unique(body):
        own = faces[body == ply]
        used, local = np.unique(own, return_inverse=True)
        local = local.reshape(own.shape)
        lengths[used] = own_reach(
            np.ascontiguousarray(points[used]), np.ascontiguousarray(normals[used]),
            local, reach,
        )  # fmt: skip
    lengths = upright_reach(points, normals, faces, lengths)
    return Columns(points, normals, faces, surface.is_quadrilateral, -lengths[:, 0], lengths[:, 1])


def _closed(surface: Surface) -> np.ndarray:
    """Faces of four nodes (F, 4), all wound alike; a triangle repeats its last node."""
    closed = np.where(surface.faces[:, 3:] < 0, surface.faces[:, 2:3], surface.faces[:, 3:])
    faces = np.concatenate([surface.faces[:, :3], closed], axis=1)
    turned = surface.winding.side < 0.0
    quad = surface.is_quadrilateral
    faces[turned & quad] = faces[turned & quad][:, ::-1]
    faces[turned & ~quad] = faces[turned & ~quad][:, [1, 0, 2, 2]]
    return faces


def node_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals of nodes: means over the faces around them, weighted by their angles, (N, 3).

    Source: Thürrner and Wüthrich, Journal of Graphics Tools 3 (1998) 43.
    """
    x = points[faces]
    across = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    across /= np.linalg.norm(across, axis=1)[:, None]
    # the repeated node of a triangle counts once, with its angle between the two others
    triangle = faces[:, 3] == faces[:, 2]
    summed = np.zeros_like(points)
    for k in range(4):
        before = x[:, (k - 1) % 4]
        after = x[:, (k + 1) % 4]
        if k == 2:
            after = np.where(triangle[:, None], x[:, 0], after)
        angle = _angle(before - x[:, k], after - x[:, k])
        if k == 3:
            angle = np.where(triangle, 0.0, angle)
        np.add.at(summed, faces[:, k], angle[:, None] * across)
    length = np.linalg.norm(summed, axis=1)
    return summed / np.where(length > 0.0, length, 1.0)[:, None]


def _angle(e: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Angle between vectors [rad], shape (F,)."""
    return np.arctan2(np.linalg.norm(np.cross(e, f), axis=1), np.einsum("fi,fi->f", e, f))


def merged_places(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Number of the place of each node of each cell; nodes at the same place share one.

    cells : node numbers, filled with -1, which stays.
    """
    used, local = np.unique(cells[cells >= 0], return_inverse=True)
    own = points[used]
    size = float(np.linalg.norm(np.ptp(own, axis=0)))
    place = _places(own, np.zeros(len(own), dtype=np.int64), COINCIDENCE * size)
    numbers = np.full(cells.shape, -1, dtype=np.int64)
    numbers[cells >= 0] = place[local.reshape(-1)]
    return numbers


def _merged(surface: Surface, faces: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the nodes [m] and faces by place: nodes repeated in a ply are one place."""
    keys, local = np.unique(
        np.stack([np.repeat(body, 4), faces.ravel()], axis=1), axis=0, return_inverse=True
    )
    points = surface.points[keys[:, 1]]
    place = _places(points, keys[:, 0], COINCIDENCE * surface.size)
    first = np.unique(place, return_index=True)[1]
    return np.ascontiguousarray(points[first]), place[local.reshape(faces.shape)]


def _places(points: np.ndarray, body: np.ndarray, tolerance: float) -> np.ndarray:
    """Number of the place of each point, shape (N,); points of one body within a distance share."""
    same = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    same = same[body[same[:, 0]] == body[same[:, 1]]]
    graph = coo_array((np.ones(len(same)), same.T), shape=(len(points), len(points)))
    return connected_components(graph, directed=False)[1]
