"""Which part of every face in a stack looks at another ply, where plies end inside others.

Fluid between two plies presses on both of their faces alike
(:mod:`lcmchain.effects.pore_pressure`), and so the parts of both that look at each other have to be
equal, place by place: else the stack would be pushed as a whole. They are found column by column. A
ply has a part of a column; plies with unlike parts lie within each other, and two of them look at
each other in the part that both have and none between them. Where they have come apart, each face
is bare.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

#: Of the thinner of two plies: up to the smaller gap the fluid joins them, from the larger one on
#: it does not. Contact knows no gap beyond half a thickness.
JOINED, APART = 0.25, 0.5


class PliesInColumns(NamedTuple):
    """What the plies of a stack have of each of its columns, (P, C) each.

    part : of the area of the column, at most 1. height : of the ply's middle along the column's
    normal [m]. thickness : of the ply there [m]. Both are 0 where there is nothing of the ply.
    """

    part: np.ndarray
    height: np.ndarray
    thickness: np.ndarray

    @classmethod
    def of_elements(
        cls,
        shares: csr_array,
        ply: np.ndarray,
        area: np.ndarray,
        volume: np.ndarray,
        centre: np.ndarray,
        columns: tuple[np.ndarray, np.ndarray],
    ) -> PliesInColumns:
        """Gather the elements of each ply in each column.

        Parameters
        ----------
        shares : of the area of each element over each column (E, C). ply : number of each element's
            ply (E,). area, volume, centre : of the elements [m², m³, m], (E,), (E,), (E, 3).
        columns : areas (C,) [m²] and normals (C, 3).
        """
        own_area, normals = columns
        count = int(ply.max()) + 1
        part, height, thickness = np.zeros((3, count, own_area.size))
        for number in range(count):
            rows = np.flatnonzero(ply == number)
            own = shares[rows]
            covered = own.T @ area[rows]
            there = covered > 0.0
            middle = own.T @ (area[rows, None] * centre[rows])
            total = own.T @ volume[rows]
            part[number] = np.minimum(covered / own_area, 1.0)
            height[number, there] = ((middle * normals).sum(axis=1)[there]) / covered[there]
            thickness[number, there] = total[there] / covered[there]
        return cls(part, height, thickness)

    def facing(self, thinnest: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of the columns in which each ply looks at one below, above (P, C).

        thinnest : thickness of each ply at the start [m].
        """
        below, above = np.zeros_like(self.part), np.zeros_like(self.part)
        count = len(self.part)
        for lower in range(count):
            between = np.zeros(self.part.shape[1])
            for upper in range(lower + 1, count):
                both = np.minimum(self.part[lower], self.part[upper])
                seen = np.maximum(both - between, 0.0)
                gap = self.height[upper] - self.height[lower]
                gap = gap - 0.5 * (self.thickness[upper] + self.thickness[lower])
                wide = gap / min(thinnest[lower], thinnest[upper])
                joined = seen * np.clip((APART - wide) / (APART - JOINED), 0.0, 1.0)
                above[lower] += joined
                below[upper] += joined
                between = np.maximum(between, self.part[upper])
        return below, above


def inner_parts(
    shares: csr_array, ply: np.ndarray, part: np.ndarray, facing: np.ndarray
) -> np.ndarray:
    """Return the part of each element's face that looks at another ply (E,).

    Parameters
    ----------
    shares, ply : as of :meth:`PliesInColumns.of_elements`. part, facing : parts of the columns that
        the plies have, and in which they look at another one (P, C).
    """
    of_ply = np.divide(facing, part, out=np.zeros_like(part), where=part > 0.0)
    entries = shares.tocoo()
    element, column = entries.coords
    seen = entries.data * of_ply[ply[element], column]
    total = np.bincount(element, entries.data, minlength=ply.size)
    found = np.bincount(element, seen, minlength=ply.size)
    return np.divide(found, total, out=np.zeros_like(total), where=total > 0.0)
