"""Picture of a convergence history: residuals, iterations per window, size of the windows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.coupling.iteration.history import FAILED, OUTCOMES, REJECTED
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

#: Residuals of more iterations than these are drawn without markers.
FEW_ITERATIONS = 200


def draw_history(path: Path | str, history: xr.Dataset, title: str = "") -> None:
    """Draw the dataset of :meth:`History.dataset` as a PNG.

    Raises
    ------
    InputError : the file cannot be written.
    """
    with matplotlib.rc_context(RC):
        figure = new_figure(7.2, 6.0)
        residuals = figure.add_axes((0.105, 0.575, 0.86, 0.29))
        counts = figure.add_axes((0.105, 0.32, 0.86, 0.17))
        sizes = figure.add_axes((0.105, 0.085, 0.86, 0.17), sharex=counts)
        _draw_residuals(residuals, history)
        _draw_windows(counts, sizes, history)
        for axis in (residuals, counts, sizes):
            axis.grid(True, color="#e4e7ea", lw=0.6)
            axis.set_axisbelow(True)
            axis.spines["top"].set_visible(False)
            axis.spines["right"].set_visible(False)
            axis.tick_params(length=2.5)
        headline(figure, f"Convergence of the coupling: {history.attrs['scheme']}", title)
        save(figure, path)


def _draw_residuals(axis: Axes, history: xr.Dataset) -> None:
    """Residual over its limit for every exchange that is judged; below 1 it has converged."""
    count = history.sizes["iteration"]
    number = np.arange(1, count + 1)
    limit = history["residual_limit"].values
    drawn = 0
    for i, name in enumerate(history["exchange"].values):
        judged = np.isfinite(limit[:, i]) & (limit[:, i] > 0.0)
        if not judged.any():
            continue
        ratio = np.full(count, np.nan)
        ratio[judged] = history["residual"].values[judged, i] / limit[judged, i]
        ratio[ratio == 0.0] = np.nan  # exact, below any logarithmic axis
        marker = "." if count <= FEW_ITERATIONS else ""
        colour = SERIES[drawn % len(SERIES)]
        axis.plot(number, ratio, lw=0.9, marker=marker, ms=4, color=colour, label=str(name))
        drawn += 1
    axis.set_yscale("log")
    axis.axhline(1.0, color=INK, lw=0.8, ls="--")
    axis.set_ylabel("residual / allowed")
    axis.set_xlabel("evaluation of the parts")
    if drawn:
        axis.legend(loc="upper right", frameon=True, framealpha=0.85, edgecolor="none")
    else:
        axis.text(0.5, 0.5, "nothing is judged (explicit scheme)", transform=axis.transAxes,
                  ha="center", color=FAINT)  # fmt: skip


def _draw_windows(counts: Axes, sizes: Axes, history: xr.Dataset) -> None:
    """Iterations and size of every attempt over the time at which it begins."""
    begin = history["window_begin"].values
    outcome = history["window_outcome"].values
    undone = np.isin(outcome, (FAILED, REJECTED))
    for axis, values in (
        (counts, history["window_iterations"].values),
        (sizes, history["window_size"].values),
    ):
        axis.plot(begin[~undone], values[~undone], ".", ms=4, color=SERIES[0], label="stands")
        for kind in (FAILED, REJECTED):
            at = outcome == kind
            if at.any():
                colour, marker = (SERIES[1], "x") if kind == FAILED else (SERIES[4], "+")
                axis.plot(begin[at], values[at], marker, ms=5, color=colour, label=OUTCOMES[kind])
    counts.set_ylabel("iterations")
    counts.set_ylim(bottom=0.0)
    counts.tick_params(labelbottom=False)
    if undone.any():
        counts.legend(loc="upper right", ncols=3)
    sizes.set_ylabel("window [s]")
    if (history["window_size"].values > 0.0).any():
        sizes.set_ylim(*_of_a_decade(history["window_size"].values))
        sizes.set_yscale("log")
    sizes.set_xlabel("time [s]")


def _of_a_decade(values: np.ndarray) -> tuple[float, float]:
    """Return limits at least a decade apart, so that equal windows do not show their rounding."""
    positive = values[values > 0.0]
    least, most = float(positive.min()), float(positive.max())
    margin = max(1.3, np.sqrt(10.0 * least / most))
    return least / margin, most * margin
