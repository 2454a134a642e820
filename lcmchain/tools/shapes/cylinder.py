"""Cylinder: a roller without ends, or a puck."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import AbsentMeans, LengthOrZero, PositiveLength, wrong
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.base import ProfileShape


class Cylinder(ProfileShape):
    """Cylinder about local z: infinite (a roller), or from z = 0 to z = length."""

    type: Literal["cylinder"]
    radius: PositiveLength = Field(description="Radius of the cylinder.")
    edge_radius: LengthOrZero = Field(  # type: ignore[assignment]
        default="0 mm", description="Radius of the rounded edges at both ends; 0 is sharp."
    )
    length: Annotated[PositiveLength | None, AbsentMeans("infinite")] = Field(
        default=None, description="Length along local z."
    )

    @model_validator(mode="after")
    def _check_edges(self) -> Self:
        if self.edge_radius > 0.0 and self.length is None:
            raise wrong(
                "has no edge to round on an infinite cylinder; give a length", field="edge_radius"
            )
        if self.edge_radius > self.radius:
            raise wrong("is larger than the radius of the cylinder", field="edge_radius")
        if self.length is not None and 2 * self.edge_radius > self.length:
            raise wrong("is larger than half the length of the cylinder", field="edge_radius")
        return self

    def profile(self, *, key: str) -> Profile:
        radius, edge, length = self.radius, self.edge_radius, self.length
        if length is None:
            points, radii = [(radius, -radius), (radius, radius)], None
        else:
            points = [(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)]
            radii = [0.0, edge, edge, 0.0]
        return build_profile(points, radii, solid="left", revolved=True, key=key)
