"""What a scene will simulate and why, what it costs, and whether it can start."""

from __future__ import annotations

from lcmchain.check.effects_of_run import run_effects
from lcmchain.check.expected_cost import Estimate, estimate_run
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.report import CheckReport, check_scene, draw_start
from lcmchain.check.saved_frames import require_frames_fit
from lcmchain.check.tools_at_start import InitialGap, initial_gaps, require_no_initial_overlap

__all__ = [
    "CheckReport",
    "Estimate",
    "InitialGap",
    "check_scene",
    "draw_start",
    "estimate_run",
    "initial_gaps",
    "require_frames_fit",
    "require_no_initial_overlap",
    "run_effects",
    "scene_warnings",
]
