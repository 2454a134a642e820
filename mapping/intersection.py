"""Overlaps of target cells with faces of the sheet, and the layers of sheet over each cell.

A cell is seen along the normal of each triangle of a face and clipped by it. On the plane of the
triangle neighbouring cells still share their edges: they tile it, and the content of the face goes
to them wholly, whatever the shape of the target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine
from lcmchain.mapping.clipping import WORK, clip
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import CellPolygons
from lcmchain.mesh.box_tree import STACK, BoxTree, enclose, items_in_box, order_along_curve

# Faces steeper than this against the cell (75.5 degrees) say nothing about it: their projection
# is a thin strip whose place depends on where the tangent plane was put.
MINIMUM_COSINE = 0.25

# Parts below this fraction of the face are rounding at shared edges.
SLIVER = 1e-14

# The box of a cell is widened by this share of it, and of the distance: cells that lie over a face
# along the normal of the face may lie beside it along their own.
WIDER = 0.05
SLANT = 0.2

# So many cells that are close to each other ask the tree of the faces together.
TOGETHER = 8

# Columns of the table of pairs while it is filled.
_PART, _U, _V, _AREA, _HEIGHT, _CENTRE = range(6)


class Overlaps(NamedTuple):
    """Pairs of a target cell and a source face that lie over each other, by cell, then face.

    A layer is a connected part of the sheet over the cell that shows one side to it.
    """

    cell: np.ndarray  # (K,) int64
    face: np.ndarray  # (K,) int64
    layer: np.ndarray  # (K,) number of the layer, counted through all cells
    side: np.ndarray  # (K,) int8: 1 where cell and face (as its piece is wound) face one way
    part: np.ndarray  # (K,) share of the face that lies over the cell
    place: np.ndarray  # (K, 2) [m] its centroid in the face's frame, from the face's centroid
    area: np.ndarray  # (K,) [m2] of this share, projected onto the cell's tangent plane
    height: np.ndarray  # (K,) [m] of this share over the tangent plane, signed
    centre: np.ndarray  # (K,) [m] distance of the cell's centroid from the face over it, else nan


class _Faces(NamedTuple):
    """What the search and the clipping need of the sheet.

    planes : of the triangles, shape (T, 16): first corner, unit normal, two unit tangents the first
        of which runs along the first edge, length of this edge, third corner in the tangents, area.
    """

    tree: BoxTree
    first_triangle: np.ndarray
    planes: np.ndarray
    centroids: np.ndarray
    radii: np.ndarray
    frames: np.ndarray
    neighbours: np.ndarray
    side: np.ndarray


def overlaps(surface: Surface, cells: CellPolygons, maximum_distance: float) -> Overlaps:
    """Overlap every cell with the faces within ``maximum_distance`` [m] along its normal."""
    faces = _Faces(
        surface.face_tree,
        surface.first_triangle,
        _planes(surface.triangle_corners),
        surface.centroids,
        surface.face_radii,
        surface.frames,
        surface.winding.neighbours,
        surface.winding.side,
    )
    real = np.flatnonzero(np.diff(cells.start) >= 3)
    sequence = real[order_along_curve(cells.centroids[real])]
    pairs, values = _all_pairs(
        sequence, cells.start, cells.corners, cells.centroids, cells.normals, cells.radii, faces,
        maximum_distance,
    )  # fmt: skip
    return Overlaps(*_by_cell(pairs, values, len(cells.centroids)))


@routine
def _planes(corners):
    planes = np.zeros((len(corners), 16))
    for t in range(len(corners)):
        a = corners[t, 0]
        ux, uy, uz = corners[t, 1, 0] - a[0], corners[t, 1, 1] - a[1], corners[t, 1, 2] - a[2]
        dx, dy, dz = corners[t, 2, 0] - a[0], corners[t, 2, 1] - a[1], corners[t, 2, 2] - a[2]
        mx, my, mz = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
        doubled = np.sqrt(mx * mx + my * my + mz * mz)
        if doubled == 0.0:
            continue
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / length, uy / length, uz / length
        mx, my, mz = mx / doubled, my / doubled, mz / doubled
        vx, vy, vz = my * uz - mz * uy, mz * ux - mx * uz, mx * uy - my * ux
        row = planes[t]
        row[0], row[1], row[2] = a[0], a[1], a[2]
        row[3], row[4], row[5] = mx, my, mz
        row[6], row[7], row[8] = ux, uy, uz
        row[9], row[10], row[11] = vx, vy, vz
        row[12], row[13] = length, dx * ux + dy * uy + dz * uz
        row[14], row[15] = doubled / length, 0.5 * doubled
    return planes


@routine
def _all_pairs(
    sequence, start, corners, centroids, normals, radii, faces, maximum_distance
):  # fmt: skip
    """Rows of cell, face, side, number of the layer over the cell; and of the measures of pairs."""
    pairs = np.empty((max(64, 6 * len(sequence)), 4), dtype=np.int64)
    values = np.empty((len(pairs), 6))
    found = np.empty(256, dtype=np.int64)
    stack = np.empty(STACK, dtype=np.int64)
    box, together = np.empty(6), np.empty(6)
    seen, work_1, work_2 = np.empty(WORK), np.empty(WORK), np.empty(WORK)
    slot = np.full(len(faces.centroids), -1, dtype=np.int64)
    parent = np.empty(256, dtype=np.int64)
    count, candidates = 0, 0
    for place in range(len(sequence)):
        if place % TOGETHER == 0:
            together[:3], together[3:] = np.inf, -np.inf
            for c in sequence[place : place + TOGETHER]:
                prism_box(corners[start[c] : start[c + 1]], normals[c], maximum_distance, box)
                enclose(together, box)
            candidates = items_in_box(faces.tree, together, stack, found)
            if candidates < 0:
                found = np.empty(-2 * candidates, dtype=np.int64)
                candidates = items_in_box(faces.tree, together, stack, found)
            if count + TOGETHER * candidates > len(pairs):
                pairs = _grown(pairs, count + TOGETHER * candidates)
                values = _grown(values, count + TOGETHER * candidates)
        c = sequence[place]
        cell = corners[start[c] : start[c + 1]]
        first = count
        for j in range(candidates):
            reach = radii[c] + faces.radii[found[j]] + SLANT * maximum_distance
            if far_from_axis(centroids[c], normals[c], faces.centroids[found[j]], reach):
                continue
            side = _pair(
                found[j], cell, centroids[c], normals[c], faces, maximum_distance,
                seen, work_1, work_2, values[count],
            )  # fmt: skip
            if side == 0:
                continue
            pairs[count, 0], pairs[count, 1], pairs[count, 2] = c, found[j], side
            count += 1
        if count > first:
            if count - first > len(parent):
                parent = np.empty(2 * (count - first), dtype=np.int64)
            _number_layers(pairs, values, first, count, faces, slot, parent)
    return pairs[:count], values[:count]


@equation
def far_from_axis(origin, normal, point, reach):
    """Whether a point is farther than a reach from the line along a unit normal."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    along = x * normal[0] + y * normal[1] + z * normal[2]
    return x * x + y * y + z * z - along * along > reach * reach


@routine
def _by_cell(pairs, values, cell_count):
    """Columns of :class:`Overlaps`, sorted by cell; layers are counted through all cells."""
    first, layers = np.zeros(cell_count + 1, np.int64), np.zeros(cell_count + 1, np.int64)
    for k in range(len(pairs)):
        c = pairs[k, 0] + 1
        first[c] += 1
        layers[c] = max(layers[c], pairs[k, 3] + 1)
    for c in range(cell_count):
        first[c + 1] += first[c]
        layers[c + 1] += layers[c]
    count = len(pairs)
    cell, face, layer = (
        np.empty(count, np.int64),
        np.empty(count, np.int64),
        np.empty(count, np.int64),
    )
    side = np.empty(count, np.int8)
    part, area, height, centre = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    place = np.empty((count, 2))
    for k in range(count):
        c = pairs[k, 0]
        to = first[c]
        first[c] += 1
        cell[to], face[to], side[to] = c, pairs[k, 1], pairs[k, 2]
        layer[to] = layers[c] + pairs[k, 3]
        part[to], area[to] = values[k, _PART], values[k, _AREA]
        place[to, 0], place[to, 1] = values[k, _U], values[k, _V]
        height[to], centre[to] = values[k, _HEIGHT], values[k, _CENTRE]
    return cell, face, layer, side, part, place, area, height, centre


@routine
def _grown(table, needed):
    wider = np.empty((needed + needed // 2, table.shape[1]), dtype=table.dtype)
    wider[: len(table)] = table
    return wider


@equation
def _pair(
    face, cell, origin, normal, faces, maximum_distance, seen, work_1, work_2, row
):  # fmt: skip
    """Measure a cell over a face into ``row``; return the side that it shows, 0 if it is not over.

    row : as the columns of the table of pairs.
    """
    part, whole, area, moment, facing, centre = 0.0, 0.0, 0.0, 0.0, 0.0, np.nan
    px, py, pz = 0.0, 0.0, 0.0
    for t in range(faces.first_triangle[face], faces.first_triangle[face + 1]):
        plane = faces.planes[t]
        size = plane[15]
        whole += size
        cosine = plane[3] * normal[0] + plane[4] * normal[1] + plane[5] * normal[2]
        if size == 0.0 or abs(cosine) < MINIMUM_COSINE:
            continue
        look_along_normal(cell, plane, cosine < 0.0, seen)
        share, x, y = clip(seen, len(cell), plane[12], plane[13], plane[14], work_1, work_2)
        if share <= SLIVER * size:
            continue
        qx = plane[0] + x * plane[6] + y * plane[9]
        qy = plane[1] + x * plane[7] + y * plane[10]
        qz = plane[2] + x * plane[8] + y * plane[11]
        height = (
            (qx - origin[0]) * normal[0] + (qy - origin[1]) * normal[1]
            + (qz - origin[2]) * normal[2]
        )  # fmt: skip
        if abs(height) > maximum_distance:
            continue
        part += share
        area += share / abs(cosine)
        facing += share * cosine
        moment += share * height
        px, py, pz = px + share * qx, py + share * qy, pz + share * qz
        distance = distance_if_over(plane, origin)
        if distance >= 0.0 and not distance > centre:
            centre = distance
    if part == 0.0:
        return 0
    middle, tangents = faces.centroids[face], faces.frames[face]
    px, py, pz = px / part - middle[0], py / part - middle[1], pz / part - middle[2]
    row[_PART], row[_AREA] = part / whole, area
    row[_U] = px * tangents[0, 0] + py * tangents[0, 1] + pz * tangents[0, 2]
    row[_V] = px * tangents[1, 0] + py * tangents[1, 1] + pz * tangents[1, 2]
    row[_HEIGHT], row[_CENTRE] = moment / part, centre
    return faces.side[face] if facing > 0.0 else -faces.side[face]


def coverage_of_planes(
    surface: Surface, cells: CellPolygons, found: Overlaps, chosen: np.ndarray
) -> np.ndarray:
    """Share of some cells that the faces over them tile, laid along the cells' normals.

    chosen : ascending numbers of cells, shape (P,).
    """
    first = np.searchsorted(found.cell, chosen)
    end = np.searchsorted(found.cell, chosen, side="right")
    shares = np.empty(len(chosen))
    _lay_on_cells(
        chosen, first, end, found.face, cells.start, cells.corners, cells.normals, cells.areas,
        surface.first_triangle, surface.triangle_corners, shares,
    )  # fmt: skip
    return shares


@routine
def _lay_on_cells(
    chosen, first, end, face_of, start, corners, normals, areas, first_triangle, triangles, shares
):  # fmt: skip
    seen, work_1, work_2 = np.empty(WORK), np.empty(WORK), np.empty(WORK)
    for p in range(len(chosen)):
        c = chosen[p]
        cell, normal = corners[start[c] : start[c + 1]], normals[c]
        covered = 0.0
        for k in range(first[p], end[p]):
            for t in range(first_triangle[face_of[k]], first_triangle[face_of[k] + 1]):
                covered += area_under(triangles[t], cell, normal, seen, work_1, work_2)
        shares[p] = covered / areas[c]


@routine
def area_under(triangle, cell, normal, seen, work_1, work_2):
    """Area of a cell under a triangle that is laid along the cell's normal onto its plane."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ux, uy, uz = (
        triangle[1, 0] - triangle[0, 0],
        triangle[1, 1] - triangle[0, 1],
        triangle[1, 2] - triangle[0, 2],
    )
    along = ux * nx + uy * ny + uz * nz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    if length == 0.0:
        return 0.0
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    dx, dy, dz = (
        triangle[2, 0] - triangle[0, 0],
        triangle[2, 1] - triangle[0, 1],
        triangle[2, 2] - triangle[0, 2],
    )
    tip_x, tip_y = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
    turned = tip_y < 0.0  # it shows its back: seen in a mirror, both are counter-clockwise again
    if tip_y == 0.0:
        return 0.0
    for k in range(len(cell)):
        x, y, z = (
            cell[k, 0] - triangle[0, 0],
            cell[k, 1] - triangle[0, 1],
            cell[k, 2] - triangle[0, 2],
        )
        to = len(cell) - 1 - k if turned else k
        across = x * vx + y * vy + z * vz
        seen[to, 0] = x * ux + y * uy + z * uz
        seen[to, 1] = -across if turned else across
    return clip(seen, len(cell), length, tip_x, abs(tip_y), work_1, work_2)[0]


@equation
def look_along_normal(cell, plane, turned, seen):
    """Write the corners of a cell on the plane of a triangle, counter-clockwise."""
    count = len(cell)
    for k in range(count):
        to = count - 1 - k if turned else k
        x, y, z = cell[k, 0] - plane[0], cell[k, 1] - plane[1], cell[k, 2] - plane[2]
        seen[to, 0] = x * plane[6] + y * plane[7] + z * plane[8]
        seen[to, 1] = x * plane[9] + y * plane[10] + z * plane[11]


@equation
def distance_if_over(plane, point):
    """Distance of a point from a triangle if its foot lies in it, else -1."""
    x, y, z = point[0] - plane[0], point[1] - plane[1], point[2] - plane[2]
    u = x * plane[6] + y * plane[7] + z * plane[8]
    v = x * plane[9] + y * plane[10] + z * plane[11]
    length, tip_u, tip_v = plane[12], plane[13], plane[14]
    over = (
        v >= 0.0
        and tip_u * v - tip_v * u <= 0.0
        and (tip_u - length) * v - tip_v * (u - length) >= 0.0
    )
    return abs(x * plane[3] + y * plane[4] + z * plane[5]) if over else -1.0


@equation
def _number_layers(pairs, values, first, end, faces, slot, parent):
    """Number the layers of the pairs of one cell, sort them by face, return how many there are.

    Faces that share an edge and show the same side belong to one layer.
    """
    count = end - first
    for k in range(count):
        slot[pairs[first + k, 1]] = k
        parent[k] = k
    for k in range(count):
        for edge in range(4):
            other = faces.neighbours[pairs[first + k, 1], edge]
            if other < 0 or slot[other] < 0:
                continue
            if pairs[first + slot[other], 2] == pairs[first + k, 2]:
                a, b = root(parent, k), root(parent, slot[other])
                parent[max(a, b)] = min(a, b)
    found = 0
    for k in range(count):
        slot[pairs[first + k, 1]] = -1
    for k in range(count):
        if parent[k] == k:
            pairs[first + k, 3] = found
            found += 1
        else:
            pairs[first + k, 3] = pairs[first + root(parent, k), 3]
    # Pairs by face within a layer: an order that does not depend on the search.
    for k in range(first + 1, end):
        j = k
        while j > first and (pairs[j - 1, 1] > pairs[j, 1]):
            for column in range(4):
                pairs[j - 1, column], pairs[j, column] = pairs[j, column], pairs[j - 1, column]
            for column in range(6):
                values[j - 1, column], values[j, column] = values[j, column], values[j - 1, column]
            j -= 1


@equation
def root(parent, k):
    while parent[k] != k:
        k = parent[k]
    return k


@equation
def prism_box(cell, normal, distance, box):
    """Write the box around everything within a distance of a cell along its normal."""
    for axis in range(3):
        low, high = cell[0, axis], cell[0, axis]
        for k in range(1, len(cell)):
            low, high = min(low, cell[k, axis]), max(high, cell[k, axis])
        reach = (abs(normal[axis]) + SLANT) * distance + WIDER * (high - low)
        box[axis], box[3 + axis] = low - reach, high + reach
