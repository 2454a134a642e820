"""Coupling schemes: in which order parts advance, and how their inputs are corrected.

An :class:`Acceleration` computes the next inputs from the last ones and the answers to them: by
relaxation, constant or after Aitken, or by an interface quasi-Newton method, which estimates the
inverse Jacobian from differences of residuals (IQN-ILS, IQN-MVJ).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import InputError

Order = Literal["serial", "parallel"]


@dataclass
class Scheme:
    """How a system goes through a window; an object belongs to one system.

    Parameters
    ----------
    name : for histories and messages.
    order : ``serial``: a part sees the new answers of the parts before it (Gauss-Seidel);
        ``parallel``: all see the answers of the last iteration (Jacobi).
    acceleration : how the inputs are corrected; None: explicit, one evaluation per window.
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


# --- relaxation -----------------------------------------------------------------------------------


Vector = NDArray[np.float64]


class Acceleration(Protocol):
    """Computes the next inputs from the last ones, x, and the answers of the parts to them, H(x).

    One vector (n,) holds all unknown fields. ``weights`` (n,) bring them to one size: a norm is
    ``|weights * v|``. An object belongs to one system and has a memory of its own kind.
    """

    @property
    def factor(self) -> float:
        """Return the last relaxation factor, not-a-number where there was none."""

    @property
    def rank(self) -> int:
        """Return the number of columns of the last step, 0 for a relaxation."""

    def begin_window(self) -> None:
        """Begin a window of time."""

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x (n,) after one that did not converge."""

    def end_window(self, x: Vector, answer: Vector) -> None:
        """End a window with the pair that converged."""

    def drop_window(self) -> None:
        """Forget what was learnt since the window began, because it failed."""

    def forget(self) -> None:
        """Forget all earlier windows, because H has changed (another size of the window)."""

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

    def save(self) -> None:
        """Nothing is kept."""

    def restore(self, saved: None) -> None:
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
        # with a factor of zero the iteration would never move again
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

    def save(self) -> tuple[float, float, Vector | None]:
        """Return a copy of the memory."""
        kept = None if self._residual is None else self._residual.copy()
        return self._last, self.factor, kept

    def restore(self, saved: tuple[float, float, Vector | None]) -> None:
        """Return to a saved memory."""
        self._last, self.factor, kept = saved
        self._residual = None if kept is None else kept.copy()


def _require_factor(factor: float) -> None:
    if not (0.0 < factor <= 1.0):
        raise InputError(f"a relaxation factor must lie in 0..1 (0 excluded), not {factor:g}")


# --- interface quasi-Newton -----------------------------------------------------------------------


Columns = list[tuple[Vector, Vector]]  # (change of the residual, change of the answer)


#: Rows that are factorised at a time: fixed, so that results do not depend on the threads.
BLOCK = 2048


def triangular_factor(vectors: list[Vector], weights: Vector) -> NDArray[np.float64]:
    """Return R (min(n, m), m) of the QR factorisation of m weighted vectors (n,).

    Blocks of rows are factorised, then their factors. This is fast for long vectors, and the order
    of the sums does not depend on the threads of the linear algebra library.
    """
    blocks: list[NDArray[np.float64]] = []
    for at in range(0, weights.size, BLOCK):
        rows = np.stack([vector[at : at + BLOCK] for vector in vectors], axis=1)
        blocks.append(_factor(rows * weights[at : at + BLOCK, None]))
    while len(blocks) > 1:
        blocks = [_factor(np.concatenate(blocks[at : at + 8])) for at in range(0, len(blocks), 8)]
    return blocks[0]


def _factor(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)


def filtered_qr(columns: list[Vector], limit: float) -> tuple[Vector, Vector, list[int]]:
    """Return Q (n, m), R (m, m) and the numbers (m,) of the columns that are kept, in their order.

    A column (n,) is left out if the part of it that is orthogonal to the columns before it has
    less than ``limit`` times its length (filter QR2 of Haelterman, Bogaers, Scheufele, Uekermann,
    Mehl 2016). Gram-Schmidt runs twice, which is enough against round-off.
    """
    size = columns[0].size if columns else 0
    basis = np.empty((size, len(columns)))
    factors = np.zeros((len(columns), len(columns)))
    kept: list[int] = []
    for number, column in enumerate(columns):
        rank = len(kept)
        if rank == size:
            break
        length = float(np.linalg.norm(column))
        rest = column.copy()
        shares = np.zeros(rank)
        for _ in range(2):
            share = basis[:, :rank].T @ rest
            rest -= basis[:, :rank] @ share
            shares += share
        new = float(np.linalg.norm(rest))
        if not new > limit * length:
            continue
        basis[:, rank] = rest / new
        factors[:rank, rank], factors[rank, rank] = shares, new
        kept.append(number)
    rank = len(kept)
    return basis[:, :rank], factors[:rank, :rank], kept


@dataclass
class QuasiNewton:
    """IQN-ILS: least squares over differences of the residuals (Degroote, Bathe, Vierendeels 2009).

    The columns of V are differences of the residuals r = H(x) - x, those of W differences of H(x).
    The next input is H(x) + W c, where c minimises |V c + r|. The newest columns come first, so
    that the filter drops the oldest. A step without columns is a relaxation.

    Parameters
    ----------
    relaxation : factor of the step without columns.
    windows_reused : number of earlier windows whose columns are used as well.
    most_columns : the oldest columns beyond this number are dropped.
    filter_limit : see :func:`filtered_qr`.
    """

    relaxation: float = 0.01
    windows_reused: int = 20
    most_columns: int = 80
    filter_limit: float = 1e-3
    factor: float = field(default=math.nan, init=False)
    rank: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if not (0.0 < self.relaxation <= 1.0):
            raise InputError(f"a relaxation factor must lie in 0..1, not {self.relaxation:g}")
        if self.windows_reused < 0 or self.most_columns < 1:
            raise InputError("windows_reused must be at least 0, most_columns at least 1")
        if not (0.0 < self.filter_limit < 1.0):
            raise InputError(f"the filter's limit must lie in 0..1, not {self.filter_limit:g}")
        self._present: Columns = []
        self._earlier: list[Columns] = []  # one entry per window, newest first
        self._last: tuple[Vector, Vector] | None = None  # (residual, answer)

    def begin_window(self) -> None:
        """Begin a window of time."""
        self._present, self._last = [], None

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x."""
        self._learn(x, answer)
        residual = answer - x
        columns = self._columns()
        # the columns of the triangular factor have the same angles as the columns themselves
        short = triangular_factor([*(v for v, _ in columns), residual], weights).T
        basis, triangle, kept = filtered_qr(list(short[:-1]), self.filter_limit)
        self.rank = len(kept)
        if not kept:
            self.factor = self.relaxation
            return x + self.relaxation * residual
        self.factor = math.nan
        shares = -np.linalg.solve(triangle, basis.T @ short[-1])
        step = np.zeros_like(x)
        for share, number in zip(shares, kept):
            step += share * columns[number][1]
        return answer + step

    def end_window(self, x: Vector, answer: Vector) -> None:
        """Keep the window's columns for the next ones."""
        self._learn(x, answer)
        if self._present:
            self._earlier.insert(0, self._present)
        del self._earlier[self.windows_reused :]
        self._present, self._last = [], None

    def drop_window(self) -> None:
        """Forget the columns of this window."""
        self._present, self._last = [], None

    def forget(self) -> None:
        """Forget the columns of all earlier windows."""
        self._earlier = []

    def save(self) -> Any:
        """Return a copy of the memory; the columns themselves are never changed in place."""
        earlier = [list(columns) for columns in self._earlier]
        return list(self._present), earlier, self._last, self.factor, self.rank

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        present, earlier, self._last, self.factor, self.rank = saved
        self._present, self._earlier = list(present), [list(columns) for columns in earlier]

    def _learn(self, x: Vector, answer: Vector) -> None:
        residual = answer - x
        if self._last is not None:
            change = (residual - self._last[0], answer - self._last[1])
            if np.any(change[0]):
                self._present.insert(0, change)
        self._last = (residual, answer.copy())

    def _columns(self) -> Columns:
        columns = list(self._present)
        for window in self._earlier:
            columns += window
        return columns[: self.most_columns]


@dataclass
class MultiVectorQuasiNewton(QuasiNewton):
    """IQN-MVJ: a full matrix holds what earlier windows taught (Bogaers, Kok, Reddy, Franz 2014).

    The inverse Jacobian J of the last window changes as little as the present columns require: the
    next input is H(x) - J r + (W - J V) c. No number of windows has to be chosen. The matrix takes
    n^2 numbers, so it is for small interfaces.

    Parameters
    ----------
    most_unknowns : most values of all fields together; more are an InputError.
    """

    windows_reused: int = 0
    most_unknowns: int = 3000

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.windows_reused:
            raise InputError("IQN-MVJ keeps a matrix of the past; windows_reused must be 0")
        self._matrix: NDArray[np.float64] | None = None
        self._weights: Vector | None = None

    def propose(self, x: Vector, answer: Vector, weights: Vector) -> Vector:
        """Return the next x."""
        if x.size > self.most_unknowns:
            raise InputError(
                f"IQN-MVJ keeps a matrix of {x.size:,} x {x.size:,}; more than "
                f"{self.most_unknowns:,} unknowns: take IQN-ILS"
            )
        if self._matrix is None:
            self._weights = weights.copy()
            return super().propose(x, answer, weights)
        self._learn(x, answer)
        self._weights, self.factor = weights.copy(), math.nan
        residual = answer - x
        step = -np.einsum("ij,j->i", self._matrix, residual)
        change, kept = self._present_change()
        self.rank = len(kept)
        return answer + step + (0.0 if change is None else -np.einsum("ij,j->i", change, residual))

    def end_window(self, x: Vector, answer: Vector) -> None:
        """Take the window's columns into the matrix."""
        self._learn(x, answer)
        change, _ = self._present_change()
        if change is not None:
            old = np.zeros_like(change) if self._matrix is None else self._matrix
            self._matrix = old + change
        self._present, self._last = [], None

    def forget(self) -> None:
        """Forget the matrix."""
        self._matrix = None

    def save(self) -> Any:
        """Return a copy of the memory; matrix and weights are never changed in place."""
        return super().save(), self._matrix, self._weights

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        memory, self._matrix, self._weights = saved
        super().restore(memory)

    def _present_change(self) -> tuple[NDArray[np.float64] | None, list[int]]:
        """Return (W - J V) V^+ with the weighted pseudo-inverse, and the columns in it."""
        if not self._present or self._weights is None:
            return None, []
        weights = self._weights
        basis, triangle, kept = filtered_qr(
            [weights * v for v, _ in self._present], self.filter_limit
        )
        if not kept:
            return None, []
        lack = np.stack([self._present[number][1] for number in kept], axis=1)
        if self._matrix is not None:
            lack = lack - self._matrix @ np.stack([self._present[n][0] for n in kept], axis=1)
        return lack @ np.linalg.solve(triangle, basis.T * weights[None, :]), kept
