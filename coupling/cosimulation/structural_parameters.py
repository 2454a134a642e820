"""Structural parameters of FMI 3.0, which give arrays their sizes, set before the initialisation.

A master sets them in the configuration mode of a unit, right after it was made. The sizes of all
arrays that they give follow, here and in the unit, and what these arrays held is lost.

Source: FMI 3.0.2, 2.3.3 and 2.4.7.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.description import UnitDescription
from lcmchain.coupling.cosimulation.start_values import values_of
from lcmchain.coupling.cosimulation.variable import STRUCTURAL, TRUTHS, Variable
from lcmchain.errors import InputError, shortened

#: Entries of an array beyond which a size is a mistake.
MOST_ENTRIES = 100_000_000


@dataclass(frozen=True)
class Configuration:
    """What is set in the configuration mode of a unit.

    Parameters
    ----------
    settings : structural parameters and their values (1,), in the unit's own types.
    resized : names of the arrays whose size has changed; their start values are gone.
    """

    settings: tuple[tuple[Variable, NDArray[Any]], ...] = ()
    resized: tuple[str, ...] = ()


def configure(
    unit: str, description: UnitDescription, given: Mapping[str, Any]
) -> tuple[UnitDescription, Configuration]:
    """Return a unit with the sizes that its start values ask for, and what is to be set for them.

    A structural parameter with the value that the unit was exported with is not set: a unit that
    has no configuration mode takes that too.

    Parameters
    ----------
    given : start values of the unit, of structural parameters and others.

    Raises
    ------
    InputError : a value that a structural parameter does not take, or an array without entries or
        beyond all memory; names the key.
    """
    settings, texts = [], {}
    for name, value in given.items():
        variable = description.variables.get(name)
        if variable is None or variable.causality != STRUCTURAL:
            continue
        key = f"units.{unit}.start.{name}"
        values = values_of(variable, value, description.units, key)
        _require_within(variable, values[0], key)
        if _text(variable, values[0]) != _own_text(variable):
            settings.append((variable, values))
            texts[name] = _text(variable, values[0])
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
    """Yield in a sentence that arrays that were resized have no values any more.

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


def _require_within(variable: Variable, value: Any, key: str) -> None:
    """Refuse a value beyond the limits that the unit states."""
    low, high = variable.limits
    if (low is not None and value < low) or (high is not None and value > high):
        least = "any" if low is None else f"{low:g}"
        most = "any" if high is None else f"{high:g}"
        raise InputError(
            f"is a structural parameter that the unit takes from {least} to {most}, not {value}",
            key=key,
        )


def _text(variable: Variable, value: Any) -> str:
    """Return a value as one text, whatever it was written as."""
    if variable.is_text:
        return str(value)
    if variable.kind in TRUTHS:
        return str(bool(value)).lower()
    return repr(float(value)) if variable.is_real else str(int(value))


def _own_text(variable: Variable) -> str | None:
    """Return the value that a unit was exported with in the same form; None where it has none."""
    try:
        text = variable.start[0]
        if variable.kind in TRUTHS:
            return {"1": "true", "0": "false"}.get(text, text)
        return _text(variable, np.array([text]).astype(variable.dtype)[0])
    except (IndexError, ValueError, OverflowError):
        return None
