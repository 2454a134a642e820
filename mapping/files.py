"""Files of a mapping: netCDF (UGRID) and VTU, both complete or not at all."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import xarray as xr

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import MappedFields
from lcmchain.mapping.weights import MappingWeights, Status

# Flags of UGRID 1.0 for the shape of volumes.
VOLUME_SHAPES = {4: 0, 5: 1, 6: 2, 8: 3}
VOLUME_MEANINGS = "tetrahedron pyramid wedge hexahedron"

MESH = "target"


def mapped_dataset(
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    report: MappingReport,
) -> xr.Dataset:
    """Mapped fields as a UGRID dataset in the conventions of the forming result.

    Cells of a shell are faces of a two-dimensional mesh, cells of a solid volumes of a
    three-dimensional one; mid-side nodes of higher-order cells are left out.
    """
    location = "volume" if target.is_solid else "face"
    dimension = f"{MESH}_{location}"
    used, corners = _compact(target.corners)
    points = target.points[used]
    coordinates = [f"{MESH}_node_{axis}" for axis in "xyz"]
    connectivity = f"{MESH}_{location}_nodes"
    topology = {
        "cf_role": "mesh_topology",
        "long_name": "mesh that received the forming fields",
        "topology_dimension": np.int32(3 if target.is_solid else 2),
        "node_coordinates": " ".join(coordinates),
        f"{location}_node_connectivity": connectivity,
        f"{location}_dimension": dimension,
    }
    variables: dict[str, tuple] = {}
    if target.is_solid:
        topology["volume_shape_type"] = f"{MESH}_volume_shape"
        shapes = np.array([VOLUME_SHAPES[n] for n in (corners >= 0).sum(axis=1)], dtype=np.int8)
        variables[f"{MESH}_volume_shape"] = (
            dimension,
            shapes,
            {
                "cf_role": "volume_shape_type",
                "long_name": "shape of the volume",
                "flag_values": np.arange(4, dtype=np.int8),
                "flag_meanings": VOLUME_MEANINGS,
            },
        )
    width = 3 if not target.is_solid and np.all(corners[:, 3] < 0) else corners.shape[1]
    variables[MESH] = ((), np.int32(0), topology)
    variables[connectivity] = (
        (dimension, f"{MESH}_{location}_corner"),
        corners[:, :width].astype(np.int32),
        {
            "cf_role": f"{location}_node_connectivity",
            "long_name": f"nodes of each {location}",
            "start_index": np.int32(0),
            "_FillValue": np.int32(-1),
        },
    )
    for axis, values in zip("xyz", points.T, strict=True):
        attributes = {
            "units": "m",
            "long_name": f"{axis} coordinate of node",
            "standard_name": "height" if axis == "z" else f"projection_{axis}_coordinate",
        }
        variables[f"{MESH}_node_{axis}"] = (f"{MESH}_node", values, attributes)

    place = {"mesh": MESH, "location": location}
    for name, (values, attributes) in _cell_fields(sheet, weights, mapped).items():
        variables[name] = (dimension, values, {**attributes, **place})

    dataset = xr.Dataset(variables)
    dataset = dataset.set_coords(coordinates)
    dataset.attrs = {**sheet.provenance, **_global_attributes(sheet, target, report)}
    return dataset


def write_netcdf(path: Path | str, dataset: xr.Dataset) -> None:
    """Write a mapped dataset as netCDF-4, numbers in double precision without loss."""
    encoding: dict[str, dict] = {}
    for name, variable in dataset.variables.items():
        options = {} if "_FillValue" in variable.attrs else {"_FillValue": None}
        if variable.ndim:
            options |= {"zlib": True, "complevel": 4, "shuffle": True}
        encoding[name] = options
    with replacing(path) as temporary:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def write_vtu(
    path: Path | str,
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
) -> None:
    """Write the mapped fields on the target mesh as VTU; fibre directions become vectors."""
    data = {
        name: values
        for name, (values, _) in _cell_fields(sheet, weights, mapped).items()
        if not any(name.startswith(f"{stem}_") for stem in mapped.directions)
    }
    for name, family in mapped.directions.items():
        data[name] = family.direction
    ends = np.cumsum([len(cells) for _, cells in target.blocks])[:-1]
    mesh = meshio.Mesh(
        target.points,
        [(name, cells) for name, cells in target.blocks],
        cell_data={name: np.split(values, ends) for name, values in data.items()},
    )
    with replacing(path) as temporary:
        try:
            meshio.write(temporary, mesh, file_format="vtu")
        except (meshio.WriteError, KeyError) as error:
            raise InputError(f"meshio cannot write this mesh as VTU ({error})", file=path) from None


def _cell_fields(sheet: Sheet, weights: MappingWeights, mapped: MappedFields) -> dict:
    """Every cell variable with its attributes, in the order of the file."""
    fields = {}
    for name, values in mapped.scalars.items():
        fields[name] = (values, _attributes(sheet, name))
    for stem, family in mapped.directions.items():
        for axis, values in zip("xyz", family.direction.T, strict=True):
            name = f"{stem}_{axis}"
            fields[name] = (np.ascontiguousarray(values), _attributes(sheet, name))
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


def _attributes(sheet: Sheet, name: str) -> dict:
    """Attributes of a field, and the value of cells without a sheet."""
    return {"long_name": name, "units": "1", **sheet.attributes.get(name, {}), "_FillValue": np.nan}


def _compact(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Used nodes, and the corner table that counts only these."""
    used, compact = np.unique(corners[corners >= 0], return_inverse=True)
    renumbered = np.full(corners.shape, -1, dtype=np.int64)
    renumbered[corners >= 0] = compact.reshape(-1)
    return used, renumbered


def _global_attributes(sheet: Sheet, target: TargetMesh, report: MappingReport) -> dict:
    step = (
        f"mapped onto {target.file.name if target.file else 'a mesh'} "
        f"({report.method} weights) by lcmchain {_version()}"
    )
    history = sheet.provenance.get("history", "")
    return {
        "Conventions": "CF-1.11 UGRID-1.0",
        "title": f"forming fields on the {report.kind} mesh {report.name}",
        "history": f"{step}\n{history}".strip(),
        "source": f"lcmchain {_version()}, mapping",
        "mapping_method": report.method,
        "mapping_maximum_distance_m": report.maximum_distance,
        "mapping_target_coverage": report.target_coverage,
        "mapping_source_coverage": report.source_coverage,
        "mapping_warnings": "\n".join(report.warnings),
    }


def _version() -> str:
    from lcmchain import __version__

    return __version__
