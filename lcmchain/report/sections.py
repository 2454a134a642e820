"""Sections through the formed sheet and its tools: to scale, and unrolled to show the gaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection

from lcmchain.fields.dataset import SHEET, SOLID
from lcmchain.fields.sheet import (
    mesh_axes,
    reference_positions,
    sheet_faces,
    sheet_positions,
    vector,
)
from lcmchain.mesh.lines import cut_polygons
from lcmchain.report.drawn_tools import RunTools
from lcmchain.report.renderer import axes_at, label_axes
from lcmchain.report.style import FAINT, INK, RC, headline, new_figure, save
from lcmchain.tools.distance import FIELD, gaps

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


# --- the cut: upper and lower face of the sheet, in order along it --------------------------------


# A plane through nodes is moved aside by this part of the sheet's extent.
ASIDE = 1e-5


@dataclass(frozen=True)
class Plane:
    """A plane with axes of its own: point [m] (3,), unit vectors along, up and normal (3,).

    name : stands above the section.
    """

    point: np.ndarray
    along: np.ndarray
    up: np.ndarray
    normal: np.ndarray
    name: str = ""

    @classmethod
    def through(cls, point: np.ndarray, normal: np.ndarray, name: str = "") -> Plane:
        """Return a plane whose ``up`` is z as far as it can be, else y."""
        normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
        upwards = np.eye(3)[2] if abs(normal[2]) < 0.99 else np.eye(3)[1]
        up = upwards - (upwards @ normal) * normal
        up /= np.linalg.norm(up)
        along = np.cross(up, normal)
        if along[np.argmax(np.abs(along))] < 0.0:  # to the right, or upwards on the map
            along, normal = -along, -normal
        return cls(np.asarray(point, dtype=float), along, up, normal, name)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (..., 2) along and up of points (..., 3), seen from the origin."""
        return np.stack([points @ self.along, points @ self.up], axis=-1)

    def place(self, flat: np.ndarray) -> np.ndarray:
        """Return the points (..., 3) of the plane with such coordinates."""
        off = (self.point @ self.normal) * self.normal
        return flat[..., :1] * self.along + flat[..., 1:] * self.up + off


def cut_sheet(
    middle: np.ndarray, bottom: np.ndarray, top: np.ndarray, faces: np.ndarray, plane: Plane
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the lower and the upper face (n, 3) where a plane cuts a sheet, strip by strip.

    The mid-surface is cut; both faces are taken at the same places of its edges, so that a strip
    has the thickness along the directors.

    Parameters
    ----------
    middle, bottom, top : of the n nodes (n, 3) [m].
    faces : (F, 4) nodes; a triangle repeats its last one.
    """
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    aside = ASIDE * float(np.ptp(middle, axis=0).max())
    height = (middle - plane.point) @ plane.normal - aside
    cut = cut_polygons(triangles, height)
    lower, upper = cut.places(bottom), cut.places(top)
    strips = _chains(cut.ends)
    cut_strips = []
    for strip in strips:
        if (lower[strip[-1]] - lower[strip[0]]) @ plane.along < 0.0:
            strip = strip[::-1]
        cut_strips.append((lower[strip], upper[strip]))
    return sorted(cut_strips, key=lambda faces: float((faces[0] @ plane.along).min()))


def _chains(pairs: np.ndarray) -> list[list[int]]:
    """Join pairs of numbers (S, 2), of which each number occurs at most twice, to chains."""
    neighbours: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    chains, seen = [], set()
    # open chains from their ends first, then closed ones from anywhere
    for start in sorted(neighbours, key=lambda number: len(neighbours[number])):
        if start in seen:
            continue
        chain, node = [start], start
        seen.add(start)
        while following := [other for other in neighbours[node] if other not in seen]:
            node = following[0]
            seen.add(node)
            chain.append(node)
        if len(chain) > 2 and start in neighbours[node] and len(neighbours[start]) == 2:
            chain.append(start)
        chains.append(chain)
    return chains


# --- a picture of all sections --------------------------------------------------------------------


SHEET_COLOUR = "#b9c0c8"
# Places of the plane at which the distance of the tools is taken, over the width of a section.
GRID = 400
# A distance that changes by more than so many steps of that grid from one to the next is none.
LARGEST_CHANGE = 1.5
# Gaps are shown as far as this from the faces of the sheet; in thicknesses.
REACH = 3.0
# Distances from a surface mesh are exact up to so many spacings of its distance field.
EXACT_SPACINGS = 3.0

Strip = tuple[np.ndarray, np.ndarray]


def default_planes(sheet: xr.Dataset) -> list[Plane]:
    """Return the planes through the middle of the blank along either axis of the ply.

    Where the middle lies beside the sheet (two sheets, a frame), the face next to it is cut.
    """
    reference = reference_positions(sheet)
    middle = 0.5 * (reference.min(axis=0) + reference.max(axis=0))
    corners = reference[sheet_faces(sheet)]
    centres = corners.mean(axis=1)
    nearest = int(np.argmin(np.linalg.norm(centres - middle, axis=1)))
    radius = np.linalg.norm(corners[nearest] - centres[nearest], axis=1).max()
    if np.linalg.norm(centres[nearest] - middle) > 1.01 * radius:
        middle = centres[nearest]
    fibres = [axis.mean(axis=0) for axis in mesh_axes(sheet)]
    normal = np.cross(*fibres)
    return [Plane.through(middle, np.cross(fibre, normal)) for fibre in fibres]


def draw_sections(
    path: Path | str,
    datasets: Mapping[str, xr.Dataset],
    planes: Sequence[Plane],
    tools: RunTools | None = None,
    travel: np.ndarray | None = None,
    frame: int = -1,
) -> None:
    """Draw cuts through sheet and tools: to scale, and unrolled with the thickness stretched.

    Unrolled, the middle of the sheet is straight; its faces lie half the thickness off, and the
    tools as far from the faces as they are, at every place the nearest way. A line within the sheet
    is a tool that the sheet reaches into.

    Parameters
    ----------
    datasets : groups of the result.
    travel : of the tools in the frame [m], shape (T,).
    """
    sheet = datasets[SHEET]
    cuts = [(plane, strips_of(datasets, plane, frame)) for plane in planes]
    width, pad = 6.4, 0.06
    boxes = [_box(plane, strips, pad) for plane, strips in cuts]
    heights = [float(np.clip(width * b[1, 1] / b[1, 0], 1.0, 5.0)) for b in boxes]
    total = sum(heights) + 0.95 * len(heights) + 0.6
    with matplotlib.rc_context(RC):
        figure = new_figure(12.0, total)
        bottom = total - 0.6
        for (plane, strips), height in zip(cuts, heights, strict=True):
            bottom -= height + 0.95
            axis = axes_at(figure, 0.65, bottom + 0.5, width, height)
            across = axes_at(figure, 0.65 + width + 0.75, bottom + 0.5, 3.95, max(height, 1.0))
            draw_section(axis, plane, [(strips, SHEET_COLOUR)], tools, travel, pad)
            _draw_unrolled(across, strips, tools, travel)
        if tools is not None:
            for tool, (name, colour) in enumerate(zip(tools.names, tools.colours)):
                if tools.shows(tool):
                    axis.plot([], [], color=colour, lw=1.6, label=name)
            figure.legend(
                handles=axis.get_legend_handles_labels()[0], loc="upper right", ncols=4,
                bbox_to_anchor=(1.0 - 0.3 / 12.0, 1.0 - 0.12 / total),
            )  # fmt: skip
        time = 1e3 * float(sheet["time"].values[frame])
        headline(figure, "Sections", f"{sheet.attrs.get('title', '')}  ·  t = {time:.4g} ms")
        save(figure, path)


# --- to scale -------------------------------------------------------------------------------------


def draw_section(
    axis: Axes,
    plane: Plane,
    sheets: Sequence[tuple[Sequence[Strip], str]],
    tools: RunTools | None,
    travel: np.ndarray | None,
    pad: float = 0.06,
) -> None:
    """Draw a cut through sheets and tools to scale.

    sheets : strips and colour of each. pad : margin around them, in parts of their extent.
    """
    strips = [strip for own, _ in sheets for strip in own]
    box = _box(plane, strips, pad)
    if tools is not None and travel is not None:
        _draw_tools(axis, plane, box, tools, travel)
    for own, colour in sheets:
        _draw_sheet(axis, plane, own, colour)
    if not strips:
        axis.text(0.5, 0.5, "the plane misses the sheet", transform=axis.transAxes, ha="center")
    axis.set_aspect("equal")
    axis.set_xlim(1e3 * box[0, 0], 1e3 * (box[0, 0] + box[1, 0]))
    axis.set_ylim(1e3 * box[0, 1], 1e3 * (box[0, 1] + box[1, 1]))
    axis.set_title(_title(plane), color=FAINT, loc="left")
    label_axes(axis, f"{_words(plane.along)} [mm]", f"{_words(plane.up)} [mm]")


def strips_of(datasets: Mapping[str, xr.Dataset], plane: Plane, frame: int) -> list[Strip]:
    """Return the strips of all sheets of a result, without thickness in the 2D approach."""
    solids = [dataset for name, dataset in datasets.items() if name.endswith(SOLID)]
    if not solids:
        middle = sheet_positions(datasets[SHEET], frame)
        return cut_sheet(middle, middle, middle, sheet_faces(datasets[SHEET]), plane)
    strips = []
    for solid in solids:
        positions = vector(solid, "reference_position") + vector(solid, "displacement", frame)
        bottom, top = np.split(positions, 2)  # the upper nodes come in the order of the lower ones
        strips += cut_sheet(0.5 * (bottom + top), bottom, top, _lower_faces(solid), plane)
    return strips


def _lower_faces(solid: xr.Dataset) -> np.ndarray:
    """Return the nodes (F, 4) of the lower faces; a triangle repeats its last one."""
    volumes = np.nan_to_num(solid["solid_volume_nodes"].values, nan=-1.0).astype(np.int64)
    wedge = volumes[:, 6] < 0
    return np.where(wedge[:, None], volumes[:, [0, 2, 1, 1]], volumes[:, :4])


def _box(plane: Plane, strips: Sequence[Strip], pad: float) -> np.ndarray:
    """Return lower corner and extent [m], (2, 2), of what a section shows."""
    if not strips:
        return np.array([[0.0, 0.0], [1e-3, 1e-3]])
    shown = plane.flat(np.concatenate([face for strip in strips for face in strip]))
    low, high = shown.min(axis=0), shown.max(axis=0)
    margin = pad * float((high - low).max())
    return np.stack([low - margin, high - low + 2.0 * margin])


def _draw_sheet(axis: Axes, plane: Plane, strips: Sequence[Strip], colour: str) -> None:
    for lower, upper in strips:
        outline = 1e3 * plane.flat(np.concatenate([lower, upper[::-1]]))
        axis.add_collection(
            PolyCollection([outline], facecolors=colour, edgecolors=INK, linewidths=0.6)
        )


def _draw_tools(
    axis: Axes, plane: Plane, box: np.ndarray, tools: RunTools, travel: np.ndarray
) -> None:
    """Tint the tools and draw their surface, where the distance that contact takes is zero."""
    step = box[1, 0] / GRID
    u, v = (low + step * np.arange(int(length / step) + 2) for low, length in box.T)
    flat = np.stack(np.meshgrid(u, v), axis=-1)
    points = np.ascontiguousarray(plane.place(flat).reshape(-1, 3))
    for tool, colour in enumerate(tools.colours):
        if not tools.shows(tool):
            continue
        distance = gaps(tools.table, tool, points, float(travel[tool])).reshape(flat.shape[:2])
        if not (distance < 0.0).any():
            continue
        mm = 1e3 * u, 1e3 * v
        axis.contourf(*mm, distance, levels=[-np.inf, 0.0], colors=[colour], alpha=0.13)
        line = _without_jumps(distance, LARGEST_CHANGE * step)
        axis.contour(*mm, line, levels=[0.0], colors=[colour], linewidths=1.0, zorder=3)


def _without_jumps(distance: np.ndarray, largest: float) -> np.ndarray:
    """Return distances on a grid, nan on both sides of a change larger than ``largest``.

    The distance to a surface changes by no more than the way. Behind an open surface mesh it is
    known so far only: what ends there is no surface.
    """
    known = np.ones(distance.shape, dtype=bool)
    for axis in range(distance.ndim):
        along = np.moveaxis(known, axis, 0)  # a view
        steady = np.abs(np.diff(np.moveaxis(distance, axis, 0), axis=0)) <= largest
        along[:-1] &= steady
        along[1:] &= steady
    return np.where(known, distance, np.nan)


# --- unrolled -------------------------------------------------------------------------------------


def _draw_unrolled(
    axis: Axes, strips: Sequence[Strip], tools: RunTools | None, travel: np.ndarray | None
) -> None:
    """Draw the thickness over the length of the sheet, and the tools at their distances."""
    start, largest = 0.0, 0.0
    for lower, upper in strips:
        middle = 0.5 * (lower + upper)
        steps = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        length = 1e3 * (start + np.concatenate([[0.0], np.cumsum(steps)]))
        start = 1e-3 * float(length[-1])
        half = 0.5e3 * np.linalg.norm(upper - lower, axis=1)
        largest = max(largest, float(2.0 * half.max()))
        axis.fill_between(length, -half, half, color=SHEET_COLOUR, lw=0.0, zorder=1)
        axis.plot(length, half, color=INK, lw=0.6, zorder=2)
        axis.plot(length, -half, color=INK, lw=0.6, zorder=2)
        if tools is None or travel is None:
            continue
        for tool, colour in enumerate(tools.colours):
            if not tools.shows(tool):
                continue
            for level in _distances(tools, tool, float(travel[tool]), lower, upper, half):
                axis.plot(length, level, color=colour, lw=1.0, zorder=3)
    reach = (0.5 + REACH) * (largest or 1.0)
    axis.set_xlim(0.0, max(1e3 * start, 1e-9))
    axis.set_ylim(-reach, reach)
    extent = axis.get_window_extent()
    stretch = (extent.height / (2.0 * reach)) / (extent.width / max(1e3 * start, 1e-9))
    axis.set_title(f"unrolled, thickness × {float(f'{stretch:.2g}'):g}", color=FAINT, loc="left")
    label_axes(axis, "along the sheet [mm]", "from its middle [mm]")


def _distances(
    tools: RunTools, tool: int, travel: float, lower: np.ndarray, upper: np.ndarray, half
) -> list[np.ndarray]:
    """Return where a tool lies in the unrolled section [mm], nan on the side that it is not on."""
    below, above = (
        1e3 * gaps(tools.table, tool, np.ascontiguousarray(face), travel) for face in (lower, upper)
    )
    # a tool that stands across the sheet is as far from one face as from the other
    is_below, is_above = above - below > half, below - above > half
    if tools.table.kind[tool] == FIELD:  # far from a surface mesh distances are lower bounds
        known = EXACT_SPACINGS * 1e3 * tools.table.spacing[tool]
        is_below, is_above = is_below & (below < known), is_above & (above < known)
    return [
        np.where(is_below, -half - below, np.nan), np.where(is_above, half + above, np.nan)
    ]  # fmt: skip


def _title(plane: Plane) -> str:
    """Say where a plane lies, after its name."""
    where = _where(plane)
    return f"{plane.name}: {where}" if plane.name else where


def _where(plane: Plane) -> str:
    across = int(np.argmax(np.abs(plane.normal)))
    if abs(plane.normal[across]) > 1.0 - 1e-9:
        return f"{'xyz'[across]} = {1e3 * plane.point[across] + 0.0:.4g} mm"
    x, y, z = np.round(1e3 * plane.point, 6) + 0.0  # no rounding errors such as -1e-14 mm
    n = np.round(plane.normal, 6) + 0.0
    return f"through ({x:.4g}, {y:.4g}, {z:.4g}) mm, normal ({n[0]:.3g}, {n[1]:.3g}, {n[2]:.3g})"


def _words(direction: np.ndarray) -> str:
    """Name a direction: an axis, or its components."""
    axis = int(np.argmax(np.abs(direction)))
    if direction[axis] > 1.0 - 1e-9:
        return "xyz"[axis]
    x, y, z = np.round(direction, 6) + 0.0
    return f"({x:.2g}, {y:.2g}, {z:.2g})"
