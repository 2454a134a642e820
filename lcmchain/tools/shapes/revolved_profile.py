"""Given profile, revolved."""

from __future__ import annotations

from typing import Literal

from lcmchain.tools.profiles import Profile
from lcmchain.tools.shapes.given_profile import GivenProfile


class RevolvedProfile(GivenProfile):
    """Profile of points [r, z] revolved about local z."""

    type: Literal["revolved_profile"]

    def profile(self, *, key: str) -> Profile:
        return self.build(revolved=True, key=key)
