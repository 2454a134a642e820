"""Coupling schemes: in which order parts advance, and how their inputs are corrected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lcmchain.coupling.iteration.quasi_newton import MultiVectorQuasiNewton, QuasiNewton
from lcmchain.coupling.iteration.relaxation import (
    Acceleration,
    AitkenRelaxation,
    ConstantRelaxation,
)
from lcmchain.errors import InputError

Order = Literal["serial", "parallel"]


@dataclass
class Scheme:
    """How a system goes through a window; an object belongs to one system.

    Parameters
    ----------
    name : for histories and messages.
    order : ``serial``: each part sees what those before it have just found (Gauss-Seidel);
        ``parallel``: all see what was there before (Jacobi).
    acceleration : None: explicit, every window is gone through once.
    most_iterations : a window that needs more has not converged.
    """

    name: str
    order: Order
    acceleration: Acceleration | None
    most_iterations: int = 50

    def __post_init__(self) -> None:
        if self.order not in ("serial", "parallel"):
            raise InputError(f'the order of a scheme is "serial" or "parallel", not "{self.order}"')
        if self.most_iterations < 1:
            raise InputError(f"at least one iteration is needed, not {self.most_iterations}")

    @property
    def explicit(self) -> bool:
        return self.acceleration is None


def jacobi() -> Scheme:
    """Return the explicit scheme in which all parts advance with inputs from before the window."""
    return Scheme("Jacobi", "parallel", None, 1)


def gauss_seidel() -> Scheme:
    """Return the explicit scheme in which parts advance one after the other."""
    return Scheme("Gauss-Seidel", "serial", None, 1)


def fixed_point(
    relaxation: float = 1.0, *, order: Order = "serial", most_iterations: int = 50
) -> Scheme:
    """Return the fixed-point iteration with a constant relaxation factor."""
    name = "fixed point" if relaxation == 1.0 else f"fixed point, relaxation {relaxation:g}"
    return Scheme(name, order, ConstantRelaxation(relaxation), most_iterations)


def aitken(initial: float = 0.5, *, order: Order = "serial", most_iterations: int = 50) -> Scheme:
    """Return the fixed-point iteration with Aitken's relaxation factor (Kuettler, Wall 2008)."""
    return Scheme("Aitken", order, AitkenRelaxation(initial), most_iterations)


def iqn_ils(
    *,
    order: Order = "serial",
    relaxation: float = 0.01,
    windows_reused: int = 20,
    most_columns: int = 80,
    filter_limit: float = 1e-3,
    most_iterations: int = 50,
) -> Scheme:
    """Return the quasi-Newton iteration IQN-ILS (Degroote, Bathe, Vierendeels 2009)."""
    newton = QuasiNewton(relaxation, windows_reused, most_columns, filter_limit)
    return Scheme("IQN-ILS", order, newton, most_iterations)


def iqn_mvj(
    *,
    order: Order = "serial",
    relaxation: float = 0.01,
    filter_limit: float = 1e-3,
    most_iterations: int = 50,
) -> Scheme:
    """Return the quasi-Newton iteration IQN-MVJ (Bogaers, Kok, Reddy, Franz 2014)."""
    newton = MultiVectorQuasiNewton(relaxation, filter_limit=filter_limit)
    return Scheme("IQN-MVJ", order, newton, most_iterations)
