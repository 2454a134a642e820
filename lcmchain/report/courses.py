"""Picture of a ply that is laid in courses: which is which, and the gaps along their joints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.colors import to_rgba

from lcmchain.fields.sheet import COURSE, JOINT_GAP, course_names, sheet_faces, sheet_positions
from lcmchain.report.extremes import mark_extremes
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_segments,
    draw_triad,
    fit_axis,
    label_axes,
)
from lcmchain.report.shown import Shown, colour_scale
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import FROM_ABOVE, View, boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr

#: Gaps are positive, overlaps negative.
GAP = Shown(JOINT_GAP, "Gap between courses", "mm", 1e3, "PuOr_r", True, 2)
#: Share of white in the colour of a course.
PALE = 0.55


def from_far_to_near(corners: np.ndarray, numbers: np.ndarray, view: View) -> list[np.ndarray]:
    """Return the faces of every course, those that lie farther from the viewer first.

    Courses lie in one surface: the depth of single faces does not tell which hides which.

    Parameters
    ----------
    corners : of the faces (F, 4, 3). numbers : of their courses (F,).
    """
    courses = [np.flatnonzero(numbers == number) for number in np.unique(numbers)]
    return sorted(courses, key=lambda own: float((corners[own] @ view.towards).mean()))


def lifted(points: np.ndarray, faces: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return points whose courses lie over each other in their order, as they are laid.

    From above nothing but the order of painting changes.
    """
    heights = np.zeros(len(points))
    heights[faces] = numbers[:, None]
    span = np.ptp(points[:, 2]) + np.ptp(points[:, :2])
    return points + heights[:, None] * np.array([0.0, 0.0, span])


def draw_courses(path: Path | str, sheet: xr.Dataset, frame: int = -1) -> None:
    """Draw the courses on the formed shape, and from above the gaps along their joints."""
    points = 1e3 * sheet_positions(sheet, frame)
    faces, numbers = sheet_faces(sheet), sheet[COURSE].values[frame]
    names = course_names(sheet)
    gaps = GAP.factor * sheet[JOINT_GAP].values[frame]
    known = np.isfinite(gaps)
    palette = np.array([to_rgba(SERIES[n % len(SERIES)]) for n in range(len(names))])
    palette[:, :3] = PALE + (1.0 - PALE) * palette[:, :3]
    rim = boundary_edges(faces)
    view = oblique(from_below=hangs_down(points, rim))
    with matplotlib.rc_context(RC):
        aspects = [np.ptp(v.on_screen(points), axis=0) for v in (view, FROM_ABOVE)]
        heights = [
            np.clip(width * span[1] / max(span[0], 1e-12), 1.6, 5.6)
            for width, span in zip((5.4, 3.9), aspects)
        ]
        panel = float(max(heights))
        figure = new_figure(11.4, panel + 1.45)
        left = axes_at(figure, 0.2, 0.35, 5.4, panel + 0.2)
        right = axes_at(figure, 6.2, 0.5, 3.9, panel)
        bar = axes_at(figure, 10.4, 0.5 + 0.12 * panel, 0.16, 0.76 * panel)
        for own in from_far_to_near(points[faces], numbers, view):
            edges = points[boundary_edges(faces[own])]
            draw_facets(left, points[faces[own]], view, palette[numbers[own]], rim=edges)
        fit_axis(left, view.on_screen(points), 0.03)
        left.set_axis_off()
        draw_triad(left, view)
        side = "below" if view.up[2] < 0.0 else "above"
        figure.text(
            0.3 / 11.4, (0.5 + panel) / (panel + 1.45), f"courses on the formed shape, from {side}",
            color=FAINT, fontsize=9, va="bottom",
        )  # fmt: skip
        draw_facets(
            right, lifted(points, faces, numbers)[faces], FROM_ABOVE, palette[numbers],
            shaded=False, edge_darkness=0.92, edge_width=0.15,
        )  # fmt: skip
        draw_segments(right, points[rim], FROM_ABOVE, INK, 0.7)
        fit_axis(right, points[:, :2], 0.04)
        label_axes(right, "x [mm]", "y [mm]")
        right.set_title("from above, gaps at the joints", color=FAINT, loc="left")
        for number, name in enumerate(names):
            middle = points[faces[numbers == number]].mean(axis=(0, 1))
            right.text(middle[0], middle[1], name, ha="center", va="center", fontsize=8, color=INK)
        colours = colour_scale(gaps[known], GAP)
        right.scatter(
            points[known, 0], points[known, 1], s=14.0, c=colours.to_rgba(gaps[known]),
            edgecolors=INK, linewidths=0.25, zorder=4,
        )  # fmt: skip
        if known.any():
            draw_colour_bar(figure, bar, colours, gaps[known], GAP)
            mark_extremes(right, points[known, :2], gaps[known], GAP)
        else:
            bar.set_axis_off()
        title = f"{sheet.attrs.get('title', '')}  ·  {len(names)} courses  ·  negative: overlap"
        headline(figure, GAP.label, title)
        save(figure, path)
