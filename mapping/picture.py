"""Pictures of a mapping: sheet beside target on one colour scale, and the errors on the target."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.patches import Patch

from lcmchain.mapping.fields import MappedFields
from lcmchain.mapping.plies import each_ply, on_faces_of_one
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import FIBRE_FAMILIES, Sheet
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import MappingWeights, Status
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_fibres,
    draw_hatches,
    draw_triad,
    even_places,
    fit_axis,
)
from lcmchain.report.style import (
    FAINT,
    FIBRE_COLOURS,
    RC,
    SHOWN,
    Shown,
    colour_scale,
    headline,
    new_figure,
    save,
)
from lcmchain.report.view import FROM_ABOVE, View, boundary_edges, hangs_down, oblique

DRAWN = ("thickness", "fibre_volume_fraction")
SHEAR = Shown("shear", "Shear between the fibres", "°", 1.0, "YlGn", False, 1, lowest=0.0)
SEGMENTS_ACROSS = 16  # fibre segments over the width of a mesh, or one to a cell
PANEL = 4.75  # width of one panel [in]
LEFT, GAP, BOTTOM, TOP = 0.25, 0.25, 0.3, 0.95  # around the panels [in]

UNMAPPED_COLOUR = (0.82, 0.82, 0.82, 1.0)
HATCHES = {Status.EXTRAPOLATED: "....", Status.UNMAPPED: "////"}


class _Drawn(NamedTuple):
    """One of the two meshes: what is seen of it in mm, and where its cells are."""

    corners: np.ndarray  # (P, 4, 3) of the facets
    cell: np.ndarray  # (P,) that a facet belongs to
    centroids: np.ndarray  # (C, 3)
    rim: np.ndarray | None  # (B, 2, 3)
    status: np.ndarray | None = None  # (C,)


class _Row(NamedTuple):
    """One field on both meshes; nan where a cell of the target has no value."""

    shown: Shown
    values: tuple[np.ndarray, np.ndarray]
    view: View
    fibres: tuple[list[np.ndarray], list[np.ndarray]] | None = None


def draw_mapping(
    path: Path | str,
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    report: MappingReport,
) -> None:
    """Draw thickness, fibre volume fraction and both fibre families on sheet and target (PNG)."""
    sheet, title_of_sheet = comparable(sheet)
    meshes = _drawn_sheet(sheet), _drawn_target(target, weights)
    rows = _rows(sheet, mapped, weights)
    heights = [_height_of(row.view, meshes) for row in rows]
    with matplotlib.rc_context(RC):
        size = LEFT + 2 * PANEL + GAP + 1.35, TOP + sum(heights) + GAP * len(rows) + BOTTOM
        figure = new_figure(*size)
        bottom = size[1] - TOP
        for number, (row, height) in enumerate(zip(rows, heights)):
            bottom -= height
            axes = [
                axes_at(figure, LEFT + k * (PANEL + GAP), bottom, PANEL, height) for k in (0, 1)
            ]
            bar = axes_at(
                figure, LEFT + 2 * (PANEL + GAP), bottom + 0.18 * height, 0.16, 0.64 * height
            )
            _draw_row(figure, axes, bar, row, meshes)
            if number == 0:
                axes[0].set_title(title_of_sheet, color=FAINT, loc="left")
                title = f"{report.name} mesh, {report.cell_count:,} cells"
                axes[1].set_title(title, color=FAINT, loc="left")
            bottom -= GAP
        _explain_status(figure, weights)
        headline(figure, f"{report.name}: mapped fields", _subtitle(report))
        save(figure, path)


def comparable(sheet: Sheet) -> tuple[Sheet, str]:
    """Return what a target is compared with, and its title.

    Fields of a target are those of a stack. Of plies that is the largest one, with what all that
    lie over each other have there together.
    """
    plies = each_ply(sheet)
    if not sheet.is_stack or not all("thickness" in ply.scalars for ply in plies):
        return sheet, "formed sheet"
    areas = [float(ply.surface.areas.sum()) for ply in plies]  # as on_faces_of_one chooses
    name = sheet.ply_names[int(np.argmax(areas))]
    return on_faces_of_one(sheet)[0], f"formed stack, at the faces of its largest ply, {name}"


def _subtitle(report: MappingReport) -> str:
    return (
        f"{report.method} weights  ·  covered {100 * report.target_coverage:.1f} % of the target "
        f"and {100 * report.source_coverage:.1f} % of the sheet  ·  farthest "
        f"{1e3 * report.worst_distance:.2f} mm off the sheet"
    )


# --- what is drawn --------------------------------------------------------------------------------


def _drawn_sheet(sheet: Sheet) -> _Drawn:
    surface = sheet.surface
    cells = np.arange(surface.face_count)
    return _Drawn(
        1e3 * surface.corners, cells, 1e3 * surface.centroids, 1e3 * surface.points[_rim(surface)]
    )


def _drawn_target(target: TargetMesh, weights: MappingWeights | None = None) -> _Drawn:
    """Return what is seen of a target, with the status of its cells where weights are given."""
    nodes, cell = skin(target)
    corners = target.points[nodes]
    rim = None if target.is_solid else 1e3 * target.points[_rim(target.surface)]
    status = None if weights is None else weights.status
    return _Drawn(1e3 * corners, cell, 1e3 * target.centroids, rim, status)


def _rim(surface) -> np.ndarray:
    faces = surface.faces
    return boundary_edges(np.where(faces < 0, faces[:, 2:3], faces))


def _rows(sheet: Sheet, mapped: MappedFields, weights: MappingWeights) -> list[_Row]:
    view = oblique(from_below=hangs_down(sheet.surface.points, _rim(sheet.surface)))
    rows = []
    for shown in SHOWN:
        if shown.name in DRAWN and shown.name in mapped.scalars:
            values = (
                shown.factor * sheet.scalars[shown.name],
                _known(shown.factor * mapped.scalars[shown.name], weights),
            )
            rows.append(_Row(shown, values, view))
    present = [name for name in FIBRE_FAMILIES if name in mapped.directions]
    if len(present) == 2 or (present and "shear_angle" in mapped.scalars):
        fibres = (
            [sheet.directions[name] for name in present],
            [mapped.directions[name].direction for name in present],
        )
        if len(present) == 2:
            angles = _shear(fibres[0]), _known(_shear(fibres[1]), weights)
        else:  # the angle of two families is no shear, or there are not two
            angles = (
                np.degrees(np.abs(sheet.scalars["shear_angle"])),
                _known(np.degrees(np.abs(mapped.scalars["shear_angle"])), weights),
            )
        rows.append(_Row(SHEAR, angles, FROM_ABOVE, fibres))
    return rows


def _known(values: np.ndarray, weights: MappingWeights) -> np.ndarray:
    return np.where(weights.mapped, values, np.nan)


def _shear(families: list[np.ndarray]) -> np.ndarray:
    cosine = np.abs(np.einsum("ci,ci->c", *families))
    return np.degrees(np.arcsin(np.clip(cosine, 0.0, 1.0)))


def skin(target: TargetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Corner nodes (F, 4) and cells (F,) of what is seen: cells of a shell, skin of a solid.

    Triangles repeat their last corner.
    """
    if not target.is_solid:
        corners = np.where(target.corners < 0, target.corners[:, 2:3], target.corners)
        return corners, np.arange(target.cell_count)
    faces, owners = target.skin
    return np.where(faces < 0, faces[:, 2:3], faces), owners


# --- on paper -------------------------------------------------------------------------------------


def _draw_row(figure, axes, bar, row: _Row, meshes: tuple[_Drawn, _Drawn]) -> None:
    colours = colour_scale(row.values[0], row.shown)
    from_above = row.fibres is not None
    everything = _on_screen(row.view, meshes)
    for axis, mesh, values in zip(axes, meshes, row.values):
        painted = colours.to_rgba(np.where(np.isnan(values), 0.0, values))
        painted[np.isnan(values)] = UNMAPPED_COLOUR
        draw_facets(
            axis, mesh.corners, row.view, painted[mesh.cell], rim=mesh.rim, shaded=not from_above
        )
        if mesh.status is not None:
            for status, pattern in HATCHES.items():
                marked = mesh.corners[mesh.status[mesh.cell] == status]
                draw_hatches(axis, marked, row.view, pattern)
        fit_axis(axis, everything, 0.02)
        axis.set_axis_off()
    if row.fibres is not None:
        for axis, mesh, families in zip(axes, meshes, row.fibres):
            _draw_families(axis, mesh, families)
        axes[0].legend(loc="upper right", bbox_to_anchor=(1.0, 1.03), ncols=2)
    else:
        draw_triad(axes[0], row.view)
    draw_colour_bar(figure, bar, colours, np.concatenate(row.values), row.shown)


def _draw_families(axis, mesh: _Drawn, families: list[np.ndarray]) -> None:
    centres = mesh.centroids[:, :2]
    across = int(np.clip(np.sqrt(len(centres)), 1, SEGMENTS_ACROSS))
    places, nearest, spacing = even_places(centres, across)
    for name, family, colour in zip(FIBRE_FAMILIES, families, FIBRE_COLOURS):
        known = np.isfinite(family[nearest]).all(axis=1)
        directions = family[nearest[known]]
        draw_fibres(axis, places[known], directions, 0.8 * spacing, colour, arrows=False)
        axis.plot([], [], color=colour, lw=1.4, label=name.replace("_", " "))


def _explain_status(figure, weights: MappingWeights) -> None:
    marks = []
    if np.any(weights.status == Status.EXTRAPOLATED):
        hatch = HATCHES[Status.EXTRAPOLATED]
        marks.append(Patch(fc="white", ec="0.3", hatch=hatch, label="extrapolated"))
    if not weights.mapped.all():
        hatch = HATCHES[Status.UNMAPPED]
        marks.append(Patch(fc=UNMAPPED_COLOUR, ec="0.5", hatch=hatch, label="no sheet: unmapped"))
    if marks:
        figure.legend(handles=marks, loc="upper right", ncols=len(marks), borderaxespad=1.0)


def _on_screen(view: View, meshes: Sequence[_Drawn]) -> np.ndarray:
    return np.concatenate([view.on_screen(mesh.corners).reshape(-1, 2) for mesh in meshes])


def _height_of(view: View, meshes: Sequence[_Drawn]) -> float:
    """Return the height [in] of a panel that shows the meshes over its width."""
    width, height = np.ptp(_on_screen(view, meshes), axis=0)
    return PANEL * float(np.clip(height / max(width, 1e-12), 0.25, 1.4))


# --- the errors that a mapping adds to its fields -------------------------------------------------

COLOURS = "YlOrRd"
ERRORS_SHOWN = (
    Shown("thickness", "Thickness", "µm", 1e6, COLOURS, False, 2, lowest=0.0),
    Shown("fibre_volume_fraction", "Fibre volume fraction", "", 1.0, COLOURS, False, 5, lowest=0.0),
    Shown("areal_fibre_mass", "Areal fibre mass", "g/m²", 1e3, COLOURS, False, 3, lowest=0.0),
    Shown("shear_angle", "Shear angle", "°", 180.0 / np.pi, COLOURS, False, 3, lowest=0.0),
    *(
        Shown(name, name.replace("_", " ").capitalize(), "°", 180.0 / np.pi, COLOURS, False, 3,
              lowest=0.0)
        for name in FIBRE_FAMILIES
    ),
)  # fmt: skip
ERROR_PANEL, BAR = 4.2, 1.35  # width of a panel and of the colour bar beside it [in]
ERROR_LEFT, ERROR_GAP, ERROR_TOP, ERROR_BOTTOM = 0.25, 0.4, 0.95, 0.0  # around the panels [in]


def draw_errors(
    path: Path | str, target: TargetMesh, mapped: MappedFields, report: MappingReport
) -> None:
    """Draw the errors of up to six fields on the target (PNG), the worst cell of each ringed."""
    shown = [one for one in ERRORS_SHOWN if one.name in mapped.errors]
    # From above, where no cell hides another but on upright walls.
    mesh, view = _drawn_target(target), FROM_ABOVE
    height = _height_of(view, [mesh])
    rows = max(-(-len(shown) // 2), 1)
    with matplotlib.rc_context(RC):
        size = (
            2 * (ERROR_LEFT + ERROR_PANEL + BAR),
            ERROR_TOP + rows * (height + ERROR_GAP) + ERROR_BOTTOM,
        )
        figure = new_figure(*size)
        for number, field in enumerate(shown):
            left = ERROR_LEFT + (number % 2) * (ERROR_LEFT + ERROR_PANEL + BAR)
            bottom = size[1] - ERROR_TOP - (number // 2) * (height + ERROR_GAP) - height
            axis = axes_at(figure, left, bottom, ERROR_PANEL, height)
            bar = axes_at(
                figure, left + ERROR_PANEL + 0.05, bottom + 0.18 * height, 0.16, 0.64 * height
            )
            errors = field.factor * mapped.errors[field.name]
            colours = colour_scale(errors, field)
            painted = colours.to_rgba(np.nan_to_num(errors))
            painted[np.isnan(errors)] = UNMAPPED_COLOUR
            draw_facets(axis, mesh.corners, view, painted[mesh.cell], rim=mesh.rim, shaded=False)
            fit_axis(axis, view.on_screen(mesh.corners).reshape(-1, 2), 0.02)
            axis.set_axis_off()
            if np.isfinite(errors).any():
                worst = int(np.nanargmax(errors))
                place = view.on_screen(1e3 * target.centroids[worst][None])[0]
                axis.plot(*place, "o", ms=9, mfc="none", mec="black", mew=1.0, zorder=5)
                text = f"{field.title}: largest {field.text(float(errors[worst]))}, cell {worst}"
                axis.set_title(text, color=FAINT, loc="left")
            draw_colour_bar(figure, bar, colours, errors, field)
        note = "difference to a mapping between twice finer meshes; a ring marks the worst cell"
        headline(figure, f"{report.name}: error that the mapping adds", note)
        save(figure, path)
