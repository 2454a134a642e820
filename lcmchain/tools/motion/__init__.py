"""Motion of rigid tools along a fixed direction: at rest, prescribed over time, or guided."""

from __future__ import annotations

from lcmchain.tools.motion.travel import (
    FIXED,
    GUIDED,
    LINEAR,
    PRESCRIBED,
    SMOOTH,
    STANDARD_GRAVITY,
    TABULATED,
    guided_load,
    motion_entries,
    prescribed_travel,
    smooth_step,
    tabulated_travel,
)

__all__ = [
    "FIXED",
    "GUIDED",
    "LINEAR",
    "PRESCRIBED",
    "SMOOTH",
    "STANDARD_GRAVITY",
    "TABULATED",
    "guided_load",
    "motion_entries",
    "prescribed_travel",
    "smooth_step",
    "tabulated_travel",
]
