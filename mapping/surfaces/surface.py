"""The faceted surface of a sheet or of a shell target: areas, normals, neighbours and its edge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine
from lcmchain.mapping.surfaces.gradients import GradientStencil, gradient_stencil
from lcmchain.mesh.search import BoxTree, bounding_box, box_tree

# Nodes closer than this fraction of the mesh's size are the same place: files written face by
# face (STL) repeat their nodes, and every edge would look like an edge of the sheet.
COINCIDENCE = 1e-9


@dataclass(frozen=True)
class Surface:
    """Sheet of triangles and quadrilaterals in space.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    faces : node numbers, shape (F, 4); -1 in the last column marks a triangle.
    """

    points: np.ndarray
    faces: np.ndarray

    @property
    def face_count(self) -> int:
        return len(self.faces)

    @cached_property
    def is_quadrilateral(self) -> np.ndarray:
        """Whether a face has four different nodes, shape (F,)."""
        f = self.faces
        return (f[:, 3] >= 0) & (f[:, 3] != f[:, 2])

    @cached_property
    def geometry(self) -> FaceGeometry:
        """Areas, normals and the like of all faces."""
        return _face_geometry(
            np.ascontiguousarray(self.points, dtype=float), np.ascontiguousarray(self.faces)
        )

    @property
    def corners(self) -> np.ndarray:
        """Corner positions [m], shape (F, 4, 3); a triangle repeats its last corner."""
        return self.geometry.corners

    @property
    def area_vectors(self) -> np.ndarray:
        """Half the cross product of the diagonals [m2], shape (F, 3).

        Its length is the area at the centre of a warped quadrilateral, the measure in which the
        forming result conserves the fibre mass.
        """
        return self.geometry.area_vectors

    @property
    def areas(self) -> np.ndarray:
        """Face areas [m2], shape (F,)."""
        return self.geometry.areas

    @property
    def normals(self) -> np.ndarray:
        """Unit normals, shape (F, 3); zero where a face has no area."""
        return self.geometry.normals

    @property
    def centroids(self) -> np.ndarray:
        """Centroids of the areas of the faces [m], shape (F, 3)."""
        return self.geometry.centroids

    @property
    def frames(self) -> np.ndarray:
        """Two unit tangents of each face, which its normal completes, shape (F, 2, 3)."""
        return self.geometry.frames

    def in_frames(self, face: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Points [m] (..., 3) in the frames of their faces, from the centroids, shape (..., 2)."""
        return np.einsum("...ui,...i->...u", self.frames[face], points - self.centroids[face])

    @property
    def face_radii(self) -> np.ndarray:
        """Largest distance from each face's centroid to its corners [m], shape (F,)."""
        return self.geometry.radii

    @cached_property
    def triangles(self) -> np.ndarray:
        """Node numbers of the triangles, shape (T, 3); a quadrilateral gives two, one after the
        other, cut along its diagonal 0-2."""
        f, quad = self.faces, self.is_quadrilateral
        first = np.concatenate([[0], np.cumsum(1 + quad)])
        triangles = np.empty((first[-1], 3), dtype=np.int64)
        triangles[first[:-1]] = f[:, :3]
        triangles[first[1:][quad] - 1] = f[quad][:, [0, 2, 3]]
        return triangles

    @cached_property
    def first_triangle(self) -> np.ndarray:
        """First triangle of each face, and the number of triangles, shape (F + 1,)."""
        return np.concatenate([[0], np.cumsum(1 + self.is_quadrilateral)]).astype(np.int64)

    @cached_property
    def triangle_face(self) -> np.ndarray:
        """Face of each triangle, shape (T,)."""
        return np.repeat(np.arange(self.face_count), 1 + self.is_quadrilateral)

    @cached_property
    def triangle_corners(self) -> np.ndarray:
        """Corner positions of the triangles [m], shape (T, 3, 3)."""
        return np.ascontiguousarray(self.points[self.triangles])

    @cached_property
    def triangle_area_vectors(self) -> np.ndarray:
        """Area times unit normal of the triangles [m2], shape (T, 3)."""
        c = self.triangle_corners
        return 0.5 * np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])

    @cached_property
    def edge_length(self) -> float:
        """Median length of the face edges [m]."""
        c = self.corners
        lengths = np.linalg.norm(np.roll(c, -1, axis=1) - c, axis=2)
        return float(np.median(lengths[lengths > 0.0]))

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the used nodes [m]."""
        low, high = bounding_box(self.corners.reshape(-1, 3))
        return float(np.linalg.norm(high - low))

    @cached_property
    def places(self) -> np.ndarray:
        """Number of the place where each node sits; repeated nodes share one."""
        return places_of(self.points, max(COINCIDENCE * self.size, np.finfo(float).tiny))

    @cached_property
    def edge_bounds_sheet(self) -> np.ndarray:
        """Whether edge k (corner k to k + 1) of a triangle bounds the sheet, shape (T, 3)."""
        quad, bounds = self.is_quadrilateral, self.winding.bounds
        edges = np.zeros((len(self.triangles), 3), dtype=bool)
        first = self.first_triangle[:-1]
        edges[first, :2] = bounds[:, :2]  # the third is the diagonal of a quadrilateral
        edges[first[~quad], 2] = bounds[~quad, 2]
        edges[first[quad] + 1, 1:] = bounds[quad, 2:]
        return edges

    @cached_property
    def corner_bounds_sheet(self) -> np.ndarray:
        """Whether corner k of a triangle lies on the edge of the sheet, shape (T, 3)."""
        place, edges = self.places[self.triangles], self.edge_bounds_sheet
        bounding = np.zeros(self.places.max() + 1, dtype=bool)
        bounding[place[edges]] = True
        bounding[np.roll(place, -1, axis=1)[edges]] = True
        return bounding[place]

    @cached_property
    def winding(self) -> Winding:
        """Neighbours across edges, pieces and sides of the faces."""
        places = self.places[self.faces]
        places[~self.is_quadrilateral, 3] = -1
        return winding(places)

    @cached_property
    def gradient_stencil(self) -> GradientStencil:
        """Faces around each face, and what they add to the gradient of a field on it."""
        corner = np.where(self.faces < 0, self.faces[:, 2:3], self.faces)
        normals = self.normals * self.winding.side[:, None]
        return gradient_stencil(
            self.places[corner], self.corners, self.centroids, self.frames, normals
        )

    @cached_property
    def face_tree(self) -> BoxTree:
        """Tree of the boxes around the faces."""
        return box_tree(self.corners)


# --- areas, centroids, normals, frames and radii, in one pass of compiled code --------------------


class FaceGeometry(NamedTuple):
    """Geometry of F triangles and quadrilaterals.

    corners : positions [m], shape (F, 4, 3); a triangle repeats its last corner.
    area_vectors : half the cross product of the diagonals [m2], shape (F, 3).
    areas : their lengths [m2], shape (F,).
    normals : unit vectors along them, shape (F, 3); zero where a face has no area.
    centroids : of the areas of both triangles of a face [m], shape (F, 3).
    frames : two unit tangents, which the normal completes, shape (F, 2, 3).
    radii : largest distance of a corner from the centroid [m], shape (F,).
    """

    corners: np.ndarray
    area_vectors: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    centroids: np.ndarray
    frames: np.ndarray
    radii: np.ndarray


@routine
def _face_geometry(points, faces):
    """Compute the geometry of faces.

    points : node positions [m], shape (N, 3).
    faces : node numbers, shape (F, 4); -1 in the last column marks a triangle.
    """
    count = len(faces)
    corners, frames = np.empty((count, 4, 3)), np.zeros((count, 2, 3))
    vectors, normals = np.empty((count, 3)), np.zeros((count, 3))
    centroids, areas, radii = np.empty((count, 3)), np.empty(count), np.empty(count)
    for f in range(count):
        own, middle = corners[f], centroids[f]
        for k in range(4):
            node = faces[f, k] if faces[f, k] >= 0 else faces[f, 2]
            for axis in range(3):
                own[k, axis] = points[node, axis]
        x, y, z = _cross(own, 0, 2, 1, 3)
        doubled = np.sqrt(x * x + y * y + z * z)
        areas[f] = 0.5 * doubled
        vectors[f, 0], vectors[f, 1], vectors[f, 2] = 0.5 * x, 0.5 * y, 0.5 * z
        if doubled > 0.0:
            normals[f, 0], normals[f, 1], normals[f, 2] = x / doubled, y / doubled, z / doubled
            _write_tangents(normals[f], frames[f])
        x, y, z = _cross(own, 0, 1, 0, 2)
        half = np.sqrt(x * x + y * y + z * z)
        x, y, z = _cross(own, 0, 2, 0, 3)
        other = np.sqrt(x * x + y * y + z * z)
        share = other / (half + other) if half + other > 0.0 else 0.0
        for axis in range(3):
            shared = own[0, axis] + own[2, axis]
            middle[axis] = (shared + own[1, axis] + share * (own[3, axis] - own[1, axis])) / 3.0
        radius = 0.0
        for k in range(4):
            x, y, z = own[k, 0] - middle[0], own[k, 1] - middle[1], own[k, 2] - middle[2]
            radius = max(radius, x * x + y * y + z * z)
        radii[f] = np.sqrt(radius)
    return FaceGeometry(corners, vectors, areas, normals, centroids, frames, radii)


@equation
def _cross(corners, a, b, c, d):
    """Cross product of the ways from corner a to b and from c to d."""
    ux, uy, uz = (
        corners[b, 0] - corners[a, 0],
        corners[b, 1] - corners[a, 1],
        corners[b, 2] - corners[a, 2],
    )
    vx, vy, vz = (
        corners[d, 0] - corners[c, 0],
        corners[d, 1] - corners[c, 1],
        corners[d, 2] - corners[c, 2],
    )
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@equation
def _write_tangents(normal, frame):
    """Write two unit vectors (2, 3) across a unit normal, from the axis that it is least along."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax <= ay and ax <= az:
        length = np.sqrt(ny * ny + nz * nz)
        ux, uy, uz = 0.0, nz / length, -ny / length
    elif ay <= az:
        length = np.sqrt(nx * nx + nz * nz)
        ux, uy, uz = -nz / length, 0.0, nx / length
    else:
        length = np.sqrt(nx * nx + ny * ny)
        ux, uy, uz = ny / length, -nx / length, 0.0
    frame[0, 0], frame[0, 1], frame[0, 2] = ux, uy, uz
    frame[1, 0], frame[1, 1] = ny * uz - nz * uy, nz * ux - nx * uz
    frame[1, 2] = nx * uy - ny * ux


# --- which points are the same place --------------------------------------------------------------


def places_of(points: np.ndarray, spacing: float) -> np.ndarray:
    """Number the places where points lie; points that round to the same place share one.

    Parameters
    ----------
    points : [m], shape (N, 3).
    spacing : of the grid to which they are rounded [m].

    Returns
    -------
    number of the place of each point, shape (N,), in the order in which the places first occur.
    """
    steps = np.round(points / spacing).astype(np.int64)
    table_size = 1 << max(4, int(2 * len(points)).bit_length())
    return _number(steps, np.full(table_size, -1, dtype=np.int64))


@routine
def _number(steps, table):
    """Number different rows by a hash table with open addressing, twice as large as need be."""
    place = np.empty(len(steps), dtype=np.int64)
    last = np.uint64(len(table) - 1)
    places = 0
    for n in range(len(steps)):
        mixed = np.uint64(0)
        for axis in range(3):
            mixed = (mixed ^ np.uint64(steps[n, axis])) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        slot = mixed & last
        while True:
            other = table[np.int64(slot)]
            if other < 0:
                table[np.int64(slot)] = n
                place[n] = places
                places += 1
                break
            if (
                steps[other, 0] == steps[n, 0]
                and steps[other, 1] == steps[n, 1]
                and steps[other, 2] == steps[n, 2]
            ):
                place[n] = place[other]
                break
            slot = (slot + np.uint64(1)) & last
    return place


# --- neighbours across edges, connected pieces, and the side that each face shows -----------------
# Two faces that share an edge show the same side where they run along it in opposite directions.
# Meshes of other programs do not always do so; here the faces of a piece are turned until they do.


class Winding(NamedTuple):
    """Pieces of a mesh of triangles and quadrilaterals.

    neighbours : face across edge k (corner k to k + 1) of each face, shape (F, 4); -1 where there
        is none, or more than one.
    bounds : whether edge k of a face belongs to no other face, shape (F, 4).
    piece : number of the piece that each face belongs to, shape (F,).
    side : 1, or -1 where the face shows the other side than the first face of its piece, (F,).
    two_sided : whether a piece has two sides; a Möbius strip has not. Shape (pieces,).
    """

    neighbours: np.ndarray
    bounds: np.ndarray
    piece: np.ndarray
    side: np.ndarray
    two_sided: np.ndarray


def winding(faces: np.ndarray) -> Winding:
    """Find neighbours, pieces and sides.

    faces : numbers of places, shape (F, 4); -1 in the last column marks a triangle. Corners that
        lie at the same place have the same number.
    """
    neighbours, bounds, against = _neighbours(faces, int(faces.max(initial=0)) + 1)
    return Winding(neighbours, bounds, *_pieces(neighbours, against))


@routine
def _neighbours(faces, place_count):
    """Faces across edges, edges without one, and whether both faces run along the edge one way.

    The edges are listed by the lower of their two places, where few others are to compare with.
    """
    shape = faces.shape
    neighbours = np.full(shape, -1, dtype=np.int64)
    bounds, against = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    first = np.zeros(place_count + 1, dtype=np.int64)
    for face in range(len(faces)):
        for column in range(4):
            start, end = _edge_of(faces, face, column)
            if start != end:
                first[min(start, end) + 1] += 1
    for place in range(place_count):
        first[place + 1] += first[place]
    edges = np.empty((first[place_count], 3), dtype=np.int64)  # higher place, face and column, way
    filled = first[:-1].copy()
    for face in range(len(faces)):
        for column in range(4):
            start, end = _edge_of(faces, face, column)
            if start != end:
                row = filled[min(start, end)]
                filled[min(start, end)] += 1
                edges[row, 0], edges[row, 1] = max(start, end), 4 * face + column
                edges[row, 2] = 1 if start < end else -1
    for place in range(place_count):
        for row in range(first[place], first[place + 1]):
            uses, other = 0, -1
            for k in range(first[place], first[place + 1]):
                if edges[k, 0] == edges[row, 0]:
                    uses += 1
                    other = k if k != row else other
            face, column = edges[row, 1] // 4, edges[row, 1] % 4
            bounds[face, column] = uses == 1
            if uses == 2:
                neighbours[face, column] = edges[other, 1] // 4
                against[face, column] = edges[other, 2] == edges[row, 2]
    return neighbours, bounds, against


@equation
def _edge_of(faces, face, column):
    """Ends of an edge of a face; twice the same where a triangle has none in this column."""
    count = 4 if faces[face, 3] >= 0 else 3
    if column >= count:
        return faces[face, 0], faces[face, 0]
    return faces[face, column], faces[face, column + 1 if column + 1 < count else 0]


@routine
def _pieces(neighbours, against):
    count = len(neighbours)
    piece = np.full(count, -1, dtype=np.int64)
    side = np.ones(count, dtype=np.int8)
    two_sided = np.ones(count, dtype=np.bool_)
    waiting = np.empty(count, dtype=np.int64)
    pieces = 0
    for seed in range(count):
        if piece[seed] >= 0:
            continue
        piece[seed], waiting[0], height = pieces, seed, 1
        while height > 0:
            height -= 1
            face = waiting[height]
            for k in range(4):
                other = neighbours[face, k]
                if other < 0:
                    continue
                wanted = -side[face] if against[face, k] else side[face]
                if piece[other] < 0:
                    piece[other], side[other] = pieces, wanted
                    waiting[height] = other
                    height += 1
                elif side[other] != wanted:
                    two_sided[pieces] = False
        pieces += 1
    return piece, side, two_sided[:pieces].copy()
