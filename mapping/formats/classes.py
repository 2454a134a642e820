"""Classes of permeability: few sets of properties that stand for those of all cells.

Programs that fill a preform of a few regions know one thickness, porosity and permeability per
region, and one direction in space that each of its cells projects onto itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Passes over all cells between two splits, and the share of the squared errors that one has to take
# away for another to follow.
MOST_PASSES, GAIN = 30, 1e-3

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
    own = _own_squares(cells, classes)
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
    own = classes.of_cell
    twice = _cosine_of_twice(*_own_components(cells, classes.direction[own]))
    return ClassErrors(
        np.sqrt(_tensor_squares(cells, classes.values[own], twice)),
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
        if its_cost < cost:
            best, gain, cost = found, cost - its_cost, its_cost
        else:
            gain = 0.0
        if gain < GAIN * cost:
            break
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
    larger, smaller = cells.values[mine].T
    twice = _cosine_of_twice(
        cells.axis[mine] @ axis, np.cross(cells.normal[mine], cells.axis[mine]) @ axis
    )
    weight = cells.area[mine] / (larger**2 + smaller**2)
    mean, half = 0.5 * (larger + smaller), 0.5 * (larger - smaller)
    middle = np.sum(weight * mean) / weight.sum()
    deviator = np.sum(weight * half * twice) / weight.sum()
    squares = (mean - middle) ** 2 + half**2 + deviator**2 - 2.0 * half * deviator * twice
    return np.array([middle + deviator, middle - deviator]), float(np.sum(weight * squares))


def _own_components(cells: Permeable, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Components of one direction per cell along its axis and across it, shape (C,)."""
    across = np.cross(cells.normal, cells.axis)
    return (
        np.einsum("ci,ci->c", cells.axis, directions),
        np.einsum("ci,ci->c", across, directions),
    )


def _cosine_of_twice(along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Cosine of twice the angle between an axis and a projected direction, from its components.

    A direction along the normal projects to nothing: the axis itself stands in.
    """
    along, across = along**2, across**2
    length = along + across
    return np.where(length > 0.0, (along - across) / np.where(length > 0.0, length, 1.0), 1.0)


def _tensor_squares(cells: Permeable, values: np.ndarray, twice: np.ndarray) -> np.ndarray:
    """Squared relative difference between the tensors of cells and classes.

    In the plane a tensor is its mean value and half the difference of its principal values at
    twice the angle of the larger one.

    Parameters
    ----------
    values : of the classes, shape (..., 2).
    twice : cosine of twice the angle between the axes, shape (C,) or (C, N).
    """
    larger, smaller = (cells.values[:, column] for column in (0, 1))
    if twice.ndim == 2:
        larger, smaller = larger[:, None], smaller[:, None]
    mean, half = 0.5 * (larger + smaller), 0.5 * (larger - smaller)
    middle, deviator = (
        0.5 * (values[..., 0] + values[..., 1]),
        0.5 * (values[..., 0] - values[..., 1]),
    )
    squares = (mean - middle) ** 2 + (half - deviator) ** 2 + 2.0 * half * deviator * (1.0 - twice)
    # Rounding may leave less than nothing where both are the same.
    return 2.0 * np.maximum(squares, 0.0) / (larger**2 + smaller**2)


def _squares(cells: Permeable, classes: Classes) -> np.ndarray:
    """Sum of the squared relative errors of each cell in each class, shape (C, N)."""
    twice = _cosine_of_twice(
        cells.axis @ classes.direction.T,
        np.cross(cells.normal, cells.axis) @ classes.direction.T,
    )
    porosity = classes.porosity / cells.porosity[:, None] - 1.0
    thickness = classes.thickness / cells.thickness[:, None] - 1.0
    return _tensor_squares(cells, classes.values, twice) + porosity**2 + thickness**2


def _own_squares(cells: Permeable, classes: Classes) -> np.ndarray:
    """Sum of the squared relative errors of each cell in its own class, shape (C,)."""
    errors = class_errors(cells, classes)
    return errors.permeability**2 + errors.porosity**2 + errors.thickness**2


def _cost(cells: Permeable, classes: Classes) -> float:
    return float(np.sum(cells.area * _own_squares(cells, classes)))
