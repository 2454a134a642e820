"""What a benchmark returns."""

from __future__ import annotations

from typing import NamedTuple


class BenchmarkResult(NamedTuple):
    """One number of a benchmark beside its reference.

    Attributes
    ----------
    name, mesh : of the problem, and its elements.
    value, reference : computed and known value, in the units of the problem.
    origin : where the reference comes from.
    expected : value over reference that an independent implementation of the element gives on the
        same mesh; ``None`` where there is none.
    """

    name: str
    mesh: str
    value: float
    reference: float
    origin: str
    expected: float | None = None

    @property
    def normalised(self) -> float:
        """Value over reference."""
        return self.value / self.reference
