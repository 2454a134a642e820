"""Where a sheet passes through itself, since without contact nothing keeps its faces apart.

Two signs are searched for in a saved state, between faces and edges or nodes that are not theirs.
One is an edge that crosses a face. The other is a node that lies over a face nearer than half the
thickness: its sheet is then in that face's sheet by at least half a thickness. The second sign
finds the lips of a cut that slide over each other in one plane, where no edge crosses anything.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.fields.courses import joint_widths
from lcmchain.fields.sheet import (
    COURSE,
    reference_positions,
    sheet_areas,
    sheet_faces,
    sheet_positions,
)
from lcmchain.quantities.readable import millimetres

if TYPE_CHECKING:
    import xarray as xr

#: Distance of mid-surfaces, in parts of the thickness, below which one is in the other.
INSIDE = 0.5
#: A node counts as over a face down to this barycentric coordinate: at its rim but for rounding,
#: since meshes of the same lattice lie on each other's lines.
WITHIN = -1e-6
#: An edge crosses a face if both its ends are this part of its length off the plane: in a plane
#: flange they are off by rounding. A node that is nearer is found by the distance above.
OFF_PLANE = 1e-6
#: Lips of a slit lie in one plane before forming, up to this part of the thickness.
COPLANAR = 1e-6
#: Faces whose neighbours are looked at together: what bounds the memory.
BATCH = 20_000
#: Faces times frames up to which all saved states are looked at; beyond, the last one alone.
MOST_FACES = 2_000_000


def crossing_faces(positions: np.ndarray, faces: np.ndarray, thickness: float) -> np.ndarray:
    """Return which faces are crossed by an edge, or have a node in them, that is not theirs.

    Parameters
    ----------
    positions : of the nodes of the mid-surface [m], shape (node_count, 3).
    faces : their nodes, shape (face_count, 4); a triangle repeats its last node.
    thickness : of the sheet [m].

    Returns
    -------
    mask : shape (face_count,).
    """
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    owner = np.tile(np.arange(len(faces)), 2)
    real = triangles[:, 1] != triangles[:, 2]
    triangles, owner = triangles[real], owner[real]
    corners = positions[triangles]
    centres = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    crossed = np.zeros(len(faces), dtype=bool)

    used = np.unique(faces)
    tree = cKDTree(positions[used])
    for offset, radius, near_enough in _balls(corners, reach, INSIDE * thickness):
        for which, node in _near(tree, centres + offset, radius, near_enough):
            node = used[node]
            foreign = (faces[owner[which]] != node[:, None]).all(axis=1)
            which, node = which[foreign], node[foreign]
            inside = _lies_in(corners[which], positions[node], INSIDE * thickness)
            crossed[owner[which[inside]]] = True

    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = np.unique(np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1), axis=0)
    ends = positions[edges]
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    tree = cKDTree(ends.mean(axis=1))
    for which, edge in _near(tree, centres, reach + half.max(initial=0.0), np.arange(len(centres))):
        own = faces[owner[which]]
        foreign = (own[:, :, None] != edges[edge][:, None, :]).all(axis=(1, 2))
        which, edge = which[foreign], edge[foreign]
        crossed[owner[which[_crosses(corners[which], ends[edge])]]] = True
    return crossed


def crossing_warnings(sheet: xr.Dataset, thickness: float) -> list[str]:
    """Say in which saved state a sheet first passes through itself, how much of it, and where.

    Faces beside a slit, whose lips lie at each other before forming, do not count: lips are told
    where they slide over each other by more than an element.

    Parameters
    ----------
    sheet : root group of a result. thickness : of the undeformed fabric [m].
    """
    faces = sheet_faces(sheet)
    times = sheet["time"].values
    frames = range(len(times)) if len(times) * len(faces) <= MOST_FACES else [len(times) - 1]
    for frame in frames:
        positions = sheet_positions(sheet, frame)
        crossed = np.zeros(len(faces), dtype=bool)
        for own in _bodies(sheet, len(faces)):
            crossed[own] = crossing_faces(positions, faces[own], thickness)
            if crossed[own].any():  # lips of a slit lie at each other from the start
                crossed[own] &= ~_lips(reference_positions(sheet), faces[own], thickness)
        if crossed.any():
            areas = sheet_areas(sheet, 0)
            first = positions[faces[np.argmax(crossed)]].mean(axis=0)
            return [
                f"the sheet passes through itself: in the saved state at {1e3 * times[frame]:.4g} "
                f"ms {int(crossed.sum())} faces ({areas[crossed].sum() / areas.sum():.2%} of the "
                f"area) cross others or lie in them, as at {millimetres(first, 1)}; folds and "
                "the lips of cuts are wrong there from then on: cut the blank such that they stay "
                "apart, hold them with a tool, or compute the contact of its faces with themselves "
                "(interfaces.itself = true)"
            ]
    return []


def joint_warnings(sheet: xr.Dataset, thickness: float) -> list[str]:
    """Say where courses of a ply with forces have slid into each other.

    Parameters
    ----------
    sheet : group of the ply. thickness : of the undeformed fabric [m], up to which edges that butt
        are not told of.
    """
    return [
        f"courses slide into each other: {joint.below} and {joint.above} overlap by up to "
        f"{-1e3 * joint.least:.3g} mm, as at {millimetres(joint.place, 1)}; nothing holds edges of "
        "one ply apart, which butt and buckle in a part, or lie on each other: leave a gap there "
        "(blank.courses.gap), or move the joint"
        for joint in joint_widths(sheet)
        if joint.least < -thickness
    ]


def _lips(positions: np.ndarray, faces: np.ndarray, thickness: float) -> np.ndarray:
    """Return which faces of a flat sheet are touched by others in its plane."""
    return crossing_faces(positions, faces, COPLANAR * thickness)


def _bodies(sheet: xr.Dataset, face_count: int) -> list[np.ndarray]:
    """Return the rows of the faces of each sheet of a result, and of each course of a ply."""
    if "body" in sheet:
        body = sheet["body"].values
    elif COURSE in sheet:  # courses are laid over each other
        body = sheet[COURSE].values[-1]
    else:
        return [np.arange(face_count)]
    return [np.flatnonzero(body == number) for number in np.unique(body)]


def _balls(
    corners: np.ndarray, reach: np.ndarray, distance: float
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield balls that together hold all points over triangles, within a distance [m].

    One ball where triangles are large beside the distance. Along the normal of small ones several
    stand on each other: a single one would hold far more points beside a triangle than over it.

    Yields
    ------
    offset of the centres [m] (P, 3), radius [m] (P,), and the rows of the triangles that need them.
    """
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    half = np.minimum(reach, distance)  # of the part of the normal that a ball covers
    levels = np.ceil(0.5 * distance / np.where(half > 0.0, half, np.inf) - 0.5).astype(int)
    radius = np.where(levels > 0, np.hypot(reach, half), reach + distance)
    for level in range(-levels.max(initial=0), levels.max(initial=0) + 1):
        yield (2.0 * level * half)[:, None] * normal, radius, np.flatnonzero(levels >= abs(level))


def _near(
    tree: cKDTree, centres: np.ndarray, reach: np.ndarray, rows: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield, batch by batch, pairs (row of centres, row of the tree) within the centre's reach."""
    for first in range(0, len(rows), BATCH):
        batch = rows[first : first + BATCH]
        lists = tree.query_ball_point(centres[batch], reach[batch])
        counts = np.fromiter(map(len, lists), dtype=np.int64, count=len(lists))
        point = np.fromiter(itertools.chain.from_iterable(lists), np.int64, count=counts.sum())
        yield np.repeat(batch, counts), point


def _lies_in(corners: np.ndarray, points: np.ndarray, distance: float) -> np.ndarray:
    """Whether points [m] (P, 3) lie over triangles (P, 3, 3), within a distance [m]; (P,)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.einsum("pi,pi->p", normal, normal)
    offset = points - corners[:, 0]
    u = np.einsum("pi,pi->p", np.cross(offset, second), normal)
    v = np.einsum("pi,pi->p", np.cross(first, offset), normal)
    height = np.abs(np.einsum("pi,pi->p", offset, normal))
    least = WITHIN * square
    over = (u > least) & (v > least) & (square - u - v > least)
    return over & (height < distance * np.sqrt(square))


def _crosses(corners: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Whether segments [m] (P, 2, 3) cross triangles (P, 3, 3), the rim included; (P,)."""
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    before = np.einsum("pi,pi->p", start - corners[:, 0], normal)
    after = np.einsum("pi,pi->p", ends[:, 1] - corners[:, 0], normal)
    around = np.stack([
        np.einsum("pi,pi->p", way, np.cross(corners[:, k] - start, corners[:, k - 2] - start))
        for k in range(3)
    ])  # fmt: skip
    rim = WITHIN * np.abs(around).sum(axis=0)
    through = np.all(around > rim, axis=0) | np.all(around < -rim, axis=0)
    least = OFF_PLANE * np.linalg.norm(way, axis=1) * np.linalg.norm(normal, axis=1)
    apart = (np.minimum(np.abs(before), np.abs(after)) > least) & (before * after < 0.0)
    return apart & through
