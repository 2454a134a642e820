"""Scene table of kinematic draping."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    AcuteAngle,
    Angle,
    Length,
    LengthOrZero,
    Name,
    PointInPlane,
    Position,
    Quantity,
    Range,
    Row,
    SceneModel,
    wrong,
)
from lcmchain.quantities.units import ANGLE

if TYPE_CHECKING:
    from lcmchain.scene.stack import Stack

#: Shear angle at which the bars of a net count as lying on each other [rad].
FOLDED = math.radians(89.0)

#: Most courses of a ply.
MOST_COURSES = 200
#: Distance of two edges that are one but for rounding [m].
SAME_EDGE = 1e-12

PreShear = Annotated[
    float,
    Quantity(ANGLE, Range(-FOLDED, FOLDED, (-FOLDED, FOLDED), "be above -89 and below 89 deg")),
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


class Course(SceneModel):
    """One course of a ply that is laid in strips: a strip of the flat blank with its own net."""

    name: Annotated[str, Name("left")] = Field(description="Name in tables, files and messages.")
    strip: Annotated[
        tuple[Length, Length], Row('["-50 mm", "0 mm"]', count=2, entries="lengths")
    ] = Field(
        description="Its edges in the flat blank: distances from the origin along fibre 2. An "
        "edge that two courses share is a butt joint; strips that share more "
        "overlap."
    )
    seed: Annotated[
        PointInPlane | None, AbsentMeans("beside draping.seed, in the middle of the strip")
    ] = Field(default=None, description="Point [x, y] of the flat blank where its net begins.")
    place: Annotated[
        Position | None, AbsentMeans("where the geodesic from the place of draping.seed ends")
    ] = Field(default=None, description="Place of its seed; the nearest point of the surface.")
    angle: Angle = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Further turn of its net about the surface normal at its seed.",
    )
    pre_shear: Annotated[PreShear | None, AbsentMeans("draping.pre_shear")] = Field(
        default=None, description="Shear angle that its net begins with."
    )
    start_line: Annotated[StartLine | None, AbsentMeans("a geodesic from its seed")] = Field(
        default=None,
        description="Points [x, y, z] of a curve that its line along fibre 1 through the seed "
        "follows.",
    )

    @model_validator(mode="after")
    def _check_entries(self) -> Self:
        low, high = self.strip
        if high <= low:
            raise wrong(
                "must end at a larger distance than it begins, as in "
                '["-50 mm", "0 mm"]', field="strip",
            )  # fmt: skip
        _refuse_two_directions(self)
        return self


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
        description="Turn of the net about the surface normal at the seed, from fibre 1 in the "
        "flat blank.",
    )
    pre_shear: PreShear = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Shear angle of the net at the seed: fibre 2 lies 90 deg less this one from "
        "fibre 1.",
    )
    start_line: Annotated[StartLine | None, AbsentMeans("a geodesic from the seed")] = Field(
        default=None,
        description="Points [x, y, z], each moved to the surface, of a curve that the line along "
        "fibre 1 through the seed follows.",
    )
    edge_radius: Annotated[
        LengthOrZero | None,
        AbsentMeans("fillet_radius of the tools and half the thickness, else blank.edge_length"),
    ] = Field(default=None, description="Radius between the tool and the plane of the blank.")
    locking_angle: Annotated[
        AcuteAngle | None, AbsentMeans("material.membrane.locking_angle, else 60 deg")
    ] = Field(default=None, description="Shear angle above which the report counts the net as "
              "locked.")  # fmt: skip

    courses: Annotated[
        tuple[Course, ...],
        Row(
            "[[draping.courses]] ... for each course",
            entries="tables",
            units=False,
            maximum_count=MOST_COURSES,
        ),
        AbsentMeans("one piece"),
    ] = Field(
        default=(),
        description="Courses of the ply, each with its own net, from the lowest strip across "
        "fibre 1 to the highest.",
    )

    @model_validator(mode="after")
    def _check_entries(self) -> Self:
        _refuse_two_directions(self)
        if self.courses and self.start_line is not None:
            raise wrong(
                "is the line of one net, but there are several courses; give each course its own",
                field="start_line",
            )
        names = [course.name for course in self.courses]
        for number, course in enumerate(self.courses):
            if course.name in names[:number]:
                raise wrong(
                    f'is the name of another course too: "{course.name}"',
                    field=f"courses[{number}].name",
                )
        for number, (below, above) in enumerate(pairwise(self.courses), start=1):
            field = f"courses[{number}].strip"
            if above.strip[0] <= below.strip[0] or above.strip[1] <= below.strip[1]:
                raise wrong(
                    f'does not lie beyond that of "{below.name}"; write the courses from the '
                    "lowest strip to the highest",
                    field=field,
                )
            gap = above.strip[0] - below.strip[1]
            if gap > SAME_EDGE:
                raise wrong(
                    f'begins {1e3 * gap:.4g} mm beyond the end of "{below.name}": there is no '
                    "fabric between; let them share an edge, or overlap",
                    field=field,
                )
        return self


def courses_to_lay(draping: Draping, stack: Stack) -> tuple[Course, ...]:
    """Return the courses of the net of a scene; none for a ply of one piece, or a stack.

    They are those of ``[draping]``, else those that the ply is laid in, each with defaults.
    """
    if draping.courses or len(stack) > 1:
        return draping.courses
    return tuple(
        Course.model_construct(
            name=name, strip=strip, seed=None, place=None, angle=0.0, pre_shear=None,
            start_line=None,
        )
        for name, strip in stack[0].strips.items()
    )  # fmt: skip


def _refuse_two_directions(entries: Draping | Course) -> None:
    if entries.start_line is not None and entries.angle != 0.0:
        raise wrong(
            "turns the net, whose direction start_line gives; leave one of them out", field="angle"
        )
