"""The sheet as a slab: every face is a column along the normals of its nodes, without gaps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.jit import routine, strict_equation
from lcmchain.mapping.solids.tetrahedra import HEXAHEDRON, WEDGE, Solids, solids
from lcmchain.mapping.surfaces.surface import COINCIDENCE, Surface
from lcmchain.mesh.search import STACK, BoxTree, box_tree, closest_point_of_triangle, items_in_box


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


# --- how far the sheet's own region reaches on both sides: half way to its next wall --------------

#: Relative change of a ball's radius below which it has come to rest, and steps that it may take.
AT_REST = 1e-12
STEPS = 200

#: Share of the length at which a column would turn over that is used.
UPRIGHT = 0.9


def own_reach(
    points: np.ndarray,
    normals: np.ndarray,
    faces: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Distance from the sheet to its medial surface along each node's normal [m], shape (N, 2).

    It is the radius of the largest ball on either side (below, above) that touches the sheet at the
    node and holds no other part of it: half the distance of parallel walls, the radius of a bend.

    Source: Ma, Bae and Choi, The Visual Computer 28 (2012) 7.

    Parameters
    ----------
    points, normals : nodes [m] and unit normals, shape (N, 3).
    faces : node numbers, shape (F, 4), a triangle repeats its last node; those around a node do
        not bound its ball.
    reach : largest radius [m].
    """
    corners, face = _fans(points, faces)
    tree = tree_of(corners.min(axis=1), corners.max(axis=1))
    start, near = touching(tree, points - 2.0 * reach, points + 2.0 * reach)
    return _largest_balls(points, normals, faces, corners, face, start, near, reach)


def _fans(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of triangles around the middle of each face, shape (T, 3, 3), and their faces (T,).

    A triangle stays as it is.
    """
    triangle = faces[:, 3] == faces[:, 2]
    quads, whole = np.flatnonzero(~triangle), np.flatnonzero(triangle)
    x = points[faces[quads]]
    middle = x.mean(axis=1)
    parts = [np.stack([x[:, k], x[:, (k + 1) % 4], middle], axis=1) for k in range(4)]
    corners = np.concatenate([points[faces[whole, :3]], *parts])
    return corners, np.concatenate([whole, np.tile(quads, 4)])


@strict_equation
def _largest_balls(points, normals, faces, corners, face, start, near, reach):
    radii = np.full((len(points), 2), reach)
    for i in range(len(points)):
        for side in range(2):
            sign = 2.0 * side - 1.0
            nx, ny, nz = sign * normals[i, 0], sign * normals[i, 1], sign * normals[i, 2]
            radius = reach
            for _ in range(STEPS):
                x, y, z = points[i, 0], points[i, 1], points[i, 2]
                cx, cy, cz = x + radius * nx, y + radius * ny, z + radius * nz
                smaller = radius
                for k in range(start[i], start[i + 1]):
                    t = near[k]
                    around = faces[face[t]]
                    if i == around[0] or i == around[1] or i == around[2] or i == around[3]:
                        continue
                    qx, qy, qz, _ = closest_point_of_triangle(corners[t], cx, cy, cz)
                    square = (qx - cx) ** 2 + (qy - cy) ** 2 + (qz - cz) ** 2
                    if square >= radius * radius:
                        continue
                    dx, dy, dz = qx - x, qy - y, qz - z
                    along = dx * nx + dy * ny + dz * nz
                    if along > 0.0:
                        ball = (dx * dx + dy * dy + dz * dz) / (2.0 * along)
                        smaller = min(smaller, ball)
                if smaller >= radius * (1.0 - AT_REST):
                    break
                radius = smaller
            radii[i, side] = radius
    return radii


def upright_reach(
    points: np.ndarray, normals: np.ndarray, faces: np.ndarray, reach: np.ndarray
) -> np.ndarray:
    """Shorten the reach of the nodes of a face until its column turns over nowhere [m], (N, 2).

    Parameters
    ----------
    faces : node numbers, shape (F, 4); a triangle repeats its last node.
    reach : below and above the sheet [m], shape (N, 2).
    """
    shortened = reach.copy()
    x, m = points[faces], normals[faces]
    across = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    for k in range(4):
        before, after = (k - 1) % 4, (k + 1) % 4
        e, f = x[:, after] - x[:, k], x[:, before] - x[:, k]
        de, df = m[:, after] - m[:, k], m[:, before] - m[:, k]
        # (e + s de) x (f + s df) along the normal of the face, as a polynomial in s
        terms = [np.cross(e, f), np.cross(e, df) + np.cross(de, f), np.cross(de, df)]
        c, b, a = (np.einsum("fi,fi->f", term, across) for term in terms)
        corner = c > 0.0  # the repeated corner of a triangle encloses nothing
        below, above = _first_roots(a[corner], b[corner], c[corner])
        own = faces[corner].ravel()
        np.minimum.at(shortened[:, 0], own, np.repeat(UPRIGHT * below, 4))
        np.minimum.at(shortened[:, 1], own, np.repeat(UPRIGHT * above, 4))
    return shortened


def _first_roots(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the first root of a s² + b s + c below and above s = 0 (c > 0), else infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4.0 * a * c)
        # without cancellation: 2c / (-b -+ root)
        both = np.stack([2.0 * c / (-b - root), 2.0 * c / (-b + root)])
    both = np.where(np.isfinite(both), both, np.inf)
    above = np.where(both > 0.0, both, np.inf).min(axis=0)
    below = np.where(both < 0.0, -both, np.inf).min(axis=0)
    return below, above


# --- which boxes of a set touch each of many boxes ------------------------------------------------


def tree_of(low: np.ndarray, high: np.ndarray) -> BoxTree:
    """Build the tree of boxes with these corners [m], both of shape (B, 3)."""
    return box_tree(np.stack([low, high], axis=1))


def touching(tree: BoxTree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the tree that touch each of Q boxes, ascending: (start (Q + 1,), numbers)."""
    queries = np.concatenate([low, high], axis=1)
    counts = np.empty(len(queries), dtype=np.int64)
    _count(tree, queries, counts)
    start = np.concatenate([[0], np.cumsum(counts)])
    numbers = np.empty(start[-1], dtype=np.int64)
    _gather(tree, queries, start, numbers)
    return start, numbers


@routine
def _count(tree, queries, counts):
    stack = np.empty(STACK, np.int64)
    for q in range(len(queries)):
        counts[q] = -items_in_box(tree, queries[q], stack, stack[:0])


@routine
def _gather(tree, queries, start, numbers):
    stack = np.empty(STACK, np.int64)
    for q in range(len(queries)):
        own = numbers[start[q] : start[q + 1]]
        items_in_box(tree, queries[q], stack, own)
        own.sort()
