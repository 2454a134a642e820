"""Materials of a deck: one per cell, or one for cells that are alike within a stated tolerance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mapping.structure.sections import Sections


class Materials(NamedTuple):
    """Materials and the cells that have them.

    of_cell : material of each cell, (C,).
    stiffness : [Pa], (M, 6, 6). plies : of each family, (M, 6, 6). density : [kg/m3], (M,).
    error : largest difference between a stiffness of a cell and that of its material, relative to
        the largest stiffness of the cell.
    """

    of_cell: np.ndarray
    stiffness: np.ndarray
    plies: tuple[np.ndarray, np.ndarray]
    density: np.ndarray
    error: float


def materials_of(sections: Sections, tolerance: float) -> Materials:
    """Group the cells whose stiffness differs by less than ``tolerance``; 0 groups none.

    Fibre volume fraction and angle between the families decide the stiffness in the axes of the
    cell. Both are divided into equal steps, which are made smaller until the tolerance holds.
    """
    count = len(sections.density)
    if tolerance == 0.0:
        return Materials(
            np.arange(count), sections.stiffness, sections.plies, sections.density, 0.0
        )
    step = tolerance
    while True:
        v_step = step * sections.fibre_volume_fraction.mean()
        keys = np.stack(
            [sections.fibre_volume_fraction / v_step, sections.angle / step], axis=1
        ).round()
        _, of_cell = np.unique(keys, axis=0, return_inverse=True)
        found = _grouped(sections, of_cell.reshape(-1))
        if found.error <= tolerance:
            return found
        step *= 0.7


def _grouped(sections: Sections, of_cell: np.ndarray) -> Materials:
    members = np.bincount(of_cell)

    def mean(values: np.ndarray) -> np.ndarray:
        total = np.zeros((len(members), *values.shape[1:]))
        np.add.at(total, of_cell, values)
        return total / members.reshape(-1, *[1] * (values.ndim - 1))

    stiffness = mean(sections.stiffness)
    off = np.abs(stiffness[of_cell] - sections.stiffness).max(axis=(1, 2))
    error = float((off / sections.stiffness.max(axis=(1, 2))).max())
    plies = mean(sections.plies[0]), mean(sections.plies[1])
    return Materials(of_cell, stiffness, plies, mean(sections.density), error)
