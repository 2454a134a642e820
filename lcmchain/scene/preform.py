"""Scene tables of what fills: a preform not formed here, permeabilities with axes, a flow medium.

They stand here and not in the package that computes the flow, as those of the infiltration do.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lcmchain.mesh.places import Where
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Direction,
    Number,
    PermeabilityValue,
    PositiveLength,
    Range,
    wrong,
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
        default=None,
        description="Permeability through the thickness, which a film or a flow medium asks for.",
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


class FlowMedium(SceneModel):
    """A distribution layer on one face of the preform, in which resin runs ahead."""

    thickness: PositiveLength = Field(
        description="Thickness of the layer, which is none of the part's."
    )
    porosity: Annotated[float, Number(0.8, Range(0.0, 1.0, (0.0, 1.0)))] = Field(
        description="Share of the layer's volume that resin can fill."
    )
    permeability: OwnPermeability = Field(description="Permeability of the layer, with its axes.")
    over: Annotated[Where | None, AbsentMeans("")] = Field(
        default=None, description="Cells that it covers; without it the whole part."
    )

    @model_validator(mode="after")
    def _check_layer(self) -> Self:
        if self.over is not None:
            require_cells(self.over, "over")
        if self.permeability.k3 is not None:
            raise wrong(
                "has no meaning: the layer does not hold resin back through its thickness; k3 of "
                "the preform counts",
                field="permeability.k3",
            )
        return self

    @property
    def in_words(self) -> str:
        """Thickness, permeability and place, for the check of a scene."""
        where = "the whole part" if self.over is None else self.over.in_words
        return f"{1e3 * self.thickness:.3g} mm of {self.permeability.k1:.3g} m² on {where}"


def require_cells(where: Where, field: str | None = None) -> None:
    """Refuse a place of which it is not clear which cells it takes.

    field : of the table that the place stands in, None where it is the table.
    """
    if where.rim or where.loop is not None or where.boundary is not None:
        raise wrong("takes cells: name a set, a box or a point with its radius", field=field)
    if where.point is not None and where.radius is None:
        raise wrong(
            "needs the radius around the point within which cells lie",
            field="radius" if field is None else f"{field}.radius",
        )
