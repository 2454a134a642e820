"""Curves of a filling over time: pressures, flow rates, and how full the part is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.report.style import INK, RC, SERIES, headline, new_figure, save


def draw_curves(path: Path | str, filled: FilledPart, title: str) -> None:
    """Draw what gates there are, what presses on the part, and the volumes of resin over time."""
    history = filled.history
    panels: list[Callable] = [_gate_pressures, _gate_rates] if filled.setup.gates else []
    panels += [_forces] if filled.history.force.shape[1] else []
    panels.append(_volumes)
    factor, unit = (1.0, "s") if history.time[-1] < 600.0 else (1.0 / 60.0, "min")
    time, count = factor * history.time, len(panels)
    width = 0.9 + 3.5 * count
    with matplotlib.rc_context(RC):
        figure = new_figure(width, 3.7)
        for number, draw in enumerate(panels):
            axis = figure.add_axes(((0.63 + 3.5 * number) / width, 0.15, 2.65 / width, 0.62))
            draw(axis, filled, time)
            axis.set_xlabel(f"time [{unit}]")
            axis.set_xlim(0.0, max(float(time[-1]), 1e-12))
            lowest = min(
                (float(np.nanmin(line.get_ydata(), initial=0.0)) for line in axis.get_lines()),
                default=0.0,
            )
            axis.set_ylim(bottom=1.05 * lowest)
            axis.grid(alpha=0.25, lw=0.5)
            if draw is _gate_rates:
                _limit(axis, 1e6 * history.gate_rate)
        headline(figure, "Filling over time", title)
        save(figure, path)


def _gate_pressures(axis: Any, filled: FilledPart, time: np.ndarray) -> None:
    for number, gate in enumerate(filled.setup.gates):
        colour = SERIES[number % len(SERIES)]
        pressure = 1e-5 * filled.history.gate_pressure[:, number]
        axis.plot(time, pressure, color=colour, label=gate.name)
    axis.set_ylabel("pressure of the gates [bar]")
    axis.legend(loc="best")


def _gate_rates(axis: Any, filled: FilledPart, time: np.ndarray) -> None:
    for number in range(len(filled.setup.gates)):
        colour = SERIES[number % len(SERIES)]
        axis.plot(time, 1e6 * filled.history.gate_rate[:, number], color=colour)
    axis.set_ylabel("flow rate of the gates [ml/s]")


def _forces(axis: Any, filled: FilledPart, time: np.ndarray) -> None:
    total, fibres, resin, *more = filled.history.force.T
    axis.plot(time, 1e-3 * total, color=INK, label="all")
    axis.plot(time, 1e-3 * fibres, color=SERIES[1], label="fibres")
    axis.plot(time, 1e-3 * resin, color=SERIES[0], ls="--", label="resin")
    if more:
        axis.plot(time, 1e-3 * more[0], color=SERIES[2], ls=":", label="friction")
    axis.set_ylabel("force of what presses [kN]")
    axis.legend(loc="best")


def _volumes(axis: Any, filled: FilledPart, time: np.ndarray) -> None:
    history = filled.history
    if filled.setup.gates:
        axis.plot(time, 1e6 * history.injected.sum(axis=1), color=INK, label="injected")
    axis.plot(time, 1e6 * history.stored, color=SERIES[0], ls="--", label="in the part")
    if history.vented[-1].sum() > 0.0:
        axis.plot(time, 1e6 * history.vented.sum(axis=1), color=SERIES[1], label="vented")
    axis.set_ylabel("volume of resin [ml]")
    share = axis.twinx()
    share.plot(time, 100.0 * history.filled_share, color=SERIES[2], ls=":", label="filled")
    share.set_ylabel("filled share of the pores [%]")
    share.set_ylim(0.0, 105.0)
    axis.legend(handles=[*axis.get_lines(), *share.get_lines()], loc="lower right")


def _limit(axis, rates: np.ndarray) -> None:
    """Keep the first moments of a pressure gate, whose flow rate is unbounded, from flattening."""
    rates = rates[np.isfinite(rates)]  # closed gates have none
    if rates.size and rates.max() > 0.0:
        low, high = min(0.0, float(rates.min())), float(rates.max())
        usual = float(np.percentile(rates[rates > 0.0], 90.0)) if (rates > 0.0).any() else high
        axis.set_ylim(low, 1.1 * min(high, 3.0 * usual))
