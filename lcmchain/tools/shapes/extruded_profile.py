"""Given profile, extruded."""

from __future__ import annotations

from typing import Literal

from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.given_profile import GivenProfile


class ExtrudedProfile(GivenProfile):
    """Profile of points [x, z] extruded along local y without end."""

    type: Literal["extruded_profile"]

    def profile(self, *, key: str) -> Profile:
        return self.build(revolved=False, key=key)
