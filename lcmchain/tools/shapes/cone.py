"""Cone with a rounded tip."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from lcmchain.quantities.entry_types import AcuteAngle, LengthOrZero
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.base import ProfileShape


class Cone(ProfileShape):
    """Cone with a spherical tip; the tip's pole is at the origin and points to local -z."""

    type: Literal["cone"]
    half_angle: AcuteAngle = Field(description="Angle between axis and surface.")
    tip_radius: LengthOrZero = Field(description="Radius of the spherical tip; 0 is sharp.")

    def profile(self, *, key: str) -> Profile:
        radius, angle = self.tip_radius, self.half_angle
        height = radius if radius else 1.0
        apex = radius - radius / math.sin(angle)
        points = [(0.0, apex), (height * math.tan(angle), apex + height)]
        return build_profile(points, [radius, 0.0], solid="left", revolved=True, key=key)
