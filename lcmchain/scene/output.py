"""Scene tables of what comes of a scene: files of a run, and its functional mock-up unit."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Direction,
    Name,
    Position,
    PositiveLength,
    PositiveTime,
    Row,
    Switch,
    Text,
)
from lcmchain.quantities.scene_model import SceneModel

#: Samples of the histories over the process where ``history_interval`` is not given.
DEFAULT_SAMPLES = 200
MOST_SAMPLES = 100_000

#: Value of ``animation`` without a film.
NO_FILM: Final = "none"


class Section(SceneModel):
    """A plane that ``sections.png`` cuts sheet and tools with."""

    name: Annotated[str, Name("middle")] = Field(description="Name above the section.")
    point: Position = Field(  # type: ignore[assignment]
        default=("0 mm", "0 mm", "0 mm"), description="Point of the plane."
    )
    normal: Direction = Field(description="Normal of the plane.")


class Output(SceneModel):
    """Which files a run writes beside its netCDF file and summary, and how fine its histories."""

    pictures: Switch = Field(default=True, description="Draw fields, forces and energies.")
    vtu: Switch = Field(
        default=True, description="Write the last frame and the time series for ParaView."
    )
    report: Switch = Field(
        default=True, description="Write report.html, with verdicts, curves and a 3D view."
    )
    history_interval: Annotated[
        PositiveTime | None, AbsentMeans(f"process.time / {DEFAULT_SAMPLES}")
    ] = Field(
        default=None,
        description="Time between two samples of forces, energies and travel; forces are means "
        "over it.",
    )
    wrinkle_length: Annotated[
        PositiveLength | None, AbsentMeans("8 edges, and at least 40 thicknesses")
    ] = Field(
        default=None,
        description="Longest wave that counts as a wrinkle: wrinkle_height is the deviation from a "
        "sheet smoothed over such waves.",
    )
    wrinkle_risk: Switch = Field(
        default=False,
        description="Tell where wrinkles are to be expected that a coarse mesh hides: compressed "
        "fibres, nearness of locking, waves of too few elements.",
    )
    sections: Annotated[
        tuple[Section, ...],
        Row("[[output.sections]] ... for each plane", entries="tables", units=False),
    ] = Field(
        default=(),
        description="Planes of sections.png; without any, two through the middle of the blank "
        "along its fibres.",
    )
    animation: Literal["none", "gif", "mp4"] = Field(
        default=NO_FILM, description="Film of the forming; mp4 needs lcmchain[video]."
    )
    animation_field: Literal[
        "shear_angle", "thickness", "fibre_volume_fraction", "wrinkle_height"
    ] = Field(default="shear_angle", description="Field that colours the sheet in the film.")


# --- functional mock-up unit ----------------------------------------------------------------------


MOST_PARAMETERS = 100


class Unit(SceneModel):
    """What a master may set in the functional mock-up unit of the scene."""

    parameters: Annotated[
        tuple[Annotated[str, Text("tools.holder.motion.mass")], ...],
        Row(
            '["tools.holder.motion.mass"]',
            entries="keys",
            units=False,
            maximum_count=MOST_PARAMETERS,
        ),
    ] = Field(
        default=(),
        description="Entries with one number that a master may set before initialization; "
        "contact.friction always is one.",
    )
