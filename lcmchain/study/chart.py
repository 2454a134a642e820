"""Chart of a study of accuracy: error against time, with the settings that no other one beats."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.study.accuracy import AccuracyStudy
from lcmchain.study.comparison import BY_NAME

MARKERS = "osD^vP*Xph"


def draw_chart(path: Path | str, study: AccuracyStudy, quantities: list[str] | None = None) -> None:
    """Draw a panel per quantity: typical error over solver time, both logarithmic.

    Parameters
    ----------
    quantities : names of those to draw, all by default.
    """
    names = quantities or study.quantities
    columns = min(3, len(names))
    row_count = math.ceil(len(names) / columns)
    axes = list(dict.fromkeys(s.variant.axis for s in study.settings))
    with matplotlib.rc_context(RC):
        width, height = 3.25 * columns + 0.3, 2.75 * row_count + 1.3
        figure = new_figure(width, height)
        for k, name in enumerate(names):
            row, column = divmod(k, columns)
            place = (
                (0.62 + 3.25 * column) / width,
                1.0 - (0.95 + 2.75 * row + 2.15) / height,
                2.45 / width,
                2.15 / height,
            )
            _draw_panel(figure.add_axes(place), study, name, axes)
        handles = [
            matplotlib.lines.Line2D(
                [], [], ls="", marker=MARKERS[i % len(MARKERS)], color=SERIES[i % len(SERIES)],
                ms=5, label=axis,
            )
            for i, axis in enumerate(axes)
        ]  # fmt: skip
        handles.append(matplotlib.lines.Line2D([], [], color=INK, lw=1.0, label="efficient"))
        figure.legend(handles=handles, loc="lower center", ncol=min(4, len(handles)))
        headline(
            figure,
            "What accuracy costs in time",
            f"{study.title}; error against {study.reference.variant.name}",
        )
        save(figure, path)


def _draw_panel(panel, study: AccuracyStudy, name: str, axes: list[str]) -> None:
    quantity = BY_NAME[name]
    front = study.efficient(name)
    panel.plot(
        [s.seconds for s in front], [quantity.scale * s.error(name) for s in front],
        color=INK, lw=1.0, zorder=1,
    )  # fmt: skip
    for setting in study.settings:
        error = quantity.scale * setting.error(name)
        if not (math.isfinite(error) and error > 0.0):
            continue
        i = axes.index(setting.variant.axis)
        panel.plot(
            setting.seconds, error, marker=MARKERS[i % len(MARKERS)], ms=4.5,
            color=SERIES[i % len(SERIES)], mec="white", mew=0.4, zorder=3,
        )  # fmt: skip
        if setting in front or setting.variant.name == study.as_it_is:
            panel.annotate(
                setting.variant.name, (setting.seconds, error), (4, 4),
                textcoords="offset points", fontsize=6, color=INK, zorder=4,
            )  # fmt: skip
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.grid(True, which="major", color="#e4e7ea", lw=0.6)
    panel.set_axisbelow(True)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    panel.set_title(quantity.title, loc="left")
    panel.set_ylabel(f"error [{quantity.unit}]")
    panel.set_xlabel("solver time [s]")
    panel.tick_params(which="both", length=2.5, color=FAINT)
    panel.margins(x=0.12, y=0.12)
