"""Temperature of a fabric: it shifts all times, by one factor, or in every element by its own.

The times of a fabric whose stress depends on a rate are longer by a factor a where it is colder
(:func:`arrhenius_factor`): viscosities and relaxation times grow by it, moduli stay
(thermorheologically simple). Source: Ferry, "Viscoelastic Properties of Polymers", chapter 11, of
melts far above their glass transition.

**One temperature** shifts the parameters of the law before a run (``shifted`` of what states them).

**A temperature that differs over the blank** gives every element a factor of its own. A warmer
element comes to the same stress in a shorter time: its law is that of the reference temperature,
asked for a step that is longer by the rate factor 1/a. This number per element is all that the
field adds. It is a value of the element and no memory, but stands with what a law remembers: it
begins as the field says (``initial_history`` of the material), and every step hands it on.
Checkpoints, rollback and resumed runs hold it with the rest.

The field is given on a grid in the coordinates of the undeformed blank, linear between its points
and constant beyond its edges. A law with it is a class of its own, made when it is asked for.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.law import Remembered, place_in_memory, remembered, unrolled
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of

GAS_CONSTANT = 8.31446261815324  # [J/(mol K)]
RATE_FACTOR = Remembered("rate_factor", "1", "how much faster than at the reference temperature")


def arrhenius_factor(temperature: float, reference: float, energy: float) -> float:
    """Return the factor on all times at a temperature [K]; energy of activation [J/mol]."""
    return math.exp(energy / GAS_CONSTANT * (1.0 / temperature - 1.0 / reference))


@dataclass(frozen=True)
class TemperatureField:
    """Temperatures on a grid, and how they shift times.

    Parameters
    ----------
    x, y : coordinates of the grid [m], rising; one y where the field does not change with it.
    temperature : (y, x) [K]. reference [K]. energy : of activation [J/mol].
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    temperature: tuple[tuple[float, ...], ...]
    reference: float
    energy: float

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the temperatures [K] at points (..., 2 or more) of the undeformed blank."""
        grid = np.array(self.temperature)
        column, right = _between(np.array(self.x), points[..., 0])
        row, above = _between(np.array(self.y), points[..., 1])
        next_row = np.minimum(row + 1, len(self.y) - 1)
        next_column = np.minimum(column + 1, len(self.x) - 1)
        low = grid[row, column] * (1.0 - right) + grid[row, next_column] * right
        high = grid[next_row, column] * (1.0 - right) + grid[next_row, next_column] * right
        values: np.ndarray = low * (1.0 - above) + high * above
        return values

    def rate_factor(self, temperature: np.ndarray) -> np.ndarray:
        """Return 1/a at temperatures [K]."""
        shift = self.energy / GAS_CONSTANT * (1.0 / self.reference - 1.0 / np.asarray(temperature))
        return np.exp(shift)

    @property
    def slowest(self) -> float:
        """The largest factor a on times anywhere: that of the coldest point."""
        return 1.0 / float(self.rate_factor(np.min(self.temperature)))

    def in_words(self) -> str:
        """Say what it is."""
        low, high = np.min(self.temperature), np.max(self.temperature)
        return f"at {low - 273.15:.4g} to {high - 273.15:.4g} degC over the blank"


def _between(grid: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the point of a grid below x, and what part of the way to the next x lies."""
    if len(grid) == 1:
        return np.zeros(x.shape, dtype=int), np.zeros(x.shape)
    inside = np.clip(x, grid[0], grid[-1])
    below = np.clip(np.searchsorted(grid, inside, side="right") - 1, 0, len(grid) - 2)
    return below, (inside - grid[below]) / (grid[below + 1] - grid[below])


# --- compiled -------------------------------------------------------------------------------------


@optional
def kept_values(law, history):
    """Return the values of the element that stand with what a law remembers; nothing without."""
    return ()


@optional
def elapsed(law, history, size):
    """Return the time that a step takes at the reference temperature [s]."""
    return size


@optional
def time_factor(law, history):
    """Return the factor on times of the element."""
    return 1.0


@unrolled(
    lambda law_class: f"lambda law, history: history[{place_in_memory(law_class, RATE_FACTOR)}]"
)
def rate_factor_of(law, history):
    """Return the rate factor of the element."""


@equation
def kept_rate_factor(law, history):
    return (rate_factor_of(law, history),)


@equation
def elapsed_in_element(law, history, size):
    return size * rate_factor_of(law, history)


@equation
def time_factor_of_element(law, history):
    return 1.0 / rate_factor_of(law, history)


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"Heated(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws whose elements have a rate factor each."""
    twin = twin_of(
        base,
        "Heated",
        about=", each element at a temperature of its own.",
        answers={
            kept_values: kept_rate_factor,
            elapsed: elapsed_in_element,
            time_factor: time_factor_of_element,
        },
    )
    twin.remembers = (*remembered(base), RATE_FACTOR)
    return twin


def with_field(law: LawOrTwin, field: TemperatureField | None) -> LawOrTwin:
    """Return a law whose elements have a rate factor each, or the law itself without a field."""
    if field is None:
        return law
    return twin_named(f"Heated{type(law).__name__}")(*law)
