"""Scene tables of a preform that was not formed here, and of permeabilities with axes of their own.

They stand here and not in the package that computes the flow, as those of the infiltration do.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Direction,
    Number,
    PermeabilityValue,
    PositiveLength,
    Range,
)
from lcmchain.quantities.scene_model import SceneModel


class OwnPermeability(SceneModel):
    """Permeability of a textile as it lies there, along axes of its own."""

    k1: PermeabilityValue = Field(description="Permeability along the axis.")
    ratio: Annotated[float, Number(1.0, POSITIVE)] = Field(
        default=1.0,
        description="Permeability across the axis, in the plane of the cell, over that along it.",
    )
    axis: Direction = Field(
        default=(1.0, 0.0, 0.0),
        description="Direction in space of k1; it is laid into every cell along its normal.",
    )
    k3: Annotated[PermeabilityValue | None, AbsentMeans("as it was")] = Field(
        default=None, description="Permeability through the thickness, which a film asks for."
    )


class Preform(SceneModel):
    """A preform on a mesh that was not formed here: the same everywhere but in [[regions]]."""

    thickness: PositiveLength = Field(description="Thickness.")
    fibre_volume_fraction: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0, 1.0)))] = Field(
        description="Share of the fibres in the volume; one less the porosity."
    )
    permeability: OwnPermeability = Field(description="Permeability, with its axes.")
    sets_hold: Literal["nodes or cells", "cells"] = Field(
        default="nodes or cells",
        description="What the sets of a Nastran deck list, which does not say it: a place that "
        "takes nodes then takes those of the cells.",
    )
