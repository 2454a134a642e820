"""Picture of the start: blank with mesh and fibre directions, tools, and a cut that shows gaps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle

from lcmchain.mesh.blank import BlankMesh
from lcmchain.report.renderer import (
    axes_at,
    draw_fibres,
    draw_mesh,
    draw_segments,
    draw_silhouette,
    draw_triad,
    even_places,
    fit_axis,
    label_axes,
)
from lcmchain.report.style import FAINT, FIBRE_COLOURS, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import FROM_ABOVE, boundary_edges, contour_edges, oblique, section
from lcmchain.tools.tool import clip_to_box

#: Plies of a stack that are drawn at most, and beside each other.
MOST_PLIES_SHOWN = 16
PLIES_IN_A_ROW = 4
#: Angles of the families of a fabric along both axes of its ply [rad].
BOTH_AXES = (0.0, 0.5 * np.pi)
#: Length of the arrow of a pull, in parts of what is drawn.
PULL_PART = 0.07
GRIP_COLOUR = "#7a2f8f"

#: Name, points [mm] (P, 3), triangles (F, 3) and colour of a tool, as far as the picture shows it.
ToolInBox = tuple[str, np.ndarray, np.ndarray, str]
#: Nodes (n, 3) [m] of a ply that a gripper has, and the direction (3,) of its pull, if it pulls.
ShownGrip = tuple[np.ndarray, np.ndarray | None]


def draw_initial(
    path: Path | str,
    blank: BlankMesh,
    tools: Sequence[tuple[str, np.ndarray, np.ndarray]] = (),
    *,
    title: str = "",
    marks: Sequence[Sequence[float]] = (),
    angles: Sequence[float] = BOTH_AXES,
    grips: Sequence[ShownGrip] = (),
) -> None:
    """Draw the start: blank with mesh and fibre directions, tools, and a cut that shows gaps.

    Parameters
    ----------
    path : of the PNG.
    blank : undeformed mesh.
    tools : name, points [m] (P, 3) and triangles (F, 3) of every tool at travel 0.
    title : of the scene.
    marks : places [m] where tools reach into the blank; the cut goes through the first.
    angles : of the families of fibres from the first axis of the ply [rad].
    grips : what grippers hold of it.

    Raises
    ------
    InputError : the place cannot be written.
    """
    points, faces = 1e3 * blank.mid_surface_positions, blank.faces
    rim = boundary_edges(faces)
    box, shapes = _tools_around(points, tools)

    with matplotlib.rc_context(RC):
        figure = new_figure(11.6, 7.6)
        oblique_axis = figure.add_axes((0.015, 0.355, 0.51, 0.53))
        map_axis = figure.add_axes((0.575, 0.39, 0.39, 0.49))
        cut_axis = figure.add_axes((0.06, 0.07, 0.44, 0.225))
        gap_axis = figure.add_axes((0.575, 0.07, 0.39, 0.225))
        _draw_start(oblique_axis, points, faces, rim, shapes)
        _draw_fibres(map_axis, blank, points, faces, rim, shapes, angles)
        where, middle = _cut_through(marks, points)
        thickness = 1e3 * blank.thickness
        _draw_cut(cut_axis, points, rim, thickness, shapes, middle, box)
        _draw_gaps(gap_axis, points, rim, thickness, shapes, middle, box)
        _draw_marks(map_axis, where[:, :2])
        _draw_grips(map_axis, grips, box)
        for axis in (cut_axis, gap_axis):
            _draw_marks(axis, where[:1, [0, 2]])
        edges = np.linalg.norm(points[faces[:, 1]] - points[faces[:, 0]], axis=1)
        subtitle = (
            f"{title + '  ·  ' if title else ''}{len(faces):,} elements, "
            f"edge {np.median(edges):.3g} mm, thickness {thickness:.4g} mm, "
            f"area {1e4 * blank.area:.4g} cm²"
        )
        headline(figure, "Blank, tools and fibre directions at the start", subtitle)
        save(figure, path)


def draw_stack(
    path: Path | str,
    plies: Sequence[tuple[str, BlankMesh]],
    tools: Sequence[tuple[str, np.ndarray, np.ndarray]] = (),
    *,
    title: str = "",
    marks: Sequence[Sequence[float]] = (),
    angles: Sequence[Sequence[float]] | None = None,
    grips: Sequence[Sequence[ShownGrip]] = (),
) -> None:
    """Draw the start of a stack: every ply with its fibres, tools, and a cut through all plies.

    Parameters
    ----------
    path : of the PNG.
    plies : name and undeformed mesh of every ply, bottom first.
    tools, title, marks : as for :func:`draw_initial`; angles, grips : the same for every ply.

    Raises
    ------
    InputError : the place cannot be written.
    """
    meshes = [mesh for _, mesh in plies]
    points = np.concatenate([1e3 * mesh.node_positions for mesh in meshes])
    low, high = points.min(axis=0), points.max(axis=0)
    box, shapes = _tools_around(points, tools)
    shown, left_out = _shown_plies(plies)
    columns = min(len(shown), PLIES_IN_A_ROW)
    rows = -(-len(shown) // columns)
    height = 1.1 + 2.6 * rows + 3.0
    with matplotlib.rc_context(RC):
        figure = new_figure(11.6, height)
        for index, (number, name, mesh) in enumerate(shown):
            row, column = divmod(index, columns)
            width = 11.0 / columns
            axis = axes_at(
                figure, 0.35 + column * width, height - 0.9 - 2.6 * (row + 1) + 0.25,
                width - 0.35, 2.1,
            )  # fmt: skip
            own = BOTH_AXES if angles is None else angles[number - 1]
            _draw_ply(axis, number, name, mesh, shapes, box, own)
            _draw_grips(axis, grips[number - 1] if grips else (), box)
        where, middle = _cut_through(marks, points)
        cut_axis = axes_at(figure, 0.75, 0.5, 4.6, 2.0)
        gap_axis = axes_at(figure, 6.5, 0.5, 4.6, 2.0)
        for axis in (cut_axis, gap_axis):
            _draw_plies_in_section(axis, meshes, shapes, middle)
            _draw_marks(axis, where[:1, [0, 2]])
        _set_cut(cut_axis, middle, box)
        _set_gaps(gap_axis, 0.5 * (low[2] + high[2]), high[2] - low[2], box)
        count = sum(mesh.element_count for mesh in meshes)
        subtitle = (
            f"{title + '  ·  ' if title else ''}{len(plies)} plies, {count:,} elements, "
            f"{high[2] - low[2]:.4g} mm from the lowest to the highest face"
            + (f"; {left_out} plies lie as others and are not drawn" if left_out else "")
        )
        headline(figure, "Stack, tools and fibre directions at the start", subtitle)
        save(figure, path)


def _tools_around(
    points: np.ndarray, tools: Sequence[tuple[str, np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, list[ToolInBox]]:
    """Return a box around points [mm], and name, points, triangles, colour of tools in it."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = np.array([0.16, 0.16, 0.34]) * float((high - low)[:2].max())
    box = np.stack([low - margin, high + margin])
    shapes = [
        (name, *clip_to_box(1e3 * np.asarray(p), t, box), SERIES[i % len(SERIES)])
        for i, (name, p, t) in enumerate(tools)
    ]
    return box, shapes


def _cut_through(marks: Sequence[Sequence[float]], points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return marks [m] in mm (n, 3), and the y of the cut: of the first mark, or of the middle."""
    where = 1e3 * np.asarray(marks, dtype=float).reshape(-1, 3)
    middle = where[0, 1] if len(where) else 0.5 * (points[:, 1].min() + points[:, 1].max())
    return where, round(middle, 6) + 0.0  # no minus zero in the title


def _shown_plies(
    plies: Sequence[tuple[str, BlankMesh]],
) -> tuple[list[tuple[int, str, BlankMesh]], int]:
    """Return plies with their number, those that lie alike once where there are many."""
    numbered = [(number, name, mesh) for number, (name, mesh) in enumerate(plies, start=1)]
    if len(numbered) <= MOST_PLIES_SHOWN:
        return numbered, 0
    first: dict[tuple, tuple[int, str, BlankMesh]] = {}
    for number, name, mesh in numbered:
        nodes = mesh.node_positions[:, :2]
        key = (
            *np.round(1e6 * np.concatenate([nodes.min(axis=0), nodes.max(axis=0)])),
            *np.round(mesh.fibre_direction_1[0], 6),
        )
        first.setdefault(key, (number, name, mesh))
    shown = list(first.values())[:MOST_PLIES_SHOWN]
    return shown, len(numbered) - len(shown)


def _draw_ply(axis, number: int, name: str, mesh: BlankMesh, shapes, box, angles) -> None:
    points, faces = 1e3 * mesh.mid_surface_positions, mesh.faces
    _draw_plan(axis, mesh, points, faces, boundary_edges(faces), shapes, angles)
    x, y = mesh.fibre_direction_1[0, :2]
    laid = f"{np.degrees(np.arctan2(y, x)) + 0.0:.4g}°" if len(angles) else "without fibres"
    axis.set_title(f"{number}: {name}, {laid}", color=INK, loc="left")
    axis.set_xlim(box[0][0], box[1][0])
    axis.set_ylim(box[0][1], box[1][1])
    axis.set_aspect("equal")
    axis.tick_params(labelsize=6)


def _draw_plies_in_section(axis, meshes: Sequence[BlankMesh], shapes, y: float) -> None:
    for index, mesh in enumerate(meshes):
        points = 1e3 * mesh.mid_surface_positions
        _draw_section(
            axis, points, boundary_edges(mesh.faces), 1e3 * mesh.thickness,
            shapes if index == 0 else (), y, colour=("#b9c0c8", "#dfe3e8")[index % 2],
        )  # fmt: skip


def _draw_start(axis, points, faces, rim, shapes) -> None:
    """Blank and tools in an oblique view; tools are translucent and in front of what they hide."""
    view = oblique(elevation=26.0)
    level = points[:, 2].mean()
    for name, vertices, triangles, colour in shapes:
        if len(triangles) == 0:
            continue
        above = vertices[triangles].mean(axis=(0, 1))[2] > level
        draw_silhouette(axis, vertices, triangles, view, colour, zorder=3 if above else 1)
        edges = contour_edges(vertices, triangles, view)
        draw_segments(axis, edges, view, colour, 0.9, alpha=0.85, zorder=3.5 if above else 1.5)
        axis.plot([], [], color=colour, lw=1.6, label=name)
    draw_mesh(axis, points[faces], view, face="#eef0f2", edge="#9aa3ad", width=0.22, zorder=2)
    draw_segments(axis, points[rim], view, INK, 1.0, zorder=2.5)
    seen = [view.on_screen(points), *(view.on_screen(s[1]) for s in shapes if len(s[1]))]
    fit_axis(axis, np.concatenate(seen), 0.03)
    axis.set_axis_off()
    draw_triad(axis, view)
    if axis.get_legend_handles_labels()[0]:  # of tools within the picture
        axis.legend(loc="upper right", title="tools", title_fontsize=8, alignment="left")


def _draw_fibres(axis, blank: BlankMesh, points, faces, rim, shapes, angles) -> None:
    _draw_plan(axis, blank, points, faces, rim, shapes, angles)
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.15)
    fit_axis(axis, points[:, :2], 0.12)
    axis.set_title("from above, tools dashed", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "y [mm]")


def _draw_plan(axis, blank: BlankMesh, points, faces, rim, shapes, angles) -> None:
    """Mesh, tools and fibre directions from above."""
    draw_mesh(axis, points[faces], FROM_ABOVE, face="#f6f7f8", edge="#c3c9d0", width=0.25)
    draw_segments(axis, points[rim], FROM_ABOVE, INK, 1.0)
    for _, vertices, triangles, colour in shapes:
        edges = contour_edges(vertices, triangles, FROM_ABOVE)
        draw_segments(axis, edges, FROM_ABOVE, colour, 0.9, alpha=0.8, style="--")
    places, nearest, spacing = even_places(points[faces].mean(axis=1)[:, :2])
    along, across = blank.fibre_direction_1[nearest], blank.fibre_direction_2[nearest]
    for number, (angle, colour) in enumerate(zip(angles, FIBRE_COLOURS), start=1):
        direction = np.cos(angle) * along + np.sin(angle) * across
        draw_fibres(axis, places, direction, 0.72 * spacing, colour, arrows=True)
        axis.plot([], [], color=colour, lw=1.8, label=f"fibre {number}")


def _draw_marks(axis, places) -> None:
    """Circle the places where tools reach into the blank."""
    if len(places):
        label = "in the blank"
        axis.scatter(*places.T, s=180, fc="none", ec="#d1001f", lw=2.0, zorder=9, label=label)
        axis.scatter(*places.T, s=40, marker="x", color="#d1001f", lw=1.6, zorder=9)


def _draw_grips(axis, grips: Sequence[ShownGrip], box) -> None:
    """Mark the nodes that are gripped, and draw an arrow of one length for every pull."""
    length = PULL_PART * float((box[1] - box[0])[:2].max())
    for positions, direction in grips:
        x, y = 1e3 * positions[:, 0], 1e3 * positions[:, 1]
        axis.scatter(x, y, s=9, marker="s", color=GRIP_COLOUR, lw=0.0, zorder=8)
        if direction is not None:
            start = np.array([x.mean(), y.mean()])
            axis.annotate(
                "", start + length * direction[:2], start, zorder=8,
                arrowprops={"arrowstyle": "-|>", "color": GRIP_COLOUR, "lw": 1.2},
            )  # fmt: skip


def _draw_cut(axis, points, rim, thickness, shapes, y, box) -> None:
    _draw_section(axis, points, rim, thickness, shapes, y)
    _set_cut(axis, y, box)


def _set_cut(axis, y, box) -> None:
    axis.set_aspect("equal")
    axis.set_xlim(box[0][0], box[1][0])
    axis.set_ylim(box[0][2], box[1][2])
    axis.set_title(f"cut at y = {y:.3g} mm", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "z [mm]")


def _draw_gaps(axis, points, rim, thickness, shapes, y, box) -> None:
    """The same cut with a stretched z axis, around the blank: gaps become visible."""
    _draw_section(axis, points, rim, thickness, shapes, y)
    _set_gaps(axis, points[:, 2].mean(), thickness, box)


def _set_gaps(axis, level, thickness, box) -> None:
    """Stretch the z axis about a level, to seven times a thickness."""
    axis.set_xlim(box[0][0], box[1][0])
    axis.set_ylim(level - 3.5 * thickness, level + 3.5 * thickness)
    extent = axis.get_window_extent()
    stretch = (extent.height / (7.0 * thickness)) / (extent.width / (box[1][0] - box[0][0]))
    axis.set_title(f"gaps: z stretched {stretch:.2g} times", color=FAINT, loc="left")
    label_axes(axis, "x [mm]", "z [mm]")


def _draw_section(axis, points, rim, thickness, shapes, y, *, colour="#b9c0c8") -> None:
    y += 1e-5 * np.ptp(points[:, 1])  # beside nodes and corners of tools in the plane
    for _, vertices, triangles, of_tool in shapes:
        if len(triangles):
            segments = section(vertices, triangles, y)
            axis.add_collection(
                LineCollection(segments, colors=of_tool, linewidths=1.4, capstyle="round", zorder=3)  # type: ignore[arg-type]
            )
    ends = points[rim]
    crossing = (ends[:, 0, 1] >= y) != (ends[:, 1, 1] >= y)
    a, b = ends[crossing, 0], ends[crossing, 1]
    where = np.sort(a[:, 0] + (b - a)[:, 0] * (y - a[:, 1]) / (b - a)[:, 1])
    level = points[:, 2].mean() - 0.5 * thickness
    for x0, x1 in zip(where[0::2], where[1::2], strict=False):
        axis.add_patch(
            Rectangle((x0, level), x1 - x0, thickness, fc=colour, ec=INK, lw=0.5, zorder=2)
        )
