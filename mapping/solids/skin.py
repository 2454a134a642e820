"""Skin of a solid target: which part of each face of the sheet has target over it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.solids.columns import Columns, touching, tree_of
from lcmchain.mapping.solids.overlap import relative
from lcmchain.mapping.solids.tetrahedra import TABLE, Solids, clip_triangle, tetrahedron_planes

#: Outer sides of each shape, normals outward.
SIDES = (
    [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
)

#: Skin that stands steeper against the sheet (60 degrees) is an end of the target.
STEEP = 0.5

#: A side with a cell within this part of its size in front of it does not bound the target.
IN_FRONT = 0.02

#: Below this ratio of the skins over and under a face, one of them is missing.
ONE_SIDED = 0.5

#: Ends of the target below this share of a face's area are rounding at a common outline.
OUTLINE = 1e-6

#: A face is wholly covered if this share is. Where the sheet bends, the columns at its outline know
#: its normal from one side only and lean against it, by as much as the others lean against their
#: faces, or a few times of that where the curvature changes; there so much less is enough.
WHOLE = 1.0 - 1e-9
LEAN = 4.0


class Skin(NamedTuple):
    """Triangles around a solid target; a quadrilateral is the mean of both ways to cut it.

    corners : [m], counter-clockwise seen from outside, shape (T, 3, 3).
    weight : 1 for a triangle, 1/2 for those of a quadrilateral, shape (T,).
    fans : triangles around the middles of quadrilaterals instead [m], shape (U, 3, 3).
    """

    corners: np.ndarray
    weight: np.ndarray
    fans: np.ndarray


class CoveredFaces(NamedTuple):
    """Part of the sheet that has target over it.

    share : of each face's area, shape (F,).
    cut : whether the target ends inside the face's column, shape (F,).
    """

    share: np.ndarray
    cut: np.ndarray


def skin_of(cells: Solids, nodes: np.ndarray) -> Skin:
    """Sides that belong to one cell only and have no other cell in front of them.

    nodes : number of the place of each corner, shape (C, 8).
    """
    four, triangle = _single_sides(cells, nodes)
    free = ~_before_a_cell(four, triangle, cells)
    four, triangle = four[free], triangle[free]
    quad = four[~triangle]
    halves = [quad[:, k] for k in ([0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3])]
    corners = np.concatenate([four[triangle][:, :3], *halves])
    weight = np.where(np.arange(len(corners)) < triangle.sum(), 1.0, 0.5)
    middle = quad.mean(axis=1)
    around = [np.stack([quad[:, k], quad[:, (k + 1) % 4], middle], axis=1) for k in range(4)]
    fans = np.concatenate([four[triangle][:, :3], *around])
    return Skin(np.ascontiguousarray(corners), weight, np.ascontiguousarray(fans))


def _single_sides(cells: Solids, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the sides that belong to one cell only (S, 4, 3), and which are triangles."""
    sides, points = [], []
    for number, table in enumerate(SIDES):
        chosen = cells.shape == number
        if not chosen.any():
            continue
        own, places = nodes[chosen], cells.corners[chosen]
        inside_out = cells.weight[chosen] < 0.0
        for side in table:
            order = [*side, side[-1]][:4]
            numbers, corners = own[:, order], places[:, order]
            if len(side) == 3:
                numbers = np.where(np.arange(4) == 3, -1, numbers)
            turned = [order[k] for k in ((0, 3, 2, 1) if len(side) == 4 else (0, 2, 1, 1))]
            corners[inside_out] = places[inside_out][:, turned]
            sides.append(np.sort(numbers, axis=1))
            points.append(corners)
    _, where, count = np.unique(
        np.concatenate(sides), axis=0, return_inverse=True, return_counts=True
    )
    outer = count[where.reshape(-1)] == 1
    return np.concatenate(points)[outer], np.concatenate(sides)[outer][:, 0] < 0


def _before_a_cell(four: np.ndarray, triangle: np.ndarray, cells: Solids) -> np.ndarray:
    """Whether a side has a cell in front: cells that meet without common nodes, shape (S,)."""
    across = np.cross(four[:, 2] - four[:, 0], four[:, 3] - four[:, 1])
    length = np.linalg.norm(across, axis=1)
    middle = np.where(triangle[:, None], four[:, :3].mean(axis=1), four.mean(axis=1))
    in_front = middle + IN_FRONT * across / np.sqrt(np.where(length > 0.0, length, 1.0))[:, None]
    start, near = touching(tree_of(cells.low, cells.high), in_front, in_front)
    return _inside(in_front, start, near, *cells[:4], TABLE)


def covered_faces(skin: Skin, columns: Columns, volume: np.ndarray) -> CoveredFaces:
    """Measure which share of each face has target over it along the columns.

    A face whose column holds no end of the target is covered as a whole. In the others it is
    the mean of the skins on the upper and the lower side of the target, projected onto the face.

    volume : of the target in each column [m3], shape (F,).
    """
    start, near = touching(columns.tree, skin.corners.min(axis=1), skin.corners.max(axis=1))
    sums = np.zeros((len(columns.faces), 5))
    _project(
        start, near, skin.corners, skin.weight, *columns.solids[:4], TABLE,
        columns.face_normals, columns.centroids, sums,
    )  # fmt: skip
    areas = columns.areas(np.zeros(len(sums)))
    area = sums[:, [0, 2]]
    height = sums[:, [1, 3]] / np.where(area > 0.0, area, 1.0)
    both = np.stack([area[:, side] / columns.areas(height[:, side]) for side in (0, 1)], axis=1)
    # Where two walls touch, the target has no skin between them.
    one_sided = both.min(axis=1) < ONE_SIDED * both.max(axis=1)
    share = np.where(one_sided, both.max(axis=1), both.mean(axis=1))
    # A column that ends inside of the target on both sides is filled where it is covered.
    share = np.minimum(np.where(share > 0.0, share, volume / columns.solids.volumes), 1.0)
    farthest = np.abs(height).max(axis=1)
    cut = sums[:, 4] > OUTLINE * areas
    inward = columns.directors - columns.face_normals[:, None]
    lean = np.linalg.norm(inward, axis=2).max(axis=1) * farthest / np.sqrt(areas)
    whole = ~cut | (share >= WHOLE - np.where(columns.at_outline, LEAN * lean, 0.0))
    return CoveredFaces(np.where(whole, 1.0, share), cut & ~whole)


@strict_equation
def _inside(points, start, near, corners, shape, counts, weight, table):
    """Whether each point lies in the cells near it, with both ways to cut them, shape (P,)."""
    inside = np.zeros(len(points), np.bool_)
    planes = np.empty((4, 4))
    four = np.empty((4, 3))
    for p in range(len(points)):
        held = 0.0
        for k in range(start[p], start[p + 1]):
            c = near[k]
            for t in range(counts[c]):
                relative(corners[c], table[shape[c], t], points[p], four)
                if tetrahedron_planes(four[0], four[1], four[2], four[3], planes) != 0.0:
                    lowest = min(min(planes[0, 3], planes[1, 3]), min(planes[2, 3], planes[3, 3]))
                    held += abs(weight[c]) if lowest > 0.0 else 0.0
        inside[p] = held > 0.75
    return inside


@strict_equation
def _project(
    start, near, corners, weight,
    column_corners, column_shape, column_counts, column_weight, table, normals, centroids, found,
):  # fmt: skip
    """Gather per face: projected upper area and its moment of height, lower, and steep area."""
    planes = np.empty((4, 4))
    work = np.empty((2, 16, 3))
    height = np.empty(16)
    centroid = np.empty(3)
    moved = np.empty((3, 3))
    other = np.empty((4, 3))
    for t in range(len(corners)):
        origin = corners[t, 0]
        for k in range(3):
            for axis in range(3):
                moved[k, axis] = corners[t, k, axis] - origin[axis]
        e, f = moved[1], moved[2]
        nx, ny, nz = (
            e[1] * f[2] - e[2] * f[1],
            e[2] * f[0] - e[0] * f[2],
            e[0] * f[1] - e[1] * f[0],
        )
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length == 0.0:
            continue
        for k in range(start[t], start[t + 1]):
            c = near[k]
            own = normals[c]
            along = (nx * own[0] + ny * own[1] + nz * own[2]) / length
            for s in range(column_counts[c]):
                relative(column_corners[c], table[column_shape[c], s], origin, other)
                sign = tetrahedron_planes(other[0], other[1], other[2], other[3], planes)
                if sign == 0.0:
                    continue
                area = clip_triangle(moved, planes, work, height, centroid)
                area *= sign * column_weight[c] * weight[t]
                if area == 0.0:
                    continue
                if abs(along) < STEEP:
                    found[c, 4] += area
                side = 0 if along > 0.0 else 2
                over = 0.0
                for axis in range(3):
                    over += (origin[axis] + centroid[axis] - centroids[c, axis]) * own[axis]
                found[c, side] += area * abs(along)
                found[c, side + 1] += area * abs(along) * over
