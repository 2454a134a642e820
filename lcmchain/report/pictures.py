"""Pictures of the formed shape coloured by its fields, and of the run that led to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.history_group import tool_places
from lcmchain.fields.sheet import (
    COURSE,
    course_names,
    reference_positions,
    sheet_faces,
    sheet_positions,
)
from lcmchain.fields.stack import PLY, ply_names, without_films
from lcmchain.fields.summary import has_forces
from lcmchain.report.courses import draw_courses, from_far_to_near, lifted
from lcmchain.report.cut import Plane
from lcmchain.report.extremes import mark_extremes
from lcmchain.report.formed import draw_between_tools, draw_fibre_directions
from lcmchain.report.plots import draw_energy, draw_force
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_outline,
    draw_segments,
    draw_triad,
    fit_axis,
    label_axes,
)
from lcmchain.report.run_tools import RunTools
from lcmchain.report.sections import default_planes, draw_sections
from lcmchain.report.shown import SHOWN, STACK_SHOWN, Shown, colour_scale
from lcmchain.report.stack_pictures import draw_plies, draw_stack_sections
from lcmchain.report.style import FAINT, INK, RC, headline, new_figure, save
from lcmchain.report.travel import draw_force_over_travel
from lcmchain.report.view import FROM_ABOVE, View, boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr


def draw_result(
    out_dir: Path | str,
    datasets: Mapping[str, xr.Dataset],
    frame: int = -1,
    *,
    tools: RunTools | None = None,
    planes: Sequence[Plane] = (),
) -> list[Path]:
    """Draw the formed shape, its fields and sections, and the energies and forces of the run.

    Parameters
    ----------
    out_dir : folder of the pictures in :data:`lcmchain.report.captions.CAPTIONS`: fields that the
        result has, ``fibre_directions.png``, of a stack those of every ply
        (:func:`lcmchain.report.stack_pictures.draw_plies`), of courses ``courses.png``,
        ``sections.png``, ``energy.png``, with tools ``tools.png``, and where their
        forces are known ``force.png`` and, if one of them moves, ``force_over_travel.png``.
    datasets : groups of the result, from :func:`lcmchain.fields.dataset.build_datasets`.
    frame : saved frame to draw, the last one by default.
    tools : of the run; without them there is no ``tools.png``, and sections show the sheet alone.
    planes : of the sections; by default through the middle of the blank along its fibres.

    Returns
    -------
    The files written.

    Raises
    ------
    InputError : the folder cannot be written.
    """
    out_dir = Path(out_dir)
    sheet, history = datasets[SHEET], datasets[HISTORY]
    files = []
    is_stack = bool(ply_names(sheet))
    for shown in STACK_SHOWN if is_stack else SHOWN:
        if shown.name in sheet:
            files.append(out_dir / f"{shown.name}.png")
            draw_field(files[-1], without_films(sheet), shown, frame)
    if course_names(sheet):
        files.append(out_dir / "courses.png")
        draw_courses(files[-1], sheet, frame)
    travel = tool_places(history)[frame]
    if is_stack:
        files += draw_plies(out_dir, datasets, frame)
    else:
        files.append(out_dir / "fibre_directions.png")
        draw_fibre_directions(files[-1], sheet, frame)
    if tools is not None and tools.names:
        files.append(out_dir / "tools.png")
        draw_between_tools(files[-1], sheet, tools, travel, frame)
    files.append(out_dir / "sections.png")
    if is_stack:
        draw_stack_sections(files[-1], datasets, planes, tools, travel, frame)
    else:
        planes = planes or default_planes(sheet)
        draw_sections(files[-1], datasets, planes, tools, travel, frame)
    title = str(sheet.attrs.get("title", ""))
    if any(str(name).startswith("energy_") for name in history.data_vars):
        files.append(out_dir / "energy.png")
        draw_energy(files[-1], history, title)
    if has_forces(history):
        files.append(out_dir / "force.png")
        draw_force(files[-1], history, title)
        if np.ptp(history["tool_travel"].values, axis=0).any():
            files.append(out_dir / "force_over_travel.png")
            draw_force_over_travel(files[-1], history, title)
    return files


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
    time = float(sheet["time"].values[frame])

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
        shades = colours.to_rgba(values)
        for own in _from_back_to_front(sheet, view, frame):
            edges = boundary_edges(faces[own])
            draw_facets(left, points[faces[own]], view, shades[own], rim=points[edges])
        fit_axis(left, view.on_screen(points), 0.03)
        left.set_axis_off()
        draw_triad(left, view)
        side = "below" if view.up[2] < 0.0 else "above"
        figure.text(
            0.3 / 11.4, (0.5 + panel) / (panel + 1.45), f"formed shape, from {side}", color=FAINT,
            fontsize=9, va="bottom",
        )  # fmt: skip
        order = np.concatenate(_from_back_to_front(sheet, FROM_ABOVE, frame))
        seen = points
        if course_names(sheet):
            seen = lifted(points, faces, sheet[COURSE].values[frame])
        _draw_map(right, seen, initial, faces[order], rim, shades[order])
        right.set_title("from above", color=FAINT, loc="left")
        draw_colour_bar(figure, bar, colours, exact, shown)
        mark_extremes(right, places[:, :2], exact, shown)
        subtitle = f"{sheet.attrs.get('title', '')}  ·  {len(faces):,} elements  ·  "
        headline(figure, shown.label, subtitle + f"t = {1e3 * time:.4g} ms")
        save(figure, path)


def _from_back_to_front(sheet: xr.Dataset, view: View, frame: int) -> list[np.ndarray]:
    """Return the faces of every ply or course, those that lie farther from the viewer first.

    Plies lie closer to each other than their faces are long: no order of faces tells which hides
    which, but that of the plies does.
    """
    count = len(ply_names(sheet))
    if course_names(sheet):
        corners = sheet_positions(sheet, frame)[sheet_faces(sheet)]
        return from_far_to_near(corners, sheet[COURSE].values[frame], view)
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


# --- formed shape ---------------------------------------------------------------------------------


def _draw_map(axis, points, initial, faces, rim, colours) -> None:
    draw_facets(
        axis, points[faces], FROM_ABOVE, colours, shaded=False, edge_darkness=0.7, edge_width=0.18
    )
    draw_segments(axis, points[rim], FROM_ABOVE, INK, 0.9)
    draw_outline(axis, initial, rim, "initial outline")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.15)
    fit_axis(axis, np.concatenate([points[:, :2], initial[:, :2]]), 0.04)
    label_axes(axis, "x [mm]", "y [mm]")
