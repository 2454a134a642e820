"""Files of a mapping: netCDF (UGRID) and VTU, each complete or not at all, and series over time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import meshio
import numpy as np

from lcmchain import __version__
from lcmchain.fields.netcdf_file import ROOT
from lcmchain.fields.ugrid import CONVENTIONS, TIME, UgridMesh, Variable, saved_times
from lcmchain.fields.vtu import frame_file, vtk_blocks, write_frame_list, write_mesh
from lcmchain.mapping.fields import ERROR, PERMEABILITY, MappedFields, turned
from lcmchain.mapping.frames import MappedFrame
from lcmchain.mapping.plies import described
from lcmchain.mapping.registration import Registration
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import Sheet, file_sha256
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.target.variables import (
    cell_data,
    cell_variables,
    node_variables,
    point_data,
)
from lcmchain.mapping.weights import MappingWeights, Status
from lcmchain.quantities.fields import FIELDS

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
    for name, (values, attributes) in _cell_fields(sheet, weights, mapped).items():
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
        for name, (values, _) in _cell_fields(sheet, weights, mapped).items()
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


def _cell_fields(sheet: Sheet, weights: MappingWeights, mapped: MappedFields) -> dict:
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
    fields = mapped.at_nodes.scalars | mapped.at_nodes.vectors
    return {f"{name}{AT_NODES}": values for name, values in fields.items()}


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
    step = f"{now} mapped by lcmchain {__version__}, as by: {command}"
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
        "source": f"lcmchain {__version__}, mapping",
        **origin,
        "mapping_method": report.method,
        "mapping_maximum_distance_m": report.maximum_distance,
        "mapping_target_coverage": report.target_coverage,
        "mapping_source_coverage": report.source_coverage,
        "mapping_warnings": "\n".join(report.warnings),
    }


# --- solids: their skin as the mesh that any reader opens, and all cells in a group ---------------
# A file holds them as the forming result holds its elements: in the root group only a
# two-dimensional mesh, since readers of UGRID files (xugrid, VTK, ugrid-checks) know no volumes.

SOLID = "solid"
SKIN = UgridMesh("skin")


def file_groups(dataset: xr.Dataset, target: TargetMesh) -> dict[str, xr.Dataset]:
    """Return the groups of the file that holds a mapping, by their path.

    Parameters
    ----------
    dataset : mapped fields on all cells of the target, as :func:`mapped_dataset` returns them.

    Returns
    -------
    groups : of a shell, the dataset at the root; of a solid, its skin at the root and the dataset
        in ``/solid``.
    """
    if not target.is_solid:
        return {ROOT: dataset}
    return {ROOT: _skin(dataset, target), SOLID: dataset}


def _skin(dataset: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """Outer faces with the values of the cells behind them."""
    faces, owners = target.skin
    # the dataset has the used corner nodes only, in ascending order
    used = np.unique(target.corners[target.corners >= 0])
    own, compact = np.unique(faces[faces >= 0], return_inverse=True)
    renumbered = np.full(faces.shape, -1, dtype=np.int64)
    renumbered[faces >= 0] = compact.reshape(-1)
    width = 3 if np.all(renumbered[:, 3] < 0) else 4
    variables = SKIN.topology(
        renumbered[:, :width], long_name="skin of the solid mesh that received the forming fields"
    )
    variables[SKIN.name][2]["skin_of"] = f"/{SOLID}"
    variables |= SKIN.node_positions(target.points[own])
    volume = UgridMesh("target", topology_dimension=3)
    nodes = np.searchsorted(used, own)
    told = "of the cell behind the face; all cells are in the group /solid"
    for name, variable in dataset.data_vars.items():
        about = dict(variable.attrs)
        if about.get("mesh") != volume.name:
            continue
        if variable.dims[-1:] == (volume.cell_dimension,):
            comment = f"{about.get('comment', '')}; {told}".removeprefix("; ")
            values = variable.values[..., owners]
            variables[str(name)] = SKIN.on_cells(values, about | {"comment": comment})
        elif variable.dims[-1:] == (volume.node_dimension,):
            variables[str(name)] = SKIN.on_nodes(variable.values[..., nodes], about)
    for name in dataset.coords:
        if name not in volume.coordinates:
            coordinate = dataset[name]
            about = dict(coordinate.attrs)
            variables[str(name)] = ([str(d) for d in coordinate.dims], coordinate.values, about)
    return SKIN.dataset(variables, dataset.attrs)


# --- a target that follows the material: netCDF over time, and a series for ParaView --------------


def write_frames(
    path: Path | str,
    dataset: xr.Dataset,
    frames: Iterable[MappedFrame],
    target: TargetMesh,
    motion: Registration | None,
) -> xr.Dataset:
    """Write every frame as VTU and the PVD file that lists them; return the fields over time.

    Parameters
    ----------
    path : of the PVD file; the frames lie in the folder ``<name>_frames`` beside it.
    dataset : the mapped fields in the frame of the weights.
    target : as its file has it, in that frame.
    motion : that brought the target to the sheet; what is written is moved back.

    Returns
    -------
    The dataset with the dimension ``time`` on every field, and with the motion of the nodes as
    ``reference_position`` (in the first frame) and ``displacement``, as in a forming result. What
    says how the cells were mapped is that of the weights, and the same at all times.
    """
    used, _ = compact(target.corners)
    mesh = UgridMesh("target", topology_dimension=3 if target.is_solid else 2)
    on_cells = [name for name, v in dataset.data_vars.items() if v.dims == (mesh.cell_dimension,)]
    times: list[float] = []
    positions: list[np.ndarray] = []
    values: dict[str, list[np.ndarray]] = {}
    for number, frame in enumerate(frames):
        frame = _moved_back(frame, motion)
        write_vtu(frame_file(path, number), frame.sheet, frame.target, frame.weights, frame.mapped)
        times.append(frame.time)
        positions.append(frame.target.points[used])
        fields = _cell_fields(frame.sheet, frame.weights, frame.mapped)
        for name in map(str, on_cells):
            of_mapping = name.startswith("mapping_") or name.endswith(ERROR)
            if not of_mapping and dataset[name].dtype.kind == "f":
                found = fields[name][0] if name in fields else np.full(target.cell_count, np.nan)
                values.setdefault(name, []).append(found)
    write_frame_list(path, times)

    over_time = dataset.drop_vars(TIME, errors="ignore")
    over_time = over_time.assign_coords({TIME: saved_times(np.array(times))})
    if TIME in dataset.variables:
        over_time.attrs["mapping_time_s"] = float(dataset[TIME])  # the state of the weights
    for name, series in values.items():
        over_time[name] = mesh.on_cells(np.stack(series), dataset[name].attrs)
    displacement = np.stack(positions) - positions[0]
    for name, vectors in (("reference_position", positions[0]), ("displacement", displacement)):
        field = FIELDS[name]
        for axis, variable in enumerate(field.variables):
            parts = np.ascontiguousarray(vectors[..., axis])
            over_time[variable] = mesh.on_nodes(parts, field.attributes(variable))
    return over_time


def _moved_back(frame: MappedFrame, motion: Registration | None) -> MappedFrame:
    if motion is None:
        return frame
    points = motion.restored(frame.target.points)
    mapped = turned(frame.mapped, motion.matrix.T)
    return replace(frame, target=replace(frame.target, points=points), mapped=mapped)
