"""Fields of a ply that is laid in courses: the course of each face, and the gaps at the joints.

At every node of the upper edge of a course the nearest point of the next one's lower edge is looked
for, a line through its nodes. The distance is a gap where that point lies outside of the course,
and an overlap, negative, where it lies inside. Between nodes the edges are chords: over a curved
edge of radius R they lie up to h²/8R off, for the edge length h. An edge that has lifted off leaves
a gap too.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lcmchain.fields.sheet import COURSE, JOINT_GAP, course_names, sheet_faces, sheet_positions
from lcmchain.fields.ugrid import Described
from lcmchain.mesh.courses import strip_names
from lcmchain.mesh.sheet_mesh import SheetMesh

if TYPE_CHECKING:
    import xarray as xr

#: Parts of the shortest edge or bar: nodes nearer to the edge of a course lie on it.
ON_EDGE = 1e-6
#: Places of the nearest point beyond an end of the other edge, in parts of its last piece.
BEYOND = 1e-6
#: An edge overlaps if the other one lies inward of it by this part of their distance: one that has
#: lifted straight off leaves a gap.
LAPPED = 0.1


class JointNodes(NamedTuple):
    """Nodes of the mid-surface on either side of a joint, along fibre 1.

    upper : on the upper edge of the course below (n,). lower : on the lower edge of the one above.
    """

    upper: np.ndarray
    lower: np.ndarray


def joint_nodes(mesh: SheetMesh) -> list[JointNodes]:
    """Return the joints of an undeformed sheet, the lowest first; none of a sheet of one piece."""
    if mesh.course is None:
        return []
    flat = mesh.mid_surface(mesh.node_positions)
    faces = _corners(mesh)
    along, across = flat @ mesh.fibre_direction_1[0], flat @ mesh.fibre_direction_2[0]
    tolerance = ON_EDGE * float(np.sqrt(mesh.element_areas.min()))
    of_courses = [np.unique(faces[mesh.course == n]) for n in range(mesh.course.max() + 1)]

    def at(nodes: np.ndarray, height: float) -> np.ndarray:
        return nodes[edge_nodes(along[nodes], across[nodes], height, tolerance)]

    return [
        JointNodes(at(below, across[below].max()), at(above, across[above].min()))
        for below, above in zip(of_courses[:-1], of_courses[1:], strict=True)
    ]


def edge_nodes(
    along: np.ndarray, across: np.ndarray, height: float, tolerance: float
) -> np.ndarray:
    """Return which nodes of a strip lie on its edge at a height across fibre 1, along fibre 1.

    Parameters
    ----------
    along, across : coordinates of the nodes in the flat blank [m], shape (n,).
    height, tolerance : of the edge [m].
    """
    there = np.flatnonzero(np.abs(across - height) < tolerance)
    return there[np.argsort(along[there])]


def joint_gaps(mesh: SheetMesh, positions: np.ndarray) -> np.ndarray:
    """Return the gaps at the joints of a sheet, on the upper edge of the course below [m].

    Parameters
    ----------
    positions : of the mid-surface nodes [m], shape (F, n, 3).

    Returns
    -------
    gaps : shape (F, n), negative for an overlap; nan on all other nodes, and where the nearest
        place lies beyond an end of the other course.
    """
    gaps = np.full(positions.shape[:2], np.nan)
    faces, joints = _corners(mesh), joint_nodes(mesh)
    for gap, places in zip(gaps, positions, strict=True):
        inside = mean_of_faces(faces, places)
        for upper, lower in joints:
            gap[upper] = signed_distance(places[upper], inside[upper], places[lower])
    return gaps


def course_field(numbers: np.ndarray, names: Sequence[str]) -> Described:
    """Return the field of the courses; numbers : of every face (F, face_count)."""
    return numbers.astype(np.int32), {
        "long_name": "course of the ply that the face belongs to",
        "units": "1",
        "flag_values": np.arange(len(names), dtype=np.int32),
        "flag_meanings": " ".join(names),
    }


def gap_field(gaps: np.ndarray) -> Described:
    """Return the field of the gaps [m] on the nodes (F, n)."""
    return gaps, {
        "long_name": "gap between courses",
        "units": "m",
        "comment": "on the upper edge of each course: distance to the "
        "edge of the next one, negative where they overlap; not a number elsewhere",
    }


def course_fields(mesh: SheetMesh, frame_count: int) -> dict[str, Described]:
    """Return the field of the courses of a sheet by its name; empty of a sheet of one piece."""
    if mesh.course is None:
        return {}
    names = strip_names(int(mesh.course.max()) + 1)
    return {COURSE: course_field(np.tile(mesh.course, (frame_count, 1)), names)}


def gap_fields(mesh: SheetMesh, positions: np.ndarray) -> dict[str, Described]:
    """Return the field of the gaps of a sheet by its name; empty of a sheet of one piece.

    positions : of the mid-surface nodes [m], shape (F, n, 3).
    """
    return {} if mesh.course is None else {JOINT_GAP: gap_field(joint_gaps(mesh, positions))}


class JointWidth(NamedTuple):
    """How wide a joint is in a frame.

    below, above : names of the courses. flat : gap in the flat blank [m].
    least, most : gap [m], negative for an overlap. place : of the least gap [m] (3,).
    """

    below: str
    above: str
    flat: float
    least: float
    most: float
    place: np.ndarray

    def as_dict(self) -> dict[str, Any]:
        """Return names and gaps under the names of ``summary.json``."""
        return {
            "below": self.below,
            "above": self.above,
            "flat_gap_m": self.flat,
            "gap_min_m": self.least,
            "gap_max_m": self.most,
        }


def joint_widths(sheet: xr.Dataset, frame: int = -1) -> list[JointWidth]:
    """Return how wide the joints of one ply are, whose group of a result is ``sheet``.

    A joint whose edges are nowhere beside each other is left out.
    """
    names = course_names(sheet)
    if not names:
        return []
    flat, gaps = sheet[JOINT_GAP].values[0], sheet[JOINT_GAP].values[frame]
    course = np.zeros(gaps.size, dtype=int)
    course[sheet_faces(sheet)] = sheet[COURSE].values[0].astype(int)[:, None]
    places = sheet_positions(sheet, frame)
    widths = []
    for number, (below, above) in enumerate(pairwise(names)):
        known = np.flatnonzero(np.isfinite(gaps) & np.isfinite(flat) & (course == number))
        if known.size:
            own = gaps[known]
            least = int(np.argmin(own))
            widths.append(
                JointWidth(
                    below, above, float(flat[known].max()), float(own[least]), float(own.max()),
                    places[known[least]],
                )
            )  # fmt: skip
    return widths


def _corners(mesh: SheetMesh) -> np.ndarray:
    """Return the nodes of the faces; a triangle repeats its last node where faces have four."""
    faces = mesh.sheet_faces
    return np.where(faces < 0, faces[:, 2:3], faces)


def mean_of_faces(faces: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the mean of the middles of the faces around each node [m] (node_count, 3)."""
    middles = positions[faces].mean(axis=1)
    total, count = np.zeros_like(positions), np.zeros(len(positions))
    for corner in range(faces.shape[1]):
        np.add.at(total, faces[:, corner], middles)
        np.add.at(count, faces[:, corner], 1.0)
    return total / np.maximum(count, 1.0)[:, None]


def signed_distance(places: np.ndarray, inside: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return distances of places (n, 3) from a line (m, 3) [m], negative where it is inside.

    inside : points of the course beside the places (n, 3). Distances are nan where the nearest
    point is an end of the line that the place lies beyond.
    """
    gap = np.full(len(places), np.nan)
    if len(line) < 2:
        return gap
    start, way = line[:-1], np.diff(line, axis=0)
    share = ((places[:, None] - start) * way).sum(-1) / (way * way).sum(-1)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * way
    distance = np.linalg.norm(places[:, None] - nearest, axis=-1)
    distance = np.where(np.isnan(distance), np.inf, distance)
    rows, best = np.arange(len(places)), np.argmin(distance, axis=1)
    before_it = (best == 0) & (share[rows, best] < -BEYOND)
    behind_it = (best == len(way) - 1) & (share[rows, best] > 1.0 + BEYOND)
    known = np.isfinite(distance[rows, best]) & ~before_it & ~behind_it
    outward = places - inside
    along = ((nearest[rows, best] - places) * outward).sum(-1)
    least = LAPPED * distance[rows, best] * np.linalg.norm(outward, axis=-1)
    gap[known] = np.where(along < -least, -distance[rows, best], distance[rows, best])[known]
    return gap
