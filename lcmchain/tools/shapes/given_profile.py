"""Entries of a profile that the scene gives by its points."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import LengthOrZero, PointInPlane, Row, wrong
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.base import ProfileShape


class GivenProfile(ProfileShape):
    """Corner points, fillet radii and the solid side of a profile."""

    points: Annotated[
        tuple[PointInPlane, ...],
        Row(
            '[["0 mm", "0 mm"], ["50 mm", "0 mm"]]', minimum_count=2, entries="points", units=False
        ),
    ] = Field(description="Corner points of the profile, in order.")
    fillet_radii: Annotated[
        tuple[LengthOrZero, ...], Row('["0 mm", "5 mm", "0 mm"]', entries="radii")
    ] = Field(default=(), description="Fillet radius at each point; left out, all are sharp.")
    solid: Literal["left", "right"] = Field(
        description="Side of the direction of travel along the points that is solid."
    )

    @model_validator(mode="after")
    def _check_radii(self) -> Self:
        if self.fillet_radii and len(self.fillet_radii) != len(self.points):
            raise wrong(
                f"needs one radius per point ({len(self.points)}), but has "
                f"{len(self.fillet_radii)}",
                field="fillet_radii",
            )
        return self

    def build(self, *, revolved: bool, key: str) -> Profile:
        """Build the profile of the entries; errors as :meth:`table_entries`."""
        return build_profile(
            self.points, self.fillet_radii, solid=self.solid, revolved=revolved, key=key
        )
