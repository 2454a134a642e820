"""What the exports to filling programs share: triangles, their properties, classes and mesh."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.formats.bulk_data import line, require_narrow, rounded
from lcmchain.mapping.formats.format import Loss, MappedCells, worst
from lcmchain.mapping.target import TargetMesh

#: Sets and parts of the target with such names are ports; a name that fits both is an inlet.
INLET = re.compile("inlet|inflow|injection")
OUTLET = re.compile("outlet|(?<![a-z])vents?(?![a-z])")


@dataclass(frozen=True)
class Preform:
    """Triangles with classes of permeability.

    Parameters
    ----------
    errors : what the classes leave of each cell, shape (C,).
    area : of each cell [m2], shape (C,).
    of_triangle : class of each triangle, shape (T,).
    inlets, outlets : rows of the triangles of each port.
    """

    target: TargetMesh
    triangles: Triangles
    classes: Classes
    errors: ClassErrors
    area: np.ndarray
    of_triangle: np.ndarray
    inlets: dict[str, np.ndarray]
    outlets: dict[str, np.ndarray]


def preform_of(
    cells: MappedCells, wanted_by: str, *, most_classes: int, classes_per_kind_of_port: int
) -> Preform:
    """Gather what a filling program needs.

    Parameters
    ----------
    most_classes : classes that the program knows where the target has no ports.
    classes_per_kind_of_port : how many of these the inlets take, and how many the outlets.

    Raises
    ------
    InputError : solid cells, no thickness, fibre volume fraction or permeability, cells without
        one of them, or numbers that do not fit into the mesh file.
    """
    cells.require_shells(wanted_by)
    target = cells.target
    triangles = triangles_of(target)
    require_narrow(triangles.ids, "cell", target.file)
    require_narrow(target.node_ids, "node", target.file)
    thickness = cells.scalar("thickness", wanted_by)
    solid_share = cells.scalar("fibre_volume_fraction", wanted_by)
    cells.require_whole(np.isfinite(thickness + solid_share), "no thickness", wanted_by)
    cells.require_whole(solid_share < 1.0, "no pores", wanted_by)
    values, axis = cells.permeability(wanted_by)
    area = target.surface.areas
    permeable = Permeable(values, axis, cells.normals, 1.0 - solid_share, thickness, area)
    inlets, outlets = (_ports(target, triangles, words) for words in (INLET, OUTLET))
    outlets = {name: rows for name, rows in outlets.items() if name not in inlets}
    kinds = int(bool(inlets)) + int(bool(outlets))
    classes = _classify(permeable, most_classes - kinds * classes_per_kind_of_port)
    return Preform(
        target, triangles, classes, _class_errors(permeable, classes), area,
        classes.of_cell[triangles.cell], inlets, outlets,
    )  # fmt: skip


def _ports(
    target: TargetMesh, triangles: Triangles, words: re.Pattern[str]
) -> dict[str, np.ndarray]:
    """Rows of the triangles of every set and part whose name has one of the words."""
    return {
        name: np.flatnonzero(np.isin(triangles.cell, rows))
        for name, rows in {**target.parts, **target.cell_sets}.items()
        if len(rows) and words.search(name.lower())
    }


def write_mesh(path: Path, preform: Preform, head: list[str], part: np.ndarray) -> None:
    """Write nodes and triangles as bulk data in columns of eight.

    head : lines before the bulk data, such as sets.
    part : number of the property of each triangle, shape (T,).
    """
    target, triangles = preform.target, preform.triangles
    used = np.unique(triangles.nodes)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write("\n".join(["$ lengths in m", "CEND", *head, "BEGIN BULK", ""]))
        for node in used:
            x, y, z = (float(value) for value in target.points[node])
            file.write(line("GRID", int(target.node_ids[node]), "", x, y, z) + "\n")
        for number, of_part, nodes in zip(triangles.ids, part, triangles.nodes, strict=True):
            ids = target.node_ids[nodes].tolist()
            file.write(line("CTRIA3", int(number), int(of_part), *ids) + "\n")
        file.write("ENDDATA\n")


def losses_of(preform: Preform) -> list[Loss]:
    """What a mesh of classes cannot hold, with the worst cells."""
    target, errors = preform.target, preform.errors
    used = np.unique(preform.triangles.nodes)
    points = target.points[used]
    moved = np.linalg.norm(rounded(points) - points, axis=1)
    count = preform.classes.count
    of_classes = f"{count} classes stand for {target.cell_count} cells"
    losses = [
        worst(f"{of_classes}: {name}", error, target.cell_ids, unit="1", area=preform.area)
        for name, error in (
            ("permeability tensor in the plane", errors.permeability),
            ("porosity", errors.porosity),
            ("thickness", errors.thickness),
        )
    ]
    losses.append(
        worst(
            "places of nodes have eight columns",
            moved,
            target.node_ids[used],
            unit="m",
            place="node",
        )
    )
    losses.append(
        Loss(
            "flow through the thickness, both fibre directions and every other field have no place"
        )
    )
    halved = preform.triangles.halved
    if halved:
        what = f"{halved} quadrilaterals are two triangles each, with the values of the cell"
        losses.append(Loss(what, 0.0))
    return losses


def class_table(preform: Preform) -> list[dict[str, float | int | list[float]]]:
    """Properties of the classes, ready for JSON, in the order of their area."""
    classes = preform.classes
    area = np.bincount(classes.of_cell, preform.area, minlength=classes.count)
    return [
        {
            "area_m2": float(area[number]),
            "thickness_m": float(classes.thickness[number]),
            "porosity": float(classes.porosity[number]),
            "permeability_m2": float(classes.values[number, 0]),
            "alpha": float(classes.values[number, 1] / classes.values[number, 0]),
            "reference_direction": classes.direction[number].tolist(),
        }
        for number in range(classes.count)
    ]


# --- targets as triangles, for programs that know no other cells ----------------------------------


@dataclass(frozen=True)
class Triangles:
    """Triangles of a surface mesh; quadrilaterals are cut along their shorter diagonal.

    Parameters
    ----------
    nodes : rows of the target's nodes, shape (T, 3).
    cell : row of the cell that each triangle is or is a part of, shape (T,).
    ids : numbers of the triangles, shape (T,): the cell's own, and for second halves the numbers
        that follow the largest of the target.
    """

    nodes: np.ndarray
    cell: np.ndarray
    ids: np.ndarray

    @property
    def halved(self) -> int:
        """Number of quadrilaterals that were cut."""
        return len(self.cell) - len(np.unique(self.cell))


def triangles_of(target: TargetMesh) -> Triangles:
    """Cut a surface mesh into triangles, in the order of its cells."""
    corners = target.corners
    quad = target.surface.is_quadrilateral
    points = target.points
    first = np.linalg.norm(points[corners[:, 2]] - points[corners[:, 0]], axis=1)
    second = np.linalg.norm(points[corners[:, 3]] - points[corners[:, 1]], axis=1)
    turned = quad & (second < first)
    start = np.where(turned[:, None], np.roll(corners, -1, axis=1), corners)
    cell = np.repeat(np.arange(target.cell_count), 1 + quad)
    later = np.append(False, cell[1:] == cell[:-1])
    nodes = np.where(later[:, None], start[cell][:, [0, 2, 3]], start[cell][:, :3])
    ids = target.cell_ids[cell].copy()
    ids[later] = target.cell_ids.max() + 1 + np.arange(int(later.sum()))
    return Triangles(nodes, cell, ids)


# --- classes of permeability: few sets of properties that stand for those of all cells ------------
# Programs that fill a preform of a few regions know one thickness, porosity and permeability per
# region, and one direction in space that each of its cells projects onto itself.

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


def _classify(cells: Permeable, count: int) -> Classes:
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


def _class_errors(cells: Permeable, classes: Classes) -> ClassErrors:
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
    errors = _class_errors(cells, classes)
    return errors.permeability**2 + errors.porosity**2 + errors.thickness**2


def _cost(cells: Permeable, classes: Classes) -> float:
    return float(np.sum(cells.area * _own_squares(cells, classes)))
