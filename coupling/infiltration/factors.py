"""Solution of the pressure's equations, with factors kept while the matrix stays the same.

The same matrix comes back where a saturated part keeps its shape, where only what is injected or
squeezed differs, and where a coupling iterates over one time step. Equal matrices have equal
factors, so what is kept changes no bit of the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

from lcmchain.errors import SimulationError

#: Factors of so many matrices are kept.
KEPT = 4
#: Factors with more entries than this in all are not kept for later [1]; 12 bytes each.
MOST_ENTRIES = 60_000_000


@dataclass
class Work:
    """How much solving a filling took: matrices factorised, and systems solved with them."""

    factorisations: int = 0
    solutions: int = 0


class Factors:
    """Factorised matrices of the pressure, the last ones used first."""

    def __init__(self) -> None:
        self.work = Work()
        self._kept: list[tuple[csc_matrix, SuperLU]] = []

    def solve(self, matrix: csc_matrix, right: np.ndarray) -> np.ndarray:
        """Solve a system of symmetric structure, refined once: nodes balance to round-off.

        Raises
        ------
        SimulationError : the matrix is singular.
        """
        factors = self._of(matrix)
        self.work.solutions += 1
        solution = factors.solve(right)
        return solution + factors.solve(right - matrix @ solution)

    def _of(self, matrix: csc_matrix) -> SuperLU:
        for place, (other, factors) in enumerate(self._kept):
            if _same(matrix, other):
                self._kept.insert(0, self._kept.pop(place))
                return factors
        try:
            factors = splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SimulationError(
                f"the equations of the resin's pressure cannot be solved ({error}): some of it is "
                "neither at a gate or vent nor at the front"
            ) from None
        self.work.factorisations += 1
        self._kept.insert(0, (matrix, factors))
        del self._kept[KEPT:]
        while len(self._kept) > 1 and sum(f.nnz for _, f in self._kept) > MOST_ENTRIES:
            self._kept.pop()
        return factors


def _same(one: csc_matrix, other: csc_matrix) -> bool:
    return (
        one.shape == other.shape
        and one.nnz == other.nnz
        and np.array_equal(one.data, other.data)
        and np.array_equal(one.indices, other.indices)
        and np.array_equal(one.indptr, other.indptr)
    )
