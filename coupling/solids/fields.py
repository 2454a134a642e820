"""Checks of the fields that solid sides exchange."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcmchain.coupling.iteration.interface import Fields
from lcmchain.errors import InputError

#: Positions of the mid-surface's nodes (3 N,) [m], x y z of one node after the other.
POINTS = "points"


def checked(name: str, values: np.ndarray, count: int) -> np.ndarray:
    """Return a copy of the values of a field (count,).

    Raises
    ------
    InputError : a wrong number of values, or one that is no number.
    """
    values = np.array(values, dtype=float)
    if values.shape != (count,):
        raise InputError(f"{name} has the shape {values.shape}; there are {count} cells")
    if not np.isfinite(values).all():
        cell = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"{name} is {values[cell]} in cell {cell}")
    return values


def chosen(names: Sequence[str], found: Fields) -> Fields:
    """Return the named ones of fields.

    Raises
    ------
    InputError : a name that is no output.
    """
    unknown = [name for name in names if name not in found]
    if unknown:
        raise InputError(f'"{unknown[0]}" is no output; there are {", ".join(found)}')
    return {name: found[name].copy() for name in names}
