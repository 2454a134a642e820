"""A sheet with lines upon it in one painting order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.report.view import View, brightness

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType


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
    from matplotlib.collections import PolyCollection

    depth = np.concatenate([layer.depth for layer in layers])
    order = np.argsort(depth, kind="stable")
    corners, faces, lines, widths = (
        np.concatenate([getattr(layer, name) for layer in layers])[order]
        for name in ("corners", "faces", "lines", "widths")
    )
    axis.add_collection(
        PolyCollection(
            view.on_screen(corners), facecolors=faces, edgecolors=lines, linewidths=widths,
            capstyle="round", zorder=zorder,
        )
    )  # fmt: skip


def _depth(corners: np.ndarray, view: View) -> np.ndarray:
    return corners.mean(axis=1) @ view.towards


def _rgba(colour: np.ndarray | ColorType, count: int) -> np.ndarray:
    from matplotlib.colors import to_rgba_array

    return np.array(np.broadcast_to(to_rgba_array(colour), (count, 4)))  # type: ignore[arg-type]
