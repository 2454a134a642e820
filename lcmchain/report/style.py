"""Look of all figures: fonts, colours, and files that appear whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lcmchain.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 200
INK = "#22272e"
FAINT = "#8a929c"
FIBRE_COLOURS = ("#1f5fa8", "#d1572a", "#3b8f4e")
#: Distinct for the common kinds of colour blindness (Okabe and Ito).
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")

RC: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.edgecolor": "#5b636d",
    "axes.linewidth": 0.7,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes.unicode_minus": True,
}


def new_figure(width: float, height: float) -> Figure:
    """Return a figure [inches] that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: Path | str) -> None:
    """Write a figure as PNG.

    Raises
    ------
    InputError : the place cannot be written.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI)


def headline(figure: Figure, title: str, subtitle: str) -> None:
    """Put title and subtitle at the upper left."""
    width, height = figure.get_size_inches()
    figure.text(0.3 / width, 1.0 - 0.17 / height, title, fontsize=12, weight="bold", va="top")
    figure.text(0.3 / width, 1.0 - 0.42 / height, subtitle, fontsize=8.5, color="#555d67", va="top")
