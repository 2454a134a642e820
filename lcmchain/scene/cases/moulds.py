"""Case "moulds": two matched moulds from files close on a blank."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.scene.cases.closing import Closing, close_moulds
from lcmchain.scene.cases.sheet import (
    ELEMENTS_ALONG_BLANK,
    Process,
    Sheet,
    round_edge_length,
    sheet_text,
)
from lcmchain.scene.cases.template import filled, mm, quoted, wrapped_comment
from lcmchain.tools.surfaces.reading import read_surface
from lcmchain.tools.surfaces.surface import Surface

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
