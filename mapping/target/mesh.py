"""Target meshes: cells with place, tangent plane and area, and what their file calls them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mesh_files.shapes import (
    SOLID_CORNERS,
    SOLID_EDGES,
    SOLID_FACES,
    base_type,
    corner_count,
)


def _counted() -> np.ndarray:
    """What stands for numbers that the file does not have."""
    return np.empty(0, dtype=np.int64)


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
        return _radii(self.start, self.corners, self.centroids)


@routine
def _radii(start, corners, centroids):
    radii = np.zeros(len(centroids))
    for c in range(len(centroids)):
        for k in range(start[c], start[c + 1]):
            x, y, z = (
                corners[k, 0] - centroids[c, 0],
                corners[k, 1] - centroids[c, 1],
                corners[k, 2] - centroids[c, 2],
            )
            radii[c] = max(radii[c], np.sqrt(x * x + y * y + z * z))
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
    cell_ids: np.ndarray = field(default_factory=_counted)
    node_ids: np.ndarray = field(default_factory=_counted)
    cell_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, count in (("cell_ids", self.cell_count), ("node_ids", len(self.points))):
            given = getattr(self, name)
            ids = np.asarray(given) if len(given) else np.arange(1, count + 1)
            if ids.shape != (count,):
                raise ValueError(f"{name} has the shape {ids.shape}, not ({count},)")
            object.__setattr__(self, name, ids.astype(np.int64))

    def with_notes(self, notes: Iterable[str]) -> TargetMesh:
        """Return this mesh with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def by_corners(self) -> TargetMesh:
        """Return this mesh with its cells by their corners, and no other nodes.

        Mid-side nodes and nodes of no cell are left out, in sets too; numbers of the file stay.
        """
        used = np.unique(self.corners[self.corners >= 0])
        row = np.full(len(self.points), -1, dtype=np.int64)
        row[used] = np.arange(len(used))
        return replace(
            self,
            points=self.points[used],
            blocks=tuple(
                (base_type(name), row[cells[:, : corner_count(name)]])
                for name, cells in self.blocks
            ),
            node_ids=self.node_ids[used],
            node_sets={name: row[rows][row[rows] >= 0] for name, rows in self.node_sets.items()},
        )

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
        if not self.is_solid:
            return float(np.median(self.surface.face_radii))
        offset = self.points[self.corners] - self.centroids[:, None]
        distance = np.where(self.corners >= 0, np.linalg.norm(offset, axis=2), 0.0)
        return float(np.median(distance.max(axis=1)))

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the corners of the cells [m]."""
        used = self.points[np.unique(self.corners[self.corners >= 0])]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))

    @cached_property
    def skin(self) -> tuple[np.ndarray, np.ndarray]:
        """Outer faces of a solid: corner nodes (F, 4), -1 behind a triangle, and cells (F,)."""
        faces, owners = [], []
        first = 0
        for name, cells in self.blocks:
            for face in SOLID_FACES[base_type(name)]:
                table = np.full((len(cells), 4), -1, dtype=np.int64)
                table[:, : len(face)] = cells[:, face]
                faces.append(table)
                owners.append(first + np.arange(len(cells)))
            first += len(cells)
        every = np.concatenate(faces)
        _, number, count = np.unique(
            np.sort(every, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        outer = count[number.reshape(-1)] == 1
        return every[outer], np.concatenate(owners)[outer]

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
        if np.all(count == 3):
            corners = np.ascontiguousarray(surface.corners[:, :3]).reshape(-1, 3)
        else:
            corners = np.ascontiguousarray(surface.corners[np.arange(4) < count[:, None]])
        return CellPolygons(
            start=np.concatenate([[0], np.cumsum(count)]),
            corners=corners,
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
