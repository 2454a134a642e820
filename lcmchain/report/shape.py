"""The formed shape on paper: shaded faces in a view, their colours, and the axes around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.report.style import INK
from lcmchain.report.view import View, brightness, painting_order


@dataclass(frozen=True)
class Shown:
    """How a face field is shown: file, title, unit, colours."""

    name: str
    title: str
    unit: str
    factor: float  # from SI to the unit shown
    colour_map: str
    signed: bool  # zero in the middle of the colours
    decimals: int


# Values beyond these percentiles do not stretch the colours when they lie far out.
PERCENTILES = (0.2, 99.8)
# Above this number of faces their edges would cover the colours.
MOST_FACES_WITH_EDGES = 30_000


def hangs_down(points: np.ndarray, rim: np.ndarray) -> bool:
    """Tell whether the sheet is drawn further below its rim than above it."""
    level = np.median(points[rim.ravel(), 2])
    return level - points[:, 2].min() > points[:, 2].max() - level


def colour_scale(values: np.ndarray, shown: Shown):
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    values = values[np.isfinite(values)]
    if len(values) == 0:
        return ScalarMappable(Normalize(0.0, 1.0), shown.colour_map)
    low, high = values.min(), values.max()
    inner_low, inner_high = np.percentile(values, PERCENTILES)
    # A few outliers only: the colours stay with the rest, and the bar gets arrows.
    slack = 0.25 * (inner_high - inner_low)
    low, high = max(low, inner_low - slack), min(high, inner_high + slack)
    if shown.signed:
        limit = max(abs(low), abs(high))
        step = 5.0 if limit > 10.0 else 1.0
        limit = max(step * np.ceil(limit / step - 1e-9), 1.0)
        low, high = -limit, limit
    if high - low < 1e-3 * max(abs(high), 1e-12):  # constant but for round-off
        middle = 0.5 * (low + high)
        low, high = middle - 0.005 * abs(middle), middle + 0.005 * abs(middle)
    return ScalarMappable(Normalize(low, high), shown.colour_map)


def draw_shape(axis, points, faces, rim, view: View, colours) -> None:
    """Paint the shaded faces from back to front, with the rim of the sheet among them."""
    from matplotlib.collections import PolyCollection

    corners = points[faces]
    shaded = colours.copy()
    shaded[:, :3] = np.clip(shaded[:, :3] * brightness(corners, view)[:, None], 0.0, 1.0)
    lines = 0.62 * shaded[:, :3] if len(faces) <= MOST_FACES_WITH_EDGES else shaded[:, :3]
    # The rim takes part as faces without area, a little in front of its neighbours.
    ends = points[rim] + 1e-3 * np.ptp(points, axis=0).max() * view.towards
    everything = np.concatenate([corners, ends[:, [0, 1, 1, 0]]])
    count = len(rim)
    order = painting_order(everything, view)
    axis.add_collection(
        PolyCollection(
            view.on_screen(everything)[order],
            facecolors=np.concatenate([shaded[:, :3], np.zeros((count, 3))])[order],
            edgecolors=np.concatenate([lines, np.full((count, 3), 0.13)])[order],
            linewidths=np.concatenate([np.full(len(faces), 0.22), np.full(count, 0.8)])[order],
            capstyle="round",
        )
    )
    fit_axis(axis, view.on_screen(points), 0.03)
    axis.set_axis_off()


def draw_triad(axis, view: View) -> None:
    """Draw the directions of the axes in the lower left corner."""
    origin, length = np.array([0.075, 0.1]), 0.055
    box = axis.get_window_extent()
    for direction, label in zip(np.eye(3), "xyz", strict=True):
        tip = view.on_screen(direction) * length * np.array([1.0, box.width / box.height])
        axis.annotate(
            "",
            xy=origin + tip,
            xytext=origin,
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "-|>", "lw": 0.9, "color": INK, "mutation_scale": 7,
                        "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axis.text(
            *(origin + 1.38 * tip), label, transform=axis.transAxes, ha="center", va="center",
            fontsize=8, style="italic",
        )  # fmt: skip


def joined_outline(points: np.ndarray, edges: np.ndarray) -> list[np.ndarray]:
    """Join edges to closed polylines in the plane: dashes run on over the nodes."""
    following = dict(edges.tolist())
    lines = []
    while following:
        start, node = following.popitem()
        loop = [start, node]
        while node in following:
            node = following.pop(node)
            loop.append(node)
        lines.append(points[loop, :2])
    return lines


def fit_axis(axis, shown: np.ndarray, margin: float) -> None:
    low, high = shown.min(axis=0), shown.max(axis=0)
    pad = margin * (high - low).max()
    axis.set_aspect("equal")
    axis.set_xlim(low[0] - pad, high[0] + pad)
    axis.set_ylim(low[1] - pad, high[1] + pad)


def label_axes(axis, x: str, y: str) -> None:
    axis.set_xlabel(x, labelpad=2)
    axis.set_ylabel(y, labelpad=2)
    axis.tick_params(length=2.5, pad=2)
