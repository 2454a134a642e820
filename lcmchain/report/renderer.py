"""The one renderer of pictures: shaded facets, lines, fibres and what stands around them.

It paints with matplotlib, from back to front: VTK (9.7, and pyvista on it) ends the interpreter
with a segmentation fault where a machine has neither X nor EGL nor OSMesa, which no fallback can
catch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba_array
from matplotlib.patches import PathPatch
from matplotlib.path import Path as DrawnPath
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox
from scipy.spatial import cKDTree

from lcmchain.report.style import FAINT, INK, Shown
from lcmchain.report.view import (
    View,
    brightness,
    fronts_and_backs,
    joined_outline,
    painting_order,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.path import Path as DrawnPath
    from matplotlib.typing import CapStyleType, ColorType, LineStyleType


# Above this number of faces their edges would cover the colours.
MOST_FACES_WITH_EDGES = 30_000


def axes_at(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Return axes at a place of the figure; all in inches from its lower left corner."""
    w, h = figure.get_size_inches()
    return figure.add_axes((x / w, y / h, width / w, height / h))


# --- surfaces and lines ---------------------------------------------------------------------------


def draw_facets(
    axis: Axes,
    corners: np.ndarray,
    view: View,
    colours: np.ndarray,
    *,
    rim: np.ndarray | None = None,
    shaded: bool = True,
    edge_darkness: float = 0.62,
    edge_width: float = 0.22,
    zorder: float = 1.0,
) -> None:
    """Paint facets from back to front, with the rim of a sheet among them.

    Parameters
    ----------
    corners : of the facets, shape (F, K, 3). colours : (F, 4), red to blue and opacity.
    rim : segments, shape (B, 2, 3).
    shaded : whether light shows the shape; without it a colour is exactly a value.
    edge_darkness, edge_width : of the edges of facets: share of their colour, and points.
    """
    faces = np.array(colours)[:, :3]
    if shaded:
        faces = np.clip(faces * brightness(corners, view)[:, None], 0.0, 1.0)
    count = len(corners)
    lines = edge_darkness * faces if count <= MOST_FACES_WITH_EDGES else faces
    widths = np.full(count, edge_width)
    if rim is not None:
        # The rim takes part as faces without area, a little in front of its neighbours.
        extent = np.ptp(corners.reshape(-1, 3), axis=0).max()
        ends = (rim + 1e-3 * extent * view.towards)[:, _as_facets(corners)]
        corners = np.concatenate([corners, ends])
        faces = np.concatenate([faces, np.zeros((len(rim), 3))])
        lines = np.concatenate([lines, np.full((len(rim), 3), 0.13)])
        widths = np.concatenate([widths, np.full(len(rim), 0.8)])
    order = painting_order(corners, view)
    axis.add_collection(
        PolyCollection(
            view.on_screen(corners)[order], facecolors=faces[order], edgecolors=lines[order],
            linewidths=widths[order], capstyle="round", zorder=zorder,
        )
    )  # fmt: skip


def _as_facets(corners: np.ndarray) -> list[int]:
    """Ends of a segment as the corners of a facet without area."""
    sides = corners.shape[1]
    return [0, *[1] * (sides - 2), 0] if sides > 3 else [0, 1, 1]


def draw_mesh(
    axis: Axes,
    corners: np.ndarray,
    view: View,
    *,
    face: str,
    edge: str,
    width: float,
    zorder: float = 1.0,
) -> None:
    """Draw facets (F, K, 3) that carry no values: one colour, thin edges while there are few."""
    width = width if len(corners) <= MOST_FACES_WITH_EDGES else 0.0
    axis.add_collection(
        PolyCollection(
            view.on_screen(corners),  # type: ignore[arg-type]
            facecolors=face,
            edgecolors=edge,
            linewidths=width,
            zorder=zorder,
        )
    )


def draw_hatches(axis: Axes, corners: np.ndarray, view: View, pattern: str) -> None:
    """Hatch facets (F, K, 3) that are painted already."""
    if len(corners):
        axis.add_collection(
            PolyCollection(
                view.on_screen(corners), facecolors="none", edgecolors="0.35", hatch=pattern,  # type: ignore[arg-type]
                linewidths=0.0,
            )
        )  # fmt: skip


def draw_segments(
    axis: Axes,
    segments: np.ndarray,
    view: View,
    colour: ColorType,
    width: float,
    *,
    alpha: float | None = None,
    style: LineStyleType = "solid",
    capstyle: CapStyleType | None = None,
    zorder: float = 2.0,
) -> None:
    """Draw segments (S, 2, 3), such as the lines that describe a surface."""
    axis.add_collection(
        LineCollection(
            view.on_screen(segments), colors=colour, linewidths=width, alpha=alpha,  # type: ignore[arg-type]
            linestyles=style, capstyle=capstyle, zorder=zorder,
        )
    )  # fmt: skip


def draw_silhouette(
    axis: Axes,
    points: np.ndarray,
    triangles: np.ndarray,
    view: View,
    colour: ColorType,
    *,
    zorder: float = 1.0,
) -> None:
    """Tint what a surface covers: twice where a closed one has a front and a back."""
    for corners in fronts_and_backs(points, triangles, view):
        axis.add_patch(
            PathPatch(one_path(corners), facecolor=colour, alpha=0.09, linewidth=0.0, zorder=zorder)
        )


def one_path(corners: np.ndarray) -> DrawnPath:
    """Join polygons with corners (F, K, 2), all turned alike, to one path.

    Their overlaps are filled once.
    """
    count, sides = corners.shape[:2]
    vertices = np.concatenate([corners, corners[:, :1]], axis=1).reshape(-1, 2)
    codes = [DrawnPath.MOVETO] + [DrawnPath.LINETO] * (sides - 1) + [DrawnPath.CLOSEPOLY]
    return DrawnPath(vertices, np.tile(np.array(codes, dtype=np.uint8), count))


def draw_outline(
    axis: Axes,
    points: np.ndarray,
    rim: np.ndarray,
    label: str,
    *,
    colour: ColorType = FAINT,
    width: float = 0.8,
    style: LineStyleType = (0, (5, 4)),
) -> None:
    """Draw the rim of a sheet as seen from above: one line for the legend, dashes run on."""
    lines = joined_outline(points, rim)
    axis.add_collection(LineCollection(lines, colors=colour, linewidths=width, linestyles=style))
    axis.plot([], [], color=colour, lw=width, ls=style, label=label)


def draw_fibres(
    axis: Axes,
    places: np.ndarray,
    direction: np.ndarray,
    length: float,
    colour: ColorType,
    *,
    arrows: bool,
) -> None:
    """Draw a fibre family from above: arrows, or segments for directions without a sense.

    Parameters
    ----------
    places : middles (P, 2). direction : unit vectors (P, 3), foreshortened where they are steep.
    """
    flat = length * direction[:, :2]
    head = {"headwidth": 4.2, "headlength": 5.0, "headaxislength": 4.4} if arrows else {
        "headwidth": 0.0, "headlength": 0.0, "headaxislength": 0.0,
        "path_effects": [withStroke(linewidth=1.2, foreground="white")],  # upon any colour
    }  # fmt: skip
    axis.quiver(
        *(places - 0.5 * flat).T, *flat.T, angles="xy", scale_units="xy", scale=1.0, color=colour,
        width=0.0032, zorder=4, **head,
    )  # fmt: skip


def even_places(centres: np.ndarray, across: int = 11) -> tuple[np.ndarray, np.ndarray, float]:
    """Return places on a square grid inside a mesh, the element nearest to each, and the spacing.

    Arrows at the grid's places, not at the centres, stand in even rows on any mesh.
    """
    low, high = centres.min(axis=0), centres.max(axis=0)
    spacing = float((high - low).max()) / across or 1.0  # one element has no extent
    counts = np.maximum(np.floor((high - low) / spacing + 1e-9).astype(int), 1)
    first = 0.5 * (low + high) - 0.5 * (counts - 1) * spacing
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in counts), indexing="ij"), axis=-1)
    places = first + spacing * grid.reshape(-1, 2)
    tree = cKDTree(centres)
    distance, nearest = tree.query(places)
    # The fourth neighbour is one edge length away, in a mesh of quadrilaterals or of triangles.
    reach = np.median(tree.query(centres, k=5)[0][:, 4])  # infinite in a mesh of fewer
    inside = distance < 0.8 * reach
    return places[inside], nearest[inside], spacing


# --- around them ----------------------------------------------------------------------------------


def draw_triad(axis: Axes, view: View) -> None:
    """Draw the directions of the axes in the lower left corner."""
    origin, length = np.array([0.075, 0.1]), 0.055
    box = axis.get_window_extent()
    for direction, label in zip(np.eye(3), "xyz", strict=True):
        tip = view.on_screen(direction) * length * np.array([1.0, box.width / box.height])
        axis.annotate(
            "",
            xy=origin + tip,
            xytext=origin,  # type: ignore[arg-type]
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "-|>", "lw": 0.9, "color": INK, "mutation_scale": 7,
                        "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        x, y = origin + 1.38 * tip
        axis.text(
            x, y, label, transform=axis.transAxes, ha="center", va="center",
            fontsize=8, style="italic",
        )  # fmt: skip


def draw_colour_bar(
    figure: Figure,
    axis: Axes,
    colours: ScalarMappable,
    values: np.ndarray | Sequence,
    shown: Shown,
    *,
    extremes: bool = True,
) -> None:
    """Fill an axis with the bar of a colour scale: arrows where values lie beyond its ends.

    Parameters
    ----------
    values : all that the colours stand for, in the unit shown.
    extremes : whether the largest and the smallest value are written above and below.
    """
    low, high = np.nanmin(values), np.nanmax(values)
    below = low < colours.norm.vmin - 1e-9 * abs(low)
    above = high > colours.norm.vmax + 1e-9 * abs(high)
    extend = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]
    bar = figure.colorbar(colours, cax=axis, extend=extend)
    bar.outline.set_linewidth(0.6)
    bar.set_label(shown.axis_label, labelpad=6)
    if extremes:
        for word, value, y, va in (("max", high, 1.075, "bottom"), ("min", low, -0.075, "top")):
            label = f"{word} {shown.text(value)}"
            axis.text(-0.2, y, label, transform=axis.transAxes, fontsize=8, va=va)


def fit_axis(axis: Axes, shown: np.ndarray, margin: float) -> None:
    """Give an axis equal scales that just hold the points shown (P, 2)."""
    low, high = shown.min(axis=0), shown.max(axis=0)
    pad = margin * (high - low).max()
    axis.set_aspect("equal")
    axis.set_xlim(low[0] - pad, high[0] + pad)
    axis.set_ylim(low[1] - pad, high[1] + pad)


def label_axes(axis: Axes, x: str, y: str) -> None:
    axis.set_xlabel(x, labelpad=2)
    axis.set_ylabel(y, labelpad=2)
    axis.tick_params(length=2.5, pad=2)


# --- a sheet and lines upon it in one painting order ----------------------------------------------


class Layer(NamedTuple):
    """Facets that take part in the painting order of a picture.

    corners : (F, 4, 3). depth : (F,) towards the viewer. faces, lines : colours (F, 4).
    widths : of the edges, points (F,).
    """

    corners: np.ndarray
    depth: np.ndarray
    faces: np.ndarray
    lines: np.ndarray
    widths: np.ndarray


def sheet_layer(
    corners: np.ndarray, view: View, colours: np.ndarray | ColorType, *, shaded: bool = True
) -> Layer:
    """Return the facets (F, 4, 3) of a sheet in one colour, or in colours (F, 4)."""
    faces = _rgba(colours, len(corners))
    if shaded:
        faces[:, :3] = np.clip(faces[:, :3] * brightness(corners, view)[:, None], 0.0, 1.0)
    # edges in the colour of the facets close the gaps between them
    return Layer(corners, _depth(corners, view), faces, faces, np.full(len(corners), 0.3))


def line_layer(
    segments: np.ndarray, view: View, colour: ColorType, width: float, lift: float
) -> Layer:
    """Return segments (S, 2, 3) that lie on a sheet, lifted towards the viewer by ``lift``."""
    corners = segments[:, [0, 1, 1, 0]]
    colours = _rgba(colour, len(segments))
    depth = _depth(corners, view) + lift
    return Layer(corners, depth, colours, colours, np.full(len(segments), width))


def paint(axis: Axes, view: View, layers: Sequence[Layer], zorder: float = 1.0) -> None:
    """Paint all layers from back to front."""
    depth = np.concatenate([layer.depth for layer in layers])
    order = np.argsort(depth, kind="stable")
    corners, faces, lines, widths = (
        np.concatenate([getattr(layer, name) for layer in layers])[order]
        for name in ("corners", "faces", "lines", "widths")
    )
    axis.add_collection(
        PolyCollection(
            list(view.on_screen(corners)), facecolors=faces, edgecolors=lines, linewidths=widths,
            capstyle="round", zorder=zorder,
        )
    )  # fmt: skip


def _depth(corners: np.ndarray, view: View) -> np.ndarray:
    return corners.mean(axis=1) @ view.towards


def _rgba(colour: np.ndarray | ColorType, count: int) -> np.ndarray:
    return np.array(np.broadcast_to(to_rgba_array(colour), (count, 4)))


# --- marks of the largest and the smallest value --------------------------------------------------


LABEL_GAP = 4.0  # between a mark and its label, points


def mark_extremes(axis: Axes, places: np.ndarray, values: np.ndarray, shown: Shown) -> None:
    """Mark the largest and the smallest value at their places (P, 2), with limits already set."""
    if not np.isfinite(values).any():
        return
    axis.apply_aspect()  # else equal scales move marks and labels when all is drawn
    halo = [withStroke(linewidth=2.0, foreground="white")]
    taken: list = []
    for (face, marker, word), corners in zip(
        _extremes(places, values, shown), (CORNERS + FARTHER, CORNERS[::-1] + FARTHER)
    ):
        axis.plot(*places[face], marker, ms=5.5, mfc="white", mec=INK, mew=0.9, zorder=5)
        label = axis.annotate(
            f"{word} {shown.text(values[face])}", places[face], (0.0, 0.0),
            textcoords="offset points", fontsize=7.5, path_effects=halo, zorder=6,
        )  # fmt: skip
        taken += [_around(axis, place) for place in places[[face]]]
        taken.append(_placed(axis, label, corners, taken))


#: Sides of a mark that its label may be on, the nearer ones first: to the right or left of it,
#: above or below.
CORNERS = ((1, 1), (-1, 1), (1, -1), (-1, -1))
FARTHER = tuple((x, lift * y) for lift in (4, 7) for x, y in CORNERS)


def _extremes(places: np.ndarray, values: np.ndarray, shown: Shown) -> list[tuple[int, str, str]]:
    """Return number, mark and word; of equal values the ones that lie far apart.

    Those of mirror images are equal, but for noise. The colour bar names the extreme itself: values
    are equal where they read the same.
    """
    read = np.round(values, shown.decimals)
    largest = np.flatnonzero(read == np.nanmax(read))
    smallest = np.flatnonzero(read == np.nanmin(read))
    # to the upper right, whatever order the faces have
    top = int(largest[np.argmax(places[largest] @ [1.0, 1.01])])
    away = np.linalg.norm(places[smallest] - places[top], axis=1)
    low = int(smallest[np.argmax(away)])
    return [(top, "^", "max"), (low, "v", "min")]


def _around(axis: Axes, place: np.ndarray):
    """Return the box of a mark on the screen."""
    x, y = axis.transData.transform(place)
    return Bbox.from_extents(x - 9.0, y - 9.0, x + 9.0, y + 9.0)


def _placed(axis: Axes, label, corners, taken: list):
    """Put a label on the first side where it meets nothing that is there; return its box."""
    box, frame = None, axis.get_window_extent()
    for right, up in corners:
        label.set_position((LABEL_GAP * right, LABEL_GAP * up))
        label.set_horizontalalignment("left" if right > 0 else "right")
        label.set_verticalalignment("bottom" if up > 0 else "top")
        box = label.get_window_extent()
        inside = (
            frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 <= box.y1 <= frame.y1
        )
        if inside and not any(box.overlaps(other) for other in taken[:-1]):
            break
    return box
