"""Chart of a study of accuracy: error against time, with the settings that no other one beats."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.study.accuracy import AccuracyStudy, Setting
from lcmchain.study.comparison import BY_NAME

MARKERS = "osD^vP*Xph"
#: Room that a label takes [points].
LABEL_WIDTH, LABEL_HEIGHT = 55.0, 9.0


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
    usable = [s for s in study.settings if math.isfinite(s.error(name)) and s.error(name) > 0.0]
    shown = [s for s in usable if not study.on_finest(s)]
    front = [s for s in study.efficient(name) if s in shown]
    panel.plot(
        [s.seconds for s in front], [quantity.scale * s.error(name) for s in front],
        color=INK, lw=1.0, zorder=1,
    )  # fmt: skip
    for setting in shown:
        i = axes.index(setting.variant.axis)
        panel.plot(
            setting.seconds, quantity.scale * setting.error(name), ls="",
            marker=MARKERS[i % len(MARKERS)], color=SERIES[i % len(SERIES)],
            ms=4.5, mec="white", mew=0.4, zorder=3,
        )  # fmt: skip
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.margins(x=0.16, y=0.16)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        low, high = axis.get_view_interval()
        few = high < 30.0 * low
        axis.set_minor_formatter(lambda value, _, few=few: _minor(value) if few else "")
    _label(panel, name, [s for s in shown if s.variant.name == study.as_it_is], front)
    panel.grid(True, which="major", color="#e4e7ea", lw=0.6)
    panel.set_axisbelow(True)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    panel.set_title(f"{quantity.title}: error [{quantity.unit}]", loc="left")
    panel.set_xlabel("solver time [s]")
    panel.tick_params(which="both", length=2.5, color=FAINT)


def _minor(value: float) -> str:
    """Label 2 and 5 times a power of ten alone, so that labels do not run into each other."""
    digit = round(value / 10.0 ** math.floor(math.log10(value)))
    return f"{value:g}" if digit in (2, 5) else ""


def _label(panel, name: str, scene: list[Setting], front: list[Setting]) -> None:
    """Name the scene as it is and settings of the front, as far as their labels stay apart."""
    width, height = (panel.figure.get_size_inches() * 72.0) * panel.get_position().size
    (x0, x1), (y0, y1) = (
        [math.log(v) for v in limits] for limits in (panel.get_xlim(), panel.get_ylim())
    )
    scale = BY_NAME[name].scale
    taken: list[tuple[float, float]] = []
    for setting in [*scene, *(s for s in front if s not in scene)]:
        error = scale * setting.error(name)
        x = width * (math.log(setting.seconds) - x0) / (x1 - x0)
        y = height * (math.log(error) - y0) / (y1 - y0)
        if any(abs(x - a) < LABEL_WIDTH and abs(y - b) < LABEL_HEIGHT for a, b in taken):
            continue
        taken.append((x, y))
        right = x > 0.72 * width
        panel.annotate(
            setting.variant.name, (setting.seconds, error), (-4 if right else 4, 4),
            textcoords="offset points", ha="right" if right else "left", fontsize=6, zorder=4,
            weight="bold" if setting in scene else "normal", color=INK,
        )  # fmt: skip
