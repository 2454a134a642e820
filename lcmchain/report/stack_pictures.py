"""Pictures of a formed stack: every ply by itself, plies lifted off each other, sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection

from lcmchain.fields.dataset import SHEET
from lcmchain.fields.sheet import (
    course_names,
    reference_positions,
    sheet_faces,
    sheet_positions,
    vector,
)
from lcmchain.fields.stack import plies_of
from lcmchain.report.drawn_tools import RunTools
from lcmchain.report.fibre_segments import fibre_lines
from lcmchain.report.pictures import GAP, draw_joints, joint_gaps_shown, on_faces
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_outline,
    draw_segments,
    draw_triad,
    fit_axis,
    label_axes,
    line_layer,
    paint,
    sheet_layer,
)
from lcmchain.report.sections import Plane, Strip, default_planes, draw_section, strips_of
from lcmchain.report.style import (
    BETWEEN_SHOWN,
    FAINT,
    FIBRE_COLOURS,
    INK,
    RC,
    SHOWN,
    Shown,
    colour_scale,
    headline,
    new_figure,
    save,
    shades_of,
)
from lcmchain.report.view import FROM_ABOVE, boundary_edges, hangs_down, oblique
from lcmchain.tools.distance import gaps

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

#: Colour of films.
FILM_SHADE = (0.93, 0.94, 0.96, 1.0)
#: Plies that a picture shows at most, and beside each other.
MOST_PLIES, IN_A_ROW = 16, 4
PANEL = 2.5  # width and height of a ply's panel [in]
#: Colours of neighbouring plies in a section.
PLY_COLOURS = ("#aeb8c4", "#dcd3c3")
#: How far plies are lifted off each other, in parts of the height and of the width of the stack.
LIFT_OF_HEIGHT, LIFT_OF_WIDTH = 0.8, 0.16
#: Places at which tools are looked for in an unrolled section: along, and across.
PLACES = (300, 80)
#: How far beyond the stack an unrolled section reaches, in thicknesses of a ply.
BEYOND = 1.5
#: Strips whose lengths differ by less than this part are as long as each other: a ply outside of a
#: bend is longer by its thickness.
AS_LONG = 0.1


def draw_plies(out_dir: Path, datasets: Mapping[str, xr.Dataset], frame: int = -1) -> list[Path]:
    """Draw fields and fibres of every ply, and the plies lifted off each other.

    Parameters
    ----------
    datasets : groups of the result of a stack.

    Returns
    -------
    The files written: ``plies_<field>.png`` for the fields that a ply has and for pressure and slip
    path on every ply that another one lies on, ``plies_courses.png`` of plies in courses,
    ``plies_fibre_directions.png`` and ``exploded.png``.

    Raises
    ------
    InputError : the folder cannot be written.
    """
    plies = [(name, groups[SHEET]) for name, groups in plies_of(datasets)]
    files = []
    for shown in SHOWN:
        having = [(name, sheet) for name, sheet in plies if shown.name in sheet]
        if having:
            files.append(out_dir / f"plies_{shown.name}.png")
            _draw_field(files[-1], having, shown, frame)
    for shown in BETWEEN_SHOWN:
        covered = [(name, sheet) for name, sheet in plies if _is_covered(sheet, frame).any()]
        if covered:
            files.append(out_dir / f"plies_{shown.name}.png")
            _draw_field(files[-1], covered, shown, frame, count=len(plies))
    laid = [(name, sheet) for name, sheet in plies if course_names(sheet)]
    if laid:
        files.append(out_dir / "plies_courses.png")
        _draw_courses(files[-1], laid, frame, len(plies))
    files.append(out_dir / "plies_fibre_directions.png")
    _draw_fibres(files[-1], plies, frame)
    files.append(out_dir / "exploded.png")
    draw_exploded(files[-1], plies, frame)
    return files


# --- every ply by itself --------------------------------------------------------------------------


def _draw_field(
    path: Path,
    plies: Sequence[tuple[str, xr.Dataset]],
    shown: Shown,
    frame: int,
    count: int | None = None,
) -> None:
    """Draw a field on every ply, formed and from above, in the same colours.

    Fields between plies are drawn where another ply lies on the one that is shown.

    count : of all plies, where not all are drawn.
    """
    values = [_face_values(sheet, shown, frame) for _, sheet in plies]
    exact = [shown.factor * sheet[shown.name].values[frame] for _, sheet in plies]
    titles = [name for name, _ in plies]
    if shown in BETWEEN_SHOWN:
        known = [_is_covered(sheet, frame) | (own != 0.0) for own, (_, sheet) in zip(exact, plies)]
        values = [
            np.where(nodes[sheet_faces(sheet)].any(axis=1), own, np.nan)
            for own, nodes, (_, sheet) in zip(values, known, plies)
        ]
        exact = [np.where(nodes, own, np.nan) for own, nodes in zip(exact, known)]
        titles = [f"{name} under {_lying_on(sheet, frame)}" for name, sheet in plies]
    every = np.concatenate(exact)
    with matplotlib.rc_context(RC):
        colours = colour_scale(np.concatenate(values), shown)
        figure, axes, bar = _panels(len(plies), bar=True)
        around = _around(plies, frame)
        for axis, title, (_, sheet), own, raw in zip(axes, titles, plies, values, exact):
            points, initial = 1e3 * sheet_positions(sheet, frame), 1e3 * reference_positions(sheet)
            faces = sheet_faces(sheet)
            rim = boundary_edges(faces)
            shades = shades_of(colours, own)
            draw_facets(
                axis, points[faces], FROM_ABOVE, shades, shaded=False, edge_darkness=0.7,
                edge_width=0.1,
            )  # fmt: skip
            draw_segments(axis, points[rim], FROM_ABOVE, INK, 0.7)
            draw_outline(axis, initial, rim, "initial outline", width=0.6)
            low, high = np.nanmin(raw), np.nanmax(raw)
            _finish(axis, around, f"{title}: {shown.text(low)} to {shown.text(high)}")
        draw_colour_bar(figure, bar, colours, every, shown)
        of = "" if shown in BETWEEN_SHOWN else " of the plies"
        headline(figure, f"{shown.label}{of}", _subtitle(plies, frame, count))
        save(figure, path)


def _is_covered(sheet: xr.Dataset, frame: int) -> np.ndarray:
    """Tell of every node whether another ply lies on the upper face there, (n,)."""
    if "faced_ply_top" not in sheet:
        return np.zeros(sheet["displacement_x"].shape[-1], dtype=bool)
    return sheet["faced_ply_top"].values[frame] >= 0


def _lying_on(sheet: xr.Dataset, frame: int) -> str:
    """Name the plies that lie on the upper face of one."""
    faced = sheet["faced_ply_top"]
    names = dict(
        zip(faced.attrs["flag_values"].tolist(), faced.attrs["flag_meanings"].split(), strict=True)
    )
    return ", ".join(names[number] for number in np.unique(faced.values[frame]) if number >= 0)


def _face_values(sheet: xr.Dataset, shown: Shown, frame: int) -> np.ndarray:
    """Return a field on the faces in the unit shown; one on nodes as the mean of their corners."""
    values = shown.factor * sheet[shown.name].values[frame]
    if sheet[shown.name].attrs["location"] != "node":
        return values
    return on_faces(values, sheet_faces(sheet))


def _draw_fibres(path: Path, plies: Sequence[tuple[str, xr.Dataset]], frame: int) -> None:
    """Draw the fibre lines of every ply, formed and from above."""
    with matplotlib.rc_context(RC):
        figure, axes, _ = _panels(len(plies))
        around = _around(plies, frame)
        shown: set[int] = set()
        for axis, (name, sheet) in zip(axes, plies):
            points, initial = 1e3 * sheet_positions(sheet, frame), 1e3 * reference_positions(sheet)
            faces = sheet_faces(sheet)
            rim = boundary_edges(faces)
            layers = [sheet_layer(points[faces], FROM_ABOVE, "#f1efe9", shaded=False)]
            # above the faces that a line lies between
            lift = float(np.median(np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)))
            for number, pieces in fibre_lines(sheet, points):
                shown.add(number)
                colour = FIBRE_COLOURS[number - 1]
                layers.append(line_layer(pieces, FROM_ABOVE, colour, 0.6, lift))
            paint(axis, FROM_ABOVE, layers)
            draw_segments(axis, points[rim], FROM_ABOVE, INK, 0.7)
            draw_outline(axis, initial, rim, "initial outline", width=0.6)
            _finish(axis, around, f"{name}, {_laid(sheet)}")
        for number in sorted(shown):
            colour = FIBRE_COLOURS[number - 1]
            axes[0].plot([], [], color=colour, lw=1.5, label=f"fibre {number}")
        width = figure.get_size_inches()[0]
        figure.legend(
            handles=axes[0].get_legend_handles_labels()[0], loc="upper right", ncols=3,
            bbox_to_anchor=(1.0 - 0.3 / width, 0.99),
        )  # fmt: skip
        headline(figure, "Fibre directions of the plies", _subtitle(plies, frame))
        save(figure, path)


def _draw_courses(
    path: Path, plies: Sequence[tuple[str, xr.Dataset]], frame: int, count: int
) -> None:
    """Draw the plies that are laid in courses from above, with the gaps along their joints.

    count : of all plies.
    """
    gaps = [joint_gaps_shown(sheet, frame) for _, sheet in plies]
    every = np.concatenate(gaps)
    with matplotlib.rc_context(RC):
        colours = colour_scale(every, GAP)
        figure, axes, bar = _panels(len(plies), bar=True)
        around = _around(plies, frame)
        for axis, (name, sheet), own in zip(axes, plies, gaps):
            draw_joints(axis, sheet, frame, colours)
            told = f": {GAP.text(own.min())} to {GAP.text(own.max())}" if own.size else ""
            _finish(axis, around, f"{name}{told}")
        if every.size:
            draw_colour_bar(figure, bar, colours, every, GAP)
        else:
            bar.set_axis_off()
        headline(figure, GAP.label, f"{_subtitle(plies, frame, count)}  ·  negative: overlap")
        save(figure, path)


def _panels(count: int, *, bar: bool = False):
    """Return a figure with a panel for every ply that is shown, and an axis for a colour bar."""
    count = min(count, MOST_PLIES)
    columns = min(count, IN_A_ROW)
    rows = -(-count // columns)
    # one alone is as wide as two, for the headline
    panel = PANEL if count > 1 else 2.0 * PANEL + 0.45
    width, height = columns * (panel + 0.45) + 0.4 + (1.3 if bar else 0.0), rows * (panel + 0.55)
    figure = new_figure(width, height + 0.75)
    axes = [
        axes_at(
            figure, 0.5 + (n % columns) * (panel + 0.45),
            height - (n // columns + 1) * (panel + 0.55) + 0.35, panel - 0.1, panel - 0.1,
        )
        for n in range(count)
    ]  # fmt: skip
    of_bar = axes_at(figure, width - 1.15, 0.75, 0.16, max(height - 1.3, 1.2)) if bar else None
    return figure, axes, of_bar


def _around(plies: Sequence[tuple[str, xr.Dataset]], frame: int) -> np.ndarray:
    """Return all points that a panel may show (P, 2) [mm]: all panels show the same part."""
    places = [
        place[:, :2]
        for _, sheet in plies
        for place in (sheet_positions(sheet, frame), reference_positions(sheet))
    ]
    return 1e3 * np.concatenate(places)


def _finish(axis: Axes, around: np.ndarray, title: str) -> None:
    fit_axis(axis, around, 0.04)
    axis.set_title(title, color=INK, loc="left", fontsize=8)
    axis.tick_params(labelsize=6, length=2, pad=1.5)


def _laid(sheet: xr.Dataset) -> str:
    """Say at which angle from x fibre 1 was before forming, or that there are no fibres."""
    if "fibre_direction_1_x" not in sheet:
        return "without fibres"
    x, y = vector(sheet, "fibre_direction_1", 0).mean(axis=0)[:2]
    return f"laid at {float(np.degrees(np.arctan2(y, x)).round(6)) + 0.0:.4g}°"


def _subtitle(plies: Sequence[tuple[str, xr.Dataset]], frame: int, count: int | None = None) -> str:
    sheet = plies[0][1]
    time = 1e3 * float(sheet["time"].values[frame])
    more = f", the lowest {MOST_PLIES} of them" if len(plies) > MOST_PLIES else ""
    return (
        f"{sheet.attrs.get('title', '')}  ·  {count or len(plies)} plies{more}, bottom first, from "
        f"above  ·  t = {time:.4g} ms"
    )


# --- lifted off each other ------------------------------------------------------------------------


def draw_exploded(path: Path, plies: Sequence[tuple[str, xr.Dataset]], frame: int = -1) -> None:
    """Draw the formed plies lifted off each other, with their shear angle and fibre lines."""
    shown = SHOWN[0]
    formed = [1e3 * sheet_positions(sheet, frame) for _, sheet in plies]
    every = np.concatenate(formed)
    span = np.ptp(every, axis=0)
    lift = LIFT_OF_HEIGHT * span[2] + LIFT_OF_WIDTH * span[:2].max()
    faces = [sheet_faces(sheet) for _, sheet in plies]
    view = oblique(from_below=hangs_down(formed[0], boundary_edges(faces[0])))
    lifted = [points + [0.0, 0.0, number * lift] for number, points in enumerate(formed)]
    seen = view.on_screen(np.concatenate(lifted))
    extent = np.ptp(seen, axis=0)
    height = float(np.clip(7.2 * extent[1] / max(extent[0], 1e-12), 2.0, 14.0))
    # a film has no shear angle
    values = [
        shown.factor * sheet[shown.name].values[frame]
        if shown.name in sheet
        else np.full(len(own), np.nan)
        for (_, sheet), own in zip(plies, faces, strict=True)
    ]
    # what lies farther from the viewer is painted first
    order = range(len(plies)) if view.towards[2] > 0.0 else range(len(plies) - 1, -1, -1)
    with matplotlib.rc_context(RC):
        colours = colour_scale(np.concatenate(values), shown)
        figure = new_figure(10.2, height + 1.1)
        axis = axes_at(figure, 0.2, 0.2, 8.2, height)
        for depth, number in enumerate(order):
            name, sheet = plies[number]
            points, rim = lifted[number], boundary_edges(faces[number])
            shades = colours.to_rgba(np.nan_to_num(values[number]))
            shades[np.isnan(values[number])] = FILM_SHADE
            step = float(np.median(np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)))
            layers = [
                sheet_layer(points[faces[number]], view, shades),
                line_layer(points[rim], view, INK, 0.8, 0.1 * step),
            ]
            for _, pieces in fibre_lines(sheet, points, 15):
                layers.append(line_layer(pieces, view, "#3a4149", 0.45, step))
            paint(axis, view, layers, zorder=1.0 + depth)
            corner = view.on_screen(points)
            place = corner[np.argmin(corner[:, 0])]
            start = (seen[:, 0].min() - 0.02 * extent[0], place[1])
            axis.plot(*np.array([start, place]).T, color=FAINT, lw=0.5, zorder=0.5)
            axis.text(*start, f"{name}, {_laid(sheet)} ", fontsize=8, ha="right", va="center")
        room = seen - [0.22 * extent[0], 0.0]  # for the names
        fit_axis(axis, np.concatenate([seen, room]), 0.02)
        axis.set_axis_off()
        draw_triad(axis, view)
        bar = axes_at(figure, 8.9, 0.2 + 0.2 * height, 0.16, 0.6 * height)
        draw_colour_bar(figure, bar, colours, np.concatenate(values), shown)
        time = 1e3 * float(plies[0][1]["time"].values[frame])
        headline(
            figure, "Plies lifted off each other",
            f"{plies[0][1].attrs.get('title', '')}  ·  shear angle and fibre lines, {lift:.3g} mm "
            f"between plies  ·  t = {time:.4g} ms",
        )  # fmt: skip
        save(figure, path)


# --- sections -------------------------------------------------------------------------------------


def draw_stack_sections(
    path: Path,
    datasets: Mapping[str, xr.Dataset],
    planes: Sequence[Plane],
    tools: RunTools | None = None,
    travel: np.ndarray | None = None,
    frame: int = -1,
) -> None:
    """Draw cuts through all plies and the tools: to scale, and unrolled along the longest ply.

    Unrolled, the middle of one ply is straight: of that which covers most of the cut, the lowest of
    equal ones. All else keeps its shortest distance from this middle. The thickness is stretched.

    Parameters
    ----------
    planes : of the cuts; without any through the middle along the fibres of the lowest ply.
    travel : of the tools in the frame [m], shape (T,).
    """
    plies = dict(plies_of(datasets))
    lowest = next(iter(plies.values()))
    planes = planes or default_planes(lowest[SHEET])
    cuts = [
        (plane, [(name, strips_of(groups, plane, frame)) for name, groups in plies.items()])
        for plane in planes
    ]
    with matplotlib.rc_context(RC):
        rows = len(cuts)
        total = 0.6 + 3.4 * rows
        figure = new_figure(12.0, total)
        for row, (plane, strips) in enumerate(cuts):
            bottom = total - 0.6 - 3.4 * (row + 1) + 0.55
            axis = axes_at(figure, 0.65, bottom, 6.0, 2.4)
            across = axes_at(figure, 7.4, bottom, 4.3, 2.4)
            draw_section(
                axis, plane,
                [(own, PLY_COLOURS[n % 2]) for n, (_, own) in enumerate(strips)], tools, travel,
            )  # fmt: skip
            _draw_unrolled(across, plane, strips, tools, travel)
        names = list(plies)
        labels = [names[0], names[1] if len(names) == 2 else f"{names[1]}, and so on"]
        handles: list[Any] = [
            matplotlib.patches.Patch(fc=colour, ec=INK, lw=0.5, label=label)
            for colour, label in zip(PLY_COLOURS, labels, strict=True)
        ]
        if tools is not None:
            handles += [
                matplotlib.lines.Line2D([], [], color=colour, lw=1.6, label=name)
                for tool, (name, colour) in enumerate(zip(tools.names, tools.colours))
                if tools.shows(tool)
            ]
        figure.legend(
            handles=handles, loc="upper right", ncols=6,
            bbox_to_anchor=(1.0 - 0.3 / 12.0, 1.0 - 0.12 / total),
        )  # fmt: skip
        sheet = datasets[SHEET]
        time = 1e3 * float(sheet["time"].values[frame])
        headline(
            figure, "Sections through the stack",
            f"{sheet.attrs.get('title', '')}  ·  t = {time:.4g} ms",
        )  # fmt: skip
        save(figure, path)


def _draw_unrolled(
    axis: Axes,
    plane: Plane,
    plies: Sequence[tuple[str, Sequence[Strip]]],
    tools: RunTools | None,
    travel: np.ndarray | None,
) -> None:
    """Draw all plies over the length of the one that the plane cuts farthest."""
    longest = _base_of(plane, plies)
    if longest is None:
        axis.text(0.5, 0.5, "the plane misses the stack", transform=axis.transAxes, ha="center")
        return
    name, base, line = longest
    thickness = float(np.linalg.norm(base[1] - base[0], axis=1).max())
    low, high = 0.0, 0.0
    for number, (_, strips) in enumerate(plies):
        for lower, upper in strips:
            faces = [line.unrolled(plane.flat(face)) for face in (lower, upper)]
            outline = 1e3 * np.concatenate([faces[0], faces[1][::-1]])
            low, high = min(low, outline[:, 1].min()), max(high, outline[:, 1].max())
            axis.add_collection(
                PolyCollection(
                    [outline], facecolors=PLY_COLOURS[number % 2], edgecolors=INK, linewidths=0.5
                )
            )
    margin = 1e3 * BEYOND * thickness
    axis.set_xlim(0.0, max(1e3 * line.length, 1e-9))
    axis.set_ylim(low - margin, high + margin)
    if tools is not None and travel is not None:
        _draw_unrolled_tools(axis, plane, line, tools, travel)
    extent = axis.get_window_extent()
    stretch = (extent.height / (high - low + 2.0 * margin)) / (extent.width / (1e3 * line.length))
    axis.set_title(f"unrolled, thickness × {float(f'{stretch:.2g}'):g}", color=FAINT, loc="left")
    label_axes(axis, f"along {name} [mm]", "from its middle [mm]")


def _base_of(
    plane: Plane, plies: Sequence[tuple[str, Sequence[Strip]]]
) -> tuple[str, Strip, _Line] | None:
    """Return the strip that is longest in a cut, with the name of its ply, and its middle line.

    A patch tells nothing of the rest; of plies that are as long as each other the lowest is taken.
    """
    longest: tuple[str, Strip, _Line] | None = None
    for name, strips in plies:
        for strip in strips:
            line = _Line(plane.flat(0.5 * (strip[0] + strip[1])))
            if longest is None or line.length > (1.0 + AS_LONG) * longest[2].length:
                longest = name, strip, line
    return longest


def _draw_unrolled_tools(
    axis: Axes, plane: Plane, line: _Line, tools: RunTools, travel: np.ndarray
) -> None:
    """Draw where the distance of a tool is zero, seen from the line that is unrolled."""
    along = np.linspace(0.0, line.length, PLACES[0])
    across = 1e-3 * np.linspace(*axis.get_ylim(), PLACES[1])
    points = plane.place(line.places(along, across)).reshape(-1, 3)
    for tool, colour in enumerate(tools.colours):
        if not tools.shows(tool):
            continue
        distance = gaps(tools.table, tool, np.ascontiguousarray(points), float(travel[tool]))
        distance = distance.reshape(len(across), len(along))
        if (distance < 0.0).any() and (distance > 0.0).any():
            axis.contour(
                1e3 * along, 1e3 * across, distance, levels=[0.0], colors=[colour], linewidths=1.0,
                zorder=3,
            )  # fmt: skip


class _Line:
    """A line of points (n, 2) [m] in a plane, by which others are told along and across."""

    def __init__(self, points: np.ndarray) -> None:
        steps = np.diff(points, axis=0)
        size = np.linalg.norm(steps, axis=1)
        keep = size > 0.0
        self.start, self.step, size = points[:-1][keep], steps[keep], size[keep]
        self.size = size
        self.before = np.concatenate([[0.0], np.cumsum(size)[:-1]])
        self.length = float(size.sum())
        self.normal = np.stack([-self.step[:, 1], self.step[:, 0]], axis=1) / size[:, None]

    def unrolled(self, points: np.ndarray) -> np.ndarray:
        """Return how far along the line and off it points lie (m, 2), the nearest way."""
        offset = points[:, None] - self.start
        share = np.einsum("msi,si->ms", offset, self.step) / self.size**2
        # beyond an end the line goes on straight
        low = np.where(np.arange(len(self.size)) == 0, -np.inf, 0.0)
        high = np.where(np.arange(len(self.size)) == len(self.size) - 1, np.inf, 1.0)
        share = np.clip(share, low, high)
        rest = offset - share[..., None] * self.step
        nearest = np.argmin(np.einsum("msi,msi->ms", rest, rest), axis=1)
        row = np.arange(len(points))
        rest = rest[row, nearest]
        side = np.sign(np.einsum("mi,mi->m", rest, self.normal[nearest]))
        along = self.before[nearest] + share[row, nearest] * self.size[nearest]
        return np.stack([along, side * np.linalg.norm(rest, axis=1)], axis=1)

    def places(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Return the points (n, m, 2) at lengths along the line (m,) and off it (n,)."""
        piece = np.clip(np.searchsorted(self.before, along, side="right") - 1, 0, None)
        share = ((along - self.before[piece]) / self.size[piece])[:, None]
        on_line = self.start[piece] + share * self.step[piece]
        return on_line + across[:, None, None] * self.normal[piece]
