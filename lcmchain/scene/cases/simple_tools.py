"""Cases whose tools have simple shapes: punch, drape, and the plates of coupon."""

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
    two_digits,
    wrapped_comment,
)
from lcmchain.scene.presets import Basis, PublishedFabric
from lcmchain.tools.shapes import shape_names
from lcmchain.tools.surfaces.reading import read_surface


def _listed_shapes(head: str) -> str:
    """Return a comment that names the shapes that tools may have."""
    names = [name for name in shape_names() if name != "surface_mesh"]
    others = "surface_mesh for an STL file or any mesh that meshio reads"
    return wrapped_comment(f"{head}: {', '.join(names)}, and {others}:")


# --- punch: a spherical punch presses a blank through a round hole, with or without holder --------


# Of the published hemisphere: 1.7 kg and 100 N s/m on 300 mm x 300 mm, an edge rounded by 10 mm at
# a punch of 75 mm; 2 mm between punch and hole with a fabric of 1 mm. Elements of 5 mm
# that are drawn over that edge move the forces by some percent only.
HOLDER_MASS_PER_AREA = 1.7 / 0.09  # [kg/m²]
HOLDER_DAMPING_PER_AREA = 100.0 / 0.09  # [N s/m³]
FILLET_PER_RADIUS = 10.0 / 75.0
EDGE_PER_FILLET = 0.5
GAP_PER_THICKNESS = 2.0
BLANK_PER_RADIUS = 4.0


@dataclass(frozen=True)
class Punch:
    """Dimensions of punch, die and holder [m, kg]; None takes those of the published hemisphere."""

    radius: float = 0.075
    stroke: float | None = None
    gap: float | None = None
    fillet_radius: float | None = None
    holder: bool = True
    holder_mass: float | None = None


def punch_scene(sheet: Sheet, punch: Punch, file: str) -> str:
    """Return the text of the scene.

    Raises
    ------
    InputError : the hole is as wide as the blank, or too narrow for punch and fabric.
    """
    size = sheet.size or (BLANK_PER_RADIUS * punch.radius,) * 2
    stroke = punch.stroke or punch.radius
    gap = punch.gap or GAP_PER_THICKNESS * round(1e3 * sheet.thickness, 1) * 1e-3
    fillet = punch.fillet_radius or FILLET_PER_RADIUS * punch.radius
    hole = punch.radius + gap
    if gap <= sheet.thickness:
        raise InputError(
            f"is {mm(gap)}, but the fabric between punch and hole is {mm(sheet.thickness)} thick",
            key="--gap",
        )
    if min(size) <= 2.0 * (hole + fillet):
        raise InputError(
            f"is {mm(min(size))}, but the hole with its rounded edge is {mm(2 * (hole + fillet))} "
            "wide: the blank would fall through",
            key="--blank-size",
        )
    area = size[0] * size[1]
    values = {
        "punch_radius": mm(punch.radius),
        "top": mm(sheet.thickness),
        "stroke": mm(stroke),
        "shapes": _listed_shapes("Shapes of tools"),
        "hole_radius": mm(hole),
        "fillet_radius": mm(fillet),
        "holder_mass": f"{punch.holder_mass or two_digits(HOLDER_MASS_PER_AREA * area):g} kg",
        "holder_damping": f"{two_digits(HOLDER_DAMPING_PER_AREA * area):g} N*s/m",
    }
    along = min(size) / ELEMENTS_ALONG_BLANK
    if punch.fillet_radius is None:  # one that is given may be too small for any mesh
        along = min(along, EDGE_PER_FILLET * fillet)
    text = sheet_text(
        sheet,
        Process(
            damping="50 1/s",
            damping_reason="Less leaves more vibrations. Assumed.",
            gravity=False,
            gravity_reason="It hardly matters beside a punch; true adds 9.81 m/s2 along -z.",
        ),
        case="punch",
        file=file,
        headline="Punch and die" + (" with blank holder" if punch.holder else ""),
        remarks="A punch with a spherical end presses the blank, which lies on a die with a round "
        "hole, down through this hole"
        + (" under the weight of a holder." if punch.holder else "; nothing holds the blank."),
        size=size,
        edge_length=sheet.edge_length or round_edge_length(along),
        height=0.5 * sheet.thickness,
        height_reason="half the thickness, so that the lower face lies on the die at z = 0.",
    )
    text += filled("punch", values)
    if punch.holder:
        # a process without a time fills in its own
        ramp = filled("ramp", {}) if sheet.time else ""
        text += filled("holder", values | {"ramp": ramp})
    return text + filled("more", {})


# --- drape: a blank falls over a fixed form under its own weight ----------------------------------


#: Shapes by their name on the command line, with what they are.
SHAPES = {
    "sphere": "Half a sphere on a cylinder, its pole at the origin, turned upwards.",
    "pillar": "Upright round pillar with a rounded edge, as in the drape test.",
    "ridge": "Lying cylinder along y.",
    "file": "Surface from a file, relative to this scene file; length_unit: of its coordinates.",
}
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
        "shapes": _listed_shapes("All shapes"),
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


# --- coupon: a fabric with all its values spelled out, between two plates -------------------------


SPECIMEN = 0.02  # side of the piece between the plates [m]
#: Thickness at the end over that of the unloaded fabric.
COMPACTED = 0.7


def coupon_scene(sheet: Sheet, file: str) -> str:
    """Return the text of the scene."""
    size = sheet.size or (SPECIMEN, SPECIMEN)
    text = sheet_text(
        sheet,
        Process(
            damping="0 1/s",
            damping_reason="None is needed between plates.",
            gravity=False,
            gravity_reason="true adds 9.81 m/s2 along -z.",
        ),
        case="coupon",
        file=file,
        headline=f"Coupons of {sheet.preset}",
        remarks="The fabric under test with all its values, to be replaced by those that "
        "`lcmchain identify` finds. The clamps of coupon tests are no part of a scene: the "
        "command `lcmchain coupon` takes material and element from this file and sets up the "
        f"rest: lcmchain coupon bias-extension --scene {file} (or picture-frame, compaction, "
        f"cantilever). Run as it is, the scene presses a piece of the fabric between two plates.",
        size=size,
        edge_length=sheet.edge_length or round_edge_length(0.25 * min(size)),
        height=0.5 * sheet.thickness,
        height_reason="half the thickness: the lower face lies on the lower plate at z = 0.",
        material=material_text(sheet.fabric),
    )
    values = {
        "top": mm(sheet.thickness),
        "stroke": mm((1.0 - COMPACTED) * sheet.thickness),
        "end": mm(COMPACTED * sheet.thickness),
    }
    return text + filled("plates", values) + filled("more", {})


_TABLES = {
    "": "",
    "membrane": "Stiffness in the plane, and of shear over the thickness. Shear: S12 = C12(|E12|) "
    "2 E12 with C12 = s0 + s1 |E12| + ... + s4 |E12|^4 (lcmchain identify shear).",
    "compaction": "Pressure between plates: S33 = c0 exp(c1 |E33|^c2) E33 (lcmchain identify "
    "compaction).",
    "bending": "Bending, independent of the membrane: stiffness per width is C t^3 / 12 (lcmchain "
    "identify bending). More entries: in_plane.",
}


def material_text(fabric: PublishedFabric) -> str:
    """Return the material table of a fabric with all values, and what each rests on."""
    lines = [
        wrapped_comment(
            f'The values of {fabric.name}, {fabric.description}. Laws: "fabric", '
            '"fabric-with-set" (a set remains of compaction), "isotropic", "orthotropic", '
            '"stiffness".'
        ),
        "[material]",
        'law = "fabric"',
        "# Name in reports.",
        f'name = "{fabric.name}"',
    ]
    table = ""
    for key, (value, basis) in fabric.values.items():
        *path, entry = key.split(".")
        if path and path[0] != table:
            table = path[0]
            lines += ["", wrapped_comment(_TABLES[table]), f"[material.{table}]"]
        lines += [_reason(basis), f"{entry} = {_toml(value)}"]
    return "\n".join(lines) + "\n"


def _reason(basis: Basis) -> str:
    return wrapped_comment(f"{basis.kind.capitalize()}: {basis.note}.")


def _toml(value: str | float) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
