from .html import write_report
from .pictures import draw_result
from .start import draw_initial

__all__ = ["draw_initial", "draw_result", "write_report"]
