"""Motion of rigid tools: at rest, prescribed along a direction or about an axis, or guided.

A motion is a scene table with the methods of :class:`ToolMotion` (``base``). It is registered by
its place in ``Motion``. One whose travel is given over time (``prescribed``), but neither as a
stroke nor as a table, also has its compiled law called in :func:`prescribed_travel`. One that
follows from forces is ``guided``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.tools.motion.base import (
    FIXED,
    GUIDED,
    PRESCRIBED,
    STANDARD_GRAVITY,
    FixedMotion,
    ToolMotion,
    smooth_step,
)
from lcmchain.tools.motion.guided import GuidedMotion, guided_load, way_to_stop
from lcmchain.tools.motion.prescribed import (
    StrokeMotion,
    TableMotion,
    TurnMotion,
    prescribed_travel,
)

Motion = Annotated[
    FixedMotion | StrokeMotion | TableMotion | TurnMotion | GuidedMotion,
    Field(discriminator="type"),
]

#: Of what leads without a mass of its own.
LeadingMotion = Annotated[
    FixedMotion | StrokeMotion | TableMotion | TurnMotion,
    Field(discriminator="type"),
]

__all__ = [
    "FIXED",
    "GUIDED",
    "PRESCRIBED",
    "STANDARD_GRAVITY",
    "FixedMotion",
    "GuidedMotion",
    "LeadingMotion",
    "Motion",
    "StrokeMotion",
    "TableMotion",
    "ToolMotion",
    "TurnMotion",
    "guided_load",
    "prescribed_travel",
    "smooth_step",
    "way_to_stop",
]
