"""Whether an exchanged field has converged, and where it has done so least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.iteration.interface import Tolerance

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Judgement:
    """Residual of one exchange in one iteration against its limit.

    ``limit`` is infinite where the field is not judged; ``worst`` is the number of the value that
    changed most, ``worst_residual`` by how much.
    """

    residual: float
    size: float
    limit: float
    worst: int
    worst_residual: float

    @property
    def converged(self) -> bool:
        return self.residual <= self.limit


def rms(values: Values) -> float:
    """Return the root mean square, 0 of no values."""
    if values.size == 0:
        return 0.0
    largest = float(np.abs(values).max())
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    return largest * float(np.sqrt(np.mean((values / largest) ** 2)))  # squares never overflow


def largest_size(values: Values) -> float:
    """Return the largest absolute value, 0 of no values."""
    return float(np.abs(values).max()) if values.size else 0.0


def judge(
    before: Values, now: Values, start: Values, tolerance: Tolerance | None, scale: float
) -> Judgement:
    """Judge what an iteration has changed: ``before`` -> ``now``; the window began at ``start``.

    ``scale`` is the largest size that the field has had.
    """
    norm = largest_size if tolerance is not None and tolerance.norm == "largest" else rms
    change = now - before
    size = norm(now)
    worst = int(np.abs(change).argmax()) if change.size else 0
    worst_residual = float(abs(change[worst])) if change.size else 0.0
    limit = np.inf
    if tolerance is not None:
        limits = [np.inf]
        if tolerance.relative is not None:
            limits.append(tolerance.relative * size)
        if tolerance.increment is not None:
            limits.append(tolerance.increment * norm(now - start))
        limit = min(limits)
        if tolerance.absolute is not None:
            limit = tolerance.absolute if np.isinf(limit) else max(limit, tolerance.absolute)
        limit = max(limit, tolerance.floor * scale)
    return Judgement(norm(change), size, float(limit), worst, worst_residual)
