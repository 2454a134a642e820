"""A film of the front: the same view and colours in every saved state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.coupling.infiltration.picture import (
    PRESSURE_COLOURS,
    draw_level_bar,
    mark_places,
    nice_levels,
    paint_contours,
)
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.report.animation import DPI, DURATION, HEIGHT, LEAST, WIDTH, write_film
from lcmchain.report.renderer import axes_at, draw_triad, fit_axis
from lcmchain.report.style import RC, headline, new_figure
from lcmchain.report.view import boundary_edges, hangs_down, oblique


def draw_film(
    path: Path | str,
    filled: FilledPart,
    title: str,
    report: Callable[[int, int], None] | None = None,
) -> None:
    """Draw the pressure behind the front in every saved state into a GIF or MP4 file.

    Parameters
    ----------
    path : its suffix, .gif or .mp4, chooses the kind.
    report : called with the frames drawn and all frames.

    Raises
    ------
    InputError : the place cannot be written.
    """
    path = Path(path)
    images = _images(filled, title, report or (lambda done, total: None))
    seconds = max(DURATION / len(filled.time), LEAST)
    with replacing(path) as temporary:
        write_film(temporary, images, seconds)


def _images(filled: FilledPart, title: str, report) -> Iterator[np.ndarray]:
    target = filled.setup.part.target
    points, cells = 1e3 * target.points, target.corners
    rim = boundary_edges(np.where(cells < 0, cells[:, 2:3], cells))
    view = oblique(from_below=len(rim) > 0 and hangs_down(points, rim))
    values = np.where(filled.fill > 0.5, 1e-5 * filled.pressure, np.nan)
    levels = nice_levels(values, None)
    for frame, time in enumerate(filled.time):
        with matplotlib.rc_context(RC):
            figure = new_figure(WIDTH, HEIGHT)
            axis = axes_at(figure, 0.1, 0.15, WIDTH - 1.4, HEIGHT - 0.8)
            paint_contours(
                axis, points, cells, values[frame], levels, PRESSURE_COLOURS, view, rim, True
            )
            fit_axis(axis, view.on_screen(points), 0.05)
            axis.set_axis_off()
            mark_places(axis, filled, view, dry=False, legend=False)
            draw_triad(axis, view)
            bar = axes_at(figure, WIDTH - 1.15, 0.9, 0.16, HEIGHT - 2.2)
            draw_level_bar(figure, bar, levels, PRESSURE_COLOURS, "Pressure [bar]", True)
            headline(figure, "Filling", f"{title}  ·  t = {time:.4g} s")
            figure.set_dpi(DPI)
            canvas = figure.canvas
            canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]
        report(frame + 1, len(filled.time))
