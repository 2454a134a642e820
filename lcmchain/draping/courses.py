"""Courses: a ply that is laid in strips side by side, each with a net of its own, and their joints.

A strip lies in the flat blank between two lines along fibre 1. Where its course begins follows from
the start of the whole ply: from there a geodesic runs as far and in the direction in which the seed
of the course lies in the flat blank, and fibre 1 keeps its angle to it. On a plane and on a
developable surface strips then lie as they do in the flat blank; on a doubly curved one they do so
at their start alone, and gaps open or overlaps grow along the joints.

Gaps and overlaps are measured as those of a formed sheet (:mod:`lcmchain.fields.courses`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from lcmchain.draping.laid import LaidNet, lay
from lcmchain.draping.net import ACCURACY, PLACED, UNREACHED, lay_start_line, unit_normal
from lcmchain.draping.start import NetStart, SteeredLine, nearest_place, tangent_frame
from lcmchain.draping.surface import ASKER, DrapedSurface
from lcmchain.errors import InputError
from lcmchain.fields.courses import ON_EDGE, edge_nodes, mean_of_faces, signed_distance
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.courses import strip_of
from lcmchain.quantities.readable import millimetres
from lcmchain.scene import Scene
from lcmchain.scene.draping import Course, courses_to_lay
from lcmchain.scene.stack import PlySettings

#: Part of the blank's area that strips may leave uncovered: rounding.
UNCOVERED = 1e-9


def lay_courses(scene: Scene, surface: DrapedSurface, begin: NetStart) -> tuple[LaidNet, ...]:
    """Lay every course of the one ply of a scene.

    Parameters
    ----------
    begin : where the net of the whole ply would begin.

    Raises
    ------
    InputError : a strip is no part of the blank, its mesh cannot be made, strips leave some of the
        blank uncovered, or a course has no place to begin.
    """
    ply = scene.only_ply(ASKER)
    if any(ply.blank.cuts.values()):
        raise InputError(
            "divides a blank without holes, darts and slits; leave these out, or the courses",
            key="draping.courses",
        )
    courses = courses_to_lay(scene.draping, scene.stack)
    strips = [
        _part_of(ply, course, f"draping.courses[{number}]") for number, course in enumerate(courses)
    ]
    if scene.draping.courses:  # those of the ply itself may leave gaps at their joints
        _require_cover(ply, strips)
    nets = []
    for number, (course, part) in enumerate(zip(courses, strips, strict=True)):
        key = f"draping.courses[{number}]"
        outline = np.array(part.exterior.coords[:-1])
        blank = _mesh_of(ply, outline, f"{key}.strip")
        start = _start_of(scene, surface, begin, course, blank, part, key)
        edge_length = ply.blank.edge_length
        nets.append(lay(surface, blank, start, edge_length, course.name, course.strip, outline))
    return tuple(nets)


def _require_cover(ply: PlySettings, strips: Sequence[shapely.Polygon]) -> None:
    """Refuse strips that leave some of the blank uncovered."""
    left = ply.contours.polygon.difference(shapely.union_all(strips))
    if left.area > UNCOVERED * ply.contours.area:
        where = np.array(left.representative_point().coords[0])
        raise InputError(
            f"leaves {left.area / ply.contours.area:.1%} of the blank without a course, as at "
            f"{millimetres(where, 1)}; give further courses, or a smaller blank",
            key="draping.courses",
        )


def _axes(ply: PlySettings) -> np.ndarray:
    """Return the directions of fibre 1 and 2 in the flat blank, as rows (2, 2)."""
    cosine, sine = math.cos(ply.blank.fibre_angle), math.sin(ply.blank.fibre_angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def _part_of(ply: PlySettings, course: Course, key: str) -> shapely.Polygon:
    """Return the part of the blank that a course is cut from, anticlockwise."""
    part = strip_of(ply.contours.polygon, ply.blank.fibre_angle, course.strip)
    if not isinstance(part, shapely.Polygon) or part.is_empty or part.interiors:
        what = "no piece" if part.area == 0.0 else "several pieces"
        raise InputError(
            f"cuts {what} of the blank; a course is one piece, and lies between two distances "
            "from the origin along fibre 2",
            key=f"{key}.strip",
        )
    return shapely.geometry.polygon.orient(part)


def _mesh_of(ply: PlySettings, outline: np.ndarray, key: str) -> BlankMesh:
    """Mesh the part of the ply inside an outline (n, 2) [m]."""
    whole = ply.blank.model_copy(update={"courses": None})
    strip = replace(ply, blank=whole.with_outline(outline - np.array(ply.center)))
    try:
        return strip.build_blank()
    except InputError as error:
        raise InputError(f"cannot be meshed: {error.message}", key=key) from None


def _start_of(
    scene: Scene,
    surface: DrapedSurface,
    begin: NetStart,
    course: Course,
    blank: BlankMesh,
    part: shapely.Polygon,
    key: str,
) -> NetStart:
    """Return how the net of a course begins."""
    ply = scene.only_ply(ASKER)
    axes, edge_length = _axes(ply), ply.blank.edge_length
    if course.seed is not None:
        seed = np.array(course.seed)
        if part.distance(shapely.Point(seed)) > edge_length:
            raise InputError(
                f"{millimetres(seed, 1)} lies outside of the strip of the course",
                key=f"{key}.seed",
            )
    else:
        seed = np.array([begin.seed @ axes[0], 0.5 * sum(course.strip)]) @ axes
    if course.place is not None:
        place = nearest_place(surface, course.place, edge_length, f"{key}.place")
        fibre = blank.fibre_direction_1[0]
        angle = course.angle + scene.draping.angle
    else:
        place, fibre = _carried(surface, begin, axes @ (seed - begin.seed), edge_length, key)
        angle = course.angle
    pre_shear = scene.draping.pre_shear if course.pre_shear is None else course.pre_shear
    line = None
    if course.start_line is not None:
        line_key = f"{key}.start_line"
        line = SteeredLine.through(surface, course.start_line, place, edge_length, line_key)
        place, fibre, angle = line.place, line.tangent, 0.0
    return NetStart(
        seed, place, *tangent_frame(surface, place, fibre, angle, pre_shear, f"{key}.place"), line
    )


def _carried(
    surface: DrapedSurface, begin: NetStart, way: np.ndarray, edge_length: float, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the end of the geodesic to a seed (3,) [m], and the direction of fibre 1 there (3,).

    way : from the seed of the ply to that of the course along both fibres (2,) [m].
    """
    # with pre-shear both fibres are no right angle apart: the way is as long as in the sheared ply
    ahead = way[0] * begin.direction_1 + way[1] * begin.direction_2
    length = float(np.linalg.norm(ahead))
    if length == 0.0:
        return begin.place, begin.direction_1
    direction = ahead / length
    lines = np.linspace(0.0, length, max(1, math.ceil(length / edge_length - 1e-9)) + 1)
    places = np.full((lines.size, 1, 3), np.nan)
    status = np.full((lines.size, 1), UNREACHED)
    places[0, 0], status[0, 0] = begin.place, PLACED
    lay_start_line(
        surface, begin.side, tuple(direction), lines, 0, 0, True, 1, ACCURACY * edge_length,
        places, status,
    )  # fmt: skip
    end, before = places[-1, 0], places[-2, 0]
    if not np.isfinite(end).all():
        raise InputError(
            "has no place: the way to it from draping.seed leaves the surface; give place, or "
            "another seed",
            key=f"{key}.seed",
        )
    first, last = (
        np.array(unit_normal(surface, begin.side, tuple(point))) for point in (begin.place, end)
    )
    onward = end - before
    onward -= (onward @ last) * last
    onward /= np.linalg.norm(onward)
    cosine = begin.direction_1 @ direction
    sine = np.cross(direction, begin.direction_1) @ first
    return end, cosine * onward + sine * np.cross(last, onward)


# --- joints ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Joint:
    """The joint between two courses, node by node along the upper edge of the first.

    below, above : names of the courses. nominal : gap in the flat blank [m], negative where the
        strips overlap.
    nodes : numbers of the nodes in the mesh of all courses (n,).
    along : coordinate of the nodes along fibre 1 in the flat blank, from the seed of the first
        course [m] (n,). places : of the nodes [m] (n, 3).
    gap : to the edge of the other course [m] (n,), negative for an overlap; nan beyond its ends.
    """

    below: str
    above: str
    nominal: float
    nodes: np.ndarray
    along: np.ndarray
    places: np.ndarray
    gap: np.ndarray

    @property
    def extremes(self) -> tuple[float, float] | None:
        """Least and largest gap [m]; None where the edges are not beside each other."""
        known = self.gap[np.isfinite(self.gap)]
        return (float(known.min()), float(known.max())) if known.size else None

    def in_words(self) -> str:
        """Say how wide the joint is."""
        if self.extremes is None:
            return "the edges are not beside each other"
        flat = f"; {_from_to(self.nominal, self.nominal)} in the flat blank"
        return _from_to(*self.extremes) + flat


def _from_to(least: float, most: float) -> str:
    """Say gaps [m] in words, in mm; negative ones are overlaps."""
    low, high = round(1e3 * least, 2) + 0.0, round(1e3 * most, 2) + 0.0
    if low == high == 0.0:
        return "butt joint"
    if low < 0.0 < high:
        return f"overlap up to {-low:.2f} mm and gap up to {high:.2f} mm"
    what, first, last = ("gap", low, high) if high > 0.0 else ("overlap", -high, -low)
    first, last = sorted((first + 0.0, last + 0.0))
    if first == 0.0:
        return f"{what} up to {last:.2f} mm"
    if first == last:
        return f"{what} of {first:.2f} mm"
    return f"{what} of {first:.2f} to {last:.2f} mm"


def joints_of(courses: Sequence[LaidNet]) -> list[Joint]:
    """Return the joints between neighbouring courses of a ply, of which there may be none."""
    first = np.cumsum([0, *(net.mesh.node_count for net in courses)])
    return [
        _joint(below, above, int(number))
        for (below, above), number in zip(pairwise(courses), first, strict=False)
    ]


def _joint(below: LaidNet, above: LaidNet, first: int) -> Joint:
    """Return a joint; first : number of the first node of the lower course."""
    assert below.strip is not None and above.strip is not None
    upper, lower = _edge(below, below.strip[1]), _edge(above, above.strip[0])
    places = below.positions[upper]
    inside = mean_of_faces(below.mesh.elements, below.positions)[upper]
    gap = signed_distance(places, inside, above.positions[lower])
    return Joint(
        below.name,
        above.name,
        above.strip[0] - below.strip[1],
        first + upper,
        below.coordinates[upper, 0],
        places,
        gap,
    )


def _edge(net: LaidNet, at: float) -> np.ndarray:
    """Return the nodes on an edge of a strip, by growing coordinate along fibre 1."""
    across = net.mesh.fibre_direction_2[0]
    heights = net.mesh.node_positions @ across
    length = min(float(bars.min()) for bars in net.net_lengths)
    return edge_nodes(net.coordinates[:, 0], heights, at, ON_EDGE * length)
