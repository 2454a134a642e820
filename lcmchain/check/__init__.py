"""What a scene will simulate and why, what it costs, and whether it can start."""

from __future__ import annotations

from lcmchain.check.effects_of_scene import Effect, couples_thickness, scene_effects
from lcmchain.check.expected_cost import Estimate, estimate_run
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.report import CheckReport, check_scene, draw_start
from lcmchain.check.tools_at_start import InitialGap, initial_gaps, require_no_initial_overlap

__all__ = [
    "CheckReport",
    "Effect",
    "Estimate",
    "InitialGap",
    "check_scene",
    "couples_thickness",
    "draw_start",
    "estimate_run",
    "initial_gaps",
    "require_no_initial_overlap",
    "scene_effects",
    "scene_warnings",
]
