"""What a benchmark returns."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class BenchmarkResult(NamedTuple):
    """One number of a benchmark beside its reference.

    Attributes
    ----------
    name, mesh : of the problem, and its elements.
    options : of the element, a name of ``meshes.OPTIONS``.
    value, reference : computed and known value, in the units of the problem.
    origin : where the reference comes from.
    expected : value over reference that an independent implementation of the element gives on the
        same mesh; ``None`` where there is none.
    """

    name: str
    mesh: str
    options: str
    value: float
    reference: float
    origin: str
    expected: float | None = None

    @property
    def normalised(self) -> float:
        """Value over reference; not a number where the reference is zero."""
        return self.value / self.reference if self.reference else math.nan


class CurveResult(NamedTuple):
    """Displacements of a benchmark along its load, beside their references.

    Attributes
    ----------
    load_factor : (n,) load over its largest value.
    options : of the element, a name of ``meshes.OPTIONS``.
    labels : names of the k displacements.
    values, references : (n, k), values not a number where the solver found no equilibrium.
    end : its words, then.
    """

    name: str
    mesh: str
    options: str
    load_factor: np.ndarray
    labels: tuple[str, ...]
    values: np.ndarray
    references: np.ndarray
    origin: str
    end: str = ""

    @property
    def deviation(self) -> np.ndarray:
        """Value less reference over the largest reference of that displacement, (n, k)."""
        return (self.values - self.references) / abs(self.references).max(axis=0)

    @property
    def reached(self) -> int:
        """How many of the load factors were reached."""
        return int(np.isfinite(self.values).all(axis=1).sum())
