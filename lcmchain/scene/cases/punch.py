"""Case "punch": a spherical punch presses a blank through a round hole, with or without holder."""

from __future__ import annotations

from dataclasses import dataclass

from lcmchain.errors import InputError
from lcmchain.scene.cases.sheet import (
    ELEMENTS_ALONG_BLANK,
    Process,
    Sheet,
    filled,
    mm,
    round_edge_length,
    sheet_text,
    two_digits,
)

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
