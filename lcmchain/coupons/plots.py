"""Frame of the coupon figures: one or two panels, headline, saved whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib

from lcmchain.report.style import RC, headline, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@contextmanager
def two_panels(path: Path, title: str, subtitle: str) -> Iterator[tuple]:
    """Yield the two axes of a figure that is saved at the end."""
    with matplotlib.rc_context(RC):
        figure = new_figure(9.6, 3.9)
        left = figure.add_axes((0.07, 0.135, 0.40, 0.67))
        right = figure.add_axes((0.56, 0.135, 0.40, 0.67))
        yield left, right
        headline(figure, title, subtitle)
        save(figure, path)


def finish(axis: Axes) -> None:
    """Grid, open frame, and an ordinate from zero."""
    finish_loop(axis)
    axis.set_xlim(left=0.0)
    axis.set_ylim(bottom=0.0)


def finish_loop(axis: Axes) -> None:
    """Grid and open frame, of what lies on both sides of zero."""
    axis.grid(True, color="#e4e7ea", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines["top"].set_visible(False)
    axis.spines["right"].set_visible(False)
    axis.tick_params(length=2.5)
