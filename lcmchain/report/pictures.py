"""Pictures of the formed sheet: its fields, courses, fibres, and the tools that it lies between."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.colors import to_rgba

from lcmchain.fields.sheet import (
    COURSE,
    JOINT_GAP,
    course_names,
    reference_positions,
    sheet_faces,
    sheet_positions,
)
from lcmchain.fields.stack import PLY, ply_names
from lcmchain.report.drawn_tools import DepthBuffer, RunTools, draw_tool
from lcmchain.report.fibre_segments import fibre_lines
from lcmchain.report.renderer import (
    Layer,
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_outline,
    draw_segments,
    draw_triad,
    fit_axis,
    label_axes,
    line_layer,
    mark_extremes,
    paint,
    sheet_layer,
)
from lcmchain.report.style import (
    FAINT,
    FIBRE_COLOURS,
    INK,
    RC,
    SERIES,
    Shown,
    colour_scale,
    headline,
    new_figure,
    save,
    shades_of,
)
from lcmchain.report.view import FROM_ABOVE, View, boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure


# --- fields on the formed shape -------------------------------------------------------------------


def draw_field(path: Path | str, sheet: xr.Dataset, shown: Shown, frame: int = -1) -> None:
    """Draw a field on the formed shape: oblique view and view from above.

    A field on nodes is drawn as its mean over every face; its extremes are those of the nodes.
    """
    points = 1e3 * sheet_positions(sheet, frame)
    initial = 1e3 * reference_positions(sheet)
    faces = sheet_faces(sheet)
    exact = shown.factor * sheet[shown.name].values[frame]
    on_nodes = sheet[shown.name].attrs["location"] == "node"
    values = on_faces(exact, faces) if on_nodes else exact
    places = points if on_nodes else points[faces].mean(axis=1)

    rim = boundary_edges(faces)
    view = oblique(from_below=hangs_down(points, rim))
    aspects = [
        span[1] / max(span[0], 1e-12)
        for span in (
            np.ptp(view.on_screen(points), axis=0),
            np.ptp(FROM_ABOVE.on_screen(np.concatenate([points, initial])), axis=0),
        )
    ]

    with matplotlib.rc_context(RC):
        widths = (5.4, 3.9)  # of the panels [in]
        heights = [np.clip(w * aspect, 1.6, 5.6) for w, aspect in zip(widths, aspects)]
        panel = float(max(heights))
        figure = new_figure(11.4, panel + 1.45)
        left = axes_at(figure, 0.2, 0.35, widths[0], panel + 0.2)
        right = axes_at(figure, 6.2, 0.5, widths[1], panel)
        bar = axes_at(figure, 10.4, 0.5 + 0.12 * panel, 0.16, 0.76 * panel)
        colours = colour_scale(values, shown)
        shades = shades_of(colours, values)
        for own in _from_back_to_front(sheet, view, frame):
            edges = boundary_edges(faces[own])
            draw_facets(left, points[faces[own]], view, shades[own], rim=points[edges])
        fit_axis(left, view.on_screen(points), 0.03)
        left.set_axis_off()
        draw_triad(left, view)
        _say_side(figure, view, panel, "formed shape")
        order = np.concatenate(_from_back_to_front(sheet, FROM_ABOVE, frame))
        seen = points
        if course_names(sheet):
            seen = _lifted(points, faces, sheet[COURSE].values[frame])
        _draw_map(right, seen, initial, faces[order], rim, shades[order])
        right.set_title("from above", color=FAINT, loc="left")
        draw_colour_bar(figure, bar, colours, exact, shown)
        mark_extremes(right, places[:, :2], exact, shown)
        headline(figure, shown.label, _subtitle(sheet, frame))
        save(figure, path)


def _from_back_to_front(sheet: xr.Dataset, view: View, frame: int) -> list[np.ndarray]:
    """Return the faces of every ply or course, those that lie farther from the viewer first.

    Plies lie closer to each other than their faces are long: no order of faces tells which hides
    which, but that of the plies does.
    """
    count = len(ply_names(sheet))
    if course_names(sheet):
        corners = sheet_positions(sheet, frame)[sheet_faces(sheet)]
        return _from_far_to_near(corners, sheet[COURSE].values[frame], view)
    if not count:
        return [np.arange(sheet.sizes["sheet_face"])]
    plies = [np.flatnonzero(sheet[PLY].values == number) for number in range(count)]
    plies = [own for own in plies if own.size]  # films are left out where they count in nothing
    return plies if view.towards[2] > 0.0 else plies[::-1]


def on_faces(values: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return means of node values over the corners of faces; a triangle repeats its last one."""
    corners = values[faces]
    triangle = faces[:, 3] == faces[:, 2]
    return np.where(triangle, corners[:, :3].mean(axis=1), corners.mean(axis=1))


def _draw_map(axis, points, initial, faces, rim, colours) -> None:
    draw_facets(
        axis, points[faces], FROM_ABOVE, colours, shaded=False, edge_darkness=0.7, edge_width=0.18
    )
    draw_segments(axis, points[rim], FROM_ABOVE, INK, 0.9)
    draw_outline(axis, initial, rim, "initial outline")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.15)
    fit_axis(axis, np.concatenate([points[:, :2], initial[:, :2]]), 0.04)
    label_axes(axis, "x [mm]", "y [mm]")


# --- courses of a ply -----------------------------------------------------------------------------


#: Gaps are positive, overlaps negative.
GAP = Shown(JOINT_GAP, "Gap between courses", "mm", 1e3, "PuOr_r", True, 2)
#: Share of white in the colour of a course.
PALE = 0.55


def _from_far_to_near(corners: np.ndarray, numbers: np.ndarray, view: View) -> list[np.ndarray]:
    """Return the faces of every course, those that lie farther from the viewer first.

    Courses lie in one surface: the depth of single faces does not tell which hides which.

    Parameters
    ----------
    corners : of the faces (F, 4, 3). numbers : of their courses (F,).
    """
    courses = [np.flatnonzero(numbers == number) for number in np.unique(numbers)]
    return sorted(courses, key=lambda own: float((corners[own] @ view.towards).mean()))


def _lifted(points: np.ndarray, faces: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return points whose courses lie over each other in their order, as they are laid.

    From above nothing but the order of painting changes.
    """
    heights = np.zeros(len(points))
    heights[faces] = numbers[:, None]
    span = np.ptp(points[:, 2]) + np.ptp(points[:, :2])
    return points + heights[:, None] * np.array([0.0, 0.0, span])


def _course_colours(sheet: xr.Dataset) -> np.ndarray:
    """Return a pale colour for every course of a ply (course_count, 4)."""
    count = len(course_names(sheet))
    palette = np.array([to_rgba(SERIES[n % len(SERIES)]) for n in range(count)])
    palette[:, :3] = PALE + (1.0 - PALE) * palette[:, :3]
    return palette


def joint_gaps_shown(sheet: xr.Dataset, frame: int) -> np.ndarray:
    """Return the known gaps at the joints of a ply in the unit shown."""
    gaps = GAP.factor * sheet[JOINT_GAP].values[frame]
    return gaps[np.isfinite(gaps)]


def draw_joints(axis: Axes, sheet: xr.Dataset, frame: int, colours: ScalarMappable) -> None:
    """Draw the courses of a ply from above, with the gaps along their joints."""
    points = 1e3 * sheet_positions(sheet, frame)
    faces, numbers = sheet_faces(sheet), sheet[COURSE].values[frame].astype(int)
    draw_facets(
        axis, _lifted(points, faces, numbers)[faces], FROM_ABOVE, _course_colours(sheet)[numbers],
        shaded=False, edge_darkness=0.92, edge_width=0.15,
    )  # fmt: skip
    draw_segments(axis, points[boundary_edges(faces)], FROM_ABOVE, INK, 0.7)
    for number, name in enumerate(course_names(sheet)):
        middle = points[faces[numbers == number]].mean(axis=(0, 1))
        axis.text(middle[0], middle[1], name, ha="center", va="center", fontsize=8, color=INK)
    gaps = GAP.factor * sheet[JOINT_GAP].values[frame]
    known = np.isfinite(gaps)
    axis.scatter(
        points[known, 0], points[known, 1], s=14.0, c=colours.to_rgba(gaps[known]),
        edgecolors=INK, linewidths=0.25, zorder=4,
    )  # fmt: skip


def draw_courses(path: Path | str, sheet: xr.Dataset, frame: int = -1) -> None:
    """Draw the courses on the formed shape, and from above the gaps along their joints."""
    points = 1e3 * sheet_positions(sheet, frame)
    faces, numbers = sheet_faces(sheet), sheet[COURSE].values[frame]
    names, palette = course_names(sheet), _course_colours(sheet)
    gaps = GAP.factor * sheet[JOINT_GAP].values[frame]
    known = np.isfinite(gaps)
    rim = boundary_edges(faces)
    view = oblique(from_below=hangs_down(points, rim))
    with matplotlib.rc_context(RC):
        panel = max(
            _height(seen.on_screen(points), width)
            for seen, width in ((view, 5.4), (FROM_ABOVE, 3.9))
        )
        figure = new_figure(11.4, panel + 1.45)
        left = axes_at(figure, 0.2, 0.35, 5.4, panel + 0.2)
        right = axes_at(figure, 6.2, 0.5, 3.9, panel)
        bar = axes_at(figure, 10.4, 0.5 + 0.12 * panel, 0.16, 0.76 * panel)
        for own in _from_far_to_near(points[faces], numbers, view):
            edges = points[boundary_edges(faces[own])]
            draw_facets(left, points[faces[own]], view, palette[numbers[own]], rim=edges)
        fit_axis(left, view.on_screen(points), 0.03)
        left.set_axis_off()
        draw_triad(left, view)
        _say_side(figure, view, panel, "courses on the formed shape")
        colours = colour_scale(gaps[known], GAP)
        draw_joints(right, sheet, frame, colours)
        fit_axis(right, points[:, :2], 0.04)
        label_axes(right, "x [mm]", "y [mm]")
        right.set_title("from above, gaps at the joints", color=FAINT, loc="left")
        if known.any():
            draw_colour_bar(figure, bar, colours, gaps[known], GAP)
            mark_extremes(right, points[known, :2], gaps[known], GAP)
        else:
            bar.set_axis_off()
        title = f"{sheet.attrs.get('title', '')}  ·  {len(names)} courses  ·  negative: overlap"
        headline(figure, GAP.label, title)
        save(figure, path)


# --- fibres, and the sheet between its tools ------------------------------------------------------


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
        _say_side(figure, view, panel, "formed shape")
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


# --- results side by side -------------------------------------------------------------------------


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
    shown : the field, one of :data:`lcmchain.report.style.SHOWN`.
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


# --- panels and their words -----------------------------------------------------------------------


def _height(shown: np.ndarray, width: float) -> float:
    """Return the height [in] of a panel that shows points (P, 2) over its width."""
    span = np.ptp(shown, axis=0)
    return float(np.clip(width * span[1] / max(span[0], 1e-12), 1.6, 5.6))


def _say_side(figure: Figure, view: View, panel: float, what: str) -> None:
    """Say over the left panel, of some height [in], what it shows and from which side."""
    width, height = figure.get_size_inches()
    side = "below" if view.up[2] < 0.0 else "above"
    figure.text(
        0.3 / width, (0.5 + panel) / height, f"{what}, from {side}", color=FAINT, fontsize=9,
        va="bottom",
    )  # fmt: skip


def _subtitle(sheet: xr.Dataset, frame: int) -> str:
    time = 1e3 * float(sheet["time"].values[frame])
    title = sheet.attrs.get("title", "")
    return f"{title}  ·  {sheet.sizes['sheet_face']:,} elements  ·  t = {time:.4g} ms"
