"""Results of the same process side by side: one field on the formed shapes, and their contours."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_outline,
    draw_triad,
    fit_axis,
    label_axes,
)
from lcmchain.report.shown import Shown, colour_scale
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr

PANEL = 4.1  # width of one panel [in]
CONTOUR_STYLES = ((0, ()), (0, (4, 2)), (0, (1, 1.5)))


def draw_comparison(
    path: Path | str,
    sheets: Mapping[str, xr.Dataset],
    shown: Shown,
    *,
    title: str,
    frame: int = -1,
) -> None:
    """Draw a face field on the formed shape of each result, in one view and one colour scale.

    The last panel lays the contours of the results over each other, seen from above.

    Parameters
    ----------
    path : of the PNG.
    sheets : root groups of the results by the name under which they are shown.
    shown : the field, one of :data:`lcmchain.report.shown.SHOWN`.
    title : of the picture. frame : saved frame, the last one by default.

    Raises
    ------
    InputError : the place cannot be written.
    """
    points = {name: 1e3 * sheet_positions(sheet, frame) for name, sheet in sheets.items()}
    faces = {name: sheet_faces(sheet) for name, sheet in sheets.items()}
    rims = {name: boundary_edges(corners) for name, corners in faces.items()}
    values = {
        name: shown.factor * sheet[shown.name].values[frame] for name, sheet in sheets.items()
    }
    together = np.concatenate(list(values.values()))
    colours = colour_scale(together, shown)
    first = next(iter(sheets))
    view = oblique(from_below=hangs_down(points[first], rims[first]))
    everything = np.concatenate(list(points.values()))

    with matplotlib.rc_context(RC):
        figure = new_figure(PANEL * (len(sheets) + 1) + 1.5, PANEL + 0.85)
        for number, name in enumerate(sheets):
            axis = axes_at(figure, 0.2 + PANEL * number, 0.45, PANEL - 0.1, PANEL - 0.4)
            painted = colours.to_rgba(values[name])
            draw_facets(
                axis, points[name][faces[name]], view, painted, rim=points[name][rims[name]]
            )
            axis.set_axis_off()
            fit_axis(axis, view.on_screen(everything), 0.03)
            largest = shown.text(np.nanmax(np.abs(values[name])))
            axis.set_title(f"{name}  ·  largest {largest}", loc="left")
            if number == 0:
                draw_triad(axis, view)
        right = PANEL * len(sheets)
        bar = axes_at(figure, 0.3 + right, 0.45 + 0.15 * PANEL, 0.14, 0.6 * PANEL)
        draw_colour_bar(figure, bar, colours, together, shown, extremes=False)
        contours = axes_at(figure, 1.65 + right, 0.45, PANEL - 0.4, PANEL - 0.4)
        _draw_contours(contours, sheets, points, rims)
        headline(figure, f"{shown.label} and contour", title)
        save(figure, path)


def _draw_contours(axis, sheets, points, rims) -> None:
    first = next(iter(sheets))
    initial = 1e3 * reference_positions(sheets[first])[:, :2]
    draw_outline(axis, initial, rims[first], "initial")
    colours = (INK, *SERIES[1:])
    for name, colour, style in zip(sheets, colours, CONTOUR_STYLES, strict=False):
        draw_outline(axis, points[name], rims[name], name, colour=colour, width=1.3, style=style)
    axis.legend(loc="center")
    axis.set_title("contour from above", color=FAINT, loc="left")
    fit_axis(axis, initial, 0.04)
    label_axes(axis, "x [mm]", "y [mm]")
