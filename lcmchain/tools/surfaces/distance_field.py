"""Tools given as STL or any other surface mesh: reading, checking, and their distance field.

The signed distance is computed once, on a regular grid around the surface: exactly (closest point
of the closest triangle) in a narrow band, as a lower bound elsewhere. The sign is the side of the
angle-weighted pseudonormal of the closest face, edge or vertex (Baerentzen & Aanaes, IEEE Trans.
Vis. Comput. Graph. 11, 2005), which needs no closed surface: skins are as good as solids.
"""

from __future__ import annotations

import contextlib
import io
import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.jit import strict_equation
from lcmchain.quantities.units import QuantityError, length_factor

#: Half-width of the band with exact distances, in grid spacings. The interpolated part is what is
#: left after the stencil's reach (one node in each direction): penetrations up to 3 spacings.
BAND = 5.0

#: Number of grid nodes that an automatic spacing aims at, and the most that is accepted.
AUTOMATIC_NODES = 3_000_000
MAXIMUM_NODES = 30_000_000

#: Relative distance below which two vertices are one (STL files repeat every vertex).
WELD = 1e-6

#: Largest in-plane distance beyond an open edge, in spacings, at which the back of a skin still
#: counts as solid. Wide enough to close the cracks between patches that do not share vertices.
OVERHANG = 1.0

#: Largest difference of distances, in spacings, at which two open edges count as equally close.
CRACK = 0.05

#: Largest jump of a true signed distance between neighbouring nodes, in spacings. One is the limit
#: for a solid; beyond an open edge the two sides differ by up to 1 + sqrt(1 + OVERHANG^2).
LARGEST_JUMP = 3.0

#: Share of a spacing by which the field may miss the surface before a warning.
RESOLVED = 0.1

_TRIANGULATION = {"triangle": [(0, 1, 2)], "quad": [(0, 1, 2), (0, 2, 3)]}


class ToolWarning(UserWarning):
    """A tool that can be used, but not quite as it was given."""


@dataclass(frozen=True)
class Surface:
    """Welded, consistently oriented triangles of a tool; normals point into free space.

    Parameters
    ----------
    points : vertices [m], shape [vertex_count, 3].
    triangles : vertex indices, shape [triangle_count, 3].
    edges : the edges of each triangle (0-1, 1-2, 2-0) as indices, shape [triangle_count, 3].
    edge_use : number of triangles at each edge, shape [edge_count].
    file : where it was read from.
    """

    points: np.ndarray
    triangles: np.ndarray
    edges: np.ndarray
    edge_use: np.ndarray
    file: Path

    @property
    def open_edge_count(self) -> int:
        """Number of edges with a triangle on one side only; zero for a closed surface."""
        return int(np.count_nonzero(self.edge_use == 1))

    @property
    def normals(self) -> np.ndarray:
        """Unit normals of the triangles, shape [triangle_count, 3]."""
        a, b, c = (self.points[self.triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@dataclass(frozen=True)
class DistanceField:
    """Signed distance to a surface on a regular grid, in the frame of the surface.

    Parameters
    ----------
    spacing : distance [m] of the grid's nodes.
    origin : position [m] of node (0, 0, 0), shape [3].
    box : lower and upper corner [m] of the surface, shape [6].
    coefficients : quadratic B-spline coefficients [m] of the distance, float32, shape [nx, ny, nz].
    far_bound : 0 where the distance can be interpolated around a node; else +-(1 + k), saying that
        the distance is at least k spacings within half a spacing of the node, int8, same shape.
    """

    spacing: float
    origin: np.ndarray
    box: np.ndarray
    coefficients: np.ndarray
    far_bound: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        return self.coefficients.shape


def read_surface(file: Path, length_unit: str) -> Surface:
    """Read the surface of a tool from an STL file or any mesh that meshio reads.

    Vertices at the same place are welded, degenerate and repeated triangles dropped, and triangles
    that are turned against their neighbours turned back, with a warning.

    Parameters
    ----------
    file : path of the mesh.
    length_unit : unit of its coordinates, for example "mm".

    Raises
    ------
    InputError
        if the file is absent, broken, empty, without surface cells, or cannot be oriented.
    """
    try:
        scale = length_factor(length_unit)
    except QuantityError as error:
        raise InputError(f"length_unit of the tool's mesh: {error}", file=file) from None
    points, triangles = _read_triangles(Path(file))
    points = points * scale
    points, triangles = _weld(points, triangles, file)
    triangles = _oriented(points, triangles, file)
    edges, _, edge_use = _edges(triangles)
    surface = Surface(points, triangles, edges, edge_use, Path(file))
    if surface.open_edge_count == 0:
        a, b, c = (points[triangles[:, i]] for i in range(3))
        if np.einsum("ij,ij->i", a, np.cross(b, c)).sum() < 0.0:
            _warn(
                file,
                "the normals of the closed surface point inwards, so that everything outside it "
                "is solid; turn the normals if the tool is the inside",
            )
    if (edge_use > 2).any():
        worst = _edge_middle(surface, int(np.argmax(edge_use > 2)))
        _warn(
            file,
            f"{np.count_nonzero(edge_use > 2)} edges belong to more than two triangles, the first "
            f"at {_text(worst)}; inside and outside may be confused near them",
        )
    return surface


def build_distance_field(surface: Surface, spacing: float | None, *, key: str) -> DistanceField:
    """Compute the distance field of a surface.

    Parameters
    ----------
    surface : oriented triangles.
    spacing : grid spacing [m]; None chooses one for about three million nodes. Features smaller
        than about two spacings are rounded.
    key : scene key of the tool's shape, named in errors.

    Raises
    ------
    InputError
        if the grid would be too large, or neighbouring parts of the surface have opposite normals.
    """
    from scipy import ndimage

    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    h = _spacing(high - low, spacing, key)
    margin = (BAND + 2.0) * h
    origin = low - margin
    shape = tuple(int(n) for n in np.ceil((high - low + 2.0 * margin) / h) + 1)

    unsigned = np.full(shape, np.inf)
    side = np.zeros(shape, np.int8)
    normals, is_open = _feature_normals(surface)
    _narrow_band(
        surface.points[surface.triangles],
        normals,
        is_open,
        origin,
        h,
        BAND * h,
        OVERHANG * h,
        unsigned,
        side,
        np.zeros(shape, np.float32),
    )
    in_band = np.isfinite(unsigned)
    unsigned[~in_band] = 0.0
    beyond_edge = in_band & (side == 0)
    valid = in_band & ~beyond_edge
    distance = side * unsigned
    _check_jumps(distance, valid, origin, h, surface.file)

    inside = _enclosed(in_band, valid & (side < 0))
    free = beyond_edge | ~(in_band | inside)
    interpolated = ndimage.binary_erosion(valid, np.ones((3, 3, 3)))
    # The back of a skin ends at the band: what lies behind it is free, and so is the fringe there.
    fringe = valid & ~interpolated & (side < 0)
    fringe &= ndimage.binary_dilation(free, np.ones((3, 3, 3)))

    # Any path from a node outside the band to the surface passes a node of the band.
    way = ndimage.distance_transform_edt(~in_band) + BAND - math.sqrt(3.0)
    bound = np.where(in_band, unsigned / h, way)
    bound[beyond_edge | fringe] = 0.0
    steps = 1.0 + np.floor(np.maximum(bound - 0.5 * math.sqrt(3.0), 0.0))
    negative = (inside | (valid & (side < 0))) & ~fringe
    far_bound = np.where(negative, -1.0, 1.0) * np.minimum(steps, 127.0)
    far_bound[interpolated] = 0.0

    field = DistanceField(
        spacing=h,
        origin=origin,
        box=np.concatenate((low, high)),
        coefficients=_spline_coefficients(distance, valid).astype(np.float32),
        far_bound=far_bound.astype(np.int8),
    )
    _check_resolution(field, surface)
    return field


def _read_triangles(file: Path) -> tuple[np.ndarray, np.ndarray]:
    if not file.is_file():
        raise InputError("there is no such file; the path is relative to the scene file", file=file)
    if file.stat().st_size == 0:
        raise InputError("the file is empty; export the tool's surface again", file=file)
    import meshio

    said = io.StringIO()  # meshio prints its complaints, and may leave by SystemExit
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                mesh = meshio.read(file)
    except (Exception, SystemExit) as error:
        reason = said.getvalue().strip() or str(error) or type(error).__name__
        raise InputError(
            f"cannot be read as a surface mesh ({' '.join(reason.split())}); "
            "check that the file is complete and its ending names its format",
            file=file,
        ) from None
    triangles = []
    found = []
    for block in mesh.cells:
        cells = np.asarray(block.data)
        found.append(block.type)
        shape = block.type.rstrip("0123456789")
        if shape == "polygon":
            shape_rows = [(0, i, i + 1) for i in range(1, cells.shape[1] - 1)]
        else:
            shape_rows = _TRIANGULATION.get(shape, [])
        triangles.extend(cells[:, row] for row in shape_rows)
    if not triangles or sum(len(block) for block in triangles) == 0:
        kinds = ", ".join(sorted(set(found))) or "no cells at all"
        raise InputError(
            f"holds no triangles or quadrilaterals ({kinds}); export the tool's surface",
            file=file,
        )
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] != 3:
        raise InputError("is a plane mesh; a tool needs points with x, y and z", file=file)
    triangles = np.concatenate(triangles).astype(np.int64)
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise InputError("has triangles with vertices that do not exist; it is broken", file=file)
    if not np.isfinite(points[np.unique(triangles)]).all():
        raise InputError("has vertices that are not finite numbers; it is broken", file=file)
    return points, triangles


def _weld(points, triangles, file) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices at the same place; drop triangles without area and repeated ones."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    used, triangles = np.unique(triangles, return_inverse=True)
    points = points[used]
    points, index = np.unique(points, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles.reshape(-1, 3)]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if size == 0.0:
        raise InputError("all vertices lie at one point; export the surface again", file=file)
    tolerance = WELD * size
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        points, triangles = points[first], label[triangles].astype(np.int64)

    a, b, c = (points[triangles[:, i]] for i in range(3))
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    has_area = doubled_area > tolerance * longest
    if not has_area.any():
        raise InputError("no triangle has an area; export the tool's surface again", file=file)
    turned = np.argmin(triangles, axis=1)[:, None]
    canonical = np.take_along_axis(triangles, (turned + np.arange(3)) % 3, axis=1)
    first = np.zeros(len(triangles), dtype=bool)
    first[np.unique(canonical, axis=0, return_index=True)[1]] = True
    kept = has_area & first
    if not kept.all():
        _warn(
            file,
            f"{np.count_nonzero(~has_area)} triangles without area and "
            f"{np.count_nonzero(has_area & ~first)} repeated triangles were left out",
        )
    return points, np.ascontiguousarray(triangles[kept])


def _edges(triangles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edge index and direction (True: from the lower vertex) per triangle, and uses per edge."""
    directed = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    forward = directed[:, 0] < directed[:, 1]
    _, edges, use = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return edges.reshape(-1, 3), forward.reshape(-1, 3), use


def _oriented(points, triangles, file) -> np.ndarray:
    """Turn triangles so that all that share an edge agree, keeping the side of the larger area."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, forward, use = _edges(triangles)
    order = np.argsort(edges.ravel(), kind="stable")
    order = order[use[edges.ravel()[order]] == 2].reshape(-1, 2)
    first, second = order[:, 0] // 3, order[:, 1] // 3
    clash = forward.ravel()[order[:, 0]] == forward.ravel()[order[:, 1]]
    if not clash.any():
        return triangles

    # Each triangle stands for two nodes, as given (t) and turned (t + count): neighbours that agree
    # join equal nodes, those that clash unequal ones.
    count = len(triangles)
    other = second + np.where(clash, count, 0)
    rows = np.concatenate((first, first + count))
    columns = np.concatenate((other, (other + count) % (2 * count)))
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    _, label = connected_components(graph, directed=False)
    as_given, turned = label[:count], label[count:]
    if (as_given == turned).any():
        worst = points[triangles[int(np.argmax(as_given == turned))]].mean(axis=0)
        raise InputError(
            f"the surface has only one side (like a Moebius strip) near {_text(worst)}, so that "
            "inside and outside cannot be told; repair the mesh",
            file=file,
        )
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area_as_given = np.bincount(as_given, weights=area, minlength=label.max() + 1)
    flip = area_as_given[as_given] < area_as_given[turned]
    # Where both sides weigh the same, the first triangle decides.
    tie = area_as_given[as_given] == area_as_given[turned]
    flip |= tie & (as_given > turned)
    _warn(
        file,
        f"{np.count_nonzero(flip)} of {count} triangles were turned against their neighbours and "
        "have been turned back; check that the normals of the rest point away from the solid",
    )
    result = triangles.copy()
    result[flip] = result[flip][:, ::-1]
    return result


def _feature_normals(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Pseudonormals of the face, edges (0-1, 1-2, 2-0) and vertices of each triangle.

    Returns unit vectors, shape [triangle_count, 7, 3], and whether the feature lies on an open
    edge, shape [triangle_count, 7].
    """
    triangles, edges = surface.triangles, surface.edges
    face = surface.normals
    corners = surface.points[triangles]
    ahead = np.roll(corners, -1, axis=1) - corners
    ahead /= np.linalg.norm(ahead, axis=2, keepdims=True)
    back = -np.roll(ahead, 1, axis=1)
    angle = np.arccos(np.clip(np.einsum("tij,tij->ti", ahead, back), -1.0, 1.0))

    edge_sum = np.zeros((len(surface.edge_use), 3))
    vertex_sum = np.zeros_like(surface.points)
    for i in range(3):
        np.add.at(edge_sum, edges[:, i], face)
        np.add.at(vertex_sum, triangles[:, i], angle[:, i, None] * face)
    normals = np.concatenate((face[:, None], edge_sum[edges], vertex_sum[triangles]), axis=1)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)

    open_edge = (surface.edge_use == 1)[edges]
    open_vertex = np.zeros(len(surface.points), dtype=bool)
    open_vertex[triangles[open_edge]] = True
    open_vertex[np.roll(triangles, -1, axis=1)[open_edge]] = True
    is_open = np.concatenate(
        (np.zeros((len(triangles), 1), bool), open_edge, open_vertex[triangles]), axis=1
    )
    return normals, is_open


@strict_equation
def _closest_on_triangle(p, a, b, c):
    """Closest point of a triangle and its feature: 0 face, 1-3 edges ab, bc, ca, 4-6 vertices.

    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return a[0], a[1], a[2], 4
    bpx, bpy, bpz = p[0] - b[0], p[1] - b[1], p[2] - b[2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return b[0], b[1], b[2], 5
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
        return a[0] + s * abx, a[1] + s * aby, a[2] + s * abz, 1
    cpx, cpy, cpz = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return c[0], c[1], c[2], 6
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = d2 / (d2 - d6)
        return a[0] + s * acx, a[1] + s * acy, a[2] + s * acz, 3
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return b[0] + s * (c[0] - b[0]), b[1] + s * (c[1] - b[1]), b[2] + s * (c[2] - b[2]), 2
    s = vb / (va + vb + vc)
    t = vc / (va + vb + vc)
    return a[0] + s * abx + t * acx, a[1] + s * aby + t * acy, a[2] + s * abz + t * acz, 0


@strict_equation
def _narrow_band(corners, normals, is_open, origin, h, band, overhang, distance, side, alignment):
    """Fill distance and side (+1, -1; 0 behind an open edge) of the nodes near the surface.

    The pseudonormal of an open edge knows one of its sides only. Where two such edges are as close,
    as at a crack, the one tells the side whose normal is best aligned with the way to it.
    `alignment` is scratch: this cosine; -1 where an edge or vertex with all its triangles, of which
    the closest always tells the side, is the closest.
    """
    tie = CRACK * h
    for t in range(corners.shape[0]):
        a = (corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2])
        b = (corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2])
        c = (corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2])
        low_x = int(math.ceil((min(a[0], b[0], c[0]) - band - origin[0]) / h))
        low_y = int(math.ceil((min(a[1], b[1], c[1]) - band - origin[1]) / h))
        low_z = int(math.ceil((min(a[2], b[2], c[2]) - band - origin[2]) / h))
        high_x = int(math.floor((max(a[0], b[0], c[0]) + band - origin[0]) / h))
        high_y = int(math.floor((max(a[1], b[1], c[1]) + band - origin[1]) / h))
        high_z = int(math.floor((max(a[2], b[2], c[2]) + band - origin[2]) / h))
        for i in range(low_x, high_x + 1):
            x = origin[0] + i * h
            for j in range(low_y, high_y + 1):
                y = origin[1] + j * h
                for k in range(low_z, high_z + 1):
                    z = origin[2] + k * h
                    height = (
                        (x - a[0]) * normals[t, 0, 0]
                        + (y - a[1]) * normals[t, 0, 1]
                        + (z - a[2]) * normals[t, 0, 2]
                    )
                    closest = distance[i, j, k]
                    if abs(height) > min(closest + tie, band):
                        continue
                    qx, qy, qz, feature = _closest_on_triangle((x, y, z), a, b, c)
                    dx, dy, dz = x - qx, y - qy, z - qz
                    d = math.sqrt(dx * dx + dy * dy + dz * dz)
                    if d > min(closest + tie, band):
                        continue
                    along = (
                        dx * normals[t, feature, 0]
                        + dy * normals[t, feature, 1]
                        + dz * normals[t, feature, 2]
                    )
                    cosine = -1.0
                    if feature == 0 or d == 0.0:
                        cosine = 1.0
                    elif is_open[t, feature]:
                        cosine = abs(along) / d
                    comparable = cosine >= 0.0 and alignment[i, j, k] >= 0.0
                    if comparable and d > closest - tie:
                        preferred = cosine > alignment[i, j, k]
                    else:
                        preferred = d < closest
                    distance[i, j, k] = min(d, closest)
                    if not preferred:
                        continue
                    alignment[i, j, k] = cosine
                    if along >= 0.0:
                        side[i, j, k] = 1
                    elif is_open[t, feature] and d * d - along * along > overhang * overhang:
                        side[i, j, k] = 0
                    else:
                        side[i, j, k] = -1


def _enclosed(in_band, is_solid) -> np.ndarray:
    """Nodes outside the band that only solid separates from the rest: the inside of a solid."""
    from scipy import ndimage

    label, count = ndimage.label(~in_band)
    free = np.zeros(count + 1, dtype=bool)
    for axis in range(3):
        first, last = label.take(0, axis), label.take(-1, axis)
        free[first], free[last] = True, True
        near, ahead = _shifted(label, axis)
        solid_near, solid_ahead = _shifted(is_solid, axis)
        band_near, band_ahead = _shifted(in_band, axis)
        free[near[band_ahead & ~solid_ahead]] = True
        free[ahead[band_near & ~solid_near]] = True
    free[0] = True  # label 0 is the band itself
    return ~free[label]


def _shifted(array, axis) -> tuple[np.ndarray, np.ndarray]:
    """Views of all nodes that have a next node along an axis, and of these next nodes."""
    ends = [slice(None)] * 3
    starts = [slice(None)] * 3
    ends[axis], starts[axis] = slice(None, -1), slice(1, None)
    return array[tuple(ends)], array[tuple(starts)]


def _check_jumps(distance, valid, origin, h, file) -> None:
    """Reject a surface whose sides are confused: a signed distance changes by at most its step."""
    for axis in range(3):
        near, ahead = _shifted(distance, axis)
        both = np.logical_and(*_shifted(valid, axis))
        jump = both & (np.abs(ahead - near) > LARGEST_JUMP * h)
        if jump.any():
            node = np.array(np.unravel_index(int(np.argmax(jump)), jump.shape))
            raise InputError(
                f"inside and outside are confused near {_text(origin + node * h)} (and at "
                f"{np.count_nonzero(jump)} places): neighbouring parts have opposite normals, or "
                "bodies overlap or touch, or a sheet is modelled by both its faces with the same "
                "normals; turn the normals or keep only the surface that touches the blank",
                file=file,
            )


def _spline_coefficients(distance, valid) -> np.ndarray:
    """Quadratic B-spline coefficients f - f''/8, which reproduce quadratic functions exactly."""
    coefficients = distance.copy()
    for axis in range(3):
        inner = [slice(None)] * 3
        inner[axis] = slice(1, -1)
        inner = tuple(inner)
        before = _shifted(_shifted(distance, axis)[0], axis)[0]
        after = _shifted(_shifted(distance, axis)[1], axis)[1]
        complete = valid[inner].copy()
        complete &= _shifted(_shifted(valid, axis)[0], axis)[0]
        complete &= _shifted(_shifted(valid, axis)[1], axis)[1]
        curvature = before - 2.0 * distance[inner] + after
        coefficients[inner] -= np.where(complete, 0.125 * curvature, 0.0)
    return coefficients


def _check_resolution(field: DistanceField, surface: Surface) -> None:
    """Warn where the interpolated field does not vanish on the surface."""
    from scipy import ndimage

    step = max(1, len(surface.triangles) // 20_000)
    middles = surface.points[surface.triangles[::step]].mean(axis=1)
    place = ((middles - field.origin) / field.spacing).T
    near = field.far_bound[tuple(np.floor(place + 0.5).astype(int))] == 0
    if not near.any():
        return
    place = place[:, near]
    missed = np.abs(
        ndimage.map_coordinates(field.coefficients, place, np.float64, order=2, prefilter=False)
    )
    typical = float(np.quantile(missed, 0.95))
    if typical > RESOLVED * field.spacing:
        worst = field.origin + field.spacing * place[:, int(np.argmax(missed))]
        _warn(
            surface.file,
            f"the distance field (spacing {field.spacing * 1e3:.3g} mm) misses the surface by more "
            f"than {typical * 1e3:.2g} mm on 5 % of its triangles, at most by "
            f"{missed.max() * 1e3:.2g} mm at {_text(worst)}; give the tool a smaller spacing",
        )


def _spacing(extent, spacing: float | None, key: str) -> float:
    def node_count(h):
        return float(np.prod(np.ceil(extent / h) + 2.0 * BAND + 5.0))

    if spacing is None:
        low, high = 1e-6 * extent.max(), extent.max()
        for _ in range(60):  # bisection of the logarithm
            middle = math.sqrt(low * high)
            low, high = (middle, high) if node_count(middle) > AUTOMATIC_NODES else (low, middle)
        return high
    if not 0.0 < spacing < math.inf:
        raise InputError(f"must be positive, is {spacing:g} m", key=f"{key}.spacing")
    if node_count(spacing) > MAXIMUM_NODES:
        smallest = spacing * (node_count(spacing) / MAXIMUM_NODES) ** (1.0 / 3.0)
        raise InputError(
            f"a distance field with spacing {spacing * 1e3:.3g} mm needs "
            f"{node_count(spacing) / 1e6:.0f} million nodes (at most {MAXIMUM_NODES // 1_000_000});"
            f" use about {smallest * 1.2e3:.2g} mm or check length_unit (the tool is "
            f"{extent.max() * 1e3:.3g} mm long)",
            key=f"{key}.spacing",
        )
    return float(spacing)


def _edge_middle(surface: Surface, edge: int) -> np.ndarray:
    t, i = np.argwhere(surface.edges == edge)[0]
    return surface.points[surface.triangles[t, [i, (i + 1) % 3]]].mean(axis=0)


def _warn(file, message: str) -> None:
    warnings.warn(ToolWarning(f"{file}: {message}"), stacklevel=3)


def _text(point) -> str:
    return "({:.4g}, {:.4g}, {:.4g}) m".format(*point)
