"""Overlaps of target cells with faces of the sheet, and the layers of sheet over each cell.

A cell is seen along the normal of each triangle of a face and clipped by it. On the plane of the
triangle neighbouring cells still share their edges: they tile it, and the content of the face goes
to them wholly, whatever the shape of the target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import CellPolygons
from lcmchain.mesh.search import STACK, BoxTree, items_in_box, order_along_curve

# Faces steeper than this against the cell (75.5 degrees) say nothing about it: their projection
# is a thin strip whose place depends on where the tangent plane was put.
MINIMUM_COSINE = 0.25

# Parts below this fraction of the face are rounding at shared edges.
SLIVER = 1e-14

# The box of a cell is widened by this share of it, and of the distance: cells that lie over a face
# along the normal of the face may lie beside it along their own.
WIDER = 0.05
SLANT = 0.2

# Number of cells close to each other that search the tree of the faces together.
TOGETHER = 8

# Number of cells close to each other that go through the steps together: a multiple of TOGETHER.
BLOCK = 4096

# Columns of the table of pairs while it is filled.
_PART, _AREA, _HEIGHT, _CENTRE, _PLACE = range(5)

# Two polygons and the corners that each can have: the four of a cell and one per edge of the
# triangle, doubled where the cell has a reflex corner. One array for both: the compiler counts
# references to every array that it hands to a function.
WORK = (2, 24, 2)


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
    given = _Cells(cells.start, cells.corners, cells.centroids, cells.normals, cells.radii)
    pairs, values = _all_pairs(sequence, given, faces, maximum_distance)
    return Overlaps(*_by_cell(pairs, values, len(cells.centroids)))


class _Cells(NamedTuple):
    """Arrays of the target for search and clipping, as in :class:`CellPolygons`."""

    start: np.ndarray
    corners: np.ndarray
    centroids: np.ndarray
    normals: np.ndarray
    radii: np.ndarray


class _Faces(NamedTuple):
    """Arrays of the sheet for search and clipping.

    planes : of the triangles, shape (T, 14): first corner, unit normal, unit tangent along the
        first edge, its length, third corner along and across it, lengths of the other two edges.
    """

    tree: BoxTree
    first_triangle: np.ndarray
    planes: np.ndarray
    centroids: np.ndarray
    radii: np.ndarray
    frames: np.ndarray
    neighbours: np.ndarray
    side: np.ndarray


@routine
def _planes(corners):
    planes = np.zeros((len(corners), 14))
    for t in range(len(corners)):
        ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
        ux, uy, uz = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay, corners[t, 1, 2] - az
        dx, dy, dz = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay, corners[t, 2, 2] - az
        mx, my, mz = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
        doubled = np.sqrt(mx * mx + my * my + mz * mz)
        if doubled == 0.0:
            continue
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        tip_u, tip_v = (dx * ux + dy * uy + dz * uz) / length, doubled / length
        planes[t, 0], planes[t, 1], planes[t, 2] = ax, ay, az
        planes[t, 3], planes[t, 4], planes[t, 5] = mx / doubled, my / doubled, mz / doubled
        planes[t, 6], planes[t, 7], planes[t, 8] = ux / length, uy / length, uz / length
        planes[t, 9], planes[t, 10], planes[t, 11] = length, tip_u, tip_v
        planes[t, 12] = np.hypot(tip_u - length, tip_v)
        planes[t, 13] = np.hypot(tip_u, tip_v)
    return planes


def _all_pairs(
    sequence: np.ndarray, cells: _Cells, faces: _Faces, maximum_distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of cell, face, side, number of the layer over the cell; and of the measures of pairs.

    The steps are loops of their own, and unpack what they read: within one large function the
    compiler counts references to arrays at every pair, which takes longer than the clipping.
    """
    pairs = np.empty((max(64, 5 * len(sequence)), 4), dtype=np.int64)
    values = np.empty((len(pairs), _PLACE + 2))
    near = np.empty((16 * BLOCK, 2), dtype=np.int64)
    slot = np.full(len(faces.centroids), -1, dtype=np.int64)
    count = 0
    for place in range(0, len(sequence), BLOCK):
        block = sequence[place : place + BLOCK]
        found = _near_faces(block, cells, faces, maximum_distance, near)
        if found < 0:
            near = np.empty((-2 * found, 2), dtype=np.int64)
            found = _near_faces(block, cells, faces, maximum_distance, near)
        if count + found > len(pairs):
            pairs, values = _grown(pairs, count + found), _grown(values, count + found)
        end = count + _measure(
            near[:found], cells, faces, maximum_distance, pairs[count:], values[count:]
        )
        _number_layers(pairs[count:end], values[count:end], faces.neighbours, slot)
        count = end
    return pairs[:count], values[:count]


@routine
def _near_faces(block, cells, faces, maximum_distance, near):
    """Write rows of cell and face that may lie over each other; return their number.

    Where ``near`` is too small, the number is returned with a minus sign.
    """
    start, corners, centroids, normals, radii = cells
    middles, face_radii, tree = faces.centroids, faces.radii, faces.tree
    found = np.empty(256, dtype=np.int64)
    stack, together = np.empty(STACK, dtype=np.int64), np.empty(6)
    slant = SLANT * maximum_distance
    count, candidates = 0, 0
    for place in range(len(block)):
        if place % TOGETHER == 0:
            together[:3], together[3:] = np.inf, -np.inf
            for c in block[place : place + TOGETHER]:
                _enclose_prism(
                    corners, start[c], start[c + 1], normals[c, 0], normals[c, 1], normals[c, 2],
                    maximum_distance, together,
                )  # fmt: skip
            candidates = items_in_box(tree, together, stack, found)
            if candidates < 0:
                found = np.empty(-2 * candidates, dtype=np.int64)
                candidates = items_in_box(tree, together, stack, found)
        c = block[place]
        ox, oy, oz = centroids[c, 0], centroids[c, 1], centroids[c, 2]
        nx, ny, nz = normals[c, 0], normals[c, 1], normals[c, 2]
        for j in range(candidates):
            f = found[j]
            # Far from the line through the cell's centroid along its normal?
            x, y, z = middles[f, 0] - ox, middles[f, 1] - oy, middles[f, 2] - oz
            along = x * nx + y * ny + z * nz
            reach = radii[c] + face_radii[f] + slant
            if x * x + y * y + z * z - along * along > reach * reach:
                continue
            if count < len(near):
                near[count, 0], near[count, 1] = c, f
            count += 1
    return count if count <= len(near) else -count


@equation
def _enclose_prism(corners, first, end, nx, ny, nz, distance, box):
    """Widen a box (6,) to what lies within a distance of a cell along its normal."""
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for k in range(first, end):
        low_x, high_x = min(low_x, corners[k, 0]), max(high_x, corners[k, 0])
        low_y, high_y = min(low_y, corners[k, 1]), max(high_y, corners[k, 1])
        low_z, high_z = min(low_z, corners[k, 2]), max(high_z, corners[k, 2])
    x = (abs(nx) + SLANT) * distance + WIDER * (high_x - low_x)
    y = (abs(ny) + SLANT) * distance + WIDER * (high_y - low_y)
    z = (abs(nz) + SLANT) * distance + WIDER * (high_z - low_z)
    box[0], box[3] = min(box[0], low_x - x), max(box[3], high_x + x)
    box[1], box[4] = min(box[1], low_y - y), max(box[4], high_y + y)
    box[2], box[5] = min(box[2], low_z - z), max(box[5], high_z + z)


@routine
def _measure(near, cells, faces, maximum_distance, pairs, values):
    """Measure cells over faces; write a row for each pair that overlaps, and return how many."""
    start, corners, centroids, normals, radii = cells
    first_triangle, planes, middles = faces.first_triangle, faces.planes, faces.centroids
    frames, sides = faces.frames, faces.side
    work = np.empty(WORK)
    row = 0
    for j in range(len(near)):
        c, face = near[j, 0], near[j, 1]
        first, end, radius = start[c], start[c + 1], radii[c]
        ox, oy, oz = centroids[c, 0], centroids[c, 1], centroids[c, 2]
        nx, ny, nz = normals[c, 0], normals[c, 1], normals[c, 2]
        part, whole, area, moment, facing, centre = 0.0, 0.0, 0.0, 0.0, 0.0, np.nan
        px, py, pz = 0.0, 0.0, 0.0
        for t in range(first_triangle[face], first_triangle[face + 1]):
            length, tip_u, tip_v = planes[t, 9], planes[t, 10], planes[t, 11]
            size = 0.5 * length * tip_v
            whole += size
            ax, ay, az = planes[t, 0], planes[t, 1], planes[t, 2]
            mx, my, mz = planes[t, 3], planes[t, 4], planes[t, 5]
            ux, uy, uz = planes[t, 6], planes[t, 7], planes[t, 8]
            vx, vy, vz = my * uz - mz * uy, mz * ux - mx * uz, mx * uy - my * ux
            x, y, z = ox - ax, oy - ay, oz - az
            u, v = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
            left, right = tip_v * u - tip_u * v, (tip_u - length) * v - tip_v * (u - length)
            # Is the circle around the cell on the outside of an edge?
            if v < -radius or right < -radius * planes[t, 12] or left < -radius * planes[t, 13]:
                continue
            cosine = mx * nx + my * ny + mz * nz
            if size == 0.0 or abs(cosine) < MINIMUM_COSINE:
                continue
            for k in range(first, end):
                to = end - 1 - k if cosine < 0.0 else k - first  # counter-clockwise
                qx, qy, qz = corners[k, 0] - ax, corners[k, 1] - ay, corners[k, 2] - az
                work[0, to, 0] = qx * ux + qy * uy + qz * uz
                work[0, to, 1] = qx * vx + qy * vy + qz * vz
            share, su, sv = clip(work, end - first, length, tip_u, tip_v)
            if share <= SLIVER * size:
                continue
            qx, qy, qz = ax + su * ux + sv * vx, ay + su * uy + sv * vy, az + su * uz + sv * vz
            height = (qx - ox) * nx + (qy - oy) * ny + (qz - oz) * nz
            if abs(height) > maximum_distance:
                continue
            part += share
            area += share / abs(cosine)
            facing += share * cosine
            moment += share * height
            px, py, pz = px + share * qx, py + share * qy, pz + share * qz
            distance = abs(x * mx + y * my + z * mz)
            over_centroid = v >= 0.0 and right >= 0.0 and left >= 0.0
            if over_centroid and not distance > centre:
                centre = distance
        if part == 0.0:
            continue
        px, py, pz = px / part, py / part, pz / part
        px, py, pz = px - middles[face, 0], py - middles[face, 1], pz - middles[face, 2]
        pairs[row, 0], pairs[row, 1] = c, face
        pairs[row, 2] = sides[face] if facing > 0.0 else -sides[face]
        for axis in range(2):
            values[row, _PLACE + axis] = (
                px * frames[face, axis, 0] + py * frames[face, axis, 1] + pz * frames[face, axis, 2]
            )
        values[row, _PART], values[row, _AREA] = part / whole, area
        values[row, _HEIGHT], values[row, _CENTRE] = moment / part, centre
        row += 1
    return row


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
        place[to, 0], place[to, 1] = values[k, _PLACE], values[k, _PLACE + 1]
        height[to], centre[to] = values[k, _HEIGHT], values[k, _CENTRE]
    return cell, face, layer, side, part, place, area, height, centre


@routine
def _grown(table, needed):
    wider = np.empty((needed + needed // 2, table.shape[1]), dtype=table.dtype)
    wider[: len(table)] = table
    return wider


# --- a polygon clipped by a triangle in a plane ---------------------------------------------------
# The triangle has its first corner at the origin, the second at (length, 0) and the third at
# (tip_x, tip_y), tip_y > 0.


@equation
def clip(work, count, length, tip_x, tip_y):
    """Clip a polygon, counter-clockwise, by the triangle (Sutherland and Hodgman 1974).

    Returns the area of what remains and its centroid. A reflex corner of the polygon leaves edges
    that run to and fro and enclose nothing. A polygon inside of the triangle is measured as it is,
    and a side of the triangle that has it on its outside ends the matter.

    work : shape :data:`WORK`; the first ``count`` corners of its first polygon are the given ones.
    """
    low_1, low_2, low_3 = np.inf, np.inf, np.inf
    high_1, high_2, high_3 = -np.inf, -np.inf, -np.inf
    for k in range(count):
        x, y = work[0, k, 0], work[0, k, 1]
        right = (tip_x - length) * y - tip_y * (x - length)
        left = tip_y * x - tip_x * y
        low_1, high_1 = min(low_1, y), max(high_1, y)
        low_2, high_2 = min(low_2, right), max(high_2, right)
        low_3, high_3 = min(low_3, left), max(high_3, left)
    of = 0
    if high_1 <= 0.0 or high_2 <= 0.0 or high_3 <= 0.0:
        count = 0
    # A side that cuts nothing off leaves the polygon as it is.
    if low_1 < 0.0:
        count, of = _cut(work, of, count, 0.0, 0.0, 1.0), 1 - of
    if low_2 < 0.0:
        count, of = _cut(work, of, count, length, -tip_y, tip_x - length), 1 - of
    if low_3 < 0.0:
        count, of = _cut(work, of, count, 0.0, tip_y, -tip_x), 1 - of
    return _area_and_centroid(work, of, count)


@equation
def _area_and_centroid(work, of, count):
    if count < 3:
        return 0.0, 0.0, 0.0
    area, mx, my = 0.0, 0.0, 0.0
    ax, ay = work[of, 0, 0], work[of, 0, 1]
    bx, by = work[of, 1, 0] - ax, work[of, 1, 1] - ay
    for k in range(2, count):
        cx, cy = work[of, k, 0] - ax, work[of, k, 1] - ay
        part = bx * cy - by * cx
        area += part
        mx += part * (bx + cx)
        my += part * (by + cy)
        bx, by = cx, cy
    if area <= 0.0:
        return 0.0, 0.0, 0.0
    return 0.5 * area, ax + mx / (3.0 * area), ay + my / (3.0 * area)


@equation
def _cut(work, of, count, from_x, a, b):
    """Write what lies where a (x - from_x) + b y >= 0 to the other polygon; return its corners."""
    if count < 3:
        return 0
    px, py = work[of, count - 1, 0], work[of, count - 1, 1]
    before = a * (px - from_x) + b * py
    left = 0
    for k in range(count):
        x, y = work[of, k, 0], work[of, k, 1]
        here = a * (x - from_x) + b * y
        if (here > 0.0 and before < 0.0) or (here < 0.0 and before > 0.0):
            share = before / (before - here)
            work[1 - of, left, 0] = px + share * (x - px)
            work[1 - of, left, 1] = py + share * (y - py)
            left += 1
        if here >= 0.0:
            work[1 - of, left, 0], work[1 - of, left, 1] = x, y
            left += 1
        px, py, before = x, y, here
    return left


# --- layers over a cell: its faces that hang together and show it one side ------------------------


@routine
def _number_layers(pairs, values, neighbours, slot):
    """Number the layers of the pairs of every cell, and sort them by face.

    Faces that share an edge and show the same side belong to one layer. The pairs of a cell follow
    each other; ``slot`` is -1 for every face, and is so afterwards.
    """
    parent = np.empty(256, dtype=np.int64)
    first = 0
    while first < len(pairs):
        end = first + 1
        while end < len(pairs) and pairs[end, 0] == pairs[first, 0]:
            end += 1
        if end - first > len(parent):
            parent = np.empty(2 * (end - first), dtype=np.int64)
        _sort_by_face(pairs, values, first, end)
        _number_layers_of_cell(pairs, first, end, neighbours, slot, parent)
        first = end


@equation
def _sort_by_face(pairs, values, first, end):
    for k in range(first + 1, end):
        j = k
        while j > first and (pairs[j - 1, 1] > pairs[j, 1]):
            for column in range(4):
                pairs[j - 1, column], pairs[j, column] = pairs[j, column], pairs[j - 1, column]
            for column in range(values.shape[1]):
                values[j - 1, column], values[j, column] = values[j, column], values[j - 1, column]
            j -= 1


@equation
def _number_layers_of_cell(pairs, first, end, neighbours, slot, parent):
    count = end - first
    for k in range(count):
        slot[pairs[first + k, 1]] = k
        parent[k] = k
    for k in range(count):
        for edge in range(4):
            other = neighbours[pairs[first + k, 1], edge]
            if other < 0 or slot[other] < 0:
                continue
            if pairs[first + slot[other], 2] == pairs[first + k, 2]:
                a, b = _root(parent, k), _root(parent, slot[other])
                parent[max(a, b)] = min(a, b)
    found = 0
    for k in range(count):
        slot[pairs[first + k, 1]] = -1
        if parent[k] == k:
            pairs[first + k, 3] = found
            found += 1
        else:
            pairs[first + k, 3] = pairs[first + _root(parent, k), 3]


@equation
def _root(parent, k):
    while parent[k] != k:
        k = parent[k]
    return k


# --- how much of a cell the faces over it tile, laid onto its tangent plane -----------------------


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
    work = np.empty(WORK)
    for p in range(len(chosen)):
        c = chosen[p]
        cell, normal = corners[start[c] : start[c + 1]], normals[c]
        covered = 0.0
        for k in range(first[p], end[p]):
            for t in range(first_triangle[face_of[k]], first_triangle[face_of[k] + 1]):
                covered += _area_under(triangles[t], cell, normal, work)
        shares[p] = covered / areas[c]


@routine
def _area_under(triangle, cell, normal, work):
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
        work[0, to, 0] = x * ux + y * uy + z * uz
        work[0, to, 1] = -across if turned else across
    return clip(work, len(cell), length, tip_x, abs(tip_y))[0]
