"""Materials of a deck: one per cell, or one for cells that are alike within a stated tolerance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mapping.structure.sections import Sections


class Materials(NamedTuple):
    """Materials and the cells that have them.

    of_cell : material of each cell, (C,).
    stiffness : [Pa], (M, 6, 6). layers : of each kind of layer, (M, 6, 6), where there are any.
    density : [kg/m3], (M,).
    error : largest difference between a stiffness of a cell and that of its material, relative to
        the largest stiffness of the cell.
    """

    of_cell: np.ndarray
    stiffness: np.ndarray
    layers: tuple[np.ndarray, ...]
    density: np.ndarray
    error: float


def materials_of(sections: Sections, tolerance: float) -> Materials:
    """Group the cells whose stiffness differs by less than ``tolerance``; 0 groups none.

    Fibre volume fraction, angle and share of every layer decide the stiffness in the axes of the
    cell. All are divided into equal steps, which are made smaller until the tolerance holds.
    """
    if tolerance == 0.0:
        layers = () if sections.through is None else sections.through.kinds
        each = np.arange(len(sections.density))
        return Materials(each, sections.stiffness, layers, sections.density, 0.0)
    mean = sections.fibre_volume_fraction.mean()
    states = [
        column
        for layer in sections.layers
        for column in (layer.fibre_volume_fraction / mean, layer.angle, layer.share)
    ]
    step = tolerance
    while True:
        keys = (np.stack(states, axis=1) / step).round()
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
    kinds = () if sections.through is None else sections.through.kinds
    layers = tuple(mean(kind) for kind in kinds)
    return Materials(of_cell, stiffness, layers, mean(sections.density), error)
