"""Case "moulds": two matched moulds from files close on a blank.

The upper mould comes down along -z until the smallest distance between the surfaces is the wanted
gap. A step down by s shortens no distance by more than s, so that a step by what the distance is
too large never is too long; where moulds meet first is thus found from above.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from lcmchain.errors import InputError
from lcmchain.scene.cases.sheet import (
    ELEMENTS_ALONG_BLANK,
    Process,
    Sheet,
    filled,
    mm,
    quoted,
    round_edge_length,
    sheet_text,
    wrapped_comment,
)
from lcmchain.tools.surfaces.reading import read_surface
from lcmchain.tools.surfaces.surface import Surface
from lcmchain.tools.surfaces.triangle_distance import TriangleTree, closest_places, triangle_tree

# --- how they close, from their surfaces alone ----------------------------------------------------


# Points of the upper mould are this far apart: in parts of the gap, or so far that there are at
# most about so many.
POINTS_PER_GAP = 2.0
MOST_POINTS = 100_000
CLOSE_ENOUGH = 1e-3  # of the gap
CHUNK = 10_000  # points that are looked at together


@dataclass(frozen=True)
class Closing:
    """How far the upper mould of two is from being closed.

    Parameters
    ----------
    lift : z [m] by which the upper mould as it stands in its file has to be moved up to be closed;
        negative where it has to come down.
    place : point [m] of the upper mould, closed, where the gap is smallest.
    slope : angle [rad] between the lower mould's surface there and the horizontal.
    """

    lift: float
    place: np.ndarray
    slope: float


class _Distance:
    """Smallest distance between the upper mould, lifted, and the lower one.

    Every point keeps a lower bound of its distance, which a move by s shortens by s: only points
    that may be the nearest are looked at.
    """

    def __init__(self, points: np.ndarray, tree: TriangleTree) -> None:
        self.points, self.tree = points, tree
        self.lift = 0.0
        self.bounds = np.zeros(len(points))
        self.point, self.triangle = 0, 0

    def at(self, lift: float) -> float:
        """Return the smallest distance [m] of the mould that is lifted by z [m]."""
        self.bounds -= abs(lift - self.lift)
        self.lift = lift
        smallest = math.inf
        order = np.argsort(self.bounds, kind="stable")
        for some in np.array_split(order, math.ceil(len(order) / CHUNK)):
            if self.bounds[some[0]] > smallest:
                break
            found = closest_places(self.tree, self.points[some] + [0.0, 0.0, lift])
            self.bounds[some] = found.distance
            first = int(np.argmin(found.distance))
            if found.distance[first] < smallest:
                smallest = float(found.distance[first])
                self.point, self.triangle = int(some[first]), int(found.triangle[first])
        return smallest


def close_moulds(upper: Surface, lower: Surface, gap: float) -> Closing:
    """Find where the upper mould, coming down along -z, is as near to the lower one as the gap.

    Parameters
    ----------
    upper, lower : the moulds as they stand in their files; normals do not matter.
    gap : smallest distance of the closed moulds [m].

    Raises
    ------
    InputError : the moulds pass each other without coming so near.
    """
    corners = lower.points[lower.triangles]
    points = _points_of(upper, gap)
    distance = _Distance(points, triangle_tree(corners))
    lift = float(corners[..., 2].max() - points[:, 2].min()) + gap
    lowest = float(corners[..., 2].min() - points[:, 2].max()) - gap
    left = distance.at(lift) - gap
    while left > CLOSE_ENOUGH * gap:
        # Two skins are nearer than the gap over twice the gap at least: this jumps over no contact.
        bold = lift - left - 1.5 * gap
        if bold < lowest:
            raise InputError(
                f"passes the lower mould without coming nearer than {1e3 * (left + gap):.3g} mm; "
                "name two moulds that face each other along z, in the same coordinates",
                file=upper.file,
            )
        safe, lift = lift, bold
        left = distance.at(lift) - gap
        if left < 0.0:
            xtol = CLOSE_ENOUGH * gap
            lift = float(brentq(lambda z: distance.at(z) - gap, bold, safe, xtol=xtol))
            break
    distance.at(lift)
    a, b, c = corners[distance.triangle]
    normal = np.cross(b - a, c - a)
    slope = math.acos(min(1.0, abs(normal[2]) / float(np.linalg.norm(normal))))
    return Closing(lift, points[distance.point] + [0.0, 0.0, lift], slope)


def _points_of(surface: Surface, gap: float) -> np.ndarray:
    """Return points (n, 3) of a surface, near to each other against the gap."""
    a, b, c = np.moveaxis(surface.points[surface.triangles], 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    # triangles are halves of squares whose sides are about half as long as the longest edge
    longest = max(gap / POINTS_PER_GAP, math.sqrt(8.0 * area / MOST_POINTS))
    waiting = surface.points[surface.triangles]
    centres = []
    while len(waiting):
        edges = np.linalg.norm(np.roll(waiting, -1, axis=1) - waiting, axis=2)
        is_long = edges.max(axis=1) > longest
        centres.append(waiting[~is_long].mean(axis=1))
        waiting, edges = waiting[is_long], edges[is_long]
        # halved at the longest edge, turned to be that from corner 0 to corner 1
        order = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(waiting, order[..., None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        waiting = np.concatenate((np.stack((a, middle, c), 1), np.stack((middle, b, c), 1)))
    return np.concatenate((*centres, surface.points[np.unique(surface.triangles)]))


# --- the scene ------------------------------------------------------------------------------------


#: Between the faces of the blank and moulds at the start: they are known from facets and a grid.
CLEARANCE = 0.1e-3  # [m]
#: Between the edges of blank and mould, in thicknesses.
RIM_PER_THICKNESS = 2.0
# Steeper than this, a wall keeps moulds open that are only shifted against each other.
STEEP = math.radians(70.0)


@dataclass(frozen=True)
class Moulds:
    """Files of two moulds, the unit of their coordinates, and the gap [m] of the closed moulds.

    None takes the thickness of the fabric as the gap.
    """

    upper: Path
    lower: Path
    length_unit: str
    gap: float | None = None


@dataclass(frozen=True)
class Placing:
    """Where blank and moulds are at the start [m].

    size, height : of the blank; shift : of both moulds in x and y, to have the blank at the origin.
    start, stroke : z by which the upper mould is moved at the start, and its travel.
    """

    size: tuple[float, float]
    height: float
    shift: tuple[float, float]
    start: float
    stroke: float
    closing: Closing


def place_moulds(sheet: Sheet, upper: Surface, lower: Surface, gap: float) -> Placing:
    """Find positions in which the scene can start, and the stroke that closes the moulds.

    Raises
    ------
    InputError : the moulds do not face each other.
    """
    closing = close_moulds(upper, lower, gap)
    low, high = _common_rectangle(upper, lower)
    centre = 0.5 * (low + high)
    size = sheet.size or size_within(low, high, sheet.thickness)
    half = 0.5 * np.array(size)
    lower_top = heights_over(lower, centre - half, centre + half).max()
    upper_bottom = heights_over(upper, centre - half, centre + half).min()
    bottom = round(float(lower_top) + CLEARANCE, 6)
    start = round(bottom + sheet.thickness + CLEARANCE - float(upper_bottom), 6)
    shift = -np.round(centre, 6) + 0.0
    return Placing(
        size=size,
        height=bottom + 0.5 * sheet.thickness,
        shift=(float(shift[0]), float(shift[1])),
        start=start,
        stroke=start - round(closing.lift, 6),
        closing=closing,
    )


def moulds_scene(sheet: Sheet, moulds: Moulds, scene_file: Path) -> tuple[str, list[str]]:
    """Return the text of the scene, and what a user should know of the moulds.

    Raises
    ------
    InputError : a file that is no surface, or moulds that do not face each other.
    """
    gap = moulds.gap or sheet.thickness
    upper, lower = (read_surface(f, moulds.length_unit) for f in (moulds.upper, moulds.lower))
    placing = place_moulds(sheet, upper, lower, gap)
    x, y, z = (round(1e3 * value, 2) + 0.0 for value in placing.closing.place)
    slope = math.degrees(placing.closing.slope)
    closed = f"{mm(gap)} at ({x:g}, {y:g}, {z:g}) mm in the coordinates of the lower file"
    shift_x, shift_y = placing.shift
    values = {
        "lower_file": quoted(relative_name(moulds.lower, scene_file)),
        "upper_file": quoted(relative_name(moulds.upper, scene_file)),
        "unit": moulds.length_unit,
        "lower_position": position_text(shift_x, shift_y, 0.0),
        "upper_position": position_text(shift_x, shift_y, placing.start),
        "stroke": mm(placing.stroke),
        "gap": mm(gap),
        "closed": wrapped_comment(
            f"Closed, the smallest gap is {closed}, where the lower mould slopes by "
            f"{slope:.0f} deg."
        ),
    }
    least = min(placing.size)
    text = sheet_text(
        sheet,
        Process(
            damping="50 1/s",
            damping_reason="Less leaves more vibrations. Assumed.",
            gravity=False,
            gravity_reason="It hardly matters between moulds; true adds 9.81 m/s2 along -z.",
        ),
        case="moulds",
        file=scene_file.name,
        headline="Matched moulds",
        remarks=f"The upper mould closes along -z on a blank that lies on the lower one, until the "
        f"gap is {mm(gap)}. Blank, positions and stroke are computed from the two files.",
        size=placing.size,
        edge_length=sheet.edge_length or round_edge_length(least / ELEMENTS_ALONG_BLANK),
        height=placing.height,
        height_reason=f"half the thickness and {mm(CLEARANCE)} above the lower mould.",
    )
    notes = [f"Closed after {mm(placing.stroke)}: the smallest gap is {closed}"]
    if placing.closing.slope > STEEP:
        notes.append(
            f"The moulds meet first at a wall of {slope:.0f} deg and stay open elsewhere: their "
            f"walls are nearer than {mm(gap)}; offset one mould by the thickness, or give a "
            "smaller --gap"
        )
    return text + filled("moulds", values) + filled("more", {}), notes


def _common_rectangle(upper: Surface, lower: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (x, y) of the rectangle over which both moulds stand."""
    used = [surface.points[np.unique(surface.triangles), :2] for surface in (upper, lower)]
    low = np.maximum(*(points.min(axis=0) for points in used))
    high = np.minimum(*(points.max(axis=0) for points in used))
    if (high <= low).any():
        raise InputError(
            "does not stand above the lower mould; name two moulds in the same coordinates",
            file=upper.file,
        )
    return low, high


def size_within(low: np.ndarray, high: np.ndarray, thickness: float) -> tuple[float, float]:
    """Return the sides [m], in whole millimetres, of a blank within a rectangle (x, y).

    It stays off the rim: a surface from a file may be a skin, whose back a sheet that sags over its
    edge would meet.
    """
    sides = np.floor(1e3 * (high - low - 2.0 * RIM_PER_THICKNESS * thickness) + 1e-6) / 1e3
    return float(sides[0]), float(sides[1])


def heights_over(surface: Surface, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return z of all triangles that may lie over a rectangle, at their corners."""
    corners = surface.points[surface.triangles]
    plane = corners[..., :2]
    over = ((plane.max(axis=1) >= low) & (plane.min(axis=1) <= high)).all(axis=1)
    return corners[over, :, 2]


def position_text(x: float, y: float, z: float) -> str:
    return " ".join(f"{round(1e3 * value, 3) + 0.0:g}" for value in (x, y, z)) + " mm"


def relative_name(file: Path, scene_file: Path) -> str:
    """Name a file as seen from the folder of the scene."""
    try:
        return Path(os.path.relpath(file.resolve(), scene_file.resolve().parent)).as_posix()
    except ValueError:  # on another drive
        return file.resolve().as_posix()
