"""Weights of a mapping: computed once per pair of meshes, stored, and used again for any field."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import dataclass, field, fields
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.intersection import intersect
from lcmchain.mapping.search import closest_points
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import CellPolygons, TargetMesh

METHODS = ("overlap", "closest")

# A cell counts as covered from this share on: tangent planes and facets of two meshes of the same
# curved surface disagree by about (cell size / radius of curvature)^2.
COVERED = 0.99

# A face whose nodes all lie over the target is taken as wholly covered when the intersections
# found at least this share of it; the rest fell into the wedges between neighbouring cells.
WEDGE = 0.5

FORMAT = 1


class Status(IntEnum):
    """How a target cell got its values."""

    INSIDE = 0  # its centroid lies within the thickness of the sheet, and the sheet covers it
    PROJECTED = 1  # covered, but off the sheet: values come along the normal
    EXTRAPOLATED = 2  # beyond the edge of the sheet, in part or whole: values of the nearest part
    UNMAPPED = 3  # no sheet within the maximum distance: not a number
    AMBIGUOUS = 4  # two walls of the sheet are equally near: it takes from one, or from both


@dataclass(frozen=True)
class MappingWeights:
    """Sparse weights from F sheet faces to C target cells, and how well each cell is covered.

    Parameters
    ----------
    cell, face : target cell and sheet face of each weight, shape (K,), by cell, then face.
    average : share of the face in the cell's average, shape (K,); sums to 1 for a mapped cell.
    content : share of the face's content (its fibre mass) that goes to the cell, shape (K,).
    status : :class:`Status` of each cell, shape (C,).
    coverage : covered share of each cell's area, shape (C,); above 1 where the sheet is folded.
    distance : distance [m] of each cell's centroid from the sheet, shape (C,); not a number
        where the cell is unmapped.
    cell_area : area [m2] of each cell (of a solid: of its section along the sheet), shape (C,).
    face_coverage : covered share of each face, shape (F,).
    wedge_correction : largest relative change of ``content`` that made it sum to the covered
        share of a face.
    solid_thickness, formed_thickness : of the target itself and of the textile, all plies, at each
        solid cell [m], shape (C,); empty for surfaces.
    ply_coverage : coverage of each cell by every ply, shape (P, C); empty for a single ply.
    """

    cell: np.ndarray
    face: np.ndarray
    average: np.ndarray
    content: np.ndarray
    status: np.ndarray
    coverage: np.ndarray
    distance: np.ndarray
    cell_area: np.ndarray
    face_coverage: np.ndarray
    wedge_correction: float
    method: str
    maximum_distance: float
    conservative: bool
    source_key: str
    target_key: str
    solid_thickness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    formed_thickness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ply_coverage: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def cell_count(self) -> int:
        return len(self.status)

    @property
    def face_count(self) -> int:
        return len(self.face_coverage)

    @property
    def mapped(self) -> np.ndarray:
        """Whether a cell has values, shape (C,)."""
        return self.status != Status.UNMAPPED

    @cached_property
    def average_matrix(self) -> csr_array:
        """Averages over the cell, shape (C, F)."""
        return self._matrix(self.average)

    @cached_property
    def content_matrix(self) -> csr_array:
        """Contents of faces handed to cells, shape (C, F)."""
        return self._matrix(self.content)

    def _matrix(self, values: np.ndarray) -> csr_array:
        start = np.concatenate([[0], np.cumsum(np.bincount(self.cell, minlength=self.cell_count))])
        shape = (self.cell_count, self.face_count)
        return csr_array((values, self.face, start), shape=shape)

    def save(self, path: Path | str) -> None:
        """Store as a compressed NumPy archive (``.npz``), complete or not at all."""
        arrays: dict[str, Any] = {
            entry.name: np.asarray(getattr(self, entry.name)) for entry in fields(self)
        }
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, format=FORMAT, **arrays)

    @classmethod
    def load(cls, path: Path | str) -> MappingWeights:
        """Read stored weights.

        Raises
        ------
        InputError : the file is absent or holds no mapping weights.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                if int(archive["format"]) != FORMAT:
                    raise InputError("weights of another version; compute them anew", file=path)
                values = {entry.name: archive[entry.name] for entry in fields(cls)}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise InputError(f"no stored mapping weights ({error})", file=path) from None
        for name, value in values.items():
            if value.ndim == 0:
                values[name] = value.item()
        return cls(**values)

    def check_meshes(self, sheet: Sheet, target: TargetMesh, *, file: Path | str) -> None:
        """Raise InputError unless the weights belong to this sheet and this target."""
        for what, stored, given in (
            ("sheet", self.source_key, mesh_key(sheet.surface.points, sheet.surface.faces)),
            ("target mesh", self.target_key, mesh_key(target.points, target.corners)),
        ):
            if stored != given:
                raise InputError(
                    f"these weights were computed for another {what}; delete the file to compute "
                    "them anew",
                    file=file,
                )


def mesh_key(points: np.ndarray, cells: np.ndarray) -> str:
    """Fingerprint of a mesh: its node positions and connectivity."""
    digest = hashlib.sha256()
    digest.update(np.ascontiguousarray(points, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(cells, dtype="<i8").tobytes())
    return digest.hexdigest()[:32]


def default_maximum_distance(sheet: Sheet, target: TargetMesh) -> float:
    """Distance [m] up to which a cell and the sheet count as the same part.

    One edge length of the sheet, or the radius of a typical cell where that is larger: flat cells
    cut the corners of a curved part by a fraction of their size. Cells larger than the whole sheet
    have no corners to cut, more likely a wrong unit of length, and do not widen the search.
    """
    edge_length, radius = sheet.surface.edge_length, target.cell_radius
    larger_than_sheet = radius > 0.5 * sheet.surface.size * (1.0 + 1e-9)
    return edge_length if larger_than_sheet else max(edge_length, radius)


def compute_weights(
    sheet: Sheet,
    target: TargetMesh,
    *,
    method: str = "overlap",
    maximum_distance: float | None = None,
) -> MappingWeights:
    """Compute the weights that carry face fields of a sheet to the cells of a target.

    Parameters
    ----------
    method : ``"overlap"`` averages over the part of the sheet that lies over the cell, measured
        on the cell's tangent plane; ``"closest"`` takes the face closest to the cell's centroid.
    maximum_distance : how far [m] from the sheet a cell may lie; by default one edge length of
        the sheet, or the radius of a typical cell where that is larger.

    Raises
    ------
    InputError : unknown method or a distance that is not positive.
    """
    if method not in METHODS:
        raise InputError(f'"{method}" is no mapping method; write one of {", ".join(METHODS)}')
    if target.is_solid and method == "overlap":
        from lcmchain.mapping.solids.weights import compute_solid_weights

        return compute_solid_weights(sheet, target, maximum_distance=maximum_distance)
    if sheet.is_stack:
        from lcmchain.mapping.plies import weights_of_plies

        return weights_of_plies(
            sheet,
            lambda ply: compute_weights(
                ply, target, method=method, maximum_distance=maximum_distance
            ),
        )
    if maximum_distance is None:
        maximum_distance = default_maximum_distance(sheet, target)
    if not (np.isfinite(maximum_distance) and maximum_distance > 0.0):
        raise InputError(f"maximum_distance has to be positive, not {maximum_distance} m")
    surface = sheet.surface
    closest = closest_points(surface, target.centroids, maximum_distance)
    cells = target.polygons(surface.normals[np.maximum(closest.face, 0)])
    conservative = method == "overlap" and not target.is_solid
    if method == "overlap":
        found = intersect(surface, cells, maximum_distance)
        cell, face, part = found.cell, found.face, found.face_part
        covered = np.bincount(cell, weights=found.area, minlength=target.cell_count)
        coverage = covered / np.where(cells.areas > 0.0, cells.areas, 1.0)
        average = found.area / covered[cell]
        over = coverage > 0.0
    else:
        coverage = np.where(closest.beside, 0.0, 1.0)
        over = np.zeros(target.cell_count, dtype=bool)
        cell, face = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        average, part = np.empty(0), np.empty(0)

    face_coverage, content, correction = _face_coverage(
        surface, target, cells, face, part, maximum_distance, conservative
    )

    # Cells without an overlap take the closest face, if one is near.
    alone = np.flatnonzero(~over & (closest.face >= 0))
    cell = np.concatenate([cell, alone])
    face = np.concatenate([face, closest.face[alone]])
    average = np.concatenate([average, np.ones(len(alone))])
    content = np.concatenate([content, np.zeros(len(alone))])
    order = np.lexsort((face, cell))

    status = np.full(target.cell_count, Status.UNMAPPED, dtype=np.int8)
    status[over | (closest.face >= 0)] = Status.EXTRAPOLATED
    if method == "overlap":
        whole = coverage >= COVERED
    else:
        whole = ~closest.beside
    status[whole] = Status.PROJECTED
    status[whole & (closest.distance <= half_thickness(sheet)[closest.face])] = Status.INSIDE
    # A cell that is covered although its centroid found no face lies where the overlap found it.
    distance = closest.distance.copy()
    if method == "overlap":
        height = np.bincount(found.cell, weights=found.area * found.height, minlength=len(distance))
        by_overlap = over & (closest.face < 0)
        distance[by_overlap] = (height / np.where(covered > 0.0, covered, 1.0))[by_overlap]
    distance[status == Status.UNMAPPED] = np.nan
    return MappingWeights(
        cell=cell[order],
        face=face[order],
        average=average[order],
        content=content[order],
        status=status,
        coverage=coverage,
        distance=distance,
        cell_area=cells.areas,
        face_coverage=face_coverage,
        wedge_correction=correction,
        method=method,
        maximum_distance=float(maximum_distance),
        conservative=conservative,
        source_key=mesh_key(surface.points, surface.faces),
        target_key=mesh_key(target.points, target.corners),
    )


def half_thickness(sheet: Sheet) -> np.ndarray:
    """Distance from the mid-surface within which a point lies in the sheet [m], shape (F,)."""
    if "thickness" in sheet.scalars:
        return 0.5 * sheet.scalars["thickness"]
    return np.full(sheet.surface.face_count, 0.1 * sheet.surface.edge_length)


def _face_coverage(
    surface: Surface,
    target: TargetMesh,
    cells: CellPolygons,
    face: np.ndarray,
    part: np.ndarray,
    maximum_distance: float,
    conservative: bool,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Covered share of each face; shares of its content by cell; largest correction of these.

    Where the target bends, the prisms over neighbouring cells leave or share a thin wedge, so
    the shares of a wholly covered face do not sum to one. They are scaled until they do: no
    fibre is lost or made.
    """
    found = np.bincount(face, weights=part, minlength=surface.face_count)
    nodes_over = _nodes_over_target(surface, target, cells, maximum_distance)
    corner = np.where(surface.faces < 0, surface.faces[:, 2:3], surface.faces)
    over = nodes_over[corner].mean(axis=1)
    if len(face) == 0:  # closest-cell weights have no areas: count the corners over the target
        return over, np.zeros(0), 0.0
    whole = (over == 1.0) & (found >= WEDGE)
    face_coverage = np.where(whole, 1.0, np.minimum(found, 1.0))
    scale = face_coverage / np.where(found > 0.0, found, 1.0)
    correction = float(np.abs(scale[found > 0.0] - 1.0).max()) if conservative else 0.0
    return face_coverage, part * scale[face], correction


def _nodes_over_target(
    surface: Surface, target: TargetMesh, cells: CellPolygons, maximum_distance: float
) -> np.ndarray:
    """Whether each node of the sheet projects onto the target, shape (N,)."""
    skin = target.surface if not target.is_solid else _surface_of_sections(cells)
    if skin.face_count == 0:
        return np.zeros(len(surface.points), dtype=bool)
    closest = closest_points(skin, surface.points, maximum_distance)
    if target.is_solid:
        # Sections of neighbouring solids share no nodes: every edge would count as the part's.
        return closest.face >= 0
    return (closest.face >= 0) & ~closest.beside


def _surface_of_sections(cells: CellPolygons) -> Surface:
    triangles = [
        (first, first + k, first + k + 1, -1)
        for first, end in zip(cells.start[:-1], cells.start[1:], strict=True)
        for k in range(1, end - first - 1)
    ]
    return Surface(cells.corners, np.array(triangles, dtype=np.int64).reshape(-1, 4))
