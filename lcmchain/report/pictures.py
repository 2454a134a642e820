"""Pictures of the blank at the start and of the formed shape coloured by its fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
import xarray as xr

from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.summary import sheet_faces, sheet_positions
from lcmchain.mesh.blank import BlankMesh
from lcmchain.report.plots import draw_energy, draw_force
from lcmchain.report.shape import (
    MOST_FACES_WITH_EDGES,
    Shown,
    colour_scale,
    draw_shape,
    draw_triad,
    fit_axis,
    hangs_down,
    joined_outline,
    label_axes,
)
from lcmchain.report.style import (
    FAINT,
    FIBRE_COLOURS,
    INK,
    RC,
    SERIES,
    headline,
    new_figure,
    save,
)
from lcmchain.report.view import (
    FROM_ABOVE,
    boundary_edges,
    contour_edges,
    fronts_and_backs,
    oblique,
    painting_order,
    section,
)

SHOWN = (
    Shown("shear_angle", "Shear angle", "°", 180.0 / np.pi, "RdBu_r", True, 1),
    Shown("thickness", "Thickness", "mm", 1e3, "viridis", False, 3),
    Shown("fibre_volume_fraction", "Fibre volume fraction", "", 1.0, "YlGnBu", False, 3),
)


def draw_result(
    out_dir: Path | str, datasets: Mapping[str, xr.Dataset], frame: int = -1
) -> list[Path]:
    """Draw the formed shape coloured by its fields, and the energies and forces of the run.

    Parameters
    ----------
    out_dir : folder of ``shear_angle.png``, ``thickness.png``, ``fibre_volume_fraction.png``
        (where the result has it), ``energy.png``, and ``force.png`` (where there are tools).
    datasets : groups of the result, from :func:`lcmchain.fields.dataset.build_datasets`.
    frame : saved frame to draw, the last one by default.

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
    for shown in SHOWN:
        if shown.name in sheet:
            files.append(out_dir / f"{shown.name}.png")
            draw_field(files[-1], sheet, shown, frame)
    title = str(sheet.attrs.get("title", ""))
    if any(str(name).startswith("energy_") for name in history.data_vars):
        files.append(out_dir / "energy.png")
        draw_energy(files[-1], history, title)
    if history.sizes["tool"]:
        files.append(out_dir / "force.png")
        draw_force(files[-1], history, title)
    return files


def draw_field(path: Path | str, sheet: xr.Dataset, shown: Shown, frame: int = -1) -> None:
    """Draw a face field on the formed shape: oblique view and view from above."""
    points = 1e3 * sheet_positions(sheet, frame)
    initial = 1e3 * np.stack([sheet[f"reference_position_{a}"].values for a in "xyz"], axis=-1)
    faces = sheet_faces(sheet)
    values = shown.factor * sheet[shown.name].values[frame]
    time = float(sheet["frame_time"].values[frame])

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
        width, height = figure.get_size_inches()

        def add_axes(x: float, y: float, w: float, h: float):
            return figure.add_axes([x / width, y / height, w / width, h / height])

        left = add_axes(0.2, 0.35, widths[0], panel + 0.2)
        right = add_axes(6.2, 0.5, widths[1], panel)
        bar = add_axes(10.4, 0.5 + 0.12 * panel, 0.16, 0.76 * panel)
        colours = colour_scale(values, shown)
        draw_shape(left, points, faces, rim, view, colours.to_rgba(values))
        draw_triad(left, view)
        side = "below" if view.up[2] < 0.0 else "above"
        figure.text(
            0.3 / width, (0.5 + panel) / height, f"formed shape, from {side}", color=FAINT,
            fontsize=9, va="bottom",
        )  # fmt: skip
        _draw_map(right, points, initial, faces, rim, colours.to_rgba(values))
        _mark_extremes(right, points, faces, values, shown)
        right.set_title("from above", color=FAINT, loc="left")
        _draw_colour_bar(figure, bar, colours, values, shown)
        unit = f" [{shown.unit}]" if shown.unit else ""
        subtitle = f"{sheet.attrs.get('title', '')}  ·  {len(faces):,} elements  ·  "
        headline(figure, f"{shown.title}{unit}", subtitle + f"t = {1e3 * time:.4g} ms")
        save(figure, path)


def draw_initial(
    path: Path | str,
    blank: BlankMesh,
    tools: Sequence[tuple[str, np.ndarray, np.ndarray]] = (),
    *,
    title: str = "",
) -> None:
    """Draw the start: blank with mesh and fibre directions, tools, and a cut that shows gaps.

    Parameters
    ----------
    path : of the PNG.
    blank : undeformed mesh.
    tools : name, points [m] (P, 3) and triangles (F, 3) of every tool at travel 0.
    title : of the scene.

    Raises
    ------
    InputError : the place cannot be written.
    """
    from lcmchain.tools.drawing import clip_to_box

    points, faces = 1e3 * blank.mid_surface_positions, blank.faces
    rim = boundary_edges(faces)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low)[:2].max())
    margin = np.array([0.16, 0.16, 0.34]) * size
    box = np.stack([low - margin, high + margin])
    shapes = [
        (name, *clip_to_box(1e3 * np.asarray(p), t, box), SERIES[i % len(SERIES)])
        for i, (name, p, t) in enumerate(tools)
    ]

    with matplotlib.rc_context(RC):
        figure = new_figure(11.6, 7.6)
        oblique_axis = figure.add_axes([0.015, 0.355, 0.51, 0.53])
        map_axis = figure.add_axes([0.575, 0.39, 0.39, 0.49])
        cut_axis = figure.add_axes([0.06, 0.07, 0.44, 0.225])
        gap_axis = figure.add_axes([0.575, 0.07, 0.39, 0.225])
        _draw_start(oblique_axis, points, faces, rim, shapes)
        _draw_fibres(map_axis, blank, points, faces, rim, shapes)
        middle = round(0.5 * (low[1] + high[1]), 6) + 0.0  # no minus zero in the title
        thickness = 1e3 * blank.thickness
        _draw_cut(cut_axis, points, rim, thickness, shapes, middle, box)
        _draw_gaps(gap_axis, points, rim, thickness, shapes, middle, box)
        edges = np.linalg.norm(points[faces[:, 1]] - points[faces[:, 0]], axis=1)
        subtitle = (
            f"{title + '  ·  ' if title else ''}{len(faces):,} elements, "
            f"edge {np.median(edges):.3g} mm, thickness {thickness:.4g} mm, "
            f"area {1e4 * blank.area:.4g} cm²"
        )
        headline(figure, "Blank, tools and fibre directions at the start", subtitle)
        save(figure, path)


# --- formed shape ---------------------------------------------------------------------------------


def _draw_map(axis, points, initial, faces, rim, colours) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    order = painting_order(points[faces], FROM_ABOVE)
    lines = 0.7 * colours[:, :3] if len(faces) <= MOST_FACES_WITH_EDGES else colours[:, :3]
    axis.add_collection(
        PolyCollection(
            points[faces][order][:, :, :2],
            facecolors=colours[order],
            edgecolors=lines[order],
            linewidths=0.18,
        )
    )
    axis.add_collection(LineCollection(points[rim][:, :, :2], colors=INK, linewidths=0.9))
    axis.add_collection(
        LineCollection(
            joined_outline(initial, rim), colors=FAINT, linewidths=0.8, linestyles=(0, (5, 4))
        )
    )
    axis.plot([], [], color=FAINT, lw=0.8, ls=(0, (5, 4)), label="initial outline")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.15)
    fit_axis(axis, np.concatenate([points[:, :2], initial[:, :2]]), 0.04)
    label_axes(axis, "x [mm]", "y [mm]")


def _mark_extremes(axis, points, faces, values, shown: Shown) -> None:
    from matplotlib.patheffects import withStroke

    if not np.isfinite(values).any():
        return
    centres = points[faces].mean(axis=1)
    halo = [withStroke(linewidth=2.0, foreground="white")]
    middle = points[:, 0].mean()
    for face, marker, word in (
        (int(np.nanargmax(values)), "^", "max"),
        (int(np.nanargmin(values)), "v", "min"),
    ):
        x, y = centres[face, :2]
        axis.plot(x, y, marker, ms=5.5, mfc="white", mec=INK, mew=0.9, zorder=5)
        towards_middle = 1 if x <= middle else -1
        label = f"{word} {values[face]:.{shown.decimals}f}{shown.unit if shown.unit == '°' else ''}"
        axis.annotate(
            label.replace("-", "\N{MINUS SIGN}"),
            # one above, one below: labels of neighbours do not meet
            (x, y), (4 * towards_middle, 4 if word == "max" else -4), textcoords="offset points",
            fontsize=7.5, ha="left" if towards_middle > 0 else "right",
            va="bottom" if word == "max" else "top", path_effects=halo, zorder=6,
        )  # fmt: skip


def _draw_colour_bar(figure, axis, colours, values, shown: Shown) -> None:
    low, high = np.nanmin(values), np.nanmax(values)
    below = low < colours.norm.vmin - 1e-9 * abs(low)
    above = high > colours.norm.vmax + 1e-9 * abs(high)
    extend = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]
    bar = figure.colorbar(colours, cax=axis, extend=extend)
    bar.outline.set_linewidth(0.6)
    unit = shown.unit and f" [{shown.unit}]"
    bar.set_label(f"{shown.title.lower()}{unit}", labelpad=6)
    suffix = "°" if shown.unit == "°" else f" {shown.unit}".rstrip()
    text = f"{{}} {{:.{shown.decimals}f}}{suffix}"
    for word, value, y, va in (("max", high, 1.075, "bottom"), ("min", low, -0.075, "top")):
        # typographic minus, as on the axis
        label = text.format(word, value).replace("-", "\N{MINUS SIGN}")
        axis.text(-0.2, y, label, transform=axis.transAxes, fontsize=8, va=va)


# --- start ----------------------------------------------------------------------------------------


def _draw_start(axis, points, faces, rim, shapes) -> None:
    """Blank and tools in an oblique view; tools are translucent and in front of what they hide."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import PathPatch

    view = oblique(elevation=26.0)
    level = points[:, 2].mean()
    for name, vertices, triangles, colour in shapes:
        if len(triangles) == 0:
            continue
        above = vertices[triangles].mean(axis=(0, 1))[2] > level
        for corners in fronts_and_backs(vertices, triangles, view):
            axis.add_patch(
                PathPatch(
                    _compound_path(corners), facecolor=colour, alpha=0.09, linewidth=0.0,
                    zorder=3 if above else 1,
                )
            )  # fmt: skip
        segments = contour_edges(vertices, triangles, view)
        axis.add_collection(
            LineCollection(
                view.on_screen(segments), colors=colour, linewidths=0.9, alpha=0.85,
                zorder=3.5 if above else 1.5,
            )
        )  # fmt: skip
        axis.plot([], [], color=colour, lw=1.6, label=name)
    axis.add_collection(
        PolyCollection(
            view.on_screen(points[faces]), facecolors="#eef0f2", edgecolors="#9aa3ad",
            linewidths=0.22 if len(faces) <= MOST_FACES_WITH_EDGES else 0.0, zorder=2,
        )
    )  # fmt: skip
    axis.add_collection(
        LineCollection(view.on_screen(points[rim]), colors=INK, linewidths=1.0, zorder=2.5)
    )
    seen = [view.on_screen(points), *(view.on_screen(s[1]) for s in shapes if len(s[1]))]
    fit_axis(axis, np.concatenate(seen), 0.03)
    axis.set_axis_off()
    draw_triad(axis, view)
    if shapes:
        axis.legend(loc="upper right", title="tools", title_fontsize=8, alignment="left")


def _draw_fibres(axis, blank: BlankMesh, points, faces, rim, shapes) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    axis.add_collection(
        PolyCollection(
            points[faces][:, :, :2], facecolors="#f6f7f8", edgecolors="#c3c9d0",
            linewidths=0.25 if len(faces) <= MOST_FACES_WITH_EDGES else 0.0,
        )
    )  # fmt: skip
    axis.add_collection(LineCollection(points[rim][:, :, :2], colors=INK, linewidths=1.0))
    for _, vertices, triangles, colour in shapes:
        segments = contour_edges(vertices, triangles, FROM_ABOVE)[:, :, :2]
        axis.add_collection(
            LineCollection(segments, colors=colour, linewidths=0.9, alpha=0.8, linestyles="--")
        )
    places, nearest, spacing = _even_places(points[faces].mean(axis=1)[:, :2])
    for number, colour in enumerate(FIBRE_COLOURS, start=1):
        direction = getattr(blank, f"fibre_direction_{number}")[nearest, :2]
        tail = places - 0.36 * spacing * direction
        axis.quiver(
            *tail.T, *(0.72 * spacing * direction).T, angles="xy", scale_units="xy", scale=1.0,
            color=colour, width=0.0032, headwidth=4.2, headlength=5.0, headaxislength=4.4,
            zorder=4,
        )  # fmt: skip
        axis.plot([], [], color=colour, lw=1.8, label=f"fibre {number}")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.15)
    fit_axis(axis, points[:, :2], 0.12)
    axis.set_title("from above, tools dashed", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "y [mm]")


def _draw_cut(axis, points, rim, thickness, shapes, y, box) -> None:
    _draw_section(axis, points, rim, thickness, shapes, y)
    axis.set_aspect("equal")
    axis.set_xlim(box[0][0], box[1][0])
    axis.set_ylim(box[0][2], box[1][2])
    axis.set_title(f"cut at y = {y:.3g} mm", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "z [mm]")


def _draw_gaps(axis, points, rim, thickness, shapes, y, box) -> None:
    """The same cut with a stretched z axis, around the blank: gaps become visible."""
    _draw_section(axis, points, rim, thickness, shapes, y)
    level = points[:, 2].mean()
    axis.set_xlim(box[0][0], box[1][0])
    axis.set_ylim(level - 3.5 * thickness, level + 3.5 * thickness)
    extent = axis.get_window_extent()
    stretch = (extent.height / (7.0 * thickness)) / (extent.width / (box[1][0] - box[0][0]))
    axis.set_title(f"gaps: z stretched {stretch:.2g} times", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "z [mm]")


def _draw_section(axis, points, rim, thickness, shapes, y) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    y += 1e-5 * np.ptp(points[:, 1])  # beside nodes and corners of tools in the plane
    for _, vertices, triangles, colour in shapes:
        if len(triangles):
            segments = section(vertices, triangles, y)
            axis.add_collection(
                LineCollection(segments, colors=colour, linewidths=1.4, capstyle="round", zorder=3)
            )
    ends = points[rim]
    crossing = (ends[:, 0, 1] >= y) != (ends[:, 1, 1] >= y)
    a, b = ends[crossing, 0], ends[crossing, 1]
    where = np.sort(a[:, 0] + (b - a)[:, 0] * (y - a[:, 1]) / (b - a)[:, 1])
    level = points[:, 2].mean() - 0.5 * thickness
    for x0, x1 in zip(where[0::2], where[1::2], strict=False):
        axis.add_patch(
            Rectangle((x0, level), x1 - x0, thickness, fc="#b9c0c8", ec=INK, lw=0.5, zorder=2)
        )


# --- shared ---------------------------------------------------------------------------------------


def _even_places(centres: np.ndarray, across: int = 11) -> tuple[np.ndarray, np.ndarray, float]:
    """Return places on a square grid inside a mesh, the element nearest to each, and the spacing.

    Arrows at the grid's places, not at the centres, stand in even rows on any mesh.
    """
    from scipy.spatial import cKDTree

    low, high = centres.min(axis=0), centres.max(axis=0)
    spacing = float((high - low).max()) / across
    counts = np.maximum(np.floor((high - low) / spacing + 1e-9).astype(int), 1)
    first = 0.5 * (low + high) - 0.5 * (counts - 1) * spacing
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in counts), indexing="ij"), axis=-1)
    places = first + spacing * grid.reshape(-1, 2)
    tree = cKDTree(centres)
    distance, nearest = tree.query(places)
    reach = np.median(tree.query(centres, k=2)[0][:, 1]) if len(centres) > 1 else np.inf
    inside = distance < 0.8 * reach
    return places[inside], nearest[inside], spacing


def _compound_path(corners: np.ndarray):
    """Join polygons with corners (F, K, 2) to one path."""
    from matplotlib.path import Path as DrawnPath

    count, sides = corners.shape[:2]
    vertices = np.concatenate([corners, corners[:, :1]], axis=1).reshape(-1, 2)
    codes = [DrawnPath.MOVETO] + [DrawnPath.LINETO] * (sides - 1) + [DrawnPath.CLOSEPOLY]
    return DrawnPath(vertices, np.tile(np.array(codes, dtype=np.uint8), count))
