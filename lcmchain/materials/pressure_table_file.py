"""Compaction of sheared fabric from a CSV file: the curves of ``material.compaction.table``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.materials.pressure_table import MOST_PRESSURES
from lcmchain.quantities.csv_columns import Column, Columns, read_columns
from lcmchain.quantities.units import ANGLE, PRESSURE, Dimension

STRETCH = Dimension("stretch", "1", "0.9", ("1", "%"), 1e-3, 1e2)
COLUMNS = (
    (Column("shear angle", ANGLE), Column("stretch", STRETCH), Column("pressure", PRESSURE)),
)
# Rows whose angles differ by less belong to one curve [rad].
SAME_ANGLE = 1e-9


def read_pressure_curves(path: Path) -> list[dict[str, Any]]:
    """Return the curves of a file as entries of a scene, to the last bit.

    Its columns are ``shear angle [deg]``, ``stretch [1]`` (thickness over that of the unloaded,
    unsheared fabric) and ``pressure [MPa]``, the rows of an angle one after the other, each from
    pressure zero on.

    Raises
    ------
    InputError : as of :func:`.csv_columns.read_columns`, or rows that are no such curves; names
        file and line.
    """
    read, _ = read_columns(path, COLUMNS, minimum_rows=4)
    angle = read.columns["shear angle"]
    starts = np.flatnonzero(np.append(True, np.abs(np.diff(angle)) > SAME_ANGLE))
    found: list[dict[str, Any]] = []
    for first, last in zip(starts, [*starts[1:], len(angle)], strict=True):
        if found and angle[first] <= angle[first - 1]:
            raise _wrong(
                path, read, int(first), "shear angle",
                "is less than that of the row before; let the rows of an angle follow each other, "
                "and the angles rise from 0 deg",
            )  # fmt: skip
        found.append(_curve(path, read, np.arange(first, last)))
    return found


def _curve(path: Path, read: Columns, rows: np.ndarray) -> dict[str, Any]:
    stretch, pressure = read.columns["stretch"][rows], read.columns["pressure"][rows]
    if pressure[0] != 0.0:
        raise _wrong(
            path, read, rows[0], "pressure",
            "is not 0; the first row of an angle is the thickness that the fabric has when nothing "
            "presses",
        )  # fmt: skip
    for name, falls in (("pressure", np.diff(pressure)), ("stretch", -np.diff(stretch))):
        wrong = np.flatnonzero(falls <= 0.0)
        if wrong.size:
            raise _wrong(
                path, read, rows[wrong[0] + 1], name,
                f"does not {'rise' if name == 'pressure' else 'fall'}: the pressure rises as the "
                "stretch falls",
            )  # fmt: skip
    if len(rows) > 1 + MOST_PRESSURES:
        raise _wrong(
            path, read, rows[1 + MOST_PRESSURES], "pressure",
            f"is number {2 + MOST_PRESSURES} at its angle; at most {1 + MOST_PRESSURES} are taken",
        )  # fmt: skip
    return {
        "shear_angle": f"{float(read.columns['shear angle'][rows[0]])!r} rad",
        "stretch": list(map(float, stretch)),
        "pressure": f"{' '.join(repr(float(value)) for value in pressure)} Pa",
    }


def _wrong(path: Path, read: Columns, row: int, column: str, message: str) -> InputError:
    return InputError(f'line {read.lines[row]}, column "{column}": {message}', file=path)
