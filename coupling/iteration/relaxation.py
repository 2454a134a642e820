"""Fixed-point iteration with a constant and with Aitken's relaxation factor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import InputError

Vector = NDArray[np.float64]


class Acceleration(Protocol):
    """How the next inputs follow from the last ones, x, and what the parts answered to them, H(x).

    All unknown fields lie in one vector; ``weights`` (n,) bring them to one size: a norm is
    ``|weights * v|``. An object belongs to one system and keeps its memory.
    """

    @property
    def factor(self) -> float:
        """Return the relaxation factor last used, not-a-number where there was none."""

    @property
    def rank(self) -> int:
        """Return the number of columns last used, 0 for a relaxation."""

    def begin_window(self) -> None:
        """Begin a window of time."""

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x from one that did not converge."""

    def end_window(self, x: Vector, answer: Vector) -> None:
        """End a window with the pair that converged."""

    def drop_window(self) -> None:
        """Forget what was learnt since the window began; it failed."""

    def forget(self) -> None:
        """Forget all earlier windows; the map has changed (another size of the window)."""

    def save(self) -> Any:
        """Return a copy of the memory."""

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""


@dataclass
class ConstantRelaxation:
    """x + omega (H(x) - x); with omega = 1 the plain fixed point."""

    factor: float = 1.0
    rank: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        _require_factor(self.factor)

    def begin_window(self) -> None:
        """Begin a window of time."""

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x."""
        return x + self.factor * (answer - x)

    def end_window(self, x: Vector, answer: Vector) -> None:
        """End a window."""

    def drop_window(self) -> None:
        """Nothing is learnt."""

    def forget(self) -> None:
        """Nothing is kept."""

    def save(self) -> Any:
        """Nothing is kept."""
        return None

    def restore(self, saved: Any) -> None:
        """Nothing is kept."""


@dataclass
class AitkenRelaxation:
    """Relaxation whose factor follows the last two residuals (Kuettler, Wall 2008).

    A window begins with the last factor of the one before, at most ``initial`` in size.
    """

    initial: float = 0.5
    factor: float = field(default=math.nan, init=False)
    rank: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        _require_factor(self.initial)
        self._last: float = self.initial  # factor at the end of the window before
        self._residual: Vector | None = None

    def begin_window(self) -> None:
        """Begin a window of time."""
        self._residual = None

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x."""
        residual = answer - x
        if self._residual is None:
            factor = math.copysign(min(abs(self._last), self.initial), self._last)
        else:
            change = weights * (residual - self._residual)
            square = float(np.sum(change * change))
            factor = self.factor
            if square > 0.0:
                factor *= -float(np.sum(weights * self._residual * change)) / square
        # A factor of zero would stop the iteration where it stands.
        self.factor = factor if factor != 0.0 else self.initial
        self._residual = residual
        return x + self.factor * residual

    def end_window(self, x: Vector, answer: Vector) -> None:
        """Keep the factor for the next window."""
        if self._residual is not None:
            self._last = self.factor
        self._residual = None

    def drop_window(self) -> None:
        """Begin the next attempt with the initial factor."""
        self._last, self._residual = self.initial, None

    def forget(self) -> None:
        """Begin the next window with the initial factor."""
        self._last = self.initial

    def save(self) -> Any:
        """Return a copy of the memory."""
        kept = None if self._residual is None else self._residual.copy()
        return self._last, self.factor, kept

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        self._last, self.factor, kept = saved
        self._residual = None if kept is None else kept.copy()


def _require_factor(factor: float) -> None:
    if not (0.0 < factor <= 1.0):
        raise InputError(f"a relaxation factor must lie in 0..1 (0 excluded), not {factor:g}")
