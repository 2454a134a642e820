"""Picture of a mapping: the sheet on the left, the target on the right, one colour scale."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import FIBRE_FAMILIES, Sheet
from lcmchain.mapping.target import TargetMesh, base_type, corner_count
from lcmchain.mapping.transfer import MappedFields
from lcmchain.mapping.weights import MappingWeights, Status

SOLID_FACES = {
    "tetra": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    "pyramid": [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "hexahedron": [
        *[(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)],
        *[(1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    ],
}

# (field, factor to the shown unit, label)
SHOWN = (
    ("thickness", 1e3, "thickness [mm]"),
    ("fibre_volume_fraction", 1.0, "fibre volume fraction [-]"),
)
OBLIQUE = (np.radians(32.0), np.radians(-58.0))  # elevation, azimuth of the viewer
FROM_ABOVE = (np.radians(90.0), np.radians(-90.0))
SEGMENTS_ACROSS = 20  # fibre segments over the width of the sheet

UNMAPPED_COLOUR = (0.82, 0.82, 0.82, 1.0)
FIBRE_COLOURS = ("#0050d8", "#101010")


class _Facets(NamedTuple):
    polygons: np.ndarray  # (P, 4, 3) [m]
    cell: np.ndarray  # (P,)


class _View(NamedTuple):
    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray


def draw_mapping(
    path: Path | str,
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    report: MappingReport,
) -> None:
    """Draw thickness, fibre volume fraction and both fibre families on sheet and target (PNG)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    rows = [row for row in SHOWN if row[0] in mapped.scalars]
    with_fibres = all(name in mapped.directions for name in FIBRE_FAMILIES)
    row_count = max(len(rows) + with_fibres, 1)
    source_facets = _Facets(sheet.surface.corners, np.arange(sheet.surface.face_count))
    target_facets = _skin(target)

    heights = [_height(OBLIQUE, source_facets, target_facets)] * len(rows)
    heights += [_height(FROM_ABOVE, source_facets, target_facets)] * with_fibres
    heights = heights or [1.0]
    figure = Figure(figsize=(11.0, 1.1 + 4.6 * sum(heights) + 0.35 * row_count), dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.subplots(row_count, 2, squeeze=False, gridspec_kw={"height_ratios": heights})
    figure.set_layout_engine("constrained", hspace=0.01, h_pad=0.06)
    figure.suptitle(_headline(report), fontsize=10.5)

    for row, (name, factor, label) in zip(axes, rows, strict=False):
        values = factor * sheet.scalars[name]
        colours = _colour_scale(values, "viridis")
        view = _view(OBLIQUE)
        _draw_facets(row[0], source_facets, view, colours.to_rgba(values))
        painted = _painted(colours, factor * mapped.scalars[name], weights)
        _draw_facets(row[1], target_facets, view, painted, weights.status)
        figure.colorbar(colours, ax=list(row), label=label, shrink=0.85, extend="both")
        _same_limits(row, view, source_facets, target_facets)
    if with_fibres:
        row = axes[len(rows)]
        view = _view(FROM_ABOVE)
        on_sheet = [sheet.directions[name] for name in FIBRE_FAMILIES]
        on_target = [mapped.directions[name].direction for name in FIBRE_FAMILIES]
        angle, target_angle = _shear(on_sheet), _shear(on_target)
        colours = _colour_scale(angle, "YlOrRd", low=0.0)
        _draw_facets(row[0], source_facets, view, colours.to_rgba(angle))
        painted = _painted(colours, target_angle, weights)
        _draw_facets(row[1], target_facets, view, painted, weights.status)
        span = np.ptp(sheet.surface.points[:, :2], axis=0).max()
        _draw_fibres(row[0], sheet.surface.centroids, on_sheet, span)
        _draw_fibres(row[1], target.centroids, on_target, span)
        label = "angle between families: |shear| [deg]"
        figure.colorbar(colours, ax=list(row), label=label, shrink=0.85, extend="max")
        _same_limits(row, view, source_facets, target_facets)
        for axis in row:
            for name, colour in zip(FIBRE_FAMILIES, FIBRE_COLOURS, strict=True):
                axis.plot([], [], color=colour, lw=1.4, label=name.replace("_", " "))
        row[0].legend(loc="lower left", fontsize=7.5, framealpha=0.9)
    axes[0, 0].set_title("formed sheet", fontsize=10)
    axes[0, 1].set_title(f"{report.name} mesh ({report.cell_count} cells)", fontsize=10)
    marks = []
    if np.any(weights.status == Status.EXTRAPOLATED):
        marks.append(Patch(facecolor="white", edgecolor="0.3", hatch="....", label="extrapolated"))
    if not weights.mapped.all():
        grey = UNMAPPED_COLOUR
        marks.append(
            Patch(facecolor=grey, edgecolor="0.5", hatch="////", label="no sheet: unmapped")
        )
    if marks:
        axes[0, 1].legend(handles=marks, loc="lower left", fontsize=8, framealpha=0.9)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _headline(report: MappingReport) -> str:
    return (
        f"{report.name}: {report.method} weights; covered {100 * report.target_coverage:.1f} % of "
        f"the target and {100 * report.source_coverage:.1f} % of the sheet; "
        f"farthest {1e3 * report.worst_distance:.2f} mm off the sheet"
    )


def _shear(families: list[np.ndarray]) -> np.ndarray:
    cosine = np.abs(np.einsum("ci,ci->c", *families))
    return np.degrees(np.arcsin(np.clip(cosine, 0.0, 1.0)))


def _colour_scale(values: np.ndarray, colour_map: str, low: float | None = None):
    """Colours from the sheet's values; a few outliers do not flatten the rest."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    floor, ceiling = np.percentile(values, [0.5, 99.5])
    floor = floor if low is None else low
    if ceiling - floor < 1e-9 * max(abs(ceiling), 1e-30):  # a constant field
        ceiling, floor = ceiling + 0.01 * abs(ceiling) + 1e-12, floor - 0.01 * abs(floor) - 1e-12
    return ScalarMappable(Normalize(floor, ceiling), colour_map)


def _painted(colours, values: np.ndarray, weights: MappingWeights) -> np.ndarray:
    painted = colours.to_rgba(np.where(np.isnan(values), 0.0, values))
    painted[np.isnan(values) | ~weights.mapped] = UNMAPPED_COLOUR
    return painted


def _skin(target: TargetMesh) -> _Facets:
    """Faces that are seen: the cells of a shell, the outer faces of a solid."""
    if not target.is_solid:
        return _Facets(target.surface.corners, np.arange(target.cell_count))
    faces, owners = [], []
    first = 0
    for name, cells in target.blocks:
        nodes = cells[:, : corner_count(name)]
        for face in SOLID_FACES[base_type(name)]:
            closed = [*face, face[-1]][:4]
            faces.append(nodes[:, closed])
            owners.append(first + np.arange(len(cells)))
        first += len(cells)
    faces, owners = np.concatenate(faces), np.concatenate(owners)
    _, number, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    outer = count[number.reshape(-1)] == 1
    return _Facets(target.points[faces[outer]], owners[outer])


def _view(angles: tuple[float, float]) -> _View:
    elevation, azimuth = angles
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    towards = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    return _View(right, np.cross(towards, right), towards)


def _on_screen(view: _View, points: np.ndarray) -> np.ndarray:
    return np.stack([points @ view.right, points @ view.up], axis=-1)


def _box(view: _View, *facets: _Facets) -> np.ndarray:
    shown = np.concatenate([_on_screen(view, f.polygons).reshape(-1, 2) for f in facets])
    return np.array([shown.min(axis=0), shown.max(axis=0)])


def _height(angles, *facets: _Facets) -> float:
    width, height = np.ptp(_box(_view(angles), *facets), axis=0)
    return float(np.clip(height / max(width, 1e-12), 0.25, 1.4))


def _same_limits(row, view: _View, *facets: _Facets) -> None:
    low, high = _box(view, *facets)
    margin = 0.02 * (high - low).max()
    for axis in row:
        axis.set_xlim(low[0] - margin, high[0] + margin)
        axis.set_ylim(low[1] - margin, high[1] + margin)
        axis.set_aspect("equal")
        axis.set_axis_off()


def _draw_facets(axis, facets: _Facets, view: _View, colours, status=None) -> None:
    """Paint facets from the back to the front, lightly shaded by their slope."""
    from matplotlib.collections import PolyCollection

    depth = facets.polygons.mean(axis=1) @ view.towards
    order = np.argsort(depth, kind="stable")
    polygons, cell = facets.polygons[order], facets.cell[order]
    shown = _on_screen(view, polygons)
    normal = np.cross(polygons[:, 2] - polygons[:, 0], polygons[:, 3] - polygons[:, 1])
    length = np.linalg.norm(normal, axis=1)
    facing = np.abs(normal @ view.towards) / np.where(length > 0.0, length, 1.0)
    face_colours = colours[cell].copy()
    face_colours[:, :3] *= (0.86 + 0.14 * facing)[:, None]
    edges = 0.55 * face_colours[:, :3]
    # Edges of many small facets would darken the colours.
    width = 0.25 if len(polygons) < 5000 else (0.1 if len(polygons) < 20000 else 0.0)
    axis.add_collection(
        PolyCollection(shown, facecolors=face_colours, edgecolors=edges, linewidths=width)
    )
    if status is None:
        return
    for kind, hatch in ((Status.EXTRAPOLATED, "...."), (Status.UNMAPPED, "////")):
        marked = status[cell] == kind
        if marked.any():
            axis.add_collection(
                PolyCollection(
                    shown[marked], facecolors="none", edgecolors="0.35", hatch=hatch, linewidths=0.0
                )
            )


def _draw_fibres(axis, centroids: np.ndarray, families: list[np.ndarray], span: float) -> None:
    """Short segments without arrow heads, thinned to an even spacing; seen from above."""
    from matplotlib.collections import LineCollection

    spacing = span / SEGMENTS_ACROSS
    bins = np.round(centroids[:, :2] / spacing)
    off_centre = np.linalg.norm(centroids[:, :2] - spacing * bins, axis=1)
    order = np.lexsort((off_centre, bins[:, 1], bins[:, 0]))
    _, first = np.unique(bins[order], axis=0, return_index=True)
    chosen = order[first]
    for directions, colour in zip(families, FIBRE_COLOURS, strict=True):
        known = chosen[np.isfinite(directions[chosen]).all(axis=1)]
        half = 0.42 * spacing * directions[known, :2]
        middle = centroids[known, :2]
        ends = np.stack([middle - half, middle + half], axis=1)
        axis.add_collection(LineCollection(ends, colors=colour, linewidths=1.3))
