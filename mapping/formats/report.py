"""What an export wrote, what its format cannot hold, and the worst error that this causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

# Errors below these are told in the report only: they are far below those of any measurement.
NOTABLE = {"rad": np.radians(0.1), "m": 1e-5, "1": 1e-3}


@dataclass(frozen=True)
class Loss:
    """Something that a format cannot hold.

    Parameters
    ----------
    what : what is left out or taken otherwise, as the beginning of a sentence.
    error : largest error that this causes, in ``unit``; None where it has no number.
    unit : ``rad``, ``m`` or ``1`` (relative).
    cell : number of the cell with that error in the target's file, or of what ``place`` names.
    mean : mean over the area [unit], where it is known.
    place : ``cell`` or ``node``.
    """

    what: str
    error: float | None = None
    unit: str = "1"
    cell: int | None = None
    mean: float | None = None
    place: str = "cell"

    @property
    def notable(self) -> bool:
        """Whether the error is worth a warning; one without a number is."""
        return self.error is None or self.error >= NOTABLE[self.unit]

    def sentence(self) -> str:
        """Say it in one sentence, angles in degrees and shares in percent."""
        if self.error is None:
            return self.what
        mean = "" if self.mean is None else f" (mean {_shown(self.mean, self.unit)})"
        where = "" if self.cell is None else f" in {self.place} {self.cell}"
        return f"{self.what}: wrong by up to {_shown(self.error, self.unit)}{where}{mean}"


@dataclass
class ExportReport:
    """Result of one export; SI units, in the file as here.

    Parameters
    ----------
    format : name of the format, one of :data:`~lcmchain.mapping.formats.FORMATS`.
    files : names of the files that were written.
    cells : number of cells with values in them.
    losses : what the format cannot hold.
    notes : sentences on what the user has to add or to know.
    details : further numbers of the format, ready for JSON.
    """

    format: str
    files: list[str]
    cells: int
    losses: list[Loss] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    details: dict = field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """Sentences for the terminal and the report of the mapping: what is worth telling."""
        said = [loss.sentence() for loss in self.losses if loss.notable] + self.notes
        return [f"export {self.format}: {sentence}" for sentence in said]

    def as_dict(self) -> dict:
        """Plain values, ready for JSON."""
        return asdict(self)


#: Writes an export whose input has been found sound.
Saver = Callable[[], ExportReport]


def worst(
    what: str,
    error: np.ndarray,
    numbers: np.ndarray,
    *,
    unit: str,
    area: np.ndarray | None = None,
    place: str = "cell",
) -> Loss:
    """Loss with the largest of many errors, shape (C,); not-a-number counts for none.

    Parameters
    ----------
    numbers : number of each cell, or of what ``place`` names, in the target's file, shape (C,).
    area : of each cell [m2], for the mean, shape (C,).
    """
    found = np.where(np.isfinite(error), np.abs(error), -1.0)
    row = int(np.argmax(found))
    mean = None
    if area is not None:
        known = found >= 0.0
        mean = float(np.average(found[known], weights=area[known]))
    return Loss(what, max(float(found[row]), 0.0), unit, int(numbers[row]), mean, place)


def _shown(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{np.degrees(value):.2g} degrees"
    return f"{100.0 * value:.2g} %" if unit == "1" else f"{value:.2g} {unit}"
