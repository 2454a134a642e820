"""Size of the coupling windows: constant, or led by iterations, failures and coupling residual."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from lcmchain.errors import InputError


@dataclass(frozen=True)
class WindowControl:
    """How long a window is.

    Parameters
    ----------
    size : of the first window [s].
    smallest : a window that fails is halved and tried again down to this size; the same as
        ``size`` (so never) where it is None.
    largest : windows that converge easily grow up to this size; None: never beyond ``size``.
    few_iterations : what "easily" means.
    patience : windows in a row that must go easily before one grows.
    grow : factor of growth.
    residual : wanted size of the coupling residual: the part of a field that its prediction at the
        beginning of the window missed, over the field. It estimates the error of an explicit
        scheme, and the change of curvature in an implicit one. A window is repeated where it is
        exceeded twofold, as long as ``smallest`` allows. None: not looked at.
    """

    size: float
    smallest: float | None = None
    largest: float | None = None
    few_iterations: int = 5
    patience: int = 3
    grow: float = 1.5
    residual: float | None = None

    def __post_init__(self) -> None:
        if not (0.0 < self.size < math.inf):
            raise InputError(f"the size of a window must be positive, not {self.size:g} s")
        if not (0.0 < self.least <= self.size <= self.most < math.inf):
            raise InputError(
                f"a window of {self.size:g} s lies outside of smallest {self.least:g} s and "
                f"largest {self.most:g} s"
            )
        if not self.grow > 1.0:
            raise InputError(f"windows grow by a factor above 1, not {self.grow:g}")
        if self.residual is not None and not self.residual > 0.0:
            raise InputError(f"the coupling residual must be positive, not {self.residual:g}")

    @property
    def least(self) -> float:
        return self.size if self.smallest is None else self.smallest

    @property
    def most(self) -> float:
        return self.size if self.largest is None else self.largest


@dataclass
class WindowSize:
    """The present size of the windows; belongs to one system."""

    control: WindowControl
    size: float = field(init=False)
    calm: int = field(default=0, init=False)  # windows in a row that went easily

    def __post_init__(self) -> None:
        self.size = self.control.size

    def within(self, remaining: float) -> float:
        """Return the size of the next window; equal windows fill what remains."""
        return remaining / max(1, math.ceil(remaining / self.size - 1e-9))

    def shorter(self, used: float) -> float | None:
        """Return half of a window that failed, None where it is the smallest already."""
        smaller = max(0.5 * used, self.control.least)
        return smaller if smaller < used * (1.0 - 1e-9) else None

    def shorten(self, size: float) -> None:
        """Go on with shorter windows."""
        self.size, self.calm = size, 0

    def follow(self, used: float, iterations: int, missed: float, order: int) -> None:
        """Choose the next size after a window that was accepted."""
        control = self.control
        self.calm = self.calm + 1 if iterations <= control.few_iterations else 0
        size = self.size
        if self.calm >= control.patience:
            size, self.calm = size * control.grow, 0
        if control.residual is not None:
            # What an extrapolation of this order misses grows with the power order + 1.
            ratio = control.residual / max(missed, 1e-300)
            fitting = used * 0.9 * ratio ** (1.0 / (order + 1))
            size = min(size, fitting) if fitting < self.size else size
        self.size = min(max(size, control.least), control.most)

    def save(self) -> Any:
        """Return a copy of the memory."""
        return self.size, self.calm

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        self.size, self.calm = saved
