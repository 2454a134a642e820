"""Pictures of a filling: isochrones and pressure on the part, a film of the front, and curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from lcmchain.atomic import replacing
from lcmchain.coupling.infiltration.formed_part import UNFORMED
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.report.drawn_tools import DepthBuffer, divided_segments
from lcmchain.report.renderer import (
    axes_at,
    draw_facets,
    draw_segments,
    draw_triad,
    fit_axis,
    label_axes,
)
from lcmchain.report.run_pictures import DPI, DURATION, HEIGHT, LEAST, WIDTH, write_film
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import (
    FROM_ABOVE,
    View,
    boundary_edges,
    brightness,
    hangs_down,
    oblique,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


GATE_COLOUR, VENT_COLOUR, DRY_COLOUR = "#d5008f", "#1769aa", (0.87, 0.87, 0.87)
WIDTHS = (5.4, 3.9)  # of the panels [in]
BANDS = 14
#: Filled share up to which the pressure of a part that fills is drawn.
NEARLY_FULL = 0.96
TIME_COLOURS, PRESSURE_COLOURS = "viridis_r", "YlOrRd"
#: Last place taken of each colour map: marks have to be seen upon it.
DARKEST = {TIME_COLOURS: 0.94, PRESSURE_COLOURS: 0.82}
#: Dry spots that are named, the largest first.
MOST_NAMED = 6


def draw_fill_time(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw how the front moved: bands and lines of equal fill time, gates, vents, dry spots."""
    last, factor, unit = _last_time(filled.fill_time)
    values = factor * filled.fill_time
    share = 100.0 * filled.history.filled_share[-1]
    # what presses on a part goes on after it is full, and the last step ends after the last node
    end = last if filled.is_filled else filled.time[-1]
    subtitle = f"{title}  ·  {share:.4g} % filled after {factor * end:.4g} {unit}"
    _draw(path, filled, values, f"Fill time [{unit}]", TIME_COLOURS, subtitle, lowest=0.0)


def draw_medium_time(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw how the front moved in the flow medium on the part."""
    assert filled.layer is not None
    last, factor, unit = _last_time(filled.layer.fill_time)
    subtitle = f"{title}  ·  the last of it is reached after {factor * last:.4g} {unit}"
    _draw(
        path, filled, factor * filled.layer.fill_time, f"Fill time of the flow medium [{unit}]",
        TIME_COLOURS, subtitle, lowest=0.0, named_dry=False, empty="none, or dry",
    )  # fmt: skip


def _last_time(fill_time: np.ndarray) -> tuple[float, float, str]:
    """Return the last of fill times [s], and factor and name of the unit that shows them."""
    last = float(np.nanmax(fill_time)) if np.isfinite(fill_time).any() else 0.0
    return (last, 1.0, "s") if last < 600.0 else (last, 1.0 / 60.0, "min")


def draw_pressure(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw the pressure in the resin shortly before the part is full, or at the end.

    In the last moment all flow is to the last dry place, which says nothing of the mould.
    """
    share = np.interp(filled.time, filled.history.time, filled.history.filled_share)
    before = np.flatnonzero((share > 0.0) & (share <= NEARLY_FULL))
    frame = int(before[-1]) if filled.is_filled and len(before) else len(filled.time) - 1
    wet = filled.fill[frame] > 0.0
    values = np.where(wet, 1e-5 * filled.pressure[frame], np.nan)
    subtitle = f"{title}  ·  t = {filled.time[frame]:.4g} s, {share[frame]:.0%} filled"
    _draw(path, filled, values, "Pressure [bar]", PRESSURE_COLOURS, subtitle, named_dry=False)


def _draw(
    path: Path | str,
    filled: FilledPart,
    values: np.ndarray,
    label: str,
    colour_map: str,
    subtitle: str,
    *,
    lowest: float | None = None,
    named_dry: bool = True,
    empty: str = "dry",
) -> None:
    points = 1e3 * filled.setup.part.target.points
    cells = filled.setup.part.target.corners
    rim = boundary_edges(np.where(cells < 0, cells[:, 2:3], cells))
    view = oblique(from_below=len(rim) > 0 and hangs_down(points, rim))
    used = points[np.unique(cells[cells >= 0])]
    aspects = [
        span[1] / max(span[0], 1e-12)
        for span in (np.ptp(v.on_screen(used), axis=0) for v in (view, FROM_ABOVE))
    ]
    levels = nice_levels(values, lowest)
    with matplotlib.rc_context(RC):
        panel = float(max(np.clip(w * a, 1.6, 5.6) for w, a in zip(WIDTHS, aspects)))
        figure = new_figure(11.4, panel + 1.6)
        left = axes_at(figure, 0.2, 0.35, WIDTHS[0], panel + 0.2)
        right = axes_at(figure, 6.2, 0.5, WIDTHS[1], panel)
        bar = axes_at(figure, 10.4, 0.5 + 0.12 * panel, 0.16, 0.76 * panel)
        for axis, seen, shaded in ((left, view, True), (right, FROM_ABOVE, False)):
            paint_contours(axis, points, cells, values, levels, colour_map, seen, rim, shaded)
            fit_axis(axis, seen.on_screen(used), 0.05)
            mark_places(axis, filled, seen, dry=named_dry, legend=axis is right)
        left.set_axis_off()
        draw_triad(left, view)
        side = "below" if view.up[2] < 0.0 else "above"
        shown = "part" if UNFORMED in filled.setup.part.dataset.attrs else "formed part"
        figure.text(
            0.3 / 11.4, (0.5 + panel) / (panel + 1.6), f"{shown}, from {side}", color=FAINT,
            fontsize=9, va="bottom",
        )  # fmt: skip
        right.set_title("from above", color=FAINT, loc="left")
        label_axes(right, "x [mm]", "y [mm]")
        has_dry = bool(np.isnan(values[cells]).any())
        draw_level_bar(figure, bar, levels, colour_map, label, has_dry, empty)
        headline(figure, label, subtitle)
        save(figure, path)


def nice_levels(values: np.ndarray, lowest: float | None = None) -> np.ndarray:
    """Return about a dozen round levels that hold all values."""
    known = values[np.isfinite(values)]
    low, high = (0.0, 1.0) if len(known) == 0 else (float(known.min()), float(known.max()))
    if lowest is not None:
        low = lowest
    if high - low <= 1e-6 * max(abs(high), 1e-12):
        high = low + max(abs(low), 1e-12)
    return np.asarray(MaxNLocator(BANDS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))


def _band_colours(levels: np.ndarray, colour_map: str) -> np.ndarray:
    """Return the colours of the bands between levels, shape (B, 4)."""
    count = len(levels) - 1
    return matplotlib.colormaps[colour_map](np.linspace(0.04, DARKEST[colour_map], count))


def paint_contours(
    axis: Axes,
    points: np.ndarray,
    cells: np.ndarray,
    values: np.ndarray,
    levels: np.ndarray,
    colour_map: str,
    view: View,
    rim: np.ndarray,
    shaded: bool,
) -> None:
    """Paint bands of a node field and the lines between them, from back to front."""
    corners, at, _ = triangles_around_centres(points, cells, values)
    found = contours(corners, at, levels)
    light = brightness(corners, view) if shaded else np.ones(len(corners))
    wet = _band_colours(levels, colour_map)[found.band][:, :3] * light[found.triangle, None]
    dry = np.array(DRY_COLOUR) * light[found.empty_triangle, None]
    empty = found.empty[:, [0, 1, 2, 2, 2]]
    draw_facets(
        axis, np.concatenate([found.polygons, empty]), view, np.concatenate([wet, dry]),
        rim=points[rim], shaded=False, edge_darkness=1.0, edge_width=0.3,
    )  # fmt: skip
    if len(found.lines):
        whole = np.where(cells < 0, cells[:, 2:3], cells)
        hidden = _hidden(DepthBuffer(points[whole], view), found.lines.mean(axis=1), view,
                         _facet_size(points, whole))  # fmt: skip
        draw_segments(axis, found.lines[~hidden], view, INK, 0.55, zorder=4.0, capstyle="round")


def mark_places(
    axis: Axes, filled: FilledPart, view: View, *, dry: bool = True, legend: bool = True
) -> None:
    """Mark gates, vents and dry spots where the part does not hide them."""
    points = 1e3 * filled.setup.part.target.points
    cells = filled.setup.part.target.corners
    whole = np.where(cells < 0, cells[:, 2:3], cells)
    buffer = DepthBuffer(points[whole], view)
    size = _facet_size(points, whole)
    for places, colour, marker in (
        (filled.setup.gates, GATE_COLOUR, "v"), (filled.setup.vents, VENT_COLOUR, "o")
    ):  # fmt: skip
        for place in places:
            _mark(axis, place.name, place.nodes, points, whole, view, buffer, size, colour, marker)
    if dry:
        for name, spot in filled.dry_spots[:MOST_NAMED]:
            at = points[spot.nodes]  # the centre of a pocket on a curved part lies off it
            at = at[np.argmin(np.linalg.norm(at - 1e3 * np.array(spot.place), axis=1))]
            if not _hidden(buffer, at[None], view, size)[0]:
                text = f"{name}: {1e4 * spot.area:.3g} cm²"
                _label(axis, view.on_screen(at), text, INK, "x")
    if legend:
        kinds = (("gate", GATE_COLOUR), ("vent", VENT_COLOUR))
        for word, colour in kinds:
            axis.plot([], [], color=colour, lw=2.2, label=word)
        axis.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.15, ncols=len(kinds)
        )


def _mark(axis, name, nodes, points, whole, view, buffer, size, colour, marker) -> None:
    """Draw a line where a place is one, else a mark at its middle; its name beside."""
    inside = np.zeros(len(points), dtype=bool)
    inside[nodes] = True
    edges = boundary_edges(whole)
    edges = edges[inside[edges].all(axis=1)] if len(edges) else edges
    if len(edges) >= 0.5 * len(nodes) and len(edges) > 1:
        parts = divided_segments(points[edges], size)
        seen = ~_hidden(buffer, parts.mean(axis=1), view, size)
        axis.add_collection(
            LineCollection(
                view.on_screen(parts[seen]), colors=colour, linewidths=2.2, zorder=5,
                capstyle="round",
            )
        )  # fmt: skip
        if seen.any():  # the name where the line is nearest to the viewer
            near = parts[seen].mean(axis=1)
            at = near[np.argmax(near @ view.towards - near @ view.up)]
            _label(axis, view.on_screen(at), name, colour, None)
        return
    middle = points[nodes].mean(axis=0)
    nearest = points[nodes[np.argmin(np.linalg.norm(points[nodes] - middle, axis=1))]]
    seen = ~_hidden(buffer, points[nodes], view, size)
    if len(nodes) > 1 and seen.any():
        axis.plot(*view.on_screen(points[nodes[seen]]).T, ".", color=colour, ms=3.0, zorder=5)
    if not _hidden(buffer, nearest[None], view, size)[0]:
        _label(axis, view.on_screen(nearest), name, colour, marker)


def _facet_size(points: np.ndarray, whole: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(points[whole[:, 1]] - points[whole[:, 0]], axis=1)))


def _hidden(buffer: DepthBuffer, places: np.ndarray, view: View, size: float) -> np.ndarray:
    return buffer.hides(places, places @ view.towards + 0.5 * size)


def _label(axis, place, text: str, colour: str, marker: str | None) -> None:
    if marker is not None:
        edge = {"mec": "white", "mew": 0.7} if marker != "x" else {"mew": 1.4}
        axis.plot(*place, marker, color=colour, ms=6.0, zorder=6, **edge)
    right = place[0] > 0.5 * sum(axis.get_xlim())
    axis.annotate(
        text, place, (-5 if right else 5, 5), textcoords="offset points", fontsize=8,
        color=colour, zorder=7, ha="right" if right else "left",
        path_effects=[withStroke(linewidth=2.0, foreground="white")],
    )  # fmt: skip


def draw_level_bar(
    figure: Figure,
    axis: Axes,
    levels: np.ndarray,
    colour_map: str,
    label: str,
    has_dry: bool,
    empty: str = "dry",
) -> None:
    """Fill an axis with the bar of bands, and name the colour of what is dry."""
    colours = ScalarMappable(
        BoundaryNorm(levels, len(levels) - 1), ListedColormap(_band_colours(levels, colour_map))
    )
    bar = figure.colorbar(colours, cax=axis, ticks=levels)
    bar.outline.set_linewidth(0.6)
    bar.set_label(label[:1].lower() + label[1:], labelpad=6)
    if has_dry:
        axis.legend(
            handles=[Patch(fc=DRY_COLOUR, ec="0.5", lw=0.6, label=empty)], loc="upper left",
            bbox_to_anchor=(-0.6, -0.04), borderaxespad=0.0,
        )  # fmt: skip


# --- filled contours of a node field on a curved mesh, as polygons and lines in space -------------


#: A field that varies by less over a triangle, as a share of all, is drawn as constant.
_FLAT = 1e-9


class Contours(NamedTuple):
    """Bands between levels, the lines between them, and what has no value.

    Parameters
    ----------
    polygons : parts of triangles within a band, shape (P, 5, 3), corners may coincide.
    band : of each polygon, from 0, shape (P,). triangle : that it is a part of, shape (P,).
    lines : along the levels, shape (L, 2, 3).
    empty : triangles without a value at a corner, shape (E, 3, 3). empty_triangle : their rows.
    """

    polygons: np.ndarray
    band: np.ndarray
    triangle: np.ndarray
    lines: np.ndarray
    empty: np.ndarray
    empty_triangle: np.ndarray


def contours(corners: np.ndarray, values: np.ndarray, levels: np.ndarray) -> Contours:
    """Cut triangles along the levels of a field that is linear on each.

    Parameters
    ----------
    corners : of triangles, shape (T, 3, 3). values : there, shape (T, 3), nan where unknown.
    levels : ascending, shape (B + 1,); the first and the last take what lies beyond them.
    """
    known = np.isfinite(values).all(axis=1)
    empty = np.flatnonzero(~known)
    rows = np.flatnonzero(known)
    order = np.argsort(values[rows], axis=1, kind="stable")
    v = np.take_along_axis(values[rows], order, axis=1)
    p = np.take_along_axis(corners[rows], order[:, :, None], axis=1)
    # what a constant field varies by is round-off, which must not become a slope
    span = max(float(np.ptp(v)), 1e-3 * float(np.abs(v).max()), 1e-300) if len(v) else 1.0
    v = v + _FLAT * span * np.arange(3)  # ascending even where the field is constant

    polygons, band, triangle, lines = [], [], [], []
    for number in range(len(levels) - 1):
        low = -np.inf if number == 0 else levels[number]
        high = np.inf if number == len(levels) - 2 else levels[number + 1]
        here = np.flatnonzero((v[:, 0] < high) & (v[:, 2] >= low))
        q, w = p[here], v[here]
        a = np.clip(low, w[:, 0], w[:, 2])
        b = np.clip(high, w[:, 0], w[:, 2])
        middle = np.clip(w[:, 1], a, b)
        parts = [_long(q, w, a), _long(q, w, b), _short(q, w, b), _short(q, w, middle),
                 _short(q, w, a)]  # fmt: skip
        polygons.append(np.stack(parts, axis=1))
        band.append(np.full(len(here), number))
        triangle.append(rows[here])
        if number > 0:
            cut = (w[:, 0] < low) & (w[:, 2] > low)
            lines.append(np.stack([parts[0][cut], parts[4][cut]], axis=1))
    return Contours(
        np.concatenate(polygons), np.concatenate(band), np.concatenate(triangle),
        np.concatenate(lines) if lines else np.empty((0, 2, 3)), corners[empty], empty,
    )  # fmt: skip


def triangles_around_centres(
    points: np.ndarray, cells: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divide cells into triangles around the mean of their corners.

    Parameters
    ----------
    points : (N, 3). cells : (C, 4), -1 behind a triangle, which stays whole. values : (N,).

    Returns
    -------
    Corners (T, 3, 3), values there (T, 3), and the cell of each triangle (T,).
    """
    quad = np.flatnonzero(cells[:, 3] >= 0)
    three = np.flatnonzero(cells[:, 3] < 0)
    corners, at = [points[cells[three, :3]]], [values[cells[three, :3]]]
    owner = [three]
    centre, mean = points[cells[quad]].mean(axis=1), values[cells[quad]].mean(axis=1)
    for k in range(4):
        i, j = cells[quad, k], cells[quad, (k + 1) % 4]
        corners.append(np.stack([points[i], points[j], centre], axis=1))
        at.append(np.stack([values[i], values[j], mean], axis=1))
        owner.append(quad)
    return np.concatenate(corners), np.concatenate(at), np.concatenate(owner)


def _long(p: np.ndarray, v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return the point of a level on the edge from the lowest to the highest value."""
    share = (level - v[:, 0]) / (v[:, 2] - v[:, 0])
    return p[:, 0] + share[:, None] * (p[:, 2] - p[:, 0])


def _short(p: np.ndarray, v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return the point of a level on the two edges over the middle corner."""
    first = np.clip((level - v[:, 0]) / (v[:, 1] - v[:, 0]), 0.0, 1.0)
    second = np.clip((level - v[:, 1]) / (v[:, 2] - v[:, 1]), 0.0, 1.0)
    before = (level <= v[:, 1])[:, None]
    return np.where(
        before,
        p[:, 0] + first[:, None] * (p[:, 1] - p[:, 0]),
        p[:, 1] + second[:, None] * (p[:, 2] - p[:, 1]),
    )


# --- a film of the front: the same view and colours in every saved state --------------------------


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


# --- curves over time: pressures, flow rates, and how full the part is ----------------------------


def draw_curves(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw what gates there are, what presses on the part, and the volumes of resin over time."""
    history = filled.history
    panels: list[Callable] = [_gate_pressures, _gate_rates] if filled.setup.gates else []
    panels += [_forces] if filled.history.force.shape[1] else []
    panels.append(_volumes)
    factor, unit = (1.0, "s") if history.time[-1] < 600.0 else (1.0 / 60.0, "min")
    time, count = factor * history.time, len(panels)
    width = 0.9 + 3.5 * count
    with matplotlib.rc_context(RC):
        figure = new_figure(width, 3.7)
        for number, draw in enumerate(panels):
            axis = figure.add_axes(((0.63 + 3.5 * number) / width, 0.15, 2.65 / width, 0.62))
            draw(axis, filled, time)
            axis.set_xlabel(f"time [{unit}]")
            axis.set_xlim(0.0, max(float(time[-1]), 1e-12))
            lowest = min(
                (float(np.nanmin(line.get_ydata(), initial=0.0)) for line in axis.get_lines()),
                default=0.0,
            )
            axis.set_ylim(bottom=1.05 * lowest)
            axis.grid(alpha=0.25, lw=0.5)
            if draw is _gate_rates:
                _limit(axis, 1e6 * history.gate_rate)
        headline(figure, "Filling over time", title)
        save(figure, path)


def _gate_pressures(axis: Axes, filled: FilledPart, time: np.ndarray) -> None:
    for number, gate in enumerate(filled.setup.gates):
        colour = SERIES[number % len(SERIES)]
        pressure = 1e-5 * filled.history.gate_pressure[:, number]
        axis.plot(time, pressure, color=colour, label=gate.name)
    axis.set_ylabel("pressure of the gates [bar]")
    axis.legend(loc="best")


def _gate_rates(axis: Axes, filled: FilledPart, time: np.ndarray) -> None:
    for number in range(len(filled.setup.gates)):
        colour = SERIES[number % len(SERIES)]
        axis.plot(time, 1e6 * filled.history.gate_rate[:, number], color=colour)
    axis.set_ylabel("flow rate of the gates [ml/s]")


def _forces(axis: Axes, filled: FilledPart, time: np.ndarray) -> None:
    total, fibres, resin, *more = filled.history.force.T
    axis.plot(time, 1e-3 * total, color=INK, label="all")
    axis.plot(time, 1e-3 * fibres, color=SERIES[1], label="fibres")
    axis.plot(time, 1e-3 * resin, color=SERIES[0], ls="--", label="resin")
    if more:
        axis.plot(time, 1e-3 * more[0], color=SERIES[2], ls=":", label="friction")
    axis.set_ylabel("force of what presses [kN]")
    axis.legend(loc="best")


def _volumes(axis: Axes, filled: FilledPart, time: np.ndarray) -> None:
    history = filled.history
    if filled.setup.gates:
        axis.plot(time, 1e6 * history.injected.sum(axis=1), color=INK, label="injected")
    axis.plot(time, 1e6 * history.stored, color=SERIES[0], ls="--", label="in the part")
    if history.vented[-1].sum() > 0.0:
        axis.plot(time, 1e6 * history.vented.sum(axis=1), color=SERIES[1], label="vented")
    axis.set_ylabel("volume of resin [ml]")
    share = axis.twinx()
    share.plot(time, 100.0 * history.filled_share, color=SERIES[2], ls=":", label="filled")
    share.set_ylabel("filled share of the pores [%]")
    share.set_ylim(0.0, 105.0)
    axis.legend(handles=[*axis.get_lines(), *share.get_lines()], loc="lower right")


def _limit(axis: Axes, rates: np.ndarray) -> None:
    """Limit the axis, because the flow rate of a pressure gate is unbounded at the begin."""
    rates = rates[np.isfinite(rates)]  # closed gates have none
    if rates.size and rates.max() > 0.0:
        low, high = min(0.0, float(rates.min())), float(rates.max())
        usual = float(np.percentile(rates[rates > 0.0], 90.0)) if (rates > 0.0).any() else high
        axis.set_ylim(low, 1.1 * min(high, 3.0 * usual))
