"""Classes of permeability: few sets of properties that stand for those of all cells.

Programs that fill a preform of a few regions know one thickness, porosity and permeability per
region, and one direction in space that each of its cells projects onto itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Passes over all cells between two splits; the last ones lower the errors by less than a percent.
MOST_PASSES = 30

# Squared relative error below which a class stands for a cell exactly.
EXACT = 1e-20


@dataclass(frozen=True)
class Permeable:
    """Cells that resin flows through.

    Parameters
    ----------
    values : principal permeabilities in the plane [m2], the larger first, shape (C, 2).
    axis : unit vector of the larger one, in the cell's plane, shape (C, 3).
    normal : unit normal, shape (C, 3).
    porosity, thickness : [1] and [m], shape (C,).
    area : [m2], shape (C,).
    """

    values: np.ndarray
    axis: np.ndarray
    normal: np.ndarray
    porosity: np.ndarray
    thickness: np.ndarray
    area: np.ndarray


@dataclass(frozen=True)
class Classes:
    """Properties of N classes, ordered by their area, the largest first.

    Parameters
    ----------
    of_cell : class of each cell, shape (C,).
    values : permeability along the projected direction and across it [m2], shape (N, 2).
    direction : unit vectors, shape (N, 3).
    porosity, thickness : [1] and [m], shape (N,).
    """

    of_cell: np.ndarray
    values: np.ndarray
    direction: np.ndarray
    porosity: np.ndarray
    thickness: np.ndarray

    @property
    def count(self) -> int:
        return len(self.porosity)


@dataclass(frozen=True)
class ClassErrors:
    """Relative errors of every cell that its class causes, shape (C,)."""

    permeability: np.ndarray
    porosity: np.ndarray
    thickness: np.ndarray


def classify(cells: Permeable, count: int) -> Classes:
    """Gather cells into at most ``count`` classes so that the squared errors over the area are few.

    The worst classes are split at their worst cells until there are enough, and cells and classes
    are improved in turn (Linde, Buzo and Gray, IEEE Transactions on Communications 28 (1980) 84).
    The pore volume of every class is that of its cells.
    """
    best = _fitted(cells, np.zeros(len(cells.area), dtype=np.int64), 1, None)
    cost = _cost(cells, best)
    while best.count < count:
        found, its_cost = _improved(cells, _split(cells, best, count - best.count))
        if found.count == best.count or its_cost >= cost:
            break
        best, cost = found, its_cost
    area = np.bincount(best.of_cell, cells.area, minlength=best.count)
    order = np.argsort(-area, kind="stable")
    rank = np.argsort(order, kind="stable")
    return Classes(
        rank[best.of_cell], best.values[order], best.direction[order], best.porosity[order],
        best.thickness[order],
    )  # fmt: skip


def _split(cells: Permeable, classes: Classes, most: int) -> Classes:
    """Begin a new class at the worst cell of each of the worst classes, ``most`` at most."""
    own = _squares(cells, classes)[np.arange(len(cells.area)), classes.of_cell]
    costs = cells.area * own
    cost = np.bincount(classes.of_cell, costs, minlength=classes.count)
    of_cell, count = classes.of_cell.copy(), classes.count
    for number in np.argsort(-cost, kind="stable")[:most]:
        mine = np.flatnonzero(classes.of_cell == number)
        seed = mine[np.argmax(costs[mine])]
        if own[seed] > EXACT and len(mine) > 1:
            of_cell[seed] = count
            count += 1
    return _fitted(cells, of_cell, count, classes)


def class_errors(cells: Permeable, classes: Classes) -> ClassErrors:
    """Return what the classes leave of each cell's permeability tensor, porosity and thickness.

    The error of the tensor is the Frobenius norm of its difference over that of the tensor.
    """
    rows, own = np.arange(len(cells.area)), classes.of_cell
    return ClassErrors(
        np.sqrt(_tensor_squares(cells, classes)[rows, own]),
        np.abs(classes.porosity[own] / cells.porosity - 1.0),
        np.abs(classes.thickness[own] / cells.thickness - 1.0),
    )


def _improved(cells: Permeable, classes: Classes) -> tuple[Classes, float]:
    """Move cells to the class that fits best, and classes to their cells, while the cost falls."""
    best, cost = classes, _cost(cells, classes)
    for _ in range(MOST_PASSES):
        of_cell = np.argmin(_squares(cells, best), axis=1)
        if len(np.unique(of_cell)) < best.count:
            break
        found = _fitted(cells, of_cell, best.count, best)
        its_cost = _cost(cells, found)
        if its_cost >= cost * (1.0 - 1e-12):
            break
        best, cost = found, its_cost
    return best, cost


def _fitted(cells: Permeable, of_cell: np.ndarray, count: int, earlier: Classes | None) -> Classes:
    """Classes with the properties that suit their cells best."""
    values, direction = np.empty((count, 2)), np.empty((count, 3))
    porosity, thickness = np.empty(count), np.empty(count)
    for number in range(count):
        mine = of_cell == number
        candidates = [_leading_axis(cells, mine)]
        if earlier is not None and number < earlier.count:
            candidates.append(earlier.direction[number])
        fits = [(*_best_values(cells, mine, axis), axis) for axis in candidates]
        values[number], _, direction[number] = min(fits, key=lambda fit: fit[1])
        volume = cells.area[mine] * cells.thickness[mine]
        thickness[number] = volume.sum() / cells.area[mine].sum()
        porosity[number] = (volume * cells.porosity[mine]).sum() / volume.sum()
    return Classes(of_cell, values, direction, porosity, thickness)


def _leading_axis(cells: Permeable, mine: np.ndarray) -> np.ndarray:
    """Axis that most of the anisotropy of the cells lies along."""
    larger, smaller = cells.values[mine].T
    weight = cells.area[mine] * ((larger - smaller) / larger) ** 2
    axes = cells.axis[mine]
    if weight.sum() == 0.0:
        weight = cells.area[mine]
    return np.linalg.eigh(np.einsum("c,ci,cj->ij", weight, axes, axes))[1][:, 2]


def _best_values(cells: Permeable, mine: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, float]:
    """Permeabilities along a projected axis and across it with the fewest squares, and these."""
    along, across, coupling, norm = _components(cells, mine, axis[None])
    weight = cells.area[mine] / norm**2
    values = np.array([
        np.sum(weight * component[:, 0]) / weight.sum() for component in (along, across)
    ])  # fmt: skip
    squares = (
        (along[:, 0] - values[0]) ** 2 + (across[:, 0] - values[1]) ** 2 + 2.0 * coupling[:, 0] ** 2
    )
    return values, float(np.sum(weight * squares))


def _components(
    cells: Permeable, mine: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Each cell's tensor in the frame of N projected directions, (M, N) each, and its norm (M,)."""
    axis, normal = cells.axis[mine], cells.normal[mine]
    larger, smaller = cells.values[mine].T
    cosine, sine = axis @ directions.T, np.cross(normal, axis) @ directions.T
    length = np.hypot(cosine, sine)
    # A direction along the normal projects to nothing: the cell's own axis stands in.
    flat = length > 0.0
    cosine = np.where(flat, cosine / np.where(flat, length, 1.0), 1.0)
    sine = np.where(flat, sine / np.where(flat, length, 1.0), 0.0)
    along = larger[:, None] * cosine**2 + smaller[:, None] * sine**2
    across = larger[:, None] * sine**2 + smaller[:, None] * cosine**2
    coupling = (larger - smaller)[:, None] * cosine * sine
    return along, across, coupling, np.hypot(larger, smaller)


def _tensor_squares(cells: Permeable, classes: Classes) -> np.ndarray:
    """Squared relative error of the tensor of each cell in each class, shape (C, N)."""
    everywhere = np.ones(len(cells.area), dtype=bool)
    along, across, coupling, norm = _components(cells, everywhere, classes.direction)
    squares = (
        (along - classes.values[:, 0]) ** 2
        + (across - classes.values[:, 1]) ** 2
        + 2.0 * coupling**2
    )
    return squares / norm[:, None] ** 2


def _squares(cells: Permeable, classes: Classes) -> np.ndarray:
    """Sum of the squared relative errors of each cell in each class, shape (C, N)."""
    porosity = classes.porosity[None] / cells.porosity[:, None] - 1.0
    thickness = classes.thickness[None] / cells.thickness[:, None] - 1.0
    return _tensor_squares(cells, classes) + porosity**2 + thickness**2


def _cost(cells: Permeable, classes: Classes) -> float:
    own = _squares(cells, classes)[np.arange(len(cells.area)), classes.of_cell]
    return float(np.sum(cells.area * own))
