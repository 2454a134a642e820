"""Scene tables of what comes of a scene: files of a run, meshes that receive its fields, a unit.

The meshes stand here and not in the package that maps: that package is built on the core, which
holds the scene and never imports what is built on it.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    AbsentMeans,
    Direction,
    FileName,
    LengthUnit,
    Name,
    Number,
    Position,
    PositiveLength,
    PositiveTime,
    Row,
    SceneModel,
    Switch,
    Text,
    wrong,
)
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.structure import Structure

#: Name of the files of an infiltration of the formed sheet itself.
SHEET_NAME = "sheet"

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
        description="Longest wave that counts as a wrinkle: wrinkle_height is measured from a "
        "sheet smoothed over such waves.",
    )
    wrinkle_risk: Switch = Field(
        default=False,
        description="Tell where a coarse mesh may hide wrinkles: compressed fibres, nearness of "
        "locking, waves of too few elements.",
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


# --- meshes that receive the fields ---------------------------------------------------------------


class MappingTarget(SceneModel):
    """A mesh that receives thickness, fibre volume fraction and fibre directions."""

    name: Annotated[str, Name("infiltration")] = Field(
        description="Name of the target and of its files."
    )
    mesh: Annotated[str, FileName("infiltration.vtu")] = Field(
        description="Mesh file, relative to the scene file."
    )
    kind: Literal["infiltration", "structure"] = Field(
        description="Surface cells for infiltration, solids (else shells) for structure."
    )
    method: Literal["overlap", "closest"] = Field(
        default="overlap",
        description="Weights from the overlap of cells and sheet, or of the closest place.",
    )
    order: Literal[1, 2] = Field(
        default=2, description="Fields within a face of the sheet: 1 constant, 2 linear."
    )
    maximum_distance: Annotated[
        PositiveLength | None, AbsentMeans("one edge length of the sheet")
    ] = Field(default=None, description="Farthest distance over which a value is taken.")
    length_unit: Annotated[str, LengthUnit()] = Field(
        default="m", description="Unit of the coordinates in the file."
    )
    thickness_limit: Annotated[float, Number(0.1, NOT_NEGATIVE)] = Field(
        default=0.1,
        description="Largest relative difference of a solid's thickness from the formed one.",
    )
    all_frames: Switch = Field(
        default=False,
        description="Carry the mesh along with the material and map every saved state.",
    )
    # Not "register", which every class of pydantic has as a method.
    registration: Switch = Field(
        default=False, description="Bring the mesh to the sheet by a small rigid motion."
    )
    nodes: Switch = Field(default=False, description="Write values at the nodes of the mesh too.")
    verify: Switch = Field(
        default=False, description="Estimate the error that the mapping adds to every field."
    )
    structure: Annotated[Structure | None, AbsentMeans("none")] = Field(
        default=None,
        description="Structural analysis on this mesh, from the mapped fields; kind = "
        '"structure" only.',
    )

    infiltration: Annotated[Infiltration | None, AbsentMeans("none")] = Field(
        default=None,
        description="Infiltration of this mesh, from the mapped fields; kind = "
        '"infiltration" only.',
    )

    @model_validator(mode="after")
    def _check_stages(self) -> Self:
        for stage in ("structure", "infiltration"):
            if getattr(self, stage) is not None and self.kind != stage:
                raise wrong(f'needs kind = "{stage}", but kind is "{self.kind}"', field=stage)
        return self

    def options(self) -> dict[str, Any]:
        """Return how to map, by the names of ``lcmchain.mapping.MappingOptions``."""
        same = self.model_dump(
            exclude={"name", "mesh", "registration", "structure", "infiltration"}
        )
        return {**same, "register": self.registration}


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
        description="Entries of one number that a master may set before initialization, beside "
        "contact.friction.",
    )
