"""Pictures of the formed shape itself: its fibres, and the tools that it lies between."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.report.fibre_segments import fibre_lines
from lcmchain.report.layers import Layer, line_layer, paint, sheet_layer
from lcmchain.report.renderer import axes_at, draw_outline, draw_triad, fit_axis, label_axes
from lcmchain.report.run_tools import RunTools
from lcmchain.report.style import FAINT, FIBRE_COLOURS, INK, RC, headline, new_figure, save
from lcmchain.report.transparent import DepthBuffer, draw_tool
from lcmchain.report.view import FROM_ABOVE, View, boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr

SHEET_COLOUR = "#f1efe9"


def draw_fibre_directions(path: Path | str, sheet: xr.Dataset, frame: int = -1) -> None:
    """Draw fibre lines of all families on the formed shape: oblique view and from above.

    The lines are material: they followed a fibre before forming.
    """
    points, initial = 1e3 * sheet_positions(sheet, frame), 1e3 * reference_positions(sheet)
    faces = sheet_faces(sheet)
    rim = boundary_edges(faces)
    lines = fibre_lines(sheet, points)
    view = oblique(from_below=hangs_down(points, rim))
    widths = (5.8, 4.4)  # of the panels [in]
    with matplotlib.rc_context(RC):
        panel = max(
            _height(view.on_screen(points), widths[0]),
            _height(np.concatenate([points, initial])[:, :2], widths[1]),
        )
        figure = new_figure(11.4, panel + 1.45)
        left = axes_at(figure, 0.2, 0.35, widths[0], panel + 0.2)
        right = axes_at(figure, 6.6, 0.5, widths[1], panel)
        for axis, seen, width in ((left, view, 0.75), (right, FROM_ABOVE, 0.7)):
            layers = _sheet(points, faces, rim, seen)
            lift = float(np.median(np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)))
            layers += [
                line_layer(pieces, seen, FIBRE_COLOURS[number - 1], width, lift)
                for number, pieces in lines
            ]
            paint(axis, seen, layers)
        fit_axis(left, view.on_screen(points), 0.03)
        left.set_axis_off()
        draw_triad(left, view)
        _say_side(figure, view, panel)
        draw_outline(right, initial, rim, "initial outline")
        for number, colour in ((number, FIBRE_COLOURS[number - 1]) for number, _ in lines):
            right.plot([], [], color=colour, lw=1.5, label=f"fibre {number}")
        right.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.15)
        right.set_title("from above", color=FAINT, loc="left")
        fit_axis(right, np.concatenate([points[:, :2], initial[:, :2]]), 0.04)
        label_axes(right, "x [mm]", "y [mm]")
        headline(figure, "Fibre directions", _subtitle(sheet, frame))
        save(figure, path)


def draw_between_tools(
    path: Path | str,
    sheet: xr.Dataset,
    tools: RunTools,
    travel: np.ndarray,
    frame: int = -1,
) -> None:
    """Draw the formed shape between transparent tools, from above and from below.

    Parameters
    ----------
    travel : of the tools in the frame [m], shape (T,).
    """
    points, faces = sheet_positions(sheet, frame), sheet_faces(sheet)
    rim = boundary_edges(faces)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    margin = size * np.array([[-0.06, -0.06, -0.08], [0.06, 0.06, 0.12]])
    box = np.stack([low, high]) + margin
    edge = 1e3 * float(np.median(np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)))
    edge = max(edge, 1e3 * size / 80.0)
    shown = [(n, 1e3 * p, t, colour) for n, p, t, colour in tools.within(box, travel)]
    points = 1e3 * points
    with matplotlib.rc_context(RC):
        views = [oblique(elevation=24.0), oblique(elevation=24.0, from_below=True)]
        extents = [
            np.concatenate([view.on_screen(p) for p in (points, *(s[1] for s in shown))])
            for view in views
        ]
        panel = max(2.8, *(_height(extent, 5.6) for extent in extents))
        figure = new_figure(11.8, panel + 1.3)
        for x, view, extent in zip((0.15, 6.0), views, extents, strict=True):
            axis = axes_at(figure, x, 0.2, 5.6, panel)
            paint(axis, view, _sheet(points, faces, rim, view), zorder=2.0)
            buffer = DepthBuffer(points[faces], view)
            for _, vertices, triangles, colour in shown:
                draw_tool(axis, vertices, triangles, view, colour, buffer, edge)
            fit_axis(axis, extent, 0.02)
            axis.set_axis_off()
            draw_triad(axis, view)
            side = "below" if view.up[2] < 0.0 else "above"
            axis.set_title(f"from {side}", color=FAINT, loc="left")
        for name, _, triangles, colour in shown:
            if len(triangles):
                axis.plot([], [], color=colour, lw=4.0, alpha=0.5, label=name)
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.15)
        headline(figure, "Formed shape between the tools", _subtitle(sheet, frame))
        save(figure, path)


def _sheet(points, faces, rim, view: View) -> list[Layer]:
    lift = 2e-3 * float(np.ptp(points, axis=0).max())
    shaded = view is not FROM_ABOVE  # where light would take away the symmetry
    return [
        sheet_layer(points[faces], view, SHEET_COLOUR, shaded=shaded),
        line_layer(points[rim], view, INK, 0.9, lift),
    ]


def _height(shown: np.ndarray, width: float) -> float:
    """Return the height [in] of a panel that shows points (P, 2) over its width."""
    span = np.ptp(shown, axis=0)
    return float(np.clip(width * span[1] / max(span[0], 1e-12), 1.6, 5.6))


def _say_side(figure, view: View, panel: float) -> None:
    width, height = figure.get_size_inches()
    side = "below" if view.up[2] < 0.0 else "above"
    figure.text(
        0.3 / width, (0.5 + panel) / height, f"formed shape, from {side}", color=FAINT,
        fontsize=9, va="bottom",
    )  # fmt: skip


def _subtitle(sheet: xr.Dataset, frame: int) -> str:
    time = 1e3 * float(sheet["time"].values[frame])
    title = sheet.attrs.get("title", "")
    return f"{title}  ·  {sheet.sizes['sheet_face']:,} elements  ·  t = {time:.4g} ms"
