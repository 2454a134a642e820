"""Measured compaction of sheared fabric: curves, how a scene states them, and their CSV file.

Plates press on fabric that is sheared by one angle; a curve is its thickness and their pressure.
:mod:`.pressure_table` makes a law of some of them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.errors import InputError
from lcmchain.quantities.csv_columns import Column, Columns, read_columns
from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    POSITIVE,
    Number,
    Quantity,
    Range,
    Row,
    SceneModel,
)
from lcmchain.quantities.units import ANGLE, PRESSURE, Dimension

#: Angles of a table at most, and pressures at each beside the first one, which is zero.
MOST_ANGLES = 4
MOST_PRESSURES = 5
#: The largest angle of a table [rad].
LARGEST_ANGLE = math.radians(75.0)


class PressureCurve(NamedTuple):
    """Compaction at one shear angle [rad]: thickness over t0 and pressure [Pa], from zero.

    The pressure is that on the present area, as plates measure it. The first stretch is that
    without pressure.
    """

    shear_angle: float
    stretch: tuple[float, ...]
    pressure: tuple[float, ...]

    def fault(self) -> str:
        """Say what is wrong with the points; empty where nothing is."""
        if len(self.stretch) != len(self.pressure):
            return f"has {len(self.pressure)} pressures for {len(self.stretch)} stretches"
        if not 2 <= len(self.pressure) <= 1 + MOST_PRESSURES:
            return f"has {len(self.pressure)} points; give 2 to {1 + MOST_PRESSURES}"
        if self.pressure[0] != 0.0:
            return (
                f"begins at {1e-6 * self.pressure[0]:.4g} MPa; the first pressure is 0, at the "
                "thickness that the fabric has when nothing presses"
            )
        wrong = (np.diff(self.pressure) <= 0.0) | (np.diff(self.stretch) >= 0.0)
        if wrong.any():
            number = int(np.argmax(wrong)) + 2
            return f"does not rise at point {number}: the pressure rises as the stretch falls"
        return ""

    def strains(self) -> np.ndarray:
        """Return x of the points that are pressed, counted from the free thickness."""
        stretch = np.array(self.stretch)
        return 0.5 * ((stretch[1:] / stretch[0]) ** 2 - 1.0)


class PressureCurveTable(SceneModel):
    """Compaction of fabric that is sheared by one angle: thickness and pressure of plates."""

    shear_angle: Annotated[
        float, Quantity(ANGLE, Range(0.0, LARGEST_ANGLE, words="be 0 to 75 deg"), "30 deg")
    ] = Field(description="Shear angle; the first curve has 0 deg, the others rise.")
    stretch: Annotated[
        tuple[Annotated[float, Number(0.9, POSITIVE)], ...],
        Row("[1.1, 1.0, 0.9]", minimum_count=2, entries="stretches", units=False),
    ] = Field(
        description="Thickness over that of the unloaded, unsheared fabric, falling; the first is "
        "that without pressure."
    )
    pressure: Annotated[
        tuple[Annotated[float, Quantity(PRESSURE, NOT_NEGATIVE)], ...],
        Row('"0 0.02 0.2 MPa"', minimum_count=2, entries="pressures"),
    ] = Field(
        description="Pressure of the plates on the present area, rising from 0; "
        f"{1 + MOST_PRESSURES} at most."
    )

    @property
    def curve(self) -> PressureCurve:
        """The points."""
        return PressureCurve(self.shear_angle, self.stretch, self.pressure)


# --- file -----------------------------------------------------------------------------------------

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
    curves: list[dict[str, Any]] = []
    for first, last in zip(starts, [*starts[1:], len(angle)], strict=True):
        if curves and angle[first] <= angle[first - 1]:
            raise _wrong(
                path, read, int(first), "shear angle",
                "is less than that of the row before; let the rows of an angle follow each other, "
                "and the angles rise from 0 deg",
            )  # fmt: skip
        curves.append(_curve(path, read, np.arange(first, last)))
    return curves


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
