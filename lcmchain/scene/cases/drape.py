"""Case "drape": a blank falls over a fixed form under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.scene.cases.moulds import (
    CLEARANCE,
    heights_over,
    position_text,
    relative_name,
    size_within,
)
from lcmchain.scene.cases.sheet import (
    ELEMENTS_ALONG_BLANK,
    Process,
    Sheet,
    filled,
    mm,
    quoted,
    round_edge_length,
    sheet_text,
)
from lcmchain.tools.surfaces.reading import read_surface

#: Shapes by their name on the command line, with what they are.
SHAPES = {
    "sphere": "Half a sphere on a cylinder, its pole at the origin, turned upwards.",
    "pillar": "Upright round pillar with a rounded edge, as in the drape test.",
    "ridge": "Lying cylinder along y.",
    "file": "Surface from a file, relative to this scene file; length_unit: of its coordinates.",
}
BLANK_PER_RADIUS = 4.0
# Long enough for a sheet of decimetres to come to rest: the fall of a heavy sheet is nearly free.
TIME = 1.0  # [s]


@dataclass(frozen=True)
class Form:
    """Form under the blank: one of SHAPES, its radius [m], or a file and the unit in it."""

    shape: str = "sphere"
    radius: float = 0.075
    file: Path | None = None
    length_unit: str = "mm"


def drape_scene(sheet: Sheet, form: Form, scene_file: Path) -> str:
    """Return the text of the scene.

    Raises
    ------
    InputError : a shape that is not known, or a file that is no surface.
    """
    if form.shape not in SHAPES:
        raise InputError(f'"{form.shape}" must be one of {", ".join(SHAPES)}', key="--shape")
    size = sheet.size or (BLANK_PER_RADIUS * form.radius,) * 2
    if form.file is None:
        shape, position, reason, axis = _made(form)
    else:
        shape, position, reason, size = _from_file(form, sheet, scene_file)
        axis = "[0, 0, 1]"
    text = sheet_text(
        sheet,
        Process(
            damping="20 1/s",
            damping_reason="It brings the falling sheet to rest (assumed).",
            gravity=True,
            gravity_reason="It is the only load here: 9.81 m/s2 along -z.",
            time=TIME,
        ),
        case="drape",
        file=scene_file.name,
        headline="Gravity drape",
        remarks="A blank lies on a fixed form and falls over it under its own weight. What shape "
        "it takes at rest is a matter of its bending stiffness. What it loses on its way there is "
        "taken by damping, and `run` says so.",
        size=size,
        edge_length=sheet.edge_length or round_edge_length(min(size) / ELEMENTS_ALONG_BLANK),
        height=0.5 * sheet.thickness,
        height_reason="half the thickness: the lower face is at z = 0, above the form.",
    )
    values = {
        "shape": shape,
        "shape_reason": SHAPES["file" if form.file else form.shape],
        "position": position,
        "position_reason": reason,
        "axis": axis,
    }
    return text + filled("drape", values) + filled("more", {})


def _made(form: Form) -> tuple[str, str, str, str]:
    """Return shape, position, its reason, and axis of a form of the program's own."""
    radius = mm(form.radius)
    if form.shape == "sphere":
        shape = f'{{ type = "sphere_capped_punch", radius = "{radius}" }}'
        return shape, "0 0 0 mm", "its pole touches the lower face of the blank.", "[0, 0, -1]"
    if form.shape == "pillar":
        edge, length = mm(0.1 * form.radius), mm(4.0 * form.radius)
        shape = (
            f'{{ type = "cylinder", radius = "{radius}", edge_radius = "{edge}", '
            f'length = "{length}" }}'
        )
        place = f"0 0 {-4e3 * form.radius:g} mm"
        return shape, place, "its upper end touches the lower face of the blank.", "[0, 0, 1]"
    shape = f'{{ type = "cylinder", radius = "{radius}" }}'
    place = f"0 0 {-1e3 * form.radius:g} mm"
    return shape, place, "its top touches the lower face of the blank.", "[0, 1, 0]"


def _from_file(
    form: Form, sheet: Sheet, scene_file: Path
) -> tuple[str, str, str, tuple[float, float]]:
    """Return shape, position, its reason, and size of the blank for a form from a file."""
    assert form.file is not None
    surface = read_surface(form.file, form.length_unit)
    corners = surface.points[surface.triangles][..., :2]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    centre = 0.5 * (low + high)
    size = sheet.size or size_within(low, high, sheet.thickness)
    half = 0.5 * np.array(size)
    top = float(heights_over(surface, centre - half, centre + half).max())
    shape = (
        f'{{ type = "surface_mesh", file = {quoted(relative_name(form.file, scene_file))}, '
        f'length_unit = "{form.length_unit}" }}'
    )
    position = position_text(-float(centre[0]), -float(centre[1]), -top - CLEARANCE)
    reason = f"its highest point lies {mm(CLEARANCE)} under the blank."
    return shape, position, reason, size
