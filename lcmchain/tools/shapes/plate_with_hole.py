"""Plate with a round hole: a die, or a blank holder."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lcmchain.quantities.entry_types import LengthOrZero, PositiveLength
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.base import ProfileShape
from lcmchain.tools.shapes.plate import Side


class PlateWithHole(ProfileShape):
    """Infinite plane z = 0 with a round hole along local z whose edge is rounded."""

    type: Literal["plate_with_hole"]
    hole_radius: PositiveLength = Field(description="Radius of the hole below its rounded edge.")
    fillet_radius: LengthOrZero = Field(description="Radius of the rounded edge; 0 is sharp.")
    side: Side = Field(description="Side of the plane that is solid.")

    def profile(self, *, key: str) -> Profile:
        hole = self.hole_radius
        depth, solid = (hole, "right") if self.side == "above" else (-hole, "left")
        points = [(2.0 * hole, 0.0), (hole, 0.0), (hole, depth)]
        radii = [0.0, self.fillet_radius, 0.0]
        return build_profile(points, radii, solid=solid, revolved=True, key=key)

    def remarks(self, tool_name: str, edge_length: float) -> list[str]:
        if self.fillet_radius == 0.0:
            return [f'the hole of "{tool_name}" has a sharp edge (fillet_radius = 0)']
        if self.fillet_radius < edge_length:
            return [
                f'the fillet of "{tool_name}" ({1e3 * self.fillet_radius:g} mm) is '
                f"smaller than the elements ({1e3 * edge_length:g} mm)"
            ]
        return []
