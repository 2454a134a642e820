"""Scene tables of what presses on a part while resin flows: a bag, tools at a gap, a press.

They stand here and not in the package that computes it, which is built on the core.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Direction,
    Force,
    Number,
    PositiveLength,
    PositiveTime,
    Pressure,
    Row,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel
from lcmchain.scene.over_time import Times, as_row, require_times


class _Closure(SceneModel):
    """What presses, and how it is coupled with the resin."""

    window: Annotated[PositiveTime | None, AbsentMeans("a two-hundredth of the filling's time")] = (
        Field(
            default=None,
            description="First time window in which resin and textile are brought to agree; "
            "windows that need many iterations become shorter, others longer.",
        )
    )
    tolerance: Annotated[float, Number(1e-4, POSITIVE)] = Field(
        default=1e-4,
        description="Change of the pore pressures in the last iteration of a window, relative to "
        "them.",
    )


class _Pressed(_Closure):
    """What presses with a pressure or force from the start on."""

    pressed: Annotated[
        Literal["dry", "wet"] | None, AbsentMeans("wet where the case has [[wetted]], else dry")
    ] = Field(
        default=None,
        description="The preform at the start: dry, pressed together before the resin comes, so "
        "that wetted places are full at the pressed thickness; or wet, as thick as it was formed "
        "where resin is, which first has to leave.",
    )


class Bag(_Pressed):
    """A bag or diaphragm: each cell bears its pressure."""

    type: Literal["bag"]
    pressure: Annotated[tuple[Pressure, ...], Row('"1 bar"', minimum_count=1)] = Field(
        description="Pressure on the bag, or one for each of times, in the system of the vents'."
    )
    times: Times = Field(
        default=None, description="Times of the pressures, which are linear between them."
    )

    @field_validator("pressure", mode="before")
    @classmethod
    def _take_one(cls, value: Any) -> Any:
        return as_row(value)

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        require_times("pressure", self.pressure, self.times)
        return self

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        return f"a bag at {1e-5 * min(self.pressure):.4g} to {1e-5 * max(self.pressure):.4g} bar"


class Gap(_Closure):
    """Rigid tools that close to a gap; a cell keeps its formed thickness until they arrive."""

    type: Literal["gap"]
    thickness: Annotated[tuple[PositiveLength, ...], Row('"0.8 mm"', minimum_count=1)] = Field(
        description="Gap of the closed tools, or one for each of times."
    )
    closing_time: Annotated[PositiveTime | None, AbsentMeans("")] = Field(
        default=None,
        description="Time in which they close, at a constant speed from the thickest cell on.",
    )
    times: Times = Field(
        default=None,
        description="Times of the gaps, which are linear between them, in place of closing_time.",
    )
    direction: Annotated[Direction | None, AbsentMeans("normal to each cell")] = Field(
        default=None, description="Direction of closing, for the force of the press."
    )

    @field_validator("thickness", mode="before")
    @classmethod
    def _take_one(cls, value: Any) -> Any:
        return as_row(value)

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        require_times("thickness", self.thickness, self.times)
        if (self.closing_time is None) == (self.times is None):
            given = "both" if self.times is not None else "neither"
            raise wrong(
                f"needs closing_time, or times with a thickness for each, but has {given}; for "
                'example closing_time = "30 s"',
                field="closing_time",
            )
        return self

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        duration = self.closing_time
        if duration is None:
            duration = self.times[-1] if self.times is not None else 0.0
        return f"tools that close to {1e3 * min(self.thickness):.4g} mm in {duration:g} s"


class Press(_Pressed):
    """A rigid tool under a force."""

    type: Literal["press"]
    force: Annotated[tuple[Force, ...], Row('"10 kN"', minimum_count=1)] = Field(
        description="Force of the press, or one for each of times."
    )
    times: Times = Field(
        default=None, description="Times of the forces, which are linear between them."
    )
    direction: Annotated[Direction | None, AbsentMeans("normal to each cell")] = Field(
        default=None, description="Direction of closing."
    )

    @field_validator("force", mode="before")
    @classmethod
    def _take_one(cls, value: Any) -> Any:
        return as_row(value)

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        require_times("force", self.force, self.times)
        if min(self.force) < 0.0 or max(self.force) == 0.0:
            raise wrong("presses, so it must not be negative, nor zero for ever", field="force")
        return self

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        return f"a press with {min(self.force):.4g} to {max(self.force):.4g} N"


Closure = Annotated[Bag | Gap | Press, Field(discriminator="type")]
