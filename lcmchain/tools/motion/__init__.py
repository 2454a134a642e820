"""Motion of rigid tools: at rest, prescribed along a direction or about an axis, or guided.

A motion is the scene table of its file, with the methods of :class:`ToolMotion`. It is registered
by its place in ``Motion``; one that is neither a stroke, a table nor guided also has its compiled
law called in ``travel.py``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.tools.motion.base import (
    FIXED,
    GUIDED,
    PRESCRIBED,
    STANDARD_GRAVITY,
    ToolMotion,
)
from lcmchain.tools.motion.fixed import FixedMotion
from lcmchain.tools.motion.guided import GuidedMotion, guided_load, way_to_stop
from lcmchain.tools.motion.smooth_step import smooth_step
from lcmchain.tools.motion.stroke import StrokeMotion
from lcmchain.tools.motion.table import TableMotion
from lcmchain.tools.motion.travel import prescribed_travel
from lcmchain.tools.motion.turn import TurnMotion

Motion = Annotated[
    FixedMotion | StrokeMotion | TableMotion | TurnMotion | GuidedMotion,
    Field(discriminator="type"),
]

__all__ = [
    "FIXED",
    "GUIDED",
    "PRESCRIBED",
    "STANDARD_GRAVITY",
    "FixedMotion",
    "GuidedMotion",
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
