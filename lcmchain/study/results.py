"""Numbers that runs of a sweep are told by, and the tables of studies for the terminal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from lcmchain.study.comparison import NUMBERS
from lcmchain.study.outcome import Outcome


@dataclass(frozen=True)
class Result:
    """A number of a run.

    Parameters
    ----------
    name : in files, where the number is in SI. title : in words; short : for narrow tables.
    unit, scale : shown in tables, and how many of it are one SI unit. si_unit : in files.
    """

    name: str
    title: str
    short: str
    unit: str
    si_unit: str
    scale: float = 1.0

    @property
    def heading(self) -> str:
        return f"{self.short}\n{self.unit}" if self.unit else self.short


RESULTS = (
    Result("thickness_mean", "mean thickness", "t mean", "mm", "m", 1e3),
    Result("thickness_least", "least thickness", "t min", "mm", "m", 1e3),
    Result("shear_angle_mean", "mean shear angle", "γ mean", "°", "rad", 180.0 / math.pi),
    Result("shear_angle_high", "shear angle, 99 %", "γ 99 %", "°", "rad", 180.0 / math.pi),
    Result("fibre_volume_fraction_high", "v_f, 99 %", "v_f 99 %", "", "1"),
    Result("wrinkle_height", "wrinkle height", "wrinkle", "mm", "m", 1e3),
    Result("punch_force", "punch force", "force", "N", "N"),
    Result("clamp_force", "clamp force", "force", "N", "N"),
    Result("forming_work", "forming work", "work", "mJ", "J", 1e3),
)
_NUMBERS = {
    "thickness_least": "thickness_min_m",
    "wrinkle_height": "wrinkle_height_max_m",
    **NUMBERS,
}


def results_of(outcome: Outcome) -> dict[str, float]:
    """Return the numbers of a run in SI; not a number where it has none, or failed.

    Means are over the undeformed sheet; 99 % of it stay below the values called so, which a single
    element does not change.
    """
    results = dict.fromkeys((result.name for result in RESULTS), math.nan)
    if outcome.failure:
        return results
    results |= {name: outcome.numbers.get(key, math.nan) for name, key in _NUMBERS.items()}
    areas = _areas(outcome)
    for field in ("thickness", "shear_angle"):
        if field in outcome.values:
            mean = np.average(np.abs(outcome.values[field]), weights=areas)
            results[f"{field}_mean"] = float(mean)
    for field in ("shear_angle", "fibre_volume_fraction"):
        if field in outcome.values:
            values = np.abs(outcome.values[field])
            order = np.argsort(values)
            covered = np.cumsum(areas[order])
            place = np.searchsorted(covered, 0.99 * covered[-1])
            results[f"{field}_high"] = float(values[order][place])
    return results


def _areas(outcome: Outcome) -> np.ndarray:
    """Return the areas of the undeformed faces (F,) [m²]."""
    last = np.where(outcome.faces[:, 3] < 0, outcome.faces[:, 2], outcome.faces[:, 3])
    corners = outcome.reference[np.column_stack([outcome.faces[:, :3], last])]
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return 0.5 * np.linalg.norm(np.cross(*diagonals), axis=1)


# --- tables: many narrow columns of numbers -------------------------------------------------------


#: Sizes below this part of one unit are shown as zero.
LEAST_SHOWN = 0.005


def plain_table(title: str, *columns: str, names: int = 1, caption: str = "") -> Table:
    """Return a table with columns of numbers behind the first ``names``, which hold words."""
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False,
        padding=(0, 1, 0, 0), caption=caption, caption_justify="left",
    )  # fmt: skip
    for k, column in enumerate(columns):
        table.add_column(column, justify="left" if k < names else "right", no_wrap=True)
    return table


def short(value: float) -> str:
    """Return a number with two digits."""
    if math.isnan(value):
        return "-"
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return "0" if abs(value) < LEAST_SHOWN else f"{value:.2g}"
