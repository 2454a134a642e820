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
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.target import TargetMesh

FORMAT = 3

# A cell counts as covered from this share on: tangent planes and facets of two meshes of the same
# curved surface disagree by about (cell size / radius of curvature)^2.
COVERED = 0.99

# A face is tiled by the cells over it if their shares leave no more than rounding.
TILED = 1e-9

#: A ply that covers this share of what the others cover is there as a whole: the outlines of two
#: meshes of one curved shape differ by about as much.
WHOLE = 0.99


class Status(IntEnum):
    """How a target cell got its values."""

    INSIDE = 0  # its centroid lies within the thickness of the sheet, and the sheet covers it
    PROJECTED = 1  # covered, but off the sheet: values come along the normal
    EXTRAPOLATED = 2  # beyond the edge of the sheet, in part or whole: values of the nearest part
    UNMAPPED = 3  # no sheet within the maximum distance: not a number
    AMBIGUOUS = 4  # two layers of the sheet are about as near: values of the nearer one


@dataclass(frozen=True)
class MappingWeights:
    """Sparse weights from F sheet faces to C target cells, and how well each cell is covered.

    Parameters
    ----------
    cell, face : target cell and sheet face of each weight, shape (K,), by cell, then face.
    average : share of the face in the cell's average, shape (K,); sums to 1 for a mapped cell.
    content : share of the face's content (its fibre mass) that goes to the cell, shape (K,).
    place : centroid of what the cell takes of the face [m], in the face's frame and from its
        centroid, shape (K, 2).
    status : :class:`Status` of each cell, shape (C,).
    coverage : covered share of each cell's area, shape (C,).
    distance : distance [m] of each cell's centroid from the sheet, shape (C,); not a number
        where the cell is unmapped.
    cell_area : area [m2] of each cell (of a solid: of its section along the sheet), shape (C,).
    face_coverage : covered share of each face, shape (F,).
    missed : faces over the target from which no cell takes, as of folds that it lacks, shape (F,).
    wedge_correction : largest relative change of ``content`` that made it sum to the covered
        share of a face; rounding, unless the target bends more sharply than the sheet.
    moved : share of the whole content that was moved between neighbouring cells, so that each holds
        what the sheet has over its area (:mod:`lcmchain.mapping.surfaces.pairing`).
    order : 1 carries means of faces, 2 what varies linearly within them.
    solid_thickness, formed_thickness : of the target itself and of the textile, all plies, at each
        solid cell [m], shape (C,); empty for surfaces.
    ply_coverage : coverage of each cell by every ply, shape (P, C); empty for a single ply.
    """

    cell: np.ndarray
    face: np.ndarray
    average: np.ndarray
    content: np.ndarray
    place: np.ndarray
    status: np.ndarray
    coverage: np.ndarray
    distance: np.ndarray
    cell_area: np.ndarray
    face_coverage: np.ndarray
    missed: np.ndarray
    wedge_correction: float
    moved: float
    method: str
    order: int
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
    def start(self) -> np.ndarray:
        """First weight of each cell, shape (C + 1,)."""
        return np.searchsorted(self.cell, np.arange(self.cell_count + 1))

    @cached_property
    def content_centroid(self) -> np.ndarray:
        """Centroid of all parts of a wholly covered face [m], in its frame, shape (F, 2).

        It is that of the face, but where the shares had to be scaled. Zero for the others.
        """
        moments = [
            np.bincount(self.face, self.content * place, minlength=self.face_count)
            for place in self.place.T
        ]
        whole = self.face_coverage >= 1.0 - TILED
        return np.where(whole[:, None], np.stack(moments, axis=1), 0.0)

    @cached_property
    def average_matrix(self) -> csr_array:
        """Averages over the cell of what is constant within each face, shape (C, F)."""
        shape = (self.cell_count, self.face_count)
        return csr_array((self.average, self.face, self.start), shape=shape)

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


def half_thickness(sheet: Sheet) -> np.ndarray:
    """Distance from the mid-surface within which a point lies in the sheet [m], shape (F,)."""
    if "thickness" in sheet.scalars:
        return 0.5 * sheet.scalars["thickness"]
    return np.full(sheet.surface.face_count, 0.1 * sheet.surface.edge_length)


def present(coverage: np.ndarray) -> np.ndarray:
    """Which part of what covers each cell every ply covers, shape (P, C): 1 where all do.

    coverage : of each cell by every ply, shape (P, C).
    """
    capped = np.minimum(coverage, 1.0)
    most = capped.max(axis=0)
    part = np.where(most > 0.0, capped / np.where(most > 0.0, most, 1.0), 1.0)
    return np.where(part >= WHOLE, 1.0, part)
