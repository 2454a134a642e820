"""Which layer of the sheet a target cell belongs to, where several lie over it.

Two walls, two folds or two plies may be closer to each other than an edge of a mesh. A cell takes
from one layer only: of those that show it the right side, the nearest. Which side is right is a
matter of a whole connected piece of the target: the cells over which a single layer lies tell it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.intersection import Overlaps
from lcmchain.mapping.winding import Winding

# A piece of the target knows its side when so much of the area that can tell agrees.
AGREEMENT = 0.9

# Only cells with one layer over them tell the side where they are at least this share of a piece.
# Else those with another layer this many times farther away than the nearest tell it too.
SINGLE_SHARE = 0.01
FARTHER = 4.0

# A layer is taken only if the next one is this many times farther away: in between, facets that
# cut the corners of a curved part may decide.
DECISIVE = 1.5

# Layers that tile a cell between them lie beside each other, not over each other; a step of the
# sheet has steep faces between its halves, which belong to no layer.
TILING = 1.001


class Choice(NamedTuple):
    """Which pairs count, and what could not be decided.

    taken : whether a pair is of the layer that its cell belongs to, shape (K,).
    ambiguous : whether a second layer could as well be the one, shape (C,).
    side : side that each cell has to see, 1 or -1 as in ``Overlaps.side``; 0 unknown, shape (C,).
    """

    taken: np.ndarray
    ambiguous: np.ndarray
    side: np.ndarray


def choose_layers(found: Overlaps, winding: Winding | None, areas: np.ndarray) -> Choice:
    """Choose the layer of each cell.

    Parameters
    ----------
    winding : of the target; None where the sides of its cells mean nothing, as sections of solids.
    areas : of the cells [m2], shape (C,).
    """
    count = len(areas)
    layer_count = int(found.layer.max(initial=-1)) + 1
    area = np.bincount(found.layer, found.area, minlength=layer_count)
    moment = np.bincount(found.layer, found.area * np.abs(found.height), minlength=layer_count)
    distance = np.where(area > 0.0, moment / np.where(area > 0.0, area, 1.0), np.inf)
    cell, side = np.zeros(layer_count, dtype=np.int64), np.zeros(layer_count, dtype=np.int64)
    cell[found.layer], side[found.layer] = found.cell, found.side
    first = np.searchsorted(cell, np.arange(count + 1))
    wanted = np.zeros(count, dtype=np.int64)
    if winding is not None:
        wanted = _side_of_cells(first, side, distance, areas, winding)
    chosen, ambiguous = _choose(first, side, area, distance, wanted, areas)
    taken = chosen[found.layer]
    return Choice(taken, ambiguous, wanted)


def _side_of_cells(
    first: np.ndarray, side: np.ndarray, distance: np.ndarray, areas: np.ndarray, winding: Winding
) -> np.ndarray:
    """Side that each cell has to see, as its connected piece of the target tells it."""
    single, clear = _votes(first, side, distance)
    turned = winding.side.astype(np.int64)
    pieces = len(winding.two_sided)
    size = np.bincount(winding.piece, areas, minlength=pieces)

    def count(votes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weight = areas * turned * votes
        total = np.bincount(winding.piece, np.abs(weight), minlength=pieces)
        return np.bincount(winding.piece, weight, minlength=pieces), total

    tally, total = count(single)
    few = total < SINGLE_SHARE * size
    for_few, total_few = count(clear)
    tally, total = np.where(few, for_few, tally), np.where(few, total_few, total)
    known = (total > 0.0) & (np.abs(tally) >= AGREEMENT * total) & winding.two_sided
    of_piece = np.where(known, np.sign(tally), 0.0).astype(np.int64)
    return of_piece[winding.piece] * turned


@routine
def _votes(first, side, distance):
    """Sides that cells with a single layer see, and with one far nearer than the others."""
    count = len(first) - 1
    single, clear = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for c in range(count):
        near, other, votes = np.inf, np.inf, 0
        agree = True
        for layer in range(first[c], first[c + 1]):
            if side[layer] != side[first[c]]:
                agree = False
            if distance[layer] < near:
                near, other, votes = distance[layer], near, side[layer]
            else:
                other = min(other, distance[layer])
        if near == np.inf:
            continue
        if agree:
            single[c] = votes
        if agree or other > FARTHER * near:
            clear[c] = votes
    return single, clear


@routine
def _choose(first, side, area, distance, wanted, areas):
    """Return whether each layer is taken, and whether each cell could not decide."""
    chosen = np.zeros(len(side), dtype=np.bool_)
    ambiguous = np.zeros(len(areas), dtype=np.bool_)
    for c in range(len(areas)):
        nearest = -1
        for layer in range(first[c], first[c + 1]):
            if wanted[c] != 0 and side[layer] != wanted[c]:
                continue
            if nearest < 0 or distance[layer] < distance[nearest]:
                nearest = layer
        if nearest < 0 or distance[nearest] == np.inf:
            continue
        chosen[nearest] = True
        covered = area[nearest]
        for layer in range(first[c], first[c + 1]):
            if layer == nearest or distance[layer] == np.inf:
                continue
            if wanted[c] != 0 and side[layer] != wanted[c]:
                continue
            if side[layer] == side[nearest] and covered + area[layer] <= TILING * areas[c]:
                chosen[layer] = True
                covered += area[layer]
            elif distance[layer] < DECISIVE * distance[nearest]:
                ambiguous[c] = True
    return chosen, ambiguous
