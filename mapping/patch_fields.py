"""Fields between the cells of a sheet and its patches, both ways, conserving what they carry.

Up: what a patch holds is the sum over its cells, what it has (thickness, pressure) their mean by
weight. Down: sums are shared out by weight; means are constant over a patch, or follow the gradient
that the patches around it tell. Constant down is the transpose of sum up: with pressure one way and
volume rate the other, both sides of a coupling count the same work.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from lcmchain.errors import InputError
from lcmchain.mapping.patches import Patches

# Of the largest spread of the patches around one: below the first they lie almost in a line, and
# those around them are asked as well; directions with less than the second have no gradient.
IN_A_LINE = 0.3
FLAT = 0.05
#: Most rings of patches that a gradient is taken from.
RINGS = 3


class PatchFields:
    """Transfer between cells and their patches.

    Parameters
    ----------
    patches : of the cells.
    centres : of the cells [m], shape (C, 3), and ``areas`` [m2], shape (C,): they weigh the means
        and place the gradients.
    neighbours : pairs of cells that share an edge, shape (2, n); patches with such a pair are
        neighbours.
    """

    def __init__(
        self, patches: Patches, centres: np.ndarray, areas: np.ndarray, neighbours: np.ndarray
    ) -> None:
        self.patches = patches
        self.areas = np.ascontiguousarray(areas, dtype=float)
        if len(self.areas) != len(patches.of_cell) or not (self.areas > 0.0).all():
            raise InputError("every cell of an interface needs a positive area")
        self._centres = np.asarray(centres, dtype=float)
        either = np.hstack([neighbours, neighbours[::-1]])
        pairs = np.unique(patches.of_cell[either], axis=1)
        self._pairs = pairs[:, pairs[0] != pairs[1]]

    @cached_property
    def patch_areas(self) -> np.ndarray:
        """Area of each patch [m2], shape (P,)."""
        return self.total(self.areas)

    @cached_property
    def patch_centres(self) -> np.ndarray:
        """Middle of the area of each patch [m], shape (P, 3); beside the sheet where it bends."""
        return np.stack([self.mean(axis) for axis in self._centres.T], axis=1)

    # --- up ---------------------------------------------------------------------------------------

    def total(self, values: np.ndarray) -> np.ndarray:
        """Return the sum over the cells of each patch, (C,) to (P,): volumes, rates of volume."""
        return np.bincount(self.patches.of_cell, values, self.patches.count)

    def mean(self, values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the mean over the cells of each patch by weight, (C,) to (P,).

        A patch whose cells all have the same value gets exactly that one.

        weights : positive, shape (C,); the areas without.
        """
        weights = self.areas if weights is None else weights
        of_cell = self.patches.of_cell
        some = values[self._first_cells]  # the mean of the differences, so that constants stay
        share = self.total(weights * (values - some[of_cell])) / self.total(weights)
        return some + share

    # --- down -------------------------------------------------------------------------------------

    def shared(self, totals: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the share of each cell in what its patch holds, by weight, (P,) to (C,).

        weights : positive, shape (C,); the areas without.
        """
        weights = self.areas if weights is None else weights
        of_cell = self.patches.of_cell
        return totals[of_cell] * (weights / self.total(weights)[of_cell])

    def constant(self, values: np.ndarray) -> np.ndarray:
        """Return the value of each cell's patch, (P,) to (C,)."""
        return values[self.patches.of_cell]

    def linear(self, values: np.ndarray, *, limited: bool = True) -> np.ndarray:
        """Return values that rise and fall over each patch and have its value as mean by area.

        Linear fields on a flat sheet come out exactly where they are not limited.

        Parameters
        ----------
        values : of the patches, shape (P,).
        limited : no cell beyond the values of its patch and the patches around it (Barth and
            Jespersen 1989); the patches at the edge of the sheet then flatten.
        """
        gradient = (self._gradients @ values).reshape(-1, 3)
        of_cell = self.patches.of_cell
        step = (self._offsets * gradient[of_cell]).sum(axis=1)
        if limited:
            one, other = self._pairs
            low, high = values.copy(), values.copy()
            np.minimum.at(low, one, values[other])
            np.maximum.at(high, one, values[other])
            room = np.where(
                step > 0.0, high[of_cell] - values[of_cell], low[of_cell] - values[of_cell]
            )
            share = np.ones(len(step))
            np.divide(room, step, out=share, where=np.abs(step) > np.abs(room))
            least = np.ones(self.patches.count)
            np.minimum.at(least, of_cell, share)
            step *= least[of_cell]
        return values[of_cell] + step

    # --- constants --------------------------------------------------------------------------------

    @cached_property
    def _first_cells(self) -> np.ndarray:
        return np.unique(self.patches.of_cell, return_index=True)[1]

    @cached_property
    def _offsets(self) -> np.ndarray:
        """Places of the cells seen from the middles of their patches [m], shape (C, 3)."""
        return self._centres - self.patch_centres[self.patches.of_cell]

    @cached_property
    def _gradients(self) -> csr_matrix:
        """The least-squares gradient of each patch from its neighbours (3 P, P)."""
        count, middles = self.patches.count, self.patch_centres
        one, other = self._pairs  # sorted by the first
        beside = np.split(other, np.searchsorted(one, np.arange(1, count)))
        rows, columns, entries = [], [], []
        for patch in range(count):
            around = _patches_around(patch, beside, middles)
            if len(around) == 0:
                continue
            offsets = middles[around] - middles[patch]
            fit = _tangential_inverse(offsets)  # (3, n): differences to gradient
            index = 3 * patch + np.arange(3)
            rows.append(np.repeat(index, len(around) + 1))
            columns.append(np.tile([*around, patch], 3))
            entries.append(np.hstack([fit, -fit.sum(axis=1, keepdims=True)]).ravel())
        if not rows:
            return csr_matrix((3 * count, count))
        table = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
        return csr_matrix(table, shape=(3 * count, count))


def _patches_around(patch: int, beside: list[np.ndarray], middles: np.ndarray) -> np.ndarray:
    """Return the neighbours of a patch; where they lie almost in a line, theirs as well."""
    around = beside[patch]
    for _ in range(RINGS - 1):
        if len(around) == 0:
            break
        sizes = np.linalg.svd(middles[around] - middles[patch], compute_uv=False)
        if len(sizes) > 1 and sizes[1] > IN_A_LINE * sizes[0]:
            break
        wider = np.unique(np.concatenate([around, *(beside[k] for k in around)]))
        around = wider[wider != patch]
    return around


def _tangential_inverse(offsets: np.ndarray) -> np.ndarray:
    """Return the pseudoinverse in the plane in which the offsets (n, 3) lie best, (3, n)."""
    left, sizes, right = np.linalg.svd(offsets, full_matrices=False)
    kept = sizes > FLAT * sizes[0]
    kept[2:] = False
    return (right[kept].T / sizes[kept]) @ left[:, kept].T
