"""Curves of a run: energies over time, tool forces over the stroke and over each tool's travel."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.patheffects import withStroke

from lcmchain.fields.loads import has_histories, mean_force, quoted_force
from lcmchain.fields.saved import SAMPLE
from lcmchain.fields.stages import borders
from lcmchain.fields.summary import punch_index, tool_force_magnitude
from lcmchain.report.renderer import axes_at
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.thresholds import LARGEST_KINETIC_PART

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


# Parts of the energy balance that are not stored or dissipated energy, and how they are drawn.
WORK, ERROR, MASS_DAMPING = "external", "balance_error", "mass_damping"
# Curves of up to this many points show each of them.
FEW_POINTS = 50


def draw_energy(path: Path | str, history: xr.Dataset, title: str = "") -> None:
    """Draw the energy balance over time, and kinetic energy and balance error as ratios.

    The histories are drawn where a result has them, else the frames. The ratios refer to the
    internal energy at the time (kinetic) and to its largest value (balance error); percent on a
    logarithmic scale.
    """
    time, parts = _energies(history)
    error = parts.pop(ERROR, None)
    mass_damping = parts.pop(MASS_DAMPING, None)
    largest = max((np.nanmax(np.abs(v)) for v in parts.values()), default=0.0)
    factor, unit = (1e3, "mJ") if largest < 1.0 else (1.0, "J")
    with matplotlib.rc_context(RC):
        figure = new_figure(7.2, 5.4)
        top = figure.add_axes((0.105, 0.42, 0.66, 0.455))
        ratios = figure.add_axes((0.105, 0.095, 0.66, 0.26), sharex=top)
        colours = iter(SERIES)
        for name, values in parts.items():
            style: dict[str, Any] = (
                {"color": INK, "ls": "--"} if name == WORK else {"color": next(colours, INK)}
            )
            label = "external work" if name == WORK else name.replace("_", " ")
            top.plot(time, factor * values, lw=1.5, label=label, **style)
            if name == "damping" and mass_damping is not None:
                style |= {"lw": 1.0, "ls": ":", "label": "of that mass damping"}
                top.plot(time, factor * mass_damping, **style)
        top.set_ylabel(f"energy [{unit}]")
        top.tick_params(labelbottom=False)
        top.legend(loc="upper left", bbox_to_anchor=(1.02, 1.02))
        _draw_ratios(ratios, time, parts, error)
        for axis in (top, ratios):
            _finish(axis, time)
            _mark_stages(axis, history, named=axis is top)
        ratios.set_xlabel("time [ms]")
        headline(figure, "Energy balance", title)
        save(figure, path)


def draw_force(path: Path | str, history: xr.Dataset, title: str = "") -> None:
    """Draw the force on every tool over the course of the punch, and over time with the travel.

    The course is the travel of the punch, or its angle where it turns; over tools that all stand
    the forces are drawn over time alone. Means over the intervals of the histories, with the
    largest force of single steps as a thin line, where a result has them; else the forces of the
    frames.
    """
    time, travel, force, largest = _tool_curves(history)
    names = [str(name) for name in history["tool"].values]
    punch = punch_index(history)
    course, label = _course(history, travel, punch, names[punch])
    with matplotlib.rc_context(RC):
        figure = new_figure(9.6, 3.9)
        top = 1.12 * max(float(np.nanmax(force)), 1e-12)
        if course is None:
            right = figure.add_axes((0.07, 0.135, 0.87, 0.67))
        else:
            left = figure.add_axes((0.07, 0.135, 0.40, 0.67))
            right = figure.add_axes((0.545, 0.135, 0.395, 0.67))
            left.set_xlabel(label)
            _draw_forces(left, course, names, force, largest, punch)
            left.legend(loc="upper left")
            _say_largest(left, history, course, time, punch)
            _finish(left, course)
            left.set_ylim(0.0, top)
        _draw_forces(right, time, names, force, None if course is not None else largest, punch)
        if course is None:
            right.legend(loc="upper left")
            _say_largest(right, history, time, time, punch)
        if np.ptp(travel, axis=0).any():
            _draw_travel(right.twinx(), time, travel)
        right.set_xlabel("time [ms]")
        _finish(right, time)
        _mark_stages(right, history)
        right.set_ylim(0.0, top)
        headline(figure, "Tool forces", title)
        save(figure, path)


def _course(
    history: xr.Dataset, travel: np.ndarray, punch: int, name: str
) -> tuple[np.ndarray | None, str]:
    """Return the travel [mm] of the punch or its angle [°] and what it is; None if it stands."""
    if np.ptp(travel[:, punch]) > 0.0:
        return travel[:, punch], f"travel of the {name} [mm]"
    angles = "history_tool_angle" if has_histories(history) else "tool_angle"
    if angles in history and np.ptp(history[angles].values[:, punch]) > 0.0:
        return np.degrees(history[angles].values[:, punch]), f"angle of the {name} [°]"
    return None, ""


def _draw_forces(
    axis: Axes,
    x: np.ndarray,
    names: Sequence[str],
    force: np.ndarray,
    largest: np.ndarray | None,
    punch: int,
) -> None:
    for tool, name in enumerate(names):
        width = 1.9 if tool == punch else 1.2
        axis.plot(x, force[:, tool], label=name, color=SERIES[tool % len(SERIES)], lw=width)
    if largest is not None:
        axis.plot(
            x, largest[:, punch], color=INK, lw=0.5, alpha=0.5, zorder=1,
            label=f"{names[punch]}, single steps",
        )  # fmt: skip
    axis.set_ylabel("contact force [N]")


def _draw_travel(axis: Axes, time: np.ndarray, travel: np.ndarray) -> None:
    """Draw the travel (H, T) [mm] of the tools that move over time [ms], dotted."""
    for tool in np.flatnonzero(np.ptp(travel, axis=0) > 0.0):
        axis.plot(time, travel[:, tool], color=SERIES[tool % len(SERIES)], lw=1.0, ls=":")
    axis.set_ylabel("travel [mm] (dotted)")
    reach = float(np.nanmax(np.abs(travel))) or 1.0
    axis.set_ylim(min(1.12 * float(np.nanmin(travel)), 0.0), 1.12 * reach)
    axis.tick_params(length=2.5)
    axis.spines["top"].set_visible(False)


def _say_largest(
    axis: Axes, history: xr.Dataset, course: np.ndarray, time: np.ndarray, punch: int
) -> None:
    """Mark the force of the punch that the summary quotes, at its place of the course."""
    name = str(history["tool"].values[punch])
    when, size = _largest_force(history, punch)
    place = float(np.interp(when, time, course)), size
    axis.annotate(
        f"{name}: max {size:.3g} N", place, (-8, 3), textcoords="offset points",
        ha="right", fontsize=7.5, zorder=6,
        path_effects=[withStroke(linewidth=2.0, foreground="white")],
    )  # fmt: skip
    axis.plot(*place, "o", ms=3.5, color=INK, clip_on=False)


def _energies(history: xr.Dataset) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times [ms] and energies by name, of the histories or else of the frames."""
    stem, clock = ("history_energy_", SAMPLE) if has_histories(history) else ("energy_", "time")
    parts = {
        str(name).removeprefix(stem): values.values
        for name, values in history.data_vars.items()
        if str(name).startswith(stem)
    }
    return 1e3 * history[clock].values, parts


def _tool_curves(
    history: xr.Dataset,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
    """Return times [ms], travel [mm], force and largest force of single steps [N] of the tools."""
    if has_histories(history):
        travel, largest = history["history_tool_travel"], history["history_tool_peak_force"]
        return (
            1e3 * history[SAMPLE].values, 1e3 * travel.values, mean_force(history), largest.values,
        )  # fmt: skip
    travel = history["tool_travel"]
    return 1e3 * history["time"].values, 1e3 * travel.values, tool_force_magnitude(history), None


def _largest_force(history: xr.Dataset, tool: int) -> tuple[float, float]:
    """Return time [ms] and size [N] of the force that the summary quotes."""
    time, _, force, _ = _tool_curves(history)
    middle = time
    if has_histories(history):
        middle, force = quoted_force(history)
        middle = 1e3 * middle
    top = int(np.argmax(force[:, tool]))
    return float(middle[top]), float(force[top, tool])


def _draw_ratios(axis, time, parts, error) -> None:
    internal = np.abs(parts.get("internal", np.full(len(time), np.nan)))
    largest = np.nanmax(internal) if np.isfinite(internal).any() else np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        if "kinetic" in parts:
            ratio = np.where(internal > 0.0, parts["kinetic"] / internal, np.nan)
            _draw_ratio(axis, time, 100.0 * ratio, SERIES[0], "kinetic / internal")
        if error is not None:
            share = np.abs(error) / largest
            _draw_ratio(axis, time, 100.0 * share, SERIES[1], "|balance error| /\nlargest internal")
    axis.axhline(100.0 * LARGEST_KINETIC_PART, color="#8a929c", lw=0.8, ls="--")
    axis.text(
        0.995, 100.0 * LARGEST_KINETIC_PART, f"{100.0 * LARGEST_KINETIC_PART:g} %",
        ha="right", va="bottom",
        transform=axis.get_yaxis_transform(), fontsize=7, color="#6b737d",
    )  # fmt: skip
    axis.set_yscale("log")
    axis.set_ylim(1e-4, 1e3)
    axis.set_ylabel("ratio [%]")
    if axis.get_legend_handles_labels()[0]:  # else no ratio is above zero
        axis.legend(loc="upper left", bbox_to_anchor=(1.02, 1.02))


def _draw_ratio(axis, time, percent, colour, label) -> None:
    shown = np.where(percent > 0.0, percent, np.nan)
    marker = "o" if len(time) <= FEW_POINTS else ""
    axis.plot(time, shown, color=colour, lw=1.3, marker=marker, ms=2.2, label=label)


def _mark_stages(axis, history: xr.Dataset, *, named: bool = True) -> None:
    """Draw a line at the end of every stage but the last, and their names above."""
    ends, start = borders(history), 0.0
    for number, (name, end) in enumerate(ends):
        if number + 1 < len(ends):
            axis.axvline(end, color=FAINT, lw=0.7, ls=":")
        if named:
            place = {"transform": axis.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            axis.text(0.5 * (start + end), 1.01, name, fontsize=6.5, color=FAINT, **place)
        start = end


def _finish(axis, x: np.ndarray) -> None:
    axis.grid(True, color="#e4e7ea", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines["top"].set_visible(False)
    axis.spines["right"].set_visible(False)
    axis.tick_params(length=2.5)
    if np.ptp(x) > 0.0:
        axis.set_xlim(np.min(x), np.max(x))


# --- force of every tool over its own travel ------------------------------------------------------


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
