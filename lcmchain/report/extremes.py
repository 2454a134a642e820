"""Marks of the largest and the smallest value on a map, with labels that keep apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.report.shown import Shown
from lcmchain.report.style import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP = 4.0  # between a mark and its label, points


def mark_extremes(axis: Axes, places: np.ndarray, values: np.ndarray, shown: Shown) -> None:
    """Mark the largest and the smallest value at their places (P, 2), with limits already set."""
    from matplotlib.patheffects import withStroke

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
    from matplotlib.transforms import Bbox

    x, y = axis.transData.transform(place)
    return Bbox.from_extents(x - 9.0, y - 9.0, x + 9.0, y + 9.0)


def _placed(axis: Axes, label, corners, taken: list):
    """Put a label on the first side where it meets nothing that is there; return its box."""
    box, frame = None, axis.get_window_extent()
    for right, up in corners:
        label.set_position((GAP * right, GAP * up))
        label.set_horizontalalignment("left" if right > 0 else "right")
        label.set_verticalalignment("bottom" if up > 0 else "top")
        box = label.get_window_extent()
        inside = (
            frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 <= box.y1 <= frame.y1
        )
        if inside and not any(box.overlaps(other) for other in taken[:-1]):
            break
    return box
