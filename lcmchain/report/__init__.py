"""Pictures, plots and the report of a run."""

from lcmchain.report.html import write_report
from lcmchain.report.pictures import draw_result
from lcmchain.report.start import draw_initial

__all__ = ["draw_initial", "draw_result", "write_report"]
