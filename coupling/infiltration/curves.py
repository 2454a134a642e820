"""Curves of a filling over time: pressures, flow rates, and how full the part is."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.report.style import INK, RC, SERIES, headline, new_figure, save


def draw_curves(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw gate pressures, flow rates, and the volumes of resin over time."""
    history = filled.history
    factor, unit = (1.0, "s") if history.time[-1] < 600.0 else (1.0 / 60.0, "min")
    time = factor * history.time
    with matplotlib.rc_context(RC):
        figure = new_figure(11.4, 3.7)
        left, middle, right = (figure.add_axes((x, 0.15, 0.25, 0.62)) for x in (0.055, 0.38, 0.70))
        for number, gate in enumerate(filled.setup.gates):
            colour = SERIES[number % len(SERIES)]
            left.plot(time, 1e-5 * history.gate_pressure[:, number], color=colour, label=gate.name)
            middle.plot(time, 1e6 * history.gate_rate[:, number], color=colour, label=gate.name)
        left.set_ylabel("pressure of the gates [bar]")
        middle.set_ylabel("flow rate of the gates [ml/s]")
        right.plot(time, 1e6 * history.injected.sum(axis=1), color=INK, label="injected")
        right.plot(time, 1e6 * history.stored, color=SERIES[0], ls="--", label="in the part")
        if history.vented[-1].sum() > 0.0:
            right.plot(time, 1e6 * history.vented.sum(axis=1), color=SERIES[1], label="vented")
        right.set_ylabel("volume of resin [ml]")
        share = right.twinx()
        share.plot(time, 100.0 * history.filled_share, color=SERIES[2], ls=":", label="filled")
        share.set_ylabel("filled share of the pores [%]")
        share.set_ylim(0.0, 105.0)
        lines = [*right.get_lines(), *share.get_lines()]
        right.legend(handles=lines, loc="lower right")
        for axis in (left, middle, right):
            axis.set_xlabel(f"time [{unit}]")
            axis.set_xlim(0.0, max(float(time[-1]), 1e-12))
            lowest = min(
                float(np.nanmin(line.get_ydata(), initial=0.0)) for line in axis.get_lines()
            )
            axis.set_ylim(bottom=1.05 * lowest)
            axis.grid(alpha=0.25, lw=0.5)
        _limit(middle, 1e6 * history.gate_rate)
        if filled.setup.gates:
            left.legend(loc="best")
        headline(figure, "Filling over time", title)
        save(figure, path)


def _limit(axis, rates: np.ndarray) -> None:
    """Keep the first moments of a pressure gate, whose flow rate is unbounded, from flattening."""
    rates = rates[np.isfinite(rates)]  # closed gates have none
    if rates.size and rates.max() > 0.0:
        low, high = min(0.0, float(rates.min())), float(rates.max())
        usual = float(np.percentile(rates[rates > 0.0], 90.0)) if (rates > 0.0).any() else high
        axis.set_ylim(low, 1.1 * min(high, 3.0 * usual))
