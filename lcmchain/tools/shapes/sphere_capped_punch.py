"""Punch with a spherical end."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lcmchain.quantities.entry_types import PositiveLength
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.base import ProfileShape


class SphereCappedPunch(ProfileShape):
    """Cylinder with a spherical end; the pole is at the origin and points to local -z."""

    type: Literal["sphere_capped_punch"]
    radius: PositiveLength = Field(description="Radius of cylinder and sphere.")

    def profile(self, *, key: str) -> Profile:
        radius = self.radius
        points = [(0.0, 0.0), (radius, 0.0), (radius, 2.0 * radius)]
        return build_profile(points, [0.0, radius, 0.0], solid="left", revolved=True, key=key)
