"""The interface at which a simulation gives and takes fields: its cells, or patches of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fields.ugrid import CONVENTIONS, UgridMesh
from lcmchain.mapping.patch_fields import PatchFields
from lcmchain.mapping.patches import Patches, centres_of, group_cells, shared_edges
from lcmchain.mapping.surface import Surface

if TYPE_CHECKING:
    import xarray as xr

MESH = UgridMesh("interface")
#: Dimension of the values that are exchanged, and the variable that says which face has which.
VALUES = "interface_patch_count"
PATCH = "interface_patch"


@dataclass(frozen=True)
class Interface:
    """Cells of a sheet, each in a patch that has one value of every field.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    cells : node rows of triangles and quadrilaterals, shape (C, 4); a triangle has -1 last.
    patches : of the cells; as many as cells where the fields are those of the cells.
    part : labels that patches do not mix, such as plies, shape (C,).
    """

    points: np.ndarray
    cells: np.ndarray
    patches: Patches
    part: np.ndarray | None = None

    @classmethod
    def of_mesh(
        cls,
        points: np.ndarray,
        cells: np.ndarray,
        count: int = 0,
        *,
        part: np.ndarray | None = None,
    ) -> Interface:
        """Return the interface with ``count`` patches, or with every cell by itself (0).

        Raises
        ------
        InputError : a negative count, or fewer patches than the sheet has loose pieces.
        """
        points = np.ascontiguousarray(points, dtype=float)
        cells = np.ascontiguousarray(cells, dtype=np.int64)
        if cells.shape[1] == 3:
            cells = np.hstack([cells, np.full((len(cells), 1), -1, dtype=np.int64)])
        if count == 0:
            return cls(points, cells, Patches.of_single_cells(len(cells)), part)
        areas = Surface(points, cells).areas
        return cls(points, cells, group_cells(points, cells, count, areas=areas, part=part), part)

    @property
    def size(self) -> int:
        """Number of values of a field."""
        return self.patches.count

    @cached_property
    def is_coarse(self) -> bool:
        """Whether fields are not simply those of the cells in their order."""
        return not np.array_equal(self.patches.of_cell, np.arange(len(self.cells)))

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.points, self.cells)

    @cached_property
    def fields(self) -> PatchFields:
        """Transfer of fields between the cells and the interface."""
        neighbours = shared_edges(self.cells, self.part)
        centres = centres_of(self.points, self.cells)
        return PatchFields(self.patches, centres, self.surface.areas, neighbours)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return the value of each cell's patch, (P,) to (C,)."""
        return values[self.patches.of_cell]

    def dataset(self, attributes: Mapping[str, Any] | None = None) -> xr.Dataset:
        """Return the interface as a UGRID mesh of its cells, with the patch of each.

        attributes : of the file.
        """
        of_cells = "cell" if not self.is_coarse else "patch of cells"
        number = {
            "long_name": f"place of the {of_cells}, from 0, in the fields that are exchanged",
            "units": "1",
        }
        variables = {
            **MESH.topology(self.cells, long_name="interface, undeformed"),
            **MESH.node_positions(self.points),
            PATCH: MESH.on_cells(self.patches.of_cell.astype(np.int32), number),
            "interface_patch_area": (
                VALUES, self.fields.patch_areas, {"units": "m2", "long_name": "area of patch"},
            ),
        }  # fmt: skip
        if self.part is not None:
            label = {"units": "1", "long_name": "part that patches do not mix"}
            variables["interface_part"] = MESH.on_cells(self.part.astype(np.int32), label)
        for axis, values in zip("xyz", self.fields.patch_centres.T, strict=True):
            text = {"units": "m", "long_name": f"{axis} coordinate of the middle of patch"}
            variables[f"interface_patch_{axis}"] = (VALUES, values, text)
        return MESH.dataset(variables, {"Conventions": CONVENTIONS, **(attributes or {})})

    def write(self, path: Path | str, attributes: Mapping[str, Any] | None = None) -> None:
        """Write :meth:`dataset` as netCDF, whole or not at all.

        Raises
        ------
        InputError : the place cannot be written.
        """
        write_netcdf(path, {ROOT: self.dataset(attributes)})


def read_interface(path: Path | str) -> Interface:
    """Read an interface that :meth:`Interface.write` has written; it comes back bit-identical.

    Raises
    ------
    InputError : no such file, or none of an interface.
    """
    try:
        with open_netcdf(path, decode_cf=False) as dataset:
            points = np.stack([dataset[name].values for name in MESH.coordinates], axis=1)
            cells = dataset[MESH.cell_nodes].values.astype(np.int64)
            of_cell = dataset[PATCH].values
            count = dataset.sizes[VALUES]
            part = dataset["interface_part"].values if "interface_part" in dataset else None
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"this is no interface of a unit ({error})", file=path) from None
    return Interface(points, cells, Patches(of_cell, count), part)
