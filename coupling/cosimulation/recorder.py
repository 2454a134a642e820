"""Values of the units over time, for a netCDF file and for pictures."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.system_file import RecorderEntry
from lcmchain.coupling.cosimulation.variable import TRUTHS, Variable
from lcmchain.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


@dataclass
class Recorder:
    """Takes the present values of variables after windows.

    Parameters
    ----------
    parts : by name.
    variables : what is recorded, by the name of the unit.
    every : of how many windows one is recorded.
    """

    parts: Mapping[str, FmuPart]
    variables: dict[str, list[Variable]]
    every: int = 1
    times: list[float] = field(default_factory=list)
    values: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    _windows: int = 0

    def __post_init__(self) -> None:
        for unit, variables in self.variables.items():
            for variable in variables:
                self.values[f"{unit}.{variable.name}"] = []

    def take(self, time: float, *, last: bool = False) -> None:
        """Record a window's end, where its turn has come or it is the last one."""
        due = self._windows % self.every == 0
        self._windows += 1
        if not (due or last) or (self.times and self.times[-1] == time):
            return
        self.times.append(time)
        for unit, variables in self.variables.items():
            for variable in variables:
                values = self.parts[unit].read(variable)
                self.values[f"{unit}.{variable.name}"].append(values)

    def save(self) -> Any:
        """Return times, values (t, n) and texts, for a file."""
        stacked = {name: self._stacked(name) for name in self.values}
        return {
            "times": np.array(self.times),
            "windows": self._windows,
            "values": {name: rows for name, rows in stacked.items() if rows.dtype != object},
            "texts": {
                name: rows.tolist() for name, rows in stacked.items() if rows.dtype == object
            },
        }

    def restore(self, saved: Any) -> None:
        """Go on from what was saved."""
        self.times, self._windows = saved["times"].tolist(), saved["windows"]
        for name, rows in saved["values"].items():
            self.values[name] = list(rows)
        for name, rows in saved["texts"].items():
            self.values[name] = [np.array(row, dtype=object) for row in rows]

    def groups(self, attributes: Mapping[str, Any]) -> dict[str, xr.Dataset]:
        """Return datasets by group: the times at the root, one group for every unit.

        A variable is named as in the unit, with ``.`` and brackets replaced; ``fmi_name`` keeps it.
        """
        import xarray as xr

        time = ("time", np.array(self.times), {"units": "s", "long_name": "time"})
        about = {"Conventions": "CF-1.11", **attributes}
        groups = {"/": xr.Dataset(coords={"time": time}, attrs=about)}
        for unit, variables in self.variables.items():
            found: dict[str, Any] = {}
            for variable in variables:
                name = _netcdf_name(variable.name, found)
                found[name] = self._variable(unit, variable)
            description = self.parts[unit].description
            groups[unit] = xr.Dataset(
                found,
                coords={"time": time},
                attrs={
                    "unit": unit,
                    "model_name": description.model_name,
                    "fmi_version": description.fmi_version,
                    "fmu_sha256": self.parts[unit].sha256,
                },
            )
        return groups

    def _stacked(self, name: str) -> NDArray[Any]:
        rows = self.values[name]
        return np.stack(rows) if rows else np.empty((0, 0))

    def _variable(self, unit: str, variable: Variable) -> Any:
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
    """Return what is recorded of every unit.

    A pattern with a star means outputs; named in full, any variable is recorded.

    Raises
    ------
    InputError : a name without a star that no unit has, or a pattern that nothing fits.
    """
    found: dict[str, list[Variable]] = {name: [] for name in parts}
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
            if variable not in found[owner]:
                found[owner].append(variable)
    return {name: variables for name, variables in found.items() if variables}


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


def _netcdf_name(name: str, taken: Mapping[str, Any]) -> str:
    """Return a name that netCDF and its readers take, different from those taken."""
    plain = "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in name)
    plain = plain.strip("_") or "variable"
    plain = f"v_{plain}" if plain[0].isdigit() or plain == "time" else plain
    number, unique = 2, plain
    while unique in taken:
        unique, number = f"{plain}_{number}", number + 1
    return unique


def final_values(recorder: Recorder) -> dict[str, Any]:
    """Return the last value of every scalar by its full name."""
    return {
        f"{unit}.{variable.name}": recorder.values[f"{unit}.{variable.name}"][-1][0]
        for unit, variables in recorder.variables.items()
        for variable in variables
        if not variable.is_field and recorder.times
    }


def scalars_of(recorder: Recorder) -> Sequence[tuple[str, Variable]]:
    """Return unit and variable of everything but texts that was recorded."""
    return [
        (unit, variable)
        for unit, variables in recorder.variables.items()
        for variable in variables
        if not variable.is_text
    ]
