"""What an identification leaves behind: table, scene snippet, numbers, picture of the fit."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import matplotlib
import numpy as np

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.identification.result import SHOWN_UNITS, Identification, LeftOut, Panel, Parameter
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save

if TYPE_CHECKING:
    from rich.table import Table

# Largest factor between a curve and the end of its band that a logarithmic axis shows.
WIDEST_BAND = 1e6
# Grey of rows that do not enter the fit.
LEFT_OUT = "#a9b0b8"


def write_identification(result: Identification, folder: Path) -> tuple[Path, Path, Path]:
    """Write ``parameters.toml``, ``fit.png`` and ``identification.json``; return their paths.

    Raises
    ------
    InputError : the folder cannot be written.
    """
    paths = (folder / "parameters.toml", folder / "fit.png", folder / "identification.json")
    with replacing(paths[0]) as temporary:
        temporary.write_text(scene_snippet(result), encoding="utf-8")
    draw_fit(paths[1], result)
    with replacing(paths[2]) as temporary:
        temporary.write_text(json.dumps(as_json(result), indent=2) + "\n", encoding="utf-8")
    return paths


def scene_snippet(result: Identification) -> str:
    """Return the scene-file table that takes the parameters; it fits below a [material] preset."""
    lines = [f"# Identified from {result.point_count} measured values: {result.method}."]
    lines += [f"# {name}: {value} ({origin})" for name, value, origin in result.inputs]
    lines += [f"# 95 % interval of {interval_text(p)}" for p in result.parameters]
    lines += [f"# Note: {warning}." for warning in result.warnings]
    lines.append(f"[{result.scene_table}]")
    lines += [f"{key} = {text}" for key, text in result.scene_entries.items()]
    return "\n".join(lines) + "\n"


def as_json(result: Identification) -> dict:
    """Return all numbers of a result, in SI units, with null where there is none."""

    def parameter(p: Parameter) -> dict:
        return {
            "value": _number(p.value),
            "unit": p.unit,
            "interval_95": [_number(p.low), _number(p.high)],
            "determined": p.is_determined if math.isfinite(p.low) else None,
        }

    def left_out(one: LeftOut) -> dict:
        return {
            "why": one.why,
            "specimen": one.specimen or None,
            "lines": [int(line) for line in one.lines],
            "driven": [float(value) for value in one.driven],
            "load": [float(value) for value in one.load],
        }

    return {
        "lcmchain_version": __version__,
        "law": result.law,
        "method": result.method,
        "noise_model": result.noise_model,
        "interval_method": result.interval_method,
        "inputs": [
            {"name": name, "value": value, "origin": origin}
            for name, value, origin in result.inputs
        ],
        "parameters": {p.name: parameter(p) for p in result.parameters},
        "derived": {p.name: parameter(p) for p in result.derived},
        "scene": {result.scene_table: result.scene_entries},
        "correlation": [[_number(c) for c in row] for row in result.correlation],
        "condition_number": _number(result.condition),
        "relative_noise": _number(result.relative_noise),
        "r_squared": _number(result.r_squared),
        "point_count": result.point_count,
        "warnings": list(result.warnings),
        "objections": list(result.objections),
        "holds": result.holds or None,
        **({"left_out": [left_out(one) for one in result.left_out]} if result.left_out else {}),
    }


def tables(result: Identification) -> tuple[Table, Table]:
    """Return rich tables: what was used, and the parameters with their intervals."""
    from rich.table import Table

    used = Table(title=f"Identification of the {result.law} law", title_justify="left")
    for heading in ("used", "value", "origin"):
        used.add_column(heading)
    for row in result.inputs:
        used.add_row(*row)
    used.add_row("method", result.method, "")
    used.add_row("noise", result.noise_model, "")
    used.add_row("intervals", result.interval_method, "")
    found = Table(title=fit_text(result), title_justify="left")
    columns: tuple[tuple[str, Literal["left", "right"]], ...] = (
        ("parameter", "left"), ("value", "right"), ("unit", "left"), ("95 % interval", "right"),
    )  # fmt: skip
    for heading, justify in columns:
        found.add_column(heading, justify=justify)
    every = (*result.parameters, *result.derived)
    if not all(p.is_determined for p in every):
        found.add_column("remark")
    for p in every:
        unit, factor = SHOWN_UNITS[p.unit]
        interval = (
            f"{factor * p.low:.5g} ... {factor * p.high:.5g}" if math.isfinite(p.low) else "unknown"
        )
        remark = () if p.is_determined else ("not determined",)
        found.add_row(p.name, f"{factor * p.value:.6g}", unit, interval, *remark)
    return used, found


def fit_text(result: Identification) -> str:
    """Return quality of the fit in one line."""
    noise = (
        f"scatter {100 * result.relative_noise:.2g} %"
        if math.isfinite(result.relative_noise)
        else "scatter unknown"
    )
    return (
        f"{result.point_count} values, {noise}, R² = {result.r_squared:.5g}, "
        f"condition number {result.condition:.2g}"
    )


def interval_text(p: Parameter) -> str:
    """Return name, value and interval of a parameter in one line, for comments."""
    unit, factor = SHOWN_UNITS[p.unit]
    interval = (
        f"{factor * p.low:.5g} ... {factor * p.high:.5g} {unit}".strip()
        if math.isfinite(p.low)
        else "unknown"
    )
    return f"{p.name}: {interval}" + ("" if p.is_determined else " (not determined by the data)")


def draw_fit(path: Path | str, result: Identification) -> None:
    """Draw data, fit, confidence bands, law and residuals."""
    with matplotlib.rc_context(RC):
        figure = new_figure(9.6, 6.2)
        grid = figure.add_gridspec(
            2, 2, height_ratios=(1.6, 1.0), left=0.085, right=0.975, bottom=0.08, top=0.875,
            wspace=0.24, hspace=0.3,
        )  # fmt: skip
        # Residuals stand below the measured curve; a fourth diagram below the law.
        places = [grid[0, 0], grid[0, 1], grid[1, 0], grid[1, 1]]
        if len(result.panels) == 3:
            places = [grid[0, 0], grid[:, 1], grid[1, 0]]
        for panel, place in zip(result.panels, places):
            _draw_panel(figure.add_subplot(place), panel)
        headline(figure, f"Identification of the {result.law} law", fit_text(result))
        save(figure, path)


def _draw_panel(axis, panel: Panel) -> None:
    for number, points in enumerate(panel.left_out):
        label = "left out" if number == 0 else None
        axis.plot(points.x, points.y, "x", ms=2.8, mew=0.7, color=LEFT_OUT, label=label)
    for number, points in enumerate(panel.points):
        # Several sets of points (deflection curves) need several colours.
        colour = SERIES[number % len(SERIES)] if len(panel.points) > 1 else FAINT
        label = points.label if number == 0 or len(panel.points) > 1 else None
        axis.plot(points.x, points.y, "o", ms=2.8, mfc="none", mew=0.8, color=colour, label=label)
    for number, curve in enumerate(panel.curves):
        several = len(panel.points) > 1
        colour = INK if several else SERIES[number % len(SERIES)]
        if curve.low is not None and curve.high is not None:
            low, high = curve.low, curve.high
            if panel.log_y:  # a band without end would leave no room for the data
                low = np.maximum(low, curve.y / WIDEST_BAND)
                high = np.minimum(high, curve.y * WIDEST_BAND)
            axis.fill_between(
                curve.x, low, high, color=colour, alpha=0.22, lw=0,
                label="95 % confidence",
            )  # fmt: skip
        style = "--" if curve.dashed else "-"
        axis.plot(curve.x, curve.y, style, color=colour, lw=1.3, label=curve.label or None)
    if panel.is_residual:
        axis.axhline(0.0, color=INK, lw=0.8)
        largest = max(float(np.max(np.abs(points.y))) for points in panel.points)
        axis.set_ylim(-1.15 * max(largest, 1e-6), 1.15 * max(largest, 1e-6))
    if panel.data_end is not None:
        last = max(float(curve.x.max()) for curve in panel.curves)
        axis.axvspan(panel.data_end, last, color="#f0f1f3", lw=0, zorder=0)
        axis.set_xlim(0.0, last)
        # at the right end: the legend stands above the middle
        axis.text(last, 0.985, "extrapolated ", transform=axis.get_xaxis_transform(),
                  fontsize=7, color="#6b737d", va="top", ha="right")  # fmt: skip
    if panel.log_x:
        axis.set_xscale("log")
    if panel.log_y:
        axis.set_yscale("log")
    axis.set_xlabel(panel.x_label)
    axis.set_ylabel(panel.y_label)
    axis.grid(True, color="#e4e7ea", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines["top"].set_visible(False)
    axis.spines["right"].set_visible(False)
    axis.tick_params(length=2.5)
    if not panel.is_residual:
        axis.legend(loc="upper center" if panel.data_end is not None else "best")


def _number(value: float):
    return float(value) if math.isfinite(value) else None
