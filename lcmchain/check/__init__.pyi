from .effect_cost import run_effects
from .expected_cost import Estimate, estimate_run
from .large_mesh import require_frames_fit
from .remarks import scene_warnings
from .report import CheckReport, check_scene, draw_start
from .tools_at_start import InitialGap, require_no_initial_overlap

__all__ = [
    "CheckReport",
    "Estimate",
    "InitialGap",
    "check_scene",
    "draw_start",
    "estimate_run",
    "require_frames_fit",
    "require_no_initial_overlap",
    "run_effects",
    "scene_warnings",
]
