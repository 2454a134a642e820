"""Files of a mapping: netCDF (UGRID) and VTU, both complete or not at all."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import meshio
import numpy as np

from lcmchain.fields.ugrid import CONVENTIONS, TIME, UgridMesh, Variable, saved_times
from lcmchain.fields.vtu import vtk_blocks, write_mesh
from lcmchain.mapping.plies import described
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import Sheet, file_sha256
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.target.variables import (
    cell_data,
    cell_variables,
    node_variables,
    point_data,
)
from lcmchain.mapping.transfer import ERROR, PERMEABILITY, MappedFields
from lcmchain.mapping.weights import MappingWeights, Status

if TYPE_CHECKING:
    import xarray as xr

ALIGNMENT = (
    "largest eigenvalue of the mean of the tensors a a over the part of the sheet above the cell: "
    "1 where all directions a are parallel, 1/2 where they are spread evenly in a plane"
)
ERROR_MEANING = (
    "size of the difference to a mapping between twice finer meshes, with a quadratic between the "
    "faces of the sheet; of directions the angle, of the permeability the largest in any direction"
)
AT_NODES = "_at_nodes"
OF_NODES = "of the sheet at the place closest to the node; contents are not kept there"
SHEAR_ABOUT_CELL = (
    "a right angle minus the angle from the axis of fibre 1 to that of fibre 2 about the normal of "
    "the cell: where it points to the lower side of the sheet, the sign is not that of the sheet"
)


def mapped_dataset(
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    report: MappingReport,
    *,
    command: str,
) -> xr.Dataset:
    """Mapped fields as a UGRID dataset in the conventions of the forming result.

    Cells of a shell are faces of a two-dimensional mesh, cells of a solid volumes of a
    three-dimensional one; mid-side nodes of higher-order cells and nodes without a cell are left
    out. Numbers, parts and sets of the target are variables beside the fields.

    command : line that maps as this mapping did, for the history of the file.
    """
    mesh = UgridMesh("target", topology_dimension=3 if target.is_solid else 2)
    used, corners = compact(target.corners)
    width = 3 if not target.is_solid and np.all(corners[:, 3] < 0) else corners.shape[1]
    variables: dict[str, Variable] = {}
    if target.is_solid:
        variables |= mesh.volume_shapes(corners, long_name="shape of the volume")
    variables |= mesh.topology(
        corners[:, :width], long_name="mesh that received the forming fields"
    )
    variables |= mesh.node_positions(target.points[used])
    if sheet.time is not None:
        variables[TIME] = saved_times(np.asarray(sheet.time))
    for name, (values, attributes) in cell_fields(sheet, weights, mapped).items():
        variables[name] = mesh.on_cells(values, attributes)
    for name, (values, attributes) in cell_variables(target).items():
        variables[name] = mesh.on_cells(values, attributes)
    for name, (values, attributes) in {
        **node_variables(target),
        **_at_nodes(sheet, mapped),
    }.items():
        variables[name] = mesh.on_nodes(values[used], attributes)
    own = _global_attributes(sheet, target, report, command)
    return mesh.dataset(variables, {**sheet.provenance, **own})


def write_vtu(
    path: Path | str,
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
) -> None:
    """Write the mapped fields on the target mesh as VTU; directions and axes become vectors.

    All nodes of the target file are there, mid-side nodes and those without a cell too. Cells of a
    type that VTK does not have are joined by their corners alone.
    """
    data = {
        name: values
        for name, (values, _) in cell_fields(sheet, weights, mapped).items()
        if name[:-2] not in mapped.vectors
    }
    data |= mapped.vectors | cell_data(target)
    ends = np.cumsum([len(cells) for _, cells in target.blocks])[:-1]
    mesh = meshio.Mesh(
        target.points,
        vtk_blocks(target.blocks),
        cell_data={name: np.split(values, ends) for name, values in data.items()},
        point_data=point_data(target) | _point_fields(mapped),
    )
    write_mesh(path, mesh)


def _at_nodes(sheet: Sheet, mapped: MappedFields) -> dict:
    """Return values (N,) and attributes of every field at the nodes; none where not asked for."""
    if mapped.at_nodes is None:
        return {}
    fields = dict(mapped.at_nodes.scalars)
    for stem, vectors in mapped.at_nodes.vectors.items():
        for axis, values in zip("xyz", vectors.T, strict=True):
            fields[f"{stem}_{axis}"] = np.ascontiguousarray(values)
    return {
        f"{name}{AT_NODES}": (values, {**_attributes(sheet, name), "comment": OF_NODES})
        for name, values in fields.items()
    }


def _point_fields(mapped: MappedFields) -> dict[str, np.ndarray]:
    """Return the fields at the nodes for a VTU file, directions and axes as vectors."""
    if mapped.at_nodes is None:
        return {}
    found = mapped.at_nodes.scalars | mapped.at_nodes.vectors
    return {f"{name}{AT_NODES}": values for name, values in found.items()}


def cell_fields(sheet: Sheet, weights: MappingWeights, mapped: MappedFields) -> dict:
    """Return values (C,) and attributes of every cell variable, in the order of the file."""
    fields = {}
    for name, values in mapped.scalars.items():
        fields[name] = (values, _attributes(sheet, name))
    if "shear_angle" in fields and not mapped.about_sheet:
        fields["shear_angle"][1]["comment"] = SHEAR_ABOUT_CELL
    for name, found in mapped.directions.items():
        attributes = {
            "long_name": f"alignment of {name.replace('_', ' ')}",
            "units": "1",
            "comment": ALIGNMENT,
            "_FillValue": np.nan,
        }
        fields[f"{name}_alignment"] = (found.alignment, attributes)
    for stem, vectors in mapped.vectors.items():
        for axis, values in zip("xyz", vectors.T, strict=True):
            name = f"{stem}_{axis}"
            fields[name] = (np.ascontiguousarray(values), _attributes(sheet, name))
    for name, errors in mapped.errors.items():
        fields[f"{name}{ERROR}"] = (errors, _error_attributes(sheet, mapped, name))
    fields["mapping_status"] = (
        weights.status,
        {
            "long_name": "how the cell got its values",
            "units": "1",
            "flag_values": np.array([int(s) for s in Status], dtype=np.int8),
            "flag_meanings": " ".join(s.name.lower() for s in Status),
        },
    )
    fields["mapping_coverage"] = (
        weights.coverage,
        {
            "long_name": "share of the cell's area that the sheet covers (above 1 in folds)",
            "units": "1",
        },
    )
    fields["mapping_distance"] = (
        weights.distance,
        {
            "long_name": "distance of the cell's centroid from the sheet",
            "units": "m",
            "_FillValue": np.nan,
        },
    )
    return fields


def _error_attributes(sheet: Sheet, mapped: MappedFields, name: str) -> dict:
    if name in mapped.directions:
        units = "rad"
    else:
        units = "m2" if name == PERMEABILITY else sheet.attributes.get(name, {}).get("units", "1")
    return {
        "long_name": f"error that the mapping adds to {name.replace('_', ' ')}",
        "units": units,
        "comment": ERROR_MEANING,
        "_FillValue": np.nan,
    }


def _attributes(sheet: Sheet, name: str) -> dict:
    """Attributes of a field, and the value of cells without a sheet."""
    return {"long_name": name, "units": "1", **described(sheet, name), "_FillValue": np.nan}


def compact(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the used nodes, and the corner table that counts only these."""
    used, numbers = np.unique(corners[corners >= 0], return_inverse=True)
    renumbered = np.full(corners.shape, -1, dtype=np.int64)
    renumbered[corners >= 0] = numbers.reshape(-1)
    return used, renumbered


def _global_attributes(
    sheet: Sheet, target: TargetMesh, report: MappingReport, command: str
) -> dict:
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    step = f"{now} mapped by lcmchain {_version()}, as by: {command}"
    history = sheet.provenance.get("history", "")
    origin = {}
    if target.file is not None:
        name = target.file.name
        origin = {"target_file": name, "target_sha256": file_sha256(target.file)}
    of_part = f"{title}: " if (title := sheet.provenance.get("title")) else ""
    return {
        "Conventions": CONVENTIONS,
        "title": f"{of_part}forming fields on the {report.kind} mesh {report.name}",
        "history": f"{step}\n{history}".strip(),
        "source": f"lcmchain {_version()}, mapping",
        **origin,
        "mapping_method": report.method,
        "mapping_maximum_distance_m": report.maximum_distance,
        "mapping_target_coverage": report.target_coverage,
        "mapping_source_coverage": report.source_coverage,
        "mapping_warnings": "\n".join(report.warnings),
    }


def _version() -> str:
    from lcmchain import __version__

    return __version__
