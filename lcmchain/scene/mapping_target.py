"""Scene table of the meshes that receive the fields.

It stands here and not in the package that maps: that package is built on the core, which holds the
scene and never imports what is built on it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    AbsentMeans,
    FileName,
    LengthUnit,
    Name,
    Number,
    PositiveLength,
    Switch,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.structure import Structure


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
