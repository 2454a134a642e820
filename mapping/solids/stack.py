"""Plies that lie over each other: which part of the target's thickness each of them takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.solids.columns import Columns, touching, tree_of
from lcmchain.mapping.solids.overlap import Overlaps, Slices
from lcmchain.mapping.solids.skin import STEEP, Skin
from lcmchain.mapping.solids.tetrahedra import Solids
from lcmchain.mapping.weights import present

#: A line that leaves a side of the target by this part of a triangle still finds it: at the outline
#: of a curved target the line through a lower corner can miss the upper side.
BESIDE = 0.2

#: Corners closer to the skin than this part of the stack's thickness lie on it.
ON_SKIN = 1e-9


class Stack(NamedTuple):
    """The plies in each cell.

    thickness : formed thickness of all plies [m], not a number without a ply, shape (C,).
    part : of this thickness that the ply of each overlap has, shape (K,).
    slices : what of the target's thickness the ply of each overlap takes.
    """

    thickness: np.ndarray
    part: np.ndarray
    slices: Slices


class _Plies(NamedTuple):
    """Plies of each cell: P = number of plies.

    normal : of the stack, shape (C, 3).
    height : of each ply's mid-surface over the cell's first corner along it [m], shape (C, P).
    thickness : of each ply, zero where the cell has nothing of it [m], shape (C, P).
    end : lowest and highest place that is nearer to this wall than to another one, shape (C, 2).
    """

    normal: np.ndarray
    height: np.ndarray
    thickness: np.ndarray
    end: np.ndarray


def stack_of(
    cells: Solids,
    columns: Columns,
    skin: Skin,
    overlap: Overlaps,
    ply: np.ndarray,
    face_thickness: np.ndarray,
) -> Stack:
    """Sort the plies of every cell along the normal and share the target's thickness out.

    Each ply takes the part of the local thickness of the target, from its lower to its upper
    side, that its formed thickness has in the stack.

    Parameters
    ----------
    overlap : of the cells with the whole columns of their own walls.
    ply : number of the ply of each face, shape (F,).
    face_thickness : formed thickness [m], shape (F,).
    """
    plies = _plies(cells, columns, overlap, ply, face_thickness)
    whole = plies.thickness.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        part = plies.thickness / whole[:, None]
    # plies at one place lie over each other in the order of their numbers
    order = np.argsort(np.where(part > 0.0, plies.height, np.inf), axis=1, kind="stable")
    rank = np.argsort(order, axis=1, kind="stable")
    upper = np.take_along_axis(np.cumsum(np.take_along_axis(part, order, axis=1), axis=1), rank, 1)
    lower = upper - part
    own = ply[overlap.face]
    count = (part > 0.0).sum(axis=1)
    first = rank[overlap.cell, own] == 0
    last = rank[overlap.cell, own] == count[overlap.cell] - 1
    slices = Slices(
        _places_in_thickness(cells, skin, plies, whole),
        np.where(first, -np.inf, lower[overlap.cell, own]),
        np.where(last, np.inf, upper[overlap.cell, own]),
    )
    return Stack(np.where(count > 0, whole, np.nan), part[overlap.cell, own], slices)


def one_ply(overlap: Overlaps, face_thickness: np.ndarray, cell_count: int) -> Stack:
    """Return the stack of a single ply, which takes all of the target."""
    volume = np.bincount(overlap.cell, weights=overlap.volume, minlength=cell_count)
    summed = np.bincount(
        overlap.cell, weights=overlap.volume * face_thickness[overlap.face], minlength=cell_count
    )
    thickness = np.where(volume > 0.0, summed / np.where(volume > 0.0, volume, 1.0), np.nan)
    return Stack(thickness, np.ones(len(overlap.cell)), Slices.nothing(overlap, cell_count))


def _plies(
    cells: Solids,
    columns: Columns,
    overlap: Overlaps,
    ply: np.ndarray,
    face_thickness: np.ndarray,
) -> _Plies:
    cell_count, ply_count = len(cells.volumes), int(ply.max()) + 1
    cell, face, volume = overlap.cell, overlap.face, overlap.volume
    # normals of plies that look to the other side are turned to that of the cell's first overlap
    leading = np.zeros(cell_count, dtype=np.int64)
    leading[cell[::-1]] = face[::-1]
    normals = columns.face_normals
    sign = np.sign(np.einsum("ki,ki->k", normals[face], normals[leading[cell]]))
    normal = np.zeros((cell_count, 3))
    np.add.at(normal, cell, (volume * sign)[:, None] * normals[face])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]

    origin = cells.corners[:, 0]
    height = np.einsum("ki,ki->k", columns.centroids[face] - origin[cell], normal[cell])
    reach = np.stack([columns.below, columns.above], axis=1)[columns.faces].mean(axis=1)[face]
    reach = np.where(sign[:, None] < 0.0, -reach[:, ::-1], reach)

    def mean(values: np.ndarray) -> np.ndarray:
        key = cell * ply_count + ply[face]
        size = cell_count * ply_count
        held = np.bincount(key, weights=volume, minlength=size)
        summed = np.bincount(key, weights=volume * values, minlength=size)
        with np.errstate(invalid="ignore", divide="ignore"):
            return (summed / held).reshape(cell_count, ply_count)

    middle = mean(height)
    ends = (middle + mean(reach[:, 0]), middle + mean(reach[:, 1]))
    low, high = (np.where(np.isnan(v), w, v) for v, w in zip(ends, (np.inf, -np.inf), strict=True))
    end = np.stack([low.min(axis=1), high.max(axis=1)], axis=1)
    # a ply that ends inside the cell counts with the part that is there
    held = np.bincount(cell * ply_count + ply[face], weights=volume, minlength=middle.size)
    held = held.reshape(middle.shape) / cells.volumes[:, None]
    thickness = np.nan_to_num(mean(face_thickness[face])) * present(held.T).T
    return _Plies(normal, middle, thickness, end)


def _places_in_thickness(cells: Solids, skin: Skin, plies: _Plies, whole: np.ndarray) -> np.ndarray:
    """Place of each corner in the target's thickness, 0 below and 1 above, shape (C, 8)."""
    offset = cells.corners - cells.corners[:, :1]
    corner = np.einsum("cki,ci->ck", offset, plies.normal)
    size = np.ptp(corner, axis=1)
    reach = np.stack([corner.max(axis=1) - plies.end[:, 0], plies.end[:, 1] - corner.min(axis=1)])
    reach = np.where(np.isfinite(reach), np.maximum(reach, 0.0), 0.0).T + size[:, None]
    low, high = _extent(cells, skin, plies.normal, corner, reach, whole, AT_EDGE)
    missing = ~(np.isfinite(low) & np.isfinite(high)) & (whole > 0.0)[:, None]
    if missing.any():
        wide = _extent(cells, skin, plies.normal, corner, reach, whole, BESIDE, missing)
        low = np.where(np.isfinite(low), low, wide[0])
        high = np.where(np.isfinite(high), high, wide[1])
    low = np.maximum(low, plies.end[:, :1])
    high = np.minimum(high, plies.end[:, 1:])
    low, high = _filled(low), _filled(high)
    # without any side of the target in reach: the plies as they were formed
    half = 0.5 * whole[:, None]
    held = plies.thickness > 0.0
    centre = (
        np.sum(np.where(held, plies.height * plies.thickness, 0.0), axis=1)[:, None]
        / (np.where(whole > 0.0, whole, 1.0)[:, None])
    )
    low, high = (np.where(np.isfinite(v), v, centre + s * half) for v, s in ((low, -1), (high, 1)))
    depth = high - low
    return (corner - low) / np.where(depth > 0.0, depth, np.inf)


def _filled(values: np.ndarray) -> np.ndarray:
    """Values of corners, those that are not known as the mean of the cell's others, (C, 8)."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    mean = np.where(known, values, 0.0).sum(axis=1) / np.where(count > 0, count, 1)
    return np.where(known, values, np.where(count > 0, mean, np.nan)[:, None])


def _extent(
    cells: Solids,
    skin: Skin,
    normal: np.ndarray,
    corner: np.ndarray,
    reach: np.ndarray,
    whole: np.ndarray,
    margin: float,
    chosen: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Heights of the target's lower and upper side on lines through the corners [m], (C, 8).

    Where a line meets several walls, the one between the corner and the middle of the cell counts.
    """
    count = len(corner)
    used = np.broadcast_to((whole > 0.0)[:, None], corner.shape) if chosen is None else chosen
    cell, k = np.nonzero(used)
    found = _crossings(cells.corners[cell, k], normal[cell], reach[cell], skin.fans, margin)
    across = np.cross(skin.fans[:, 1] - skin.fans[:, 0], skin.fans[:, 2] - skin.fans[:, 0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    own = cell[found.line]
    along = np.einsum("ki,ki->k", across[found.triangle], normal[own])
    place = corner[own, k[found.line]] + found.place
    middle = corner.mean(axis=1)[own]
    here = corner[own, k[found.line]]
    near = ON_SKIN * whole[own]
    low, high = np.full(corner.size, -np.inf), np.full(corner.size, np.inf)
    key = own * corner.shape[1] + k[found.line]
    below = (along < -STEEP) & (place <= np.maximum(here, middle) + near)
    above = (along > STEEP) & (place >= np.minimum(here, middle) - near)
    np.maximum.at(low, key[below], place[below])
    np.minimum.at(high, key[above], place[above])
    shape = (count, corner.shape[1])
    return (
        np.where(np.isfinite(low), low, np.nan).reshape(shape),
        np.where(np.isfinite(high), high, np.nan).reshape(shape),
    )


# --- where lines along the normals cross triangles ------------------------------------------------

#: A line that passes an edge within this share of a triangle crosses the triangle.
AT_EDGE = 1e-9


class Crossings(NamedTuple):
    """Crossings of L lines with triangles, by line, then by triangle.

    line : number of the line, shape (K,).
    triangle : shape (K,).
    place : along the line from its origin [m], shape (K,).
    """

    line: np.ndarray
    triangle: np.ndarray
    place: np.ndarray


def _crossings(
    points: np.ndarray,
    directions: np.ndarray,
    reach: np.ndarray,
    corners: np.ndarray,
    margin: float = AT_EDGE,
) -> Crossings:
    """Find where lines cross triangles.

    Parameters
    ----------
    points, directions : origin [m] and unit direction of each line, shape (L, 3).
    reach : how far each line goes against and along its direction [m], positive, shape (L, 2).
    corners : of the triangles [m], shape (T, 3, 3).
    margin : share of a triangle by which a line may pass beside it.
    """
    corners = np.ascontiguousarray(corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = (high - low).max(axis=1, keepdims=True)
    tree = tree_of(low - 2.0 * margin * size, high + 2.0 * margin * size)
    ends = np.stack([points - reach[:, :1] * directions, points + reach[:, 1:] * directions])
    start, near = touching(tree, ends.min(axis=0), ends.max(axis=0))
    place = _cross(start, near, points, directions, corners, margin)
    line = np.repeat(np.arange(len(points)), np.diff(start))
    with np.errstate(invalid="ignore"):
        hit = (place >= -reach[line, 0]) & (place <= reach[line, 1])
    return Crossings(line[hit], near[hit], place[hit])


@strict_equation
def _cross(start, near, points, directions, corners, margin):
    """Place along the line of each pair; not a number where the line passes by.

    Source: Möller and Trumbore, Journal of Graphics Tools 2 (1997) 21.
    """
    place = np.full(len(near), np.nan)
    for i in range(len(points)):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        for k in range(start[i], start[i + 1]):
            a, b, c = corners[near[k], 0], corners[near[k], 1], corners[near[k], 2]
            ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            fx, fy, fz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            px, py, pz = dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx
            along = ex * px + ey * py + ez * pz
            if along == 0.0:
                continue
            tx, ty, tz = points[i, 0] - a[0], points[i, 1] - a[1], points[i, 2] - a[2]
            u = (tx * px + ty * py + tz * pz) / along
            qx, qy, qz = ty * ez - tz * ey, tz * ex - tx * ez, tx * ey - ty * ex
            v = (dx * qx + dy * qy + dz * qz) / along
            if u < -margin or v < -margin or u + v > 1.0 + margin:
                continue
            place[k] = (fx * qx + fy * qy + fz * qz) / along
    return place
