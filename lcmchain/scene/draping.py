"""Scene table of kinematic draping."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    AcuteAngle,
    Angle,
    LengthOrZero,
    Name,
    PointInPlane,
    Position,
    Quantity,
    Range,
    Row,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel
from lcmchain.quantities.units import ANGLE

#: Shear angle at which the bars of a net count as lying on each other [rad].
FOLDED = math.radians(89.0)

PreShear = Annotated[
    float,
    Quantity(ANGLE, Range(-FOLDED, FOLDED, (-FOLDED, FOLDED), "lie between -89 and 89 deg")),
]
StartLine = Annotated[
    tuple[Position, ...],
    Row(
        '[["-50 mm", "0 mm", "0 mm"], ["0 mm", "5 mm", "0 mm"], ["50 mm", "0 mm", "0 mm"]]',
        minimum_count=2,
        entries="points",
        units=False,
    ),
]


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
    pre_shear: PreShear = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Shear angle that the net begins with: fibre 2 lies 90 deg less this one from "
        "fibre 1 at the seed.",
    )
    start_line: Annotated[StartLine | None, AbsentMeans("a geodesic from the seed")] = Field(
        default=None,
        description="Points [x, y, z] of a curve that the line along fibre 1 through the seed "
        "follows, in the direction of fibre 1; each the nearest point of the surface.",
    )
    edge_radius: Annotated[
        LengthOrZero | None,
        AbsentMeans("fillet_radius of the tools and half the thickness, else blank.edge_length"),
    ] = Field(default=None, description="Radius between the tool and the plane of the blank.")
    locking_angle: Annotated[
        AcuteAngle | None, AbsentMeans("material.membrane.locking_angle, else 60 deg")
    ] = Field(default=None, description="Shear angle above which the report counts the net as "
              "locked.")  # fmt: skip

    @model_validator(mode="after")
    def _check_start(self) -> Self:
        if self.start_line is not None and self.angle != 0.0:
            raise wrong(
                "turns the net, whose direction start_line gives; leave one of them out",
                field="angle",
            )
        return self
