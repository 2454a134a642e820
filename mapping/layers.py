"""Which layer of the sheet a target cell belongs to, where several lie over it.

Two walls, two folds or two plies may be closer to each other than an edge of a mesh. A cell takes
from one layer only: of those that show it the right side, the nearest. Which side is right is a
matter of a whole connected piece of the target: the one by which its cells lie nearer to the sheet,
in the mean of the squares. A U that was moved across its gap by any amount still knows its walls:
the other sides would bring one wall as much nearer as the other one farther, and the squares grow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.intersection import Overlaps
from lcmchain.mapping.winding import Winding

# A piece of the target knows its side when the mean square distance to what shows it the other side
# is this many times larger.
CLEARLY_FARTHER = 1.25

# Where no layer shows a side, the next one may be anywhere beyond the distance that was searched.
BEYOND = 2.0

# A layer is taken only if the next one is this many times farther away: in between, facets that
# cut the corners of a curved part may decide.
DECISIVE = 1.5

# The same where the side is not known, and the other layer shows another side than the nearest.
DECISIVE_OF_SIDES = 3.0

# Layers that tile a cell between them lie beside each other, not over each other; a step of the
# sheet has steep faces between its halves, which belong to no layer.
TILING = 1.001

# Neighbours of a cell's faces may touch it in a line or corner; rounding gives this an area, of
# 1e-11 of the cell. Layers smaller than this part of the largest one over the cell are no rivals.
TOUCHING = 1e-6


class Choice(NamedTuple):
    """Which pairs count, and what could not be decided.

    taken : whether a pair is of the layer that its cell belongs to, shape (K,).
    ambiguous : whether a second layer could as well be the one, shape (C,).
    side : side that each cell has to see, 1 or -1 as in ``Overlaps.side``; 0 unknown, shape (C,).
    """

    taken: np.ndarray
    ambiguous: np.ndarray
    side: np.ndarray


def choose_layers(
    found: Overlaps, winding: Winding, areas: np.ndarray, maximum_distance: float
) -> Choice:
    """Choose the layer of each cell.

    Parameters
    ----------
    winding : of the target.
    areas : of the cells [m2], shape (C,).
    maximum_distance : up to which layers were looked for [m].
    """
    count = len(areas)
    layer_count = int(found.layer.max(initial=-1)) + 1
    area = np.bincount(found.layer, found.area, minlength=layer_count)
    moment = np.bincount(found.layer, found.area * np.abs(found.height), minlength=layer_count)
    distance = np.where(area > 0.0, moment / np.where(area > 0.0, area, 1.0), np.inf)
    cell, side = np.zeros(layer_count, dtype=np.int64), np.zeros(layer_count, dtype=np.int64)
    cell[found.layer], side[found.layer] = found.cell, found.side
    first = np.searchsorted(cell, np.arange(count + 1))
    wanted = _side_of_cells(first, side, distance, areas, winding, maximum_distance)
    chosen, ambiguous = _choose(first, side, area, distance, wanted, areas)
    taken = chosen[found.layer]
    return Choice(taken, ambiguous, wanted)


def _side_of_cells(
    first: np.ndarray,
    side: np.ndarray,
    distance: np.ndarray,
    areas: np.ndarray,
    winding: Winding,
    maximum_distance: float,
) -> np.ndarray:
    """Side that each cell has to see, as its connected piece of the target tells it."""
    squares = np.zeros((len(areas), 2))
    _squares_of_distances(first, side, distance, maximum_distance, squares)
    turned = winding.side < 0
    squares[turned] = squares[turned, ::-1]
    upper, lower = (
        np.bincount(winding.piece, areas * of_side, minlength=len(winding.two_sided))
        for of_side in squares.T
    )
    known = winding.two_sided & (
        np.maximum(upper, lower) > CLEARLY_FARTHER * np.minimum(upper, lower)
    )
    of_piece = np.where(known, np.where(upper < lower, 1, -1), 0)
    return of_piece[winding.piece] * winding.side


@routine
def _squares_of_distances(first, side, distance, farthest, squares):
    """Write the squares of the distances to the nearest layers of side 1 and -1, shape (C, 2).

    Cells without any layer count for neither side.
    """
    for c in range(len(first) - 1):
        upper, lower = BEYOND * farthest, BEYOND * farthest
        for layer in range(first[c], first[c + 1]):
            if side[layer] > 0:
                upper = min(upper, distance[layer])
            else:
                lower = min(lower, distance[layer])
        if first[c + 1] > first[c]:
            squares[c, 0], squares[c, 1] = upper * upper, lower * lower


@routine
def _choose(first, side, area, distance, wanted, areas):
    """Return whether each layer is taken, and whether each cell could not decide."""
    chosen = np.zeros(len(side), dtype=np.bool_)
    ambiguous = np.zeros(len(areas), dtype=np.bool_)
    for c in range(len(areas)):
        nearest, largest = -1, 0.0
        for layer in range(first[c], first[c + 1]):
            if wanted[c] == 0 or side[layer] == wanted[c]:
                largest = max(largest, area[layer])
        for layer in range(first[c], first[c + 1]):
            if wanted[c] != 0 and side[layer] != wanted[c]:
                continue
            if area[layer] < TOUCHING * largest:
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
                continue
            if area[layer] < TOUCHING * largest:
                continue
            decisive = DECISIVE if side[layer] == side[nearest] else DECISIVE_OF_SIDES
            if distance[layer] < decisive * distance[nearest]:
                ambiguous[c] = True
    return chosen, ambiguous
