"""Picture of a structural analysis: the deformed part, and its first modes."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np

from lcmchain.mapping.picture import skin
from lcmchain.mapping.structure.report import StructureReport
from lcmchain.mapping.structure.results import StructuralResults
from lcmchain.mapping.target import TargetMesh
from lcmchain.report.renderer import axes_at, draw_colour_bar, draw_facets, draw_triad, fit_axis
from lcmchain.report.style import FAINT, RC, Shown, colour_scale, headline, new_figure, save
from lcmchain.report.view import View, boundary_edges, hangs_down, oblique

PANEL = 4.2  # width of one panel [in]
LEFT, GAP, BAR, BOTTOM, TOP = 0.25, 0.3, 1.2, 0.25, 0.95  # around the panels [in]
MOST_MODES = 3
EXAGGERATION = 0.06  # largest displacement drawn, as a share of the part's size

DISPLACEMENT = Shown("displacement", "Displacement", "mm", 1e3, "viridis", False, 3, lowest=0.0)
MODE = Shown("mode", "Mode shape", "", 1.0, "magma", False, 2, lowest=0.0)


class _Panel(NamedTuple):
    title: str
    shown: Shown
    moves: np.ndarray  # (N, 3)


def draw_results(
    path: Path | str, target: TargetMesh, results: StructuralResults, report: StructureReport
) -> None:
    """Draw the static displacement and the first three modes on the deformed part (PNG)."""
    panels = _panels(results)
    view = oblique(from_below=not target.is_solid and hangs_down(target.points, _rim(target)))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    corners, _ = skin(target)
    height = _height(view, 1e3 * target.points[corners])
    with matplotlib.rc_context(RC):
        width = LEFT + columns * (PANEL + BAR) + (columns - 1) * GAP
        figure = new_figure(width, TOP + rows * (height + GAP) + BOTTOM)
        for number, panel in enumerate(panels):
            row, column = divmod(number, columns)
            left = LEFT + column * (PANEL + BAR + GAP)
            bottom = BOTTOM + (rows - 1 - row) * (height + GAP)
            axis = axes_at(figure, left, bottom, PANEL, height)
            bar = axes_at(figure, left + PANEL + 0.1, bottom + 0.2 * height, 0.14, 0.6 * height)
            _draw(figure, axis, bar, panel, target, corners, view)
        headline(figure, f"{report.name}: structural analysis", _subtitle(report))
        save(figure, path)


def _panels(results: StructuralResults) -> list[_Panel]:
    panels = []
    if results.displacement is not None:
        panels.append(_Panel("static loads", DISPLACEMENT, results.displacement))
    pairs = zip(results.frequencies[:MOST_MODES], results.modes)
    for number, (frequency, shape) in enumerate(pairs, start=1):
        panels.append(_Panel(f"mode {number}: {frequency:.4g} Hz", MODE, shape))
    return panels


def _draw(figure, axis, bar, panel: _Panel, target, corners: np.ndarray, view: View) -> None:
    size = np.linalg.norm(panel.moves, axis=1)
    largest = float(np.nanmax(size))
    extent = np.linalg.norm(np.ptp(target.points[np.unique(corners)], axis=0))
    factor = EXAGGERATION * extent / largest if largest > 0.0 else 0.0
    count = len(target.points)
    moved = 1e3 * (target.points + factor * panel.moves[:count])
    values = panel.shown.factor * size[corners].mean(axis=1)
    colours = colour_scale(values, panel.shown)
    rim = None if target.is_solid else moved[_rim(target)]
    draw_facets(axis, moved[corners], view, colours.to_rgba(values), rim=rim)
    fit_axis(axis, view.on_screen(moved[corners]).reshape(-1, 2), 0.02)
    axis.set_axis_off()
    axis.set_title(_title(panel, largest, float(factor)), color=FAINT, loc="left")
    draw_triad(axis, view)
    # The colour of a facet is the mean of its corners: the largest stands in the title.
    draw_colour_bar(figure, bar, colours, values, panel.shown, extremes=False)


def _title(panel: _Panel, largest: float, factor: float) -> str:
    if panel.shown is MODE:
        return panel.title
    return f"{panel.title}: at most {1e3 * largest:.3g} mm, drawn {factor:.3g} times"


def _rim(target: TargetMesh) -> np.ndarray:
    return boundary_edges(skin(target)[0])


def _height(view: View, points: np.ndarray) -> float:
    width, height = np.ptp(view.on_screen(points).reshape(-1, 2), axis=0)
    return PANEL * float(np.clip(height / max(width, 1e-12), 0.25, 1.2))


def _subtitle(report: StructureReport) -> str:
    parts = [f"{report.cell_count:,} {'/'.join(report.elements)} elements"]
    if report.mass is not None:
        parts.append(f"mass {1e3 * report.mass:.4g} g")
    parts.append(f"largest angle of the second family from perpendicular "
                 f"{np.degrees(report.second_family_error_max):.1f}°")  # fmt: skip
    return "  ·  ".join([*parts, report.solver or ""])
