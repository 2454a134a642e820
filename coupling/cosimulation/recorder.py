"""Results of a co-simulation: values over time, their file and pictures, and the summary."""

from __future__ import annotations

import fnmatch
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import xarray as xr

from lcmchain import __version__
from lcmchain.coupling.cosimulation.assembly import Assembly
from lcmchain.coupling.cosimulation.description import TRUTHS, Variable, VariableValues
from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.system_file import RecorderEntry
from lcmchain.errors import InputError
from lcmchain.report.style import RC, SERIES, headline, new_figure, save

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from rich.table import Table


# --- values over time -----------------------------------------------------------------------------


@dataclass
class Recorder:
    """Records values of variables at the ends of windows.

    Parameters
    ----------
    parts : units by name.
    variables : recorded variables by the name of the unit.
    every : number of windows between two records.
    """

    parts: Mapping[str, FmuPart]
    variables: dict[str, list[Variable]]
    every: int = 1
    times: list[float] = field(default_factory=list)
    values: dict[str, list[VariableValues]] = field(default_factory=dict)
    _windows: int = 0

    def __post_init__(self) -> None:
        for unit, variables in self.variables.items():
            for variable in variables:
                self.values[f"{unit}.{variable.name}"] = []

    def take(self, time: float, *, last: bool = False) -> None:
        """Record the end of a window, if it is one of ``every`` or the last one."""
        due = self._windows % self.every == 0
        self._windows += 1
        if not (due or last) or (self.times and self.times[-1] == time):
            return
        self.times.append(time)
        for unit, variables in self.variables.items():
            for variable in variables:
                values = self.parts[unit].read(variable)
                self.values[f"{unit}.{variable.name}"].append(values)

    def save(self) -> dict[str, Any]:
        """Return times (t,), values (t, n) and texts, for a checkpoint."""
        stacked = {name: self._stacked(name) for name in self.values}
        return {
            "times": np.array(self.times),
            "windows": self._windows,
            "values": {name: rows for name, rows in stacked.items() if rows.dtype != object},
            "texts": {
                name: rows.tolist() for name, rows in stacked.items() if rows.dtype == object
            },
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from the content of a checkpoint."""
        self.times, self._windows = saved["times"].tolist(), saved["windows"]
        for name, rows in saved["values"].items():
            self.values[name] = list(rows)
        for name, rows in saved["texts"].items():
            self.values[name] = [np.array(row, dtype=object) for row in rows]

    def groups(self, attributes: Mapping[str, Any]) -> dict[str, xr.Dataset]:
        """Return datasets by group: the times at the root, and a group for every unit.

        A variable has the name that it has in the unit, with ``.`` and brackets replaced. Its
        attribute ``fmi_name`` keeps the original.
        """
        time = ("time", np.array(self.times), {"units": "s", "long_name": "time"})
        about = {"Conventions": "CF-1.11", **attributes}
        groups = {"/": xr.Dataset(coords={"time": time}, attrs=about)}
        for unit, variables in self.variables.items():
            columns: dict[str, tuple] = {}
            for variable in variables:
                name = _netcdf_name(variable.name, columns)
                columns[name] = self._variable(unit, variable)
            description = self.parts[unit].description
            groups[unit] = xr.Dataset(
                columns,
                coords={"time": time},
                attrs={
                    "unit": unit,
                    "model_name": description.model_name,
                    "fmi_version": description.fmi_version,
                    "fmu_sha256": self.parts[unit].sha256,
                },
            )
        return groups

    def _stacked(self, name: str) -> VariableValues:
        rows = self.values[name]
        return np.stack(rows) if rows else np.empty((0, 0))

    def _variable(
        self, unit: str, variable: Variable
    ) -> tuple[tuple[str, ...], VariableValues, dict[str, Any]]:
        """Return dimensions, values and attributes of a variable."""
        rows = self._stacked(f"{unit}.{variable.name}")
        attributes: dict[str, Any] = {
            "units": variable.unit_text,
            "long_name": variable.description or variable.name,
            "fmi_name": variable.name,
            "fmi_type": variable.type_name,
            "causality": variable.causality,
        }
        if variable.kind in TRUTHS:
            rows = rows.astype(np.int8)
            attributes |= {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "false true"}
        elif rows.dtype == np.bool_:
            rows = rows.astype(np.int8)
        if not variable.is_field:
            return ("time",), rows.reshape(len(self.times)), attributes
        return ("time", f"value_{variable.size}"), rows, attributes


def chosen(parts: Mapping[str, FmuPart], entry: RecorderEntry) -> dict[str, list[Variable]]:
    """Return the variables that are recorded, by the name of the unit.

    A pattern with a star stands for outputs. A full name stands for any variable.

    Raises
    ------
    InputError : a name without a star that no unit has, or a pattern that nothing fits.
    """
    recorded: dict[str, list[Variable]] = {name: [] for name in parts}
    for number, pattern in enumerate(entry.variables):
        key = f"recorder.variables[{number}]"
        unit, _, name = pattern.partition(".")
        if "*" not in pattern:
            if unit not in parts:
                raise InputError(f'there is no unit "{unit}"', key=key)
            try:
                matching = [(unit, parts[unit].description.find(name))]
            except InputError as error:
                raise InputError(error.message, key=key) from None
        else:
            matching = _matching(parts, pattern, fields=entry.fields)
            if not matching and pattern != "*.*":
                raise InputError(f'no output fits "{pattern}"', key=key)
        for owner, variable in matching:
            if variable not in recorded[owner]:
                recorded[owner].append(variable)
    return {name: variables for name, variables in recorded.items() if variables}


def _matching(
    parts: Mapping[str, FmuPart], pattern: str, *, fields: bool
) -> list[tuple[str, Variable]]:
    # brackets are part of names, not of the pattern
    pattern = pattern.replace("[", "[[]")
    return [
        (unit, variable)
        for unit, part in parts.items()
        for variable in part.description.variables.values()
        if variable.causality == "output"
        and (fields or not variable.is_field)
        and fnmatch.fnmatchcase(f"{unit}.{variable.name}", pattern)
    ]


def _netcdf_name(name: str, taken: Mapping[str, object]) -> str:
    """Return a name that netCDF and its readers accept, and that is not yet taken."""
    plain = "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in name)
    plain = plain.strip("_") or "variable"
    plain = f"v_{plain}" if plain[0].isdigit() or plain == "time" else plain
    number, unique = 2, plain
    while unique in taken:
        unique, number = f"{plain}_{number}", number + 1
    return unique


def final_values(recorder: Recorder) -> dict[str, Any]:
    """Return the last value, of numpy or a text, of every scalar by its full name."""
    return {
        f"{unit}.{variable.name}": recorder.values[f"{unit}.{variable.name}"][-1][0]
        for unit, variables in recorder.variables.items()
        for variable in variables
        if not variable.is_field and recorder.times
    }


def scalars_of(recorder: Recorder) -> Sequence[tuple[str, Variable]]:
    """Return unit and variable of all recorded variables but texts."""
    return [
        (unit, variable)
        for unit, variables in recorder.variables.items()
        for variable in variables
        if not variable.is_text
    ]


# --- picture: a panel for the variables of a unit in one unit of measurement ----------------------


#: Most panels of the picture, and most curves of one.
MOST_PANELS = 14
MOST_CURVES = len(SERIES)


def draw_signals(path: Path | str, recorder: Recorder, title: str) -> str:
    """Draw the recorded variables; return a remark where some are left out, else an empty text.

    Of a field the mean is drawn, in a band from the least to the largest value.

    Raises
    ------
    InputError : the file cannot be written.
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
        shared = (unit, variable.unit_text, variable.is_field, variable.is_real)
        groups.setdefault(shared, []).append(variable)
    return [
        (unit, group[first : first + MOST_CURVES])
        for (unit, *_), group in groups.items()
        for first in range(0, len(group), MOST_CURVES)
    ]


def _draw_panel(axis: Axes, recorder: Recorder, unit: str, group: list[Variable]) -> None:
    times = np.array(recorder.times)
    for variable, colour in zip(group, SERIES):
        rows = np.stack(recorder.values[f"{unit}.{variable.name}"]).astype(np.float64)
        # values that change in jumps stay until the next point
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


# --- summary, for summary.json and as a table -----------------------------------------------------


def summary_of(assembly: Assembly, recorder: Recorder, wall_s: float) -> dict[str, Any]:
    """Return the summary in plain values, without the state of the run.

    wall_s : wall-clock time of the run so far [s].
    """
    system, coupled = assembly.system, assembly.coupled
    history = coupled.history
    return {
        "lcmchain_version": __version__,
        "title": system.title,
        "system_sha256": system.digest(),
        "scheme": history.scheme,
        "time_reached_s": coupled.time,
        "stop_time_s": system.stop_time,
        "wall_s": wall_s,
        "window_count": len(history.accepted),
        "restart_count": history.restarts,
        "iteration_count": sum(window.iterations for window in history.windows),
        "mean_iterations": history.mean_iterations if history.accepted else None,
        "initial_loops": assembly.loops,
        "units": {name: _unit(part) for name, part in assembly.parts.items()},
        "connections": [link.name for link in assembly.links],
        "final_values": {name: _plain(value) for name, value in final_values(recorder).items()},
        "warnings": list(assembly.remarks),
        "run": {
            "process": os.getpid(),
            "host": platform.node(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
        },
    }


def _unit(part: FmuPart) -> dict[str, Any]:
    spent, description = part.spent, part.description
    return {
        "fmu": part.file.name,
        "fmu_sha256": part.sha256,
        "model_name": description.model_name,
        "fmi_version": description.fmi_version,
        "generation_tool": description.generation_tool,
        "process": "own" if part.apart else "shared",
        "step_count": spent.step_count,
        "save_count": spent.save_count,
        "rollback_count": spent.rollback_count,
        "discarded_step_count": spent.discard_count,
        "seconds": {
            "instantiation": spent.instantiation,
            "initialisation": spent.initialisation,
            "steps": spent.steps,
            "values": spent.exchange,
            "states": spent.states,
        },
    }


def _plain(value: np.generic | bool | int | float | str) -> bool | int | float | str:
    plain: bool | int | float | str = value.item() if isinstance(value, np.generic) else value
    return plain


def cost_table(summary: dict[str, Any]) -> Table:
    """Return steps, rollbacks and times of the units as a table for the terminal."""
    from rich.table import Table

    table = Table(title=_headline(summary), title_justify="left")
    table.add_column("unit")
    for name in ("steps", "rollbacks", "begin [s]", "steps [s]", "values [s]", "states [s]"):
        table.add_column(name, justify="right")
    rest = summary["wall_s"]
    for name, unit in summary["units"].items():
        seconds = unit["seconds"]
        begin = seconds["instantiation"] + seconds["initialisation"]
        rest -= sum(seconds.values()) - begin
        table.add_row(
            name, f"{unit['step_count']:,}", f"{unit['rollback_count']:,}", f"{begin:.3f}",
            *(f"{seconds[key]:.3f}" for key in ("steps", "values", "states")),
        )  # fmt: skip
    table.add_row("master", "", "", "", f"{max(rest, 0.0):.3f}", "", "")
    return table


def _headline(summary: dict[str, Any]) -> str:
    windows = summary["window_count"]
    text = f"{summary['scheme']}: {windows:,} windows to {summary['time_reached_s']:g} s"
    if summary["iteration_count"] > windows:
        text += f", {summary['iteration_count']:,} iterations"
    if summary["restart_count"]:
        text += f", {summary['restart_count']:,} windows repeated"
    return text
