"""Scene table of an infiltration that goes on while the blank is formed."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from lcmchain.quantities.entry_types import POSITIVE, AbsentMeans, Number, PositiveTime
from lcmchain.quantities.scene_model import SceneModel


class WithForming(SceneModel):
    """Forming and flow at once, as in wet compression moulding; both are brought to agree."""

    window: Annotated[PositiveTime | None, AbsentMeans("a four-hundredth of process.time")] = Field(
        default=None,
        description="First time window, on the clock of forming, in which resin and textile are "
        "brought to agree; windows that need many iterations become shorter, others longer.",
    )
    tolerance: Annotated[float, Number(1e-3, POSITIVE)] = Field(
        default=1e-3,
        description="Change of the pore pressures in the last iteration of a window, relative to "
        "them.",
    )

    open_faces: Literal["closed", "air"] = Field(
        default="closed",
        description="What a face that no tool touches lets through: nothing, as under a film, so "
        "that suction may hold the sheet together; or air, which then comes in before the "
        "pressure falls below vent_pressure.",
    )

    @property
    def in_words(self) -> str:
        """How it is coupled, for the check of a scene."""
        return f"while the blank is formed, pressures to {self.tolerance:g}"
