"""Scene table of kinematic draping."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    AcuteAngle,
    Angle,
    LengthOrZero,
    Name,
    PointInPlane,
    Position,
)
from lcmchain.quantities.scene_model import SceneModel


class Draping(SceneModel):
    """How the pin-jointed net is laid, for element = "kinematic" and the preview of check."""

    surface: Annotated[
        Annotated[str, Name("punch")] | None,
        AbsentMeans("the tool of the largest stroke at its end, and the plane of the blank"),
    ] = Field(default=None, description="Tool that the whole sheet ends on.")
    seed: Annotated[
        PointInPlane | None, AbsentMeans("where the tool of the largest stroke touches it first")
    ] = Field(default=None, description="Point [x, y] of the flat blank where the net begins.")
    place: Annotated[
        Position | None, AbsentMeans("from the seed along the stroke to the surface")
    ] = Field(default=None, description="Place of the seed; the nearest point of the surface.")
    angle: Angle = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Turn of the net about the surface normal at the seed, from the direction of "
        "fibre 1 in the flat blank.",
    )
    edge_radius: Annotated[
        LengthOrZero | None,
        AbsentMeans("fillet_radius of the tools and half the thickness, else blank.edge_length"),
    ] = Field(default=None, description="Radius between the tool and the plane of the blank.")
    locking_angle: Annotated[
        AcuteAngle | None, AbsentMeans("material.membrane.locking_angle, else 60 deg")
    ] = Field(default=None, description="Shear angle above which the report counts the net as "
              "locked.")  # fmt: skip
