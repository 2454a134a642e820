"""Plate with a round hole: a die, or a blank holder."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from lcmchain.mesh.hexahedron import largest_ripple
from lcmchain.quantities.entry_types import LengthOrZero, PositiveLength
from lcmchain.quantities.readable import two_digits
from lcmchain.thresholds import LARGEST_RIPPLE
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

    def remarks(self, tool_name: str, edge_length: float, whose: str = "") -> list[str]:
        if self.fillet_radius == 0.0:
            return [f'the hole of "{tool_name}" has a sharp edge (fillet_radius = 0)']
        ripple = largest_ripple(edge_length / self.fillet_radius)
        if ripple <= LARGEST_RIPPLE:
            return []
        enough = 1e3 * edge_length * math.sqrt(LARGEST_RIPPLE / ripple)
        return [
            f"the elements{whose} ({1e3 * edge_length:g} mm) are long for the fillet of "
            f'"{tool_name}" ({1e3 * self.fillet_radius:g} mm): where they are drawn over it, the '
            f"forces of the tools go up and down by up to {ripple:.0%}; use "
            f'blank.edge_length = "{two_digits(enough)} mm"'
        ]
