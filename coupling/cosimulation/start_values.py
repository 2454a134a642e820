"""Start values that a user sets in a system, checked against the variables of its units.

Structural parameters of FMI 3.0 are the sizes of arrays: a master sets them in the configuration
mode of a unit, right after it was made. The arrays take their new sizes here and in the unit, and
lose their start values.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lcmchain.coupling.cosimulation.description import (
    STRUCTURAL,
    TRUTHS,
    UnitDescription,
    Variable,
    VariableValues,
)
from lcmchain.coupling.cosimulation.physical_units import (
    PhysicalUnit,
    UnitError,
    unit_from_name,
    value_of,
)
from lcmchain.errors import InputError, shortened

#: One value of a variable.
Scalar = bool | int | float | str
#: Units of measurement that the description of a unit defines, by name.
_Known = Mapping[str, PhysicalUnit]


def start_values(
    unit: str, description: UnitDescription, entries: Mapping[str, object]
) -> list[tuple[Variable, VariableValues]]:
    """Return variables and their values (n,) in the unit's own types and units of measurement.

    Structural parameters, which :func:`configure` reads, are left out.

    Parameters
    ----------
    unit : its name in the system.
    entries : start values by variable, as they stand in the file of a system.

    Raises
    ------
    InputError : no such variable, one that cannot be set, or a value that does not fit; names the
        key.
    """
    settings = []
    for name, value in entries.items():
        key = f"units.{unit}.start.{name}"
        try:
            variable = description.find(name)
        except InputError as error:
            raise InputError(error.message, key=key) from None
        if variable.causality != STRUCTURAL:
            _require_settable(variable, key)
            settings.append((variable, values_of(variable, value, description.units, key)))
    return settings


def with_declared_units(
    unit: str,
    description: UnitDescription,
    quantities: Mapping[str, str],
    known: Mapping[str, PhysicalUnit],
) -> None:
    """Give variables without a unit of measurement the one that the file of the system states.

    known : units of measurement that the system defines; those of the unit go before them.

    Raises
    ------
    InputError : no such variable, one with a unit, or an unknown unit.
    """
    for name, text in quantities.items():
        key = f"units.{unit}.quantities.{name}"
        variable = description.variables.get(name)
        if variable is None:
            close = difflib.get_close_matches(name, description.variables, n=1)
            hint = f'; did you mean "{close[0]}"?' if close else ""
            raise InputError(f"the unit has no such variable{hint}", key=key)
        if variable.unit is not None:
            raise InputError(f"the unit itself gives it in {variable.unit.name}", key=key)
        try:
            physical = unit_from_name(text, {**known, **description.units})
        except UnitError as error:
            raise InputError(str(error), key=key) from None
        description.variables[name] = replace(variable, unit=physical)


def _require_settable(variable: Variable, key: str) -> None:
    settable = variable.causality in ("parameter", "input") or (
        variable.variability != "constant" and variable.initial in ("exact", "approx")
    )
    if not settable:
        raise InputError(
            f"is {variable.causality}, {variable.variability}: it has no start value", key=key
        )


def values_of(variable: Variable, entry: object, known: _Known, key: str) -> VariableValues:
    """Return the values (n,) of a variable in its own type and unit of measurement.

    Parameters
    ----------
    entry : from the file of a system; one value for all, or a list.
    known : units of measurement that the unit defines, by name.
    key : of the entry, for messages.

    Raises
    ------
    InputError : another number of values, or one that does not fit.
    """
    entries: Sequence[object] | None = entry if isinstance(entry, (list, tuple)) else None
    if entries is not None and len(entries) != variable.size:
        owners = [owner for owner in variable.dimensions if isinstance(owner, str)]
        sizes = f" (its size is given by {', '.join(owners)})" if owners else ""
        raise InputError(
            f"has {len(entries)} values, but the variable has {variable.size}{sizes}; give that "
            "many, or one for all",
            key=key,
        )
    values = np.empty(variable.size, dtype=variable.dtype)
    if entries is None:
        values[:] = _value(variable, entry, known, key)
    else:
        values[:] = [_value(variable, one, known, key) for one in entries]
    return values


def _value(variable: Variable, value: object, known: _Known, key: str) -> Scalar:
    kind = variable.type_name
    if variable.is_text:
        if not isinstance(value, str):
            raise InputError(f"must be a text in quotes, not {value!r}", key=key)
        return value
    if variable.kind in TRUTHS:
        if not isinstance(value, bool):
            raise InputError(f"must be true or false, not {value!r}", key=key)
        return value
    if variable.is_real:
        return _real(variable, value, known, key)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"must be a whole number ({kind}), not {value!r}", key=key)
    limits = np.iinfo(variable.dtype)
    if not limits.min <= value <= limits.max:
        raise InputError(f"is beyond the range of {kind}", key=key)
    return value


def _real(variable: Variable, value: object, known: _Known, key: str) -> float:
    unit = variable.unit
    if isinstance(value, dict) and set(value) == {"value"}:  # in the variable's own unit
        value, unit = value["value"], None
    if isinstance(value, str):
        if unit is None:
            raise InputError(
                f'has no unit of measurement in the unit; write a plain number, not "'
                f'{shortened(value)}", or give its unit in "quantities"',
                key=key,
            )
        try:
            return value_of(value, unit, relative=variable.relative, known=known)
        except UnitError as error:
            raise InputError(f"{error}; it is in {unit.name}", key=key) from None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"must be a number, not {value!r}", key=key)
    if not math.isfinite(value):
        raise InputError("must be finite", key=key)
    if unit is not None and not unit.is_plain:
        raise InputError(
            f'{value!r} has no unit; write it in quotes with one, for example "{value} '
            f'{unit.name}"',
            key=key,
        )
    return float(value)


# --- structural parameters (FMI 3.0.2, 2.3.3 and 2.4.7.3) -----------------------------------------

#: Most entries of an array; a larger size is a mistake.
MOST_ENTRIES = 100_000_000


@dataclass(frozen=True)
class Configuration:
    """What a master sets in the configuration mode of a unit.

    Parameters
    ----------
    settings : structural parameters and their values (1,), in the unit's own types.
    resized : names of the arrays whose size has changed; their start values are gone.
    """

    settings: tuple[tuple[Variable, VariableValues], ...] = ()
    resized: tuple[str, ...] = ()


def configure(
    unit: str, description: UnitDescription, entries: Mapping[str, object]
) -> tuple[UnitDescription, Configuration]:
    """Return a unit with the sizes that its start values ask for, and what to set for them.

    A structural parameter that keeps its exported value is not set, so that a unit without
    configuration mode takes it too.

    Parameters
    ----------
    unit : its name in the system.
    entries : start values of the unit, of structural parameters and others.

    Raises
    ------
    InputError : a value that a structural parameter does not take, or an array without entries or
        beyond all memory; names the key.
    """
    settings, texts = [], {}
    for name, value in entries.items():
        variable = description.variables.get(name)
        if variable is None or variable.causality != STRUCTURAL:
            continue
        key = f"units.{unit}.start.{name}"
        values = values_of(variable, value, description.units, key)
        _require_within(variable, values[0], key)
        if value_text(variable, values[0]) != _own_text(variable):
            settings.append((variable, values))
            texts[name] = value_text(variable, values[0])
    if not settings:
        return description, Configuration()
    variables = dict(description.variables)
    for name, text in texts.items():
        variables[name] = replace(variables[name], start=(text,))
    resized = []
    for variable in list(variables.values()):
        if not any(owner in texts for owner in variable.dimensions):
            continue
        sizes = tuple(_size_of(owner, variables) for owner in variable.dimensions)
        size = math.prod(sizes)
        if not 0 < size <= MOST_ENTRIES:
            owner = next(owner for owner in variable.dimensions if owner in texts)
            raise InputError(
                f'makes the array "{shortened(variable.name)}" one of '
                f"{' x '.join(map(str, sizes))} entries; an array has at least one and at most "
                f"{MOST_ENTRIES:,}",
                key=f"units.{unit}.start.{owner}",
            )
        resized.append(variable.name)
        variables[variable.name] = replace(variable, size=size, start=())
    configured = replace(description, variables=variables)
    return configured, Configuration(tuple(settings), tuple(resized))


def without_values(
    description: UnitDescription, configuration: Configuration, known: set[str]
) -> Iterator[str]:
    """Yield a sentence where arrays that were resized have no values any more.

    Parameters
    ----------
    known : names of the variables that have start values or are connected.
    """
    lost = [
        name
        for name in configuration.resized
        if name not in known and description.variables[name].causality in ("input", "parameter")
    ]
    if lost:
        yield (
            f"the start values of {', '.join(lost[:8])}{' and others' if len(lost) > 8 else ''} "
            "are gone with the former sizes, and the unit decides what is there now; give start "
            "values (one stands for all entries)"
        )


def _size_of(owner: int | str, variables: Mapping[str, Variable]) -> int:
    return owner if isinstance(owner, int) else int(variables[owner].start[0])


def _require_within(variable: Variable, value: float, key: str) -> None:
    """Refuse a value beyond the limits that the unit states."""
    low, high = variable.limits
    if (low is not None and value < low) or (high is not None and value > high):
        least = "any" if low is None else f"{low:g}"
        most = "any" if high is None else f"{high:g}"
        raise InputError(
            f"is a structural parameter that the unit takes from {least} to {most}, not {value}",
            key=key,
        )


def value_text(variable: Variable, value: Scalar) -> str:
    """Return one value, of Python or numpy, as the text that stands for it in XML."""
    if variable.is_text:
        return str(value)
    if variable.kind in TRUTHS:
        return str(bool(value)).lower()
    return repr(float(value)) if variable.is_real else str(int(value))


def _own_text(variable: Variable) -> str | None:
    """Return the exported value of a variable as such a text; None where it has none."""
    try:
        text = variable.start[0]
        if variable.kind in TRUTHS:
            return {"1": "true", "0": "false"}.get(text, text)
        return value_text(variable, np.array([text]).astype(variable.dtype)[0])
    except (IndexError, ValueError, OverflowError):
        return None
