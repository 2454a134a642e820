from .html import write_report
from .run_pictures import draw_result
from .start import draw_initial, draw_stack

__all__ = ["draw_initial", "draw_result", "draw_stack", "write_report"]
