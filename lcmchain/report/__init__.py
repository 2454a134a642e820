"""Pictures and plots of a run."""

from lcmchain.report.pictures import draw_initial, draw_result

__all__ = ["draw_initial", "draw_result"]
