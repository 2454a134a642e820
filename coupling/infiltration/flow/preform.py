"""Surface mesh of an infiltration: nodes with control volumes, cells with material."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr

# Of the shortest edge: two nodes this close are one point with two numbers.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class FlowMesh:
    """Triangles and quadrilaterals in space, whose nodes carry fill factor and pressure.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    cells : node rows of the cells, shape (C, 4); a triangle has -1 in the fourth place. Both
        orders of the corners, clockwise and counter-clockwise, may occur.
    cell_sets, node_sets : rows of the cells and nodes of each named set.

    Raises
    ------
    InputError : wrong shapes, a node row that does not exist, a cell without area, a point that
        is not finite, a node that no cell uses.
    """

    points: np.ndarray
    cells: np.ndarray
    cell_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = np.ascontiguousarray(self.points, dtype=float)
        cells = np.ascontiguousarray(self.cells, dtype=np.int64)
        if cells.ndim == 2 and cells.shape[1] == 3:
            cells = np.hstack([cells, np.full((len(cells), 1), -1, dtype=np.int64)])
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        _check_arrays(points, cells)
        for kind, count in (("cell", len(cells)), ("node", len(points))):
            _check_sets(kind, getattr(self, f"{kind}_sets"), count)
        _few_cells(self.areas <= 1e-14 * np.max(self.areas), "have no area; delete them")

    @classmethod
    def from_target(cls, target: TargetMesh) -> FlowMesh:
        """Return the mesh of a mapping's target; nodes that no cell uses are left out.

        Sets keep their names; parts of the file join the cell sets.

        Raises
        ------
        InputError : the target is made of solids.
        """
        if target.is_solid:
            raise InputError(
                "infiltration needs a surface mesh (triangles, quadrilaterals), this one has "
                "solid cells; export the middle surface of the part",
                file=target.file,
            )
        used = np.unique(target.corners[target.corners >= 0])
        row = np.full(len(target.points), -1, dtype=np.int64)
        row[used] = np.arange(len(used))
        cells = np.where(target.corners >= 0, row[target.corners], -1)
        node_sets = {name: row[nodes][row[nodes] >= 0] for name, nodes in target.node_sets.items()}
        try:
            return cls(target.points[used], cells, {**target.parts, **target.cell_sets}, node_sets)
        except InputError as error:
            raise InputError(error.message, file=target.file or "the mesh of the part") from None

    @property
    def node_count(self) -> int:
        return len(self.points)

    @property
    def cell_count(self) -> int:
        return len(self.cells)

    @cached_property
    def is_quadrilateral(self) -> np.ndarray:
        """True for quadrilaterals, shape (C,)."""
        return self.cells[:, 3] >= 0

    @cached_property
    def corners(self) -> np.ndarray:
        """Positions of the corners [m], shape (C, 4, 3); a triangle repeats its third."""
        closed = np.where(self.cells < 0, self.cells[:, 2:3], self.cells)
        return self.points[closed]

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals of the cells, shape (C, 3); of a warped quad that of its diagonals."""
        x = self.corners
        crossed = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
        crossed = np.where(
            self.is_quadrilateral[:, None],
            crossed,
            np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]),
        )
        length = np.linalg.norm(crossed, axis=1)
        return crossed / np.where(length > 0.0, length, 1.0)[:, None]

    @cached_property
    def areas(self) -> np.ndarray:
        """Areas of the cells [m2], shape (C,); of a warped quad that of its projection."""
        x = self.corners
        crossed = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
        triangle = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        return 0.5 * np.linalg.norm(
            np.where(self.is_quadrilateral[:, None], crossed, triangle), axis=1
        )

    @cached_property
    def centroids(self) -> np.ndarray:
        """Means of the corners [m], shape (C, 3)."""
        x, count = self.corners, np.where(self.is_quadrilateral, 4.0, 3.0)
        total = x[:, :3].sum(axis=1) + np.where(self.is_quadrilateral[:, None], x[:, 3], 0.0)
        return total / count[:, None]

    @cached_property
    def edges(self) -> np.ndarray:
        """Sides of the cells, every one once, smaller node row first, shape (E, 2)."""
        return self._sides[0]

    @cached_property
    def rim(self) -> np.ndarray:
        """Rows of the nodes on sides that belong to one cell only, ascending."""
        edges, _, count = self._sides
        return np.unique(edges[count == 1])

    @cached_property
    def part_of_node(self) -> np.ndarray:
        """Number of the connected part of the mesh that each node belongs to, shape (N,)."""
        graph = coo_matrix(
            (np.ones(len(self.edges)), self.edges.T), shape=(self.node_count, self.node_count)
        )
        return connected_components(graph, directed=False)[1]

    @cached_property
    def _sides(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        following = np.roll(self.cells, -1, axis=1)
        following = np.where(following < 0, self.cells[:, :1], following)
        ends = np.stack([self.cells, following], axis=2)
        kept = self.cells >= 0
        edges, cell_side, count = np.unique(
            np.sort(ends[kept], axis=1), axis=0, return_inverse=True, return_counts=True
        )
        return edges, cell_side.reshape(-1), count

    def moved(self, points: np.ndarray) -> FlowMesh:
        """Return this mesh with its nodes at other places [m], shape (N, 3)."""
        return replace(self, points=points)

    def warnings(self) -> list[str]:
        """Return sentences about what makes an infiltration on this mesh doubtful.

        Doubled nodes and T-junctions part the flow where the eye sees one sheet; sides with more
        than two cells let it branch.
        """
        return [*self._doubled_nodes(), *self._junctions(), *self._branches()]

    def _doubled_nodes(self) -> Iterable[str]:
        shortest = np.linalg.norm(np.diff(self.points[self.edges], axis=1), axis=2).min()
        pairs = cKDTree(self.points).query_pairs(SAME_PLACE * shortest, output_type="ndarray")
        if len(pairs):
            yield (
                f"{len(pairs)} pairs of nodes lie at one place ({_rows('node', pairs[:, 0])}) and "
                "no resin flows between them; merge the nodes of the mesh, or keep them if the "
                "layers are meant to be apart"
            )

    def _junctions(self) -> Iterable[str]:
        edges, _, count = self._sides
        free = edges[count == 1]
        if not len(free):
            return
        rim = self.rim
        ends = self.points[free]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        tree = cKDTree(self.points[rim])
        near = tree.query_ball_point(ends.mean(axis=1), 0.5 * length)
        edge = np.repeat(np.arange(len(free)), [len(found) for found in near])
        node = rim[np.array([n for found in near for n in found], dtype=np.int64)]
        kept = (node != free[edge, 0]) & (node != free[edge, 1])
        edge, node = edge[kept], node[kept]
        along = ends[edge, 1] - ends[edge, 0]
        away = self.points[node] - ends[edge, 0]
        share = np.einsum("ki,ki->k", away, along) / length[edge] ** 2
        off = np.linalg.norm(away - share[:, None] * along, axis=1)
        hanging = (share > 1e-3) & (share < 1.0 - 1e-3) & (off < 1e-3 * length[edge])
        if hanging.any():
            nodes = np.unique(node[hanging])
            yield (
                f"{len(nodes)} nodes lie in the middle of a side of another cell "
                f"({_rows('node', nodes)}) and no resin flows across; mesh the part again with "
                "cells that meet corner to corner"
            )

    def _branches(self) -> Iterable[str]:
        edges, _, count = self._sides
        if (count > 2).any():
            nodes = np.unique(edges[count > 2])
            yield (
                f"{int((count > 2).sum())} sides have more than two cells "
                f"({_rows('node', nodes)}): the flow branches there; delete doubled cells, or keep "
                "them if ribs are meant"
            )


def _check_arrays(points: np.ndarray, cells: np.ndarray) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"points of a flow mesh have the shape (N, 3), not {points.shape}")
    if cells.ndim != 2 or cells.shape[1] != 4 or not len(cells):
        raise InputError(f"cells of a flow mesh have the shape (C, 4), not {cells.shape}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"the place of {_rows('node', bad)} is not a number")
    wrong = (cells[:, :3] < 0).any(axis=1) | (cells >= len(points)).any(axis=1)
    _few_cells(wrong | (cells[:, 3] < -1), f"name nodes that are not among the {len(points)}")
    filled = np.where(cells < 0, -1 - np.arange(4), cells)
    ordered = np.sort(filled, axis=1)
    doubled = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    _few_cells(doubled, "name a node twice", "; write a triangle by its three nodes")
    used = np.zeros(len(points), dtype=bool)
    used[cells[cells >= 0]] = True
    if not used.all():
        raise InputError(
            f"no cell uses {_rows('node', np.flatnonzero(~used))}; leave such nodes out"
        )


def _check_sets(kind: str, sets: Mapping[str, np.ndarray], count: int) -> None:
    for name, rows in sets.items():
        rows = np.asarray(rows)
        if len(rows) and (rows.min() < 0 or rows.max() >= count):
            raise InputError(f'the {kind} set "{name}" names rows beyond the {count} {kind}s')


def _few_cells(wrong: np.ndarray, what: str, remedy: str = "") -> None:
    if np.any(wrong):
        raise InputError(
            f"{int(np.sum(wrong))} cells {what} ({_rows('row', np.flatnonzero(wrong))}){remedy}"
        )


def _rows(called: str, numbers: np.ndarray, count: int = 5) -> str:
    shown = ", ".join(str(number) for number in numbers[:count])
    return f"{called} {shown}" + (", ..." if len(numbers) > count else "")


# --- Preform: thickness, porosity and permeability of every cell of a flow mesh -----------------


#: Factor on the permeability (C,) from the fibre volume fractions (C,) now and in the beginning.
PermeabilityFactor = Callable[[np.ndarray, np.ndarray], np.ndarray]


def kozeny_factor(now: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Factor on the permeability after Kozeny and Carman, (1 - v)³ / v² now over that before."""
    return ((1.0 - now) / (1.0 - before)) ** 3 * (before / now) ** 2


@dataclass(frozen=True)
class Preform:
    """Material of the cells of a flow mesh.

    Parameters
    ----------
    thickness : [m], shape (C,) or one number.
    porosity : share of the volume that resin can fill, between 0 and 1, shape (C,) or one number.
    permeability : [m2], symmetric tensors in space, shape (C, 3, 3); (3, 3) for all cells, or one
        number for an isotropic preform. Its part in the plane of the cell counts.
    through_permeability : permeability through the thickness [m2], shape (C,) or one number; None
        where nothing flows through the thickness.
    factor : how the permeability follows the fibre volume fraction of a preform that is
        compacted, see :data:`PermeabilityFactor`.

    Raises
    ------
    InputError : a thickness or permeability that is not positive, a porosity outside 0 to 1; the
        message names the first cells.
    """

    thickness: np.ndarray
    porosity: np.ndarray
    permeability: np.ndarray
    through_permeability: np.ndarray | None = None
    factor: PermeabilityFactor = kozeny_factor

    def __post_init__(self) -> None:
        given = [self.thickness, self.porosity, self.through_permeability]
        tensor = np.asarray(self.permeability, dtype=float)
        if tensor.ndim == 0:
            tensor = tensor * np.eye(3)
        count = max(
            [1 if value is None else np.size(value) for value in given]
            + [len(tensor) if tensor.ndim == 3 else 1]
        )
        tensor = np.array(np.broadcast_to(tensor, (count, 3, 3)))
        thickness, porosity, through = (
            None if value is None else np.array(np.broadcast_to(value, (count,)), dtype=float)
            for value in given
        )
        made = {
            "thickness": thickness, "porosity": porosity, "permeability": tensor,
            "through_permeability": through,
        }  # fmt: skip
        for name, value in made.items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        _refuse("thickness", self.thickness, ~(self.thickness > 0.0), "it has to be positive")
        _refuse(
            "porosity", self.porosity, ~((self.porosity > 0.0) & (self.porosity < 1.0)),
            "it lies between 0 and 1 (neither included); a fibre volume fraction of 1 or more "
            "leaves the resin no room",
        )  # fmt: skip
        tensor = self.permeability
        size = np.abs(tensor).max(axis=(1, 2))
        skew = np.abs(tensor - tensor.transpose(0, 2, 1)).max(axis=(1, 2))
        _refuse("permeability", skew, ~(skew <= 1e-9 * size), "the tensor has to be symmetric")
        least = np.linalg.eigvalsh(np.where(np.isfinite(tensor), tensor, -1.0))
        # In the plane two values count; the third may be 0 where nothing is known through it.
        _refuse(
            "permeability", least[:, 1], ~(least[:, 1] > 0.0) | (least[:, 0] < -1e-9 * size),
            "principal permeabilities in the plane have to be positive",
        )  # fmt: skip
        if self.through_permeability is not None:
            through = self.through_permeability
            _refuse("through_permeability", through, ~(through > 0.0), "it has to be positive")

    def of_cells(self, count: int) -> Preform:
        """Return this preform with values for each of so many cells.

        Raises
        ------
        InputError : it has values for another number of cells.
        """
        if len(self.thickness) == count:
            return self
        if len(self.thickness) != 1:
            raise InputError(
                f"the preform has values for {len(self.thickness)} cells, the mesh has {count}"
            )
        through = self.through_permeability
        return Preform(
            np.full(count, self.thickness[0]), np.full(count, self.porosity[0]),
            np.repeat(self.permeability, count, axis=0),
            None if through is None else np.full(count, through[0]), self.factor,
        )  # fmt: skip

    @classmethod
    def from_principal(
        cls,
        thickness: np.ndarray,
        porosity: np.ndarray,
        values: np.ndarray,
        axes: np.ndarray,
        *,
        factor: PermeabilityFactor = kozeny_factor,
    ) -> Preform:
        """Return a preform from principal permeabilities and their axes in the plane.

        Parameters
        ----------
        values : principal permeabilities [m2], shape (C, 2) or (C, 3); a third one is that
            through the thickness.
        axes : unit vectors, shape (C, 2, 3) or (C, 3, 3); their sign has no meaning.
        """
        values, axes = np.asarray(values, dtype=float), np.asarray(axes, dtype=float)
        tensor = np.einsum("cm,cmi,cmj->cij", values[:, :2], axes[:, :2], axes[:, :2])
        through = values[:, 2] if values.shape[1] > 2 else None
        return cls(thickness, porosity, tensor, through, factor)

    @classmethod
    def from_mapped(
        cls, mapped: xr.Dataset, *, frame: int = -1, factor: PermeabilityFactor = kozeny_factor
    ) -> Preform:
        """Return the preform that a mapping wrote: thickness, fibre content, permeability.

        Parameters
        ----------
        mapped : dataset with ``thickness``, ``fibre_volume_fraction``, ``permeability_1`` to
            ``_3`` and the vectors ``permeability_direction_1_x`` and so on, one value per face.
        frame : number of the saved state, of a dataset with a dimension ``time``.

        Raises
        ------
        InputError : a variable is missing (the message says which), a cell has no value.
        """
        needed = ["thickness", "fibre_volume_fraction", "permeability_1", "permeability_2"]
        needed += [f"permeability_direction_{m}_{axis}" for m in (1, 2) for axis in "xyz"]
        missing = [name for name in needed if name not in mapped]
        if missing:
            raise InputError(
                f"the mapped result lacks {', '.join(missing)}; give the scene a table "
                "[permeability] and map again"
            )

        def values(name: str) -> np.ndarray:
            array = mapped[name]
            return np.asarray((array.isel(time=frame) if "time" in array.dims else array).values)

        numbers = [m for m in (1, 2, 3) if f"permeability_{m}" in mapped]
        axes = np.stack(
            [
                np.stack([values(f"permeability_direction_{m}_{axis}") for axis in "xyz"], axis=1)
                for m in (1, 2)
            ],
            axis=1,
        )
        principal = np.stack([values(f"permeability_{m}") for m in numbers], axis=1)
        porosity = 1.0 - values("fibre_volume_fraction")
        return cls.from_principal(values("thickness"), porosity, principal, axes, factor=factor)


def _refuse(name: str, values: np.ndarray, wrong: np.ndarray, why: str) -> None:
    rows = np.flatnonzero(wrong)
    if len(rows):
        few = ", ".join(str(row) for row in rows[:5]) + (", ..." if len(rows) > 5 else "")
        raise InputError(
            f"{name} of {len(rows)} cells (row {few}) is {values[rows[0]]:.6g}: {why}",
            key=f"preform.{name}",
        )
