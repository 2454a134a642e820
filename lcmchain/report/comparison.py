"""Results of the same process side by side: one field on the formed shapes, and their contours."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
import xarray as xr

from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.report.shape import (
    Shown,
    colour_scale,
    draw_shape,
    draw_triad,
    fit_axis,
    hangs_down,
    joined_outline,
    label_axes,
)
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import boundary_edges, oblique

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
    shown : the field, one of :data:`lcmchain.report.pictures.SHOWN`.
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
    colours = colour_scale(np.concatenate(list(values.values())), shown)
    first = next(iter(sheets))
    view = oblique(from_below=hangs_down(points[first], rims[first]))
    everything = np.concatenate(list(points.values()))

    with matplotlib.rc_context(RC):
        width, height = PANEL * (len(sheets) + 1) + 1.5, PANEL + 0.85
        figure = new_figure(width, height)

        def add_axes(x: float, w: float, y: float = 0.45, h: float = PANEL - 0.4):
            return figure.add_axes([x / width, y / height, w / width, h / height])

        for number, name in enumerate(sheets):
            axis = add_axes(0.2 + PANEL * number, PANEL - 0.1)
            draw_shape(
                axis, points[name], faces[name], rims[name], view, colours.to_rgba(values[name])
            )
            fit_axis(axis, view.on_screen(everything), 0.03)
            largest = np.nanmax(np.abs(values[name]))
            axis.set_title(
                f"{name}  ·  largest {largest:.{shown.decimals}f}{shown.unit}", loc="left"
            )
            if number == 0:
                draw_triad(axis, view)
        bar = add_axes(0.3 + PANEL * len(sheets), 0.14, 0.45 + 0.15 * PANEL, 0.6 * PANEL)
        beyond = max(np.nanmax(np.abs(v)) for v in values.values()) > colours.norm.vmax
        colour_bar = figure.colorbar(colours, cax=bar, extend="both" if beyond else "neither")
        colour_bar.outline.set_linewidth(0.6)
        unit = f" [{shown.unit}]" if shown.unit else ""
        colour_bar.set_label(f"{shown.title.lower()}{unit}", labelpad=5)

        _draw_contours(add_axes(1.65 + PANEL * len(sheets), PANEL - 0.4), sheets, points, rims)
        headline(figure, f"{shown.title}{unit} and contour", title)
        save(figure, path)


def _draw_contours(axis, sheets, points, rims) -> None:
    from matplotlib.collections import LineCollection

    first = next(iter(sheets))
    initial = 1e3 * reference_positions(sheets[first])[:, :2]
    axis.add_collection(
        LineCollection(
            joined_outline(initial, rims[first]), colors=FAINT, linewidths=0.8,
            linestyles=(0, (5, 4)),
        )
    )  # fmt: skip
    axis.plot([], [], color=FAINT, lw=0.8, ls=(0, (5, 4)), label="initial")
    colours = (INK, *SERIES[1:])
    for name, colour, style in zip(sheets, colours, CONTOUR_STYLES, strict=False):
        lines = joined_outline(points[name], rims[name])
        axis.add_collection(LineCollection(lines, colors=colour, linewidths=1.3, linestyles=style))
        axis.plot([], [], color=colour, lw=1.3, ls=style, label=name)
    axis.legend(loc="center")
    axis.set_title("contour from above", color=FAINT, loc="left")
    fit_axis(axis, initial, 0.04)
    label_axes(axis, "x [mm]", "y [mm]")
