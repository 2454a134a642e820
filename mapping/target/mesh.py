"""Target meshes: any file that meshio reads, as cells with a place, a tangent plane and an area."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import meshio
import numpy as np

from lcmchain.errors import InputError, shortened
from lcmchain.mapping.first_few import first_few
from lcmchain.mapping.surface import Surface

# Corner count of the cells that are understood; the further nodes of higher-order cells are kept
# in the file but play no part in the geometry.
SURFACE_CORNERS = {"triangle": 3, "quad": 4}
SOLID_CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}

SOLID_EDGES = {
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "pyramid": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}

KINDS = ("infiltration", "structure")

# A cell that is thinner than this part of its length is none.
FLATNESS = 1e-7

# Stands for numbers that the file does not have.
_COUNTED = np.empty(0, dtype=np.int64)

# Farthest place of a node [m] that squares and products of lengths can be computed with.
FARTHEST = 1e9


@dataclass(frozen=True)
class CellPolygons:
    """One plane-like polygon per target cell: the shell cell itself, or a section of the solid.

    ``corners`` of cell c are rows ``start[c]`` to ``start[c + 1] - 1``, counter-clockwise about
    the unit normal; fewer than three rows mark a cell without area. Lengths in m.
    """

    start: np.ndarray  # (C + 1,)
    corners: np.ndarray  # (P, 3)
    centroids: np.ndarray  # (C, 3)
    normals: np.ndarray  # (C, 3)
    areas: np.ndarray  # (C,)

    @cached_property
    def radii(self) -> np.ndarray:
        """Largest distance from each cell's centroid to its corners, shape (C,)."""
        counts = np.diff(self.start)
        owner = np.repeat(np.arange(len(counts)), counts)
        radii = np.zeros(len(counts))
        distance = np.linalg.norm(self.corners - self.centroids[owner], axis=1)
        np.maximum.at(radii, owner, distance)
        return radii


@dataclass(frozen=True)
class TargetMesh:
    """Mesh that receives forming fields, one value per cell.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    blocks : cell type (meshio's name) and node numbers of each block; all surface or all solid.
    ignored : number of cells left aside, by type (points, lines, the skin of a solid).
    cell_ids, node_ids : numbers of cells (C,) and nodes (N,) in the file; counted from 1, without
        gaps, where it has none.
    cell_sets, node_sets : rows of the cells and nodes of each named set, ascending.
    parts : rows of the cells of each part, property, block or region of the file; a cell belongs
        to one part at most.
    notes : sentences about what the file holds and this mesh does not.
    """

    points: np.ndarray
    blocks: tuple[tuple[str, np.ndarray], ...]
    ignored: dict[str, int]
    file: Path | None = None
    cell_ids: np.ndarray = field(default_factory=lambda: _COUNTED)
    node_ids: np.ndarray = field(default_factory=lambda: _COUNTED)
    cell_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, count in (("cell_ids", self.cell_count), ("node_ids", len(self.points))):
            given = getattr(self, name)
            ids = np.arange(1, count + 1) if given is _COUNTED else np.asarray(given)
            if ids.shape != (count,):
                raise ValueError(f"{name} has the shape {ids.shape}, not ({count},)")
            object.__setattr__(self, name, ids.astype(np.int64))

    @property
    def cell_count(self) -> int:
        return sum(len(cells) for _, cells in self.blocks)

    @property
    def is_solid(self) -> bool:
        return base_type(self.blocks[0][0]) in SOLID_CORNERS

    @cached_property
    def corners(self) -> np.ndarray:
        """Corner node numbers, shape (C, 4) of a surface or (C, 8) of a solid, filled with -1."""
        filled = np.full((self.cell_count, 8 if self.is_solid else 4), -1, dtype=np.int64)
        row = 0
        for name, cells in self.blocks:
            count = corner_count(name)
            filled[row : row + len(cells), :count] = cells[:, :count]
            row += len(cells)
        return filled

    @cached_property
    def surface(self) -> Surface:
        """The cells of a surface mesh as a faceted sheet."""
        return Surface(self.points, self.corners)

    @cached_property
    def centroids(self) -> np.ndarray:
        """Means of the corners [m], shape (C, 3)."""
        used = self.corners >= 0
        summed = np.where(used[:, :, None], self.points[self.corners], 0.0).sum(axis=1)
        return summed / used.sum(axis=1)[:, None]

    @cached_property
    def cell_radius(self) -> float:
        """Median over the cells of the distance from the centroid to the farthest corner [m]."""
        offset = self.points[self.corners] - self.centroids[:, None]
        distance = np.where(self.corners >= 0, np.linalg.norm(offset, axis=2), 0.0)
        return float(np.median(distance.max(axis=1)))

    def polygons(self, sheet_normals: np.ndarray) -> CellPolygons:
        """One polygon per cell; a solid is cut through its centroid.

        Parameters
        ----------
        sheet_normals : normal of the sheet closest to each cell, shape (C, 3): a solid is cut
            perpendicular to it, so that the section runs along the sheet.
        """
        if self.is_solid:
            return self._sections(sheet_normals)
        surface = self.surface
        count = np.where(surface.areas > 0.0, 3 + surface.is_quadrilateral, 0)
        used = np.arange(4) < count[:, None]
        return CellPolygons(
            start=np.concatenate([[0], np.cumsum(count)]),
            corners=np.ascontiguousarray(surface.corners[used]),
            centroids=surface.centroids,
            normals=surface.normals,
            areas=surface.areas,
        )

    def _sections(self, normals: np.ndarray) -> CellPolygons:
        count = np.zeros(self.cell_count, dtype=np.int64)
        areas = np.zeros(self.cell_count)
        polygons = []
        cell = 0
        for name, cells in self.blocks:
            edges = np.array(SOLID_EDGES[base_type(name)])
            for nodes in cells:
                polygon = section(
                    self.points[nodes[: corner_count(name)]], edges, self.centroids[cell],
                    normals[cell],
                )  # fmt: skip
                if len(polygon) >= 3:
                    spokes = polygon - polygon[0]
                    cross = np.cross(spokes[1:-1], spokes[2:]).sum(axis=0)
                    areas[cell] = 0.5 * np.linalg.norm(cross)
                    count[cell] = len(polygon) if areas[cell] > 0.0 else 0
                    if count[cell]:
                        polygons.append(polygon)
                cell += 1
        return CellPolygons(
            start=np.concatenate([[0], np.cumsum(count)]),
            corners=np.concatenate(polygons) if polygons else np.empty((0, 3)),
            centroids=self.centroids,
            normals=np.ascontiguousarray(normals),
            areas=areas,
        )


def section(
    corners: np.ndarray, edges: np.ndarray, origin: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """Section of a convex solid by a plane [m], shape (K, 3), ordered about the normal."""
    height = (corners - origin) @ normal
    a, b = edges[:, 0], edges[:, 1]
    cut = (height[a] > 0.0) != (height[b] > 0.0)
    a, b = a[cut], b[cut]
    if len(a) < 3:
        return np.empty((0, 3))
    share = height[a] / (height[a] - height[b])
    points = corners[a] + share[:, None] * (corners[b] - corners[a])
    spokes = points - points.mean(axis=0)
    first = spokes[np.argmax(np.einsum("ki,ki->k", spokes, spokes))]
    angle = np.arctan2(spokes @ np.cross(normal, first), spokes @ first)
    return points[np.argsort(angle, kind="stable")]


def base_type(name: str) -> str:
    """Cell shape of a meshio type: ``hexahedron20`` is a ``hexahedron``."""
    return name.rstrip("0123456789")


def corner_count(name: str) -> int:
    shape = base_type(name)
    return SURFACE_CORNERS.get(shape) or SOLID_CORNERS[shape]


def read_target(path: Path | str, *, kind: str = "structure", length_unit: str = "m") -> TargetMesh:
    """Read a target mesh.

    Parameters
    ----------
    path : any mesh file that meshio reads.
    kind : ``"infiltration"`` takes triangles and quadrilaterals; ``"structure"`` takes solids
        where the file has them (its surface cells are then boundary patches), else shells.
    length_unit : unit of the coordinates in the file.

    Raises
    ------
    InputError : the file is absent or unreadable, the unit is not a length, the file has no cells
        of the kind, or cells that are none: nodes that do not exist, no area or volume.
    """
    path = Path(path)
    if kind not in KINDS:
        raise InputError(f'kind is "{kind}"; write one of {", ".join(KINDS)}', file=path)
    mesh = _read_mesh(path)
    surface = [block for block in mesh.cells if base_type(block.type) in SURFACE_CORNERS]
    solid = [block for block in mesh.cells if base_type(block.type) in SOLID_CORNERS]
    chosen = solid if (kind == "structure" and solid) else surface
    if not any(len(block.data) for block in chosen):
        found = ", ".join(sorted({block.type for block in mesh.cells})) or "none"
        wanted = "triangles or quadrilaterals" if kind == "infiltration" else "shells or solids"
        raise InputError(
            f"the mesh has no {wanted} to map onto (cell types found: {found})", file=path
        )
    points = _points_in_space(mesh.points, path) * _length_factor(length_unit, path)
    ignored: dict[str, int] = {}
    for block in mesh.cells:
        if not any(block is one for one in chosen):
            ignored[block.type] = ignored.get(block.type, 0) + len(block.data)
    blocks = tuple((b.type, np.asarray(b.data, dtype=np.int64)) for b in chosen if len(b.data))
    first = 0
    for name, cells in blocks:
        _require_whole_cells(points, name, cells, first, path)
        first += len(cells)
    return TargetMesh(points, blocks, ignored, path)


def _points_in_space(points: np.ndarray, path: Path) -> np.ndarray:
    """Points with three coordinates, shape (N, 3); those of a plane mesh have z = 0."""
    given = np.asarray(points)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or given.dtype.kind not in "fiu":
        raise InputError("the mesh has no nodes with x, y and z", file=path)
    placed = np.zeros((len(given), 3))
    placed[:, : given.shape[1]] = given
    return placed


def _require_whole_cells(
    points: np.ndarray, name: str, cells: np.ndarray, first: int, path: Path
) -> None:
    """Refuse cells of a block that are none; ``first`` is the number of its first cell."""

    def refuse(wrong: np.ndarray | np.bool, what: str) -> None:
        if wrong.any():
            numbers = first + np.flatnonzero(wrong)
            raise InputError(
                f"{len(numbers)} {name} cells have {what} ({first_few(numbers)}); the mesh is "
                "broken, export or mesh it again",
                file=path,
            )

    if cells.ndim != 2 or cells.shape[1] < corner_count(name):
        raise InputError(f"{name} cells have too few nodes; the mesh is broken", file=path)
    refuse(((cells < 0) | (cells >= len(points))).any(axis=1), "nodes that do not exist")
    corners = points[cells[:, : corner_count(name)]]
    refuse(~np.isfinite(corners).all(axis=(1, 2)), "nodes at places that are not finite")
    refuse((np.abs(corners) > FARTHEST).any(axis=(1, 2)), f"nodes beyond {FARTHEST:g} m")
    offset = corners - corners.mean(axis=1, keepdims=True)
    if base_type(name) in SOLID_CORNERS:
        spread = np.linalg.eigvalsh(np.einsum("cki,ckj->cij", offset, offset))
        refuse(spread[:, 0] <= FLATNESS**2 * spread[:, 2], "no volume")
    else:
        doubled = np.cross(offset[:, 2] - offset[:, 0], offset[:, -1] - offset[:, 1])
        size = np.linalg.norm(offset, axis=2).max(axis=1)
        refuse(np.linalg.norm(doubled, axis=1) <= FLATNESS * size**2, "no area")


def _length_factor(length_unit: str, path: Path) -> float:
    if length_unit == "m":
        return 1.0  # spares the time to set up a table of units
    from lcmchain.quantities.units import QuantityError, length_factor

    try:
        return length_factor(length_unit)
    except QuantityError as error:
        raise InputError(f"length_unit: {error}", file=path) from None


def _read_mesh(path: Path) -> meshio.Mesh:
    if path.is_dir():
        raise InputError("this is a folder; name the mesh file in it", file=path)
    if not path.is_file():
        raise InputError("the target mesh does not exist", file=path)
    said = io.StringIO()
    try:
        # meshio prints its reasons and ends the process; here they become one error.
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = said.getvalue().strip() or str(error) or type(error).__name__
        reason = shortened(" ".join(reason.replace("Error: ", "").split()), 300)
        known = ", ".join(sorted(meshio.extension_to_filetypes))
        raise InputError(
            f"meshio cannot read the target mesh ({reason}); it knows files ending in {known}",
            file=path,
        ) from None
