"""Force of every tool over its travel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.fields.loads import has_histories, mean_force
from lcmchain.fields.summary import punch_index, tool_force_magnitude
from lcmchain.report.renderer import axes_at
from lcmchain.report.style import INK, RC, SERIES, headline, new_figure, save

if TYPE_CHECKING:
    import xarray as xr

# A tool that travels less than this part of the largest travel has no stroke of its own.
LEAST_STROKE = 0.05
COLUMNS = 3


def draw_force_over_travel(path: Path | str, history: xr.Dataset, title: str = "") -> None:
    """Draw the force of every tool over its travel, one panel per tool with scales of its own.

    The line is the mean over the intervals of the histories, the band reaches up to the largest
    force of a single step in them; of a result without histories, the forces of the frames. A tool
    that hardly travels is drawn over the travel of the punch.
    """
    travel, mean, peak = _curves(history)
    names = [str(name) for name in history["tool"].values]
    punch = punch_index(history)
    spans = np.ptp(travel, axis=0)
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    width, height = 3.0, 2.3
    with matplotlib.rc_context(RC):
        total = 0.75 + rows * (height + 0.75)
        figure = new_figure(0.2 + columns * (width + 0.75), total)
        for tool, name in enumerate(names):
            row, column = divmod(tool, columns)
            left, top = 0.65 + column * (width + 0.75), total - 0.95 - row * (height + 0.75)
            axis = axes_at(figure, left, top - height, width, height)
            own = spans[tool] > LEAST_STROKE * spans.max()
            over = tool if own else punch
            colour = SERIES[tool % len(SERIES)]
            x = travel[:, over]
            if peak is not None:
                axis.fill_between(
                    x, mean[:, tool], peak[:, tool], color=colour, alpha=0.25, lw=0.0,
                    label="up to the largest step",
                )  # fmt: skip
            label = "mean" if peak is not None else "frames"
            axis.plot(x, mean[:, tool], color=colour, lw=1.5, label=label)
            highest = np.nanmax(mean[:, tool] if peak is None else peak[:, tool], initial=0.0)
            axis.set_ylim(0.0, 1.18 * max(float(highest), 1e-12))
            axis.set_xlabel(
                "travel [mm]" if own else f"travel of the {names[over]} [mm]", labelpad=2
            )
            axis.set_ylabel("contact force [N]")
            axis.set_title(name, loc="left", color=INK, weight="bold")
            axis.legend(loc="upper left")
            axis.grid(True, color="#e4e7ea", lw=0.6)
            axis.set_axisbelow(True)
            axis.spines[["top", "right"]].set_visible(False)
        headline(figure, "Tool forces over travel", title)
        save(figure, path)


def _curves(history: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return travel [mm], mean force and largest force of single steps [N], each (H, T)."""
    if not has_histories(history):
        return 1e3 * history["tool_travel"].values, tool_force_magnitude(history), None
    # a force is the mean over the interval that ends at its sample, and stands in its middle
    travel = history["history_tool_travel"].values
    before = np.concatenate([np.zeros((1, travel.shape[1])), travel[:-1]])
    peak = history["history_tool_peak_force"].values
    return 0.5e3 * (before + travel), mean_force(history), peak
