"""Closures, which press on a saturated sheet: a bag, tools at a gap, a tool under a force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from lcmchain.coupling.solids.compaction_law import CompactionLaw
from lcmchain.errors import InputError, SimulationError

#: A number, or a function of time [s].
OverTime = float | Callable[[float], float]

# Newton's iteration on the gap of a press: tolerance relative to the force, and most iterations.
FORCE_TOLERANCE = 1e-12
MOST_ITERATIONS = 100
# Part of the force that may be left over at the gap where the weakest ply bears no more.
LEFT_OVER = 1e-9


class Closed(NamedTuple):
    """Thickness of the cells, and its derivative by their pore pressure.

    Parameters
    ----------
    thickness : (C,) [m].
    compliance : change of a cell's thickness per pore pressure that rises equally in all cells,
        (C,) [m/Pa].
    """

    thickness: np.ndarray
    compliance: np.ndarray


class Closure(Protocol):
    """Determines the thickness of all cells at a time from their pore pressures."""

    def close(self, law: CompactionLaw, area: np.ndarray, pore: np.ndarray, time: float) -> Closed:
        """Return the thickness of cells of present area (C,) [m²] under pressures (C,) [Pa]."""


def value_at(quantity: OverTime, time: float) -> float:
    """Return a quantity at a time."""
    return float(quantity(time)) if callable(quantity) else float(quantity)


@dataclass(frozen=True)
class Bag:
    """A bag or diaphragm without stiffness: each cell bears its pressure, P = sigma(h) + p.

    pressure : on the sheet, in the system of the pore pressures [Pa]; (C,) or over time.
    """

    pressure: OverTime | np.ndarray

    def close(self, law: CompactionLaw, area: np.ndarray, pore: np.ndarray, time: float) -> Closed:
        total = self.pressure
        if not isinstance(total, np.ndarray):
            total = np.full_like(pore, value_at(total, time))
        thickness = law.thickness_under(total - pore)
        return Closed(thickness, 1.0 / law.stiffness(thickness))


@dataclass(frozen=True)
class Gap:
    """Rigid tools at a gap; their pressure follows from the law.

    gap : [m], (C,) or over time.
    start : thickness that a cell keeps until the tools arrive (C,) [m]; None: it fills the gap.
    """

    gap: OverTime | np.ndarray
    start: np.ndarray | None = None

    def close(self, law: CompactionLaw, area: np.ndarray, pore: np.ndarray, time: float) -> Closed:
        gap = self.gap
        if not isinstance(gap, np.ndarray):
            gap = np.full_like(pore, value_at(gap, time))
        if not (gap > 0.0).all():
            raise SimulationError(f"the tools are closed at {time:g} s: gap {gap.min():.4g} m")
        if self.start is not None:
            gap = np.minimum(self.start, gap)
        return Closed(gap, np.zeros_like(pore))


@dataclass(frozen=True)
class ClosingGap:
    """Rigid tools that close at a constant speed, from the thickest cell to a gap.

    A cell keeps its thickness until the tool arrives.

    start : thickness of the cells before (C,) [m].
    end : gap at the end [m].
    duration : of the closing [s].
    """

    start: np.ndarray
    end: float
    duration: float

    def close(self, law: CompactionLaw, area: np.ndarray, pore: np.ndarray, time: float) -> Closed:
        highest = max(float(self.start.max()), self.end)
        gap = highest + (self.end - highest) * min(time / self.duration, 1.0)
        return Closed(np.minimum(self.start, gap), np.zeros_like(pore))


@dataclass(frozen=True)
class Press:
    """A rigid tool under a force: one gap for all cells, sum A (sigma(h) + p) = F.

    force : of the press on the sheet [N], or over time.
    offset : thickness of the cells over the gap (C,) [m], such as from tools that do not match.
    across : share of a cell's area across the direction d of the press, |n·d|; (C,) or one number.
    """

    force: OverTime
    offset: np.ndarray | float = 0.0
    across: np.ndarray | float = 1.0

    def close(self, law: CompactionLaw, area: np.ndarray, pore: np.ndarray, time: float) -> Closed:
        seen = self.across * area
        force = value_at(self.force, time) - float(np.sum(seen * pore))
        scale = max(abs(value_at(self.force, time)), float(np.sum(seen * np.abs(pore))), 1e-300)
        # a cell at its own thickness would bear the mean pressure: bounds of the common gap
        mean = np.full_like(pore, force / float(seen.sum()))
        alone = law.thickness_under(mean) - self.offset
        low, high = float(alone.min()), float(alone.max())
        least = law.least_gap(self.offset)
        low = max(low, least)
        gap = 0.5 * (low + high)
        for _ in range(MOST_ITERATIONS):
            thickness = gap + self.offset + np.zeros_like(pore)
            lacking = force - float(np.sum(seen * law.pressure(thickness)))
            slope = float(np.sum(seen * law.stiffness(thickness)))
            if lacking > LEFT_OVER * scale and gap - least <= LEFT_OVER * abs(gap):
                # a thinner textile would have to bear the rest: the law raises, with cell and ply
                law.pressure(least - LEFT_OVER * abs(gap) + self.offset + np.zeros_like(pore))
                break
            if abs(lacking) <= FORCE_TOLERANCE * scale or high - low <= 1e-16:
                return Closed(thickness, np.full_like(pore, float(seen.sum()) / slope))
            low, high = (low, gap) if lacking > 0.0 else (gap, high)
            better = gap - lacking / slope
            gap = better if low < better < high else 0.5 * (low + high)
        raise SimulationError(
            f"the gap of the press was not found at {time:g} s: {lacking:.3g} N are left over"
        )


def require_positive(name: str, values: np.ndarray) -> None:
    """Check that all values are positive.

    Raises
    ------
    InputError : one is not; names the cell.
    """
    wrong = np.flatnonzero(~(np.asarray(values) > 0.0))
    if wrong.size:
        raise InputError(f"{name} of cell {wrong[0]} is {np.asarray(values)[wrong[0]]:.6g}")
