"""Picture of the signals over time; a panel shows what a unit gives in one unit of measurement."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from lcmchain.coupling.cosimulation.recorder import Recorder, scalars_of
from lcmchain.coupling.cosimulation.variable import Variable
from lcmchain.report.style import RC, SERIES, headline, new_figure, save

#: Most panels of the picture, and most curves of one.
MOST_PANELS = 14
MOST_CURVES = len(SERIES)


def draw_signals(path: Path | str, recorder: Recorder, title: str) -> str:
    """Draw what was recorded; return a remark on what found no place, or nothing.

    Of a field the mean is drawn, in a band from the least to the largest value.

    Raises
    ------
    InputError : the place cannot be written.
    """
    panels = _panels(recorder)
    shown = panels[:MOST_PANELS]
    rows = max(1, (len(shown) + 1) // 2)
    columns = 2 if len(shown) > 1 else 1
    with matplotlib.rc_context(RC):
        height = 0.8 + 1.75 * rows
        figure = new_figure(4.6 * columns, height)
        axes = figure.subplots(rows, columns, squeeze=False)
        for axis in axes.flat[len(shown) :]:
            axis.set_visible(False)
        left_out = sum(len(group) for _, group in panels[MOST_PANELS:])
        for axis, (name, group) in zip(axes.flat, shown):
            _draw_panel(axis, recorder, name, group)
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        headline(figure, title, "Signals of the units; of fields the mean, in a band of all values")
        figure.subplots_adjust(
            left=0.085 if columns == 2 else 0.16, right=0.975, top=1.0 - 0.75 / height,
            bottom=0.42 / height, hspace=0.38, wspace=0.24,
        )  # fmt: skip
        save(figure, path)
    if left_out == 0:
        return ""
    count = len(scalars_of(recorder))
    return f"{left_out} of {count} recorded variables found no place in signals.png"


def _panels(recorder: Recorder) -> list[tuple[str, list[Variable]]]:
    groups: dict[tuple[str, str, bool, bool], list[Variable]] = {}
    for unit, variable in scalars_of(recorder):
        kind = (unit, variable.unit_text, variable.is_field, variable.is_real)
        groups.setdefault(kind, []).append(variable)
    return [
        (unit, group[first : first + MOST_CURVES])
        for (unit, *_), group in groups.items()
        for first in range(0, len(group), MOST_CURVES)
    ]


def _draw_panel(axis: Any, recorder: Recorder, unit: str, group: list[Variable]) -> None:
    times = np.array(recorder.times)
    for variable, colour in zip(group, SERIES):
        rows = np.stack(recorder.values[f"{unit}.{variable.name}"]).astype(np.float64)
        # what changes in jumps keeps its value until the next point
        style = "default" if variable.is_signal else "steps-post"
        if variable.is_field:
            least, most = rows.min(axis=1), rows.max(axis=1)
            axis.fill_between(times, least, most, color=colour, alpha=0.2, lw=0)
        axis.plot(
            times, rows.mean(axis=1), color=colour, lw=1.1, drawstyle=style, label=variable.name
        )
    symbol = group[0].unit_text
    axis.set_ylabel(f"{unit} [{symbol}]")
    axis.grid(True, color="#e4e7ea", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines["top"].set_visible(False)
    axis.spines["right"].set_visible(False)
    axis.margins(x=0.0)
    axis.legend(loc="best", fontsize=6.5, frameon=True, framealpha=0.8, edgecolor="none")
