"""The formed sheet as the source of a mapping: its surface and its face fields in one frame."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping.surface import Surface

# The two fibre families, in the order of the material's axes.
FIBRE_FAMILIES = ("fibre_direction_1", "fibre_direction_2")

# Fields that later stages cannot do without: a hole in one of them stops the mapping.
NEEDED = ("thickness", "fibre_volume_fraction", "areal_fibre_mass", "shear_angle", *FIBRE_FAMILIES)

_COMPONENT = re.compile(r"(.+)_([xyz])")


@dataclass(frozen=True)
class Sheet:
    """Formed mid-surface with its face fields.

    Parameters
    ----------
    surface : mid-surface at the chosen frame.
    scalars : face fields by name, each of shape (F,).
    directions : unit vectors by name (``fibre_direction_1`` ...), each of shape (F, 3).
    attributes : unit, name and definition of every field.
    unused : names of face fields that are not mapped: vectors that are no directions, and
        fields with holes.
    provenance : what the source file says about where it comes from.
    """

    surface: Surface
    scalars: Mapping[str, np.ndarray]
    directions: Mapping[str, np.ndarray]
    attributes: Mapping[str, dict] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    name: str = "forming result"


def read_sheet(source: Path | str | xr.Dataset | Sheet, *, frame: int = -1) -> Sheet:
    """Read the formed sheet from a forming result.

    Parameters
    ----------
    source : ``forming.nc``, or its root group as a dataset.
    frame : saved frame to map, the last one by default.

    Raises
    ------
    InputError : the file is absent or no forming result, the frame does not exist, or a field
        that later stages need holds values that are not finite.
    """
    if isinstance(source, Sheet):
        return source
    if isinstance(source, xr.Dataset):
        return _sheet_from_dataset(source, frame, "dataset")
    path = Path(source)
    if not path.is_file():
        raise InputError("the forming result does not exist", file=path)
    try:
        dataset = xr.open_dataset(path, engine="netcdf4", mask_and_scale=False)
    except (OSError, ValueError) as error:
        raise InputError(f"this is not a netCDF forming result ({error})", file=path) from None
    with dataset:
        return _sheet_from_dataset(dataset, frame, str(path))


def _sheet_from_dataset(dataset: xr.Dataset, frame: int, name: str) -> Sheet:
    topology = [
        variable
        for variable in dataset.variables.values()
        if variable.attrs.get("cf_role") == "mesh_topology"
        and int(variable.attrs.get("topology_dimension", 0)) == 2
    ]
    if len(topology) != 1:
        raise InputError(
            f"a forming result has one two-dimensional mesh, this has {len(topology)}", file=name
        )
    mesh = topology[0].attrs
    if "frame" in dataset.dims:
        frame_count = dataset.sizes["frame"]
        if not -frame_count <= frame < frame_count:
            raise InputError(f"frame {frame} does not exist; there are {frame_count}", file=name)
        dataset = dataset.isel(frame=frame)
    points = _node_positions(dataset, mesh, name)
    faces = _faces(dataset[mesh["face_node_connectivity"]], len(points), name)

    face_dimension = mesh.get("face_dimension") or dataset[mesh["face_node_connectivity"]].dims[0]
    fields = {
        str(key): np.asarray(variable.values, dtype=float)
        for key, variable in dataset.data_vars.items()
        if variable.dims == (face_dimension,) and variable.dtype.kind == "f"
    }
    holes = {key: np.flatnonzero(~np.isfinite(values)) for key, values in fields.items()}
    for key, bad in holes.items():
        if len(bad) and _stem(key) in NEEDED:
            raise InputError(f"{key} of face {bad[0]} is not finite", file=name)
    vectors: dict[str, list[str]] = {}
    for key in fields:
        match = _COMPONENT.fullmatch(key)
        if match:
            vectors.setdefault(match[1], []).append(key)
    whole = {stem: keys for stem, keys in vectors.items() if len(keys) == 3}
    directions = {
        stem: np.stack([fields[f"{stem}_{axis}"] for axis in "xyz"], axis=1)
        for stem, keys in whole.items()
        if "direction" in stem and not any(len(holes[key]) for key in keys)
    }
    in_vectors = {key for keys in whole.values() for key in keys}
    scalars = {
        key: values
        for key, values in fields.items()
        if key not in in_vectors and len(holes[key]) == 0
    }
    unused = tuple(
        [stem for stem in whole if stem not in directions]
        + [key for key in fields if key not in in_vectors and key not in scalars]
    )
    kept = ("units", "long_name", "comment")
    attributes = {
        key: {a: dataset[key].attrs[a] for a in kept if a in dataset[key].attrs} for key in fields
    }
    provenance = {
        key: str(value)
        for key, value in dataset.attrs.items()
        if key in ("title", "history", "source", "institution", "state") or key.startswith("scene")
    }
    return Sheet(Surface(points, faces), scalars, directions, attributes, unused, provenance, name)


def _stem(variable: str) -> str:
    """Name of the field that a variable, perhaps a component, belongs to."""
    match = _COMPONENT.fullmatch(variable)
    return match[1] if match and match[1] in FIBRE_FAMILIES else variable


def _node_positions(dataset: xr.Dataset, mesh: Mapping, name: str) -> np.ndarray:
    """Node positions in the frame that the dataset was cut down to."""
    moved = [f"{field}_{a}" for field in ("reference_position", "displacement") for a in "xyz"]
    try:
        if all(key in dataset for key in moved):
            # The coordinates of the mesh are those of the last frame, for programs that draw it.
            parts = np.stack([np.asarray(dataset[key].values, dtype=float) for key in moved], 1)
            points = parts[:, :3] + parts[:, 3:]
        else:
            keys = mesh["node_coordinates"].split()
            points = np.stack([np.asarray(dataset[key].values, dtype=float) for key in keys], 1)
        if points.shape[1] != 3:
            raise ValueError
    except (KeyError, ValueError):
        raise InputError("the mesh has no x, y and z node coordinates", file=name) from None
    if not np.isfinite(points).all():
        raise InputError("the mesh has node positions that are not finite", file=name)
    return points


def _faces(connectivity: xr.DataArray, node_count: int, name: str) -> np.ndarray:
    values = np.asarray(connectivity.values)
    fill = connectivity.attrs.get("_FillValue", connectivity.encoding.get("_FillValue", -1))
    # xarray turns integers with a fill value into floating point numbers when it masks them.
    missing = ~np.isfinite(values) if values.dtype.kind == "f" else values == fill
    missing |= values == fill
    faces = np.where(missing, 0, values).astype(np.int64)
    faces -= int(connectivity.attrs.get("start_index", 0))
    faces[missing] = -1
    if faces.shape[1] == 3:
        faces = np.concatenate([faces, np.full((len(faces), 1), -1)], axis=1)
    if faces.shape[1] != 4 or missing[:, :3].any():
        raise InputError("faces have to be triangles or quadrilaterals", file=name)
    if len(faces) == 0 or faces.max() >= node_count:
        raise InputError("faces point to nodes that do not exist", file=name)
    return faces
