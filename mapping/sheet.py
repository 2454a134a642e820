"""The formed sheet as the source of a mapping: its surface and its face fields in one frame."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.surface import Surface

# The two fibre families, in the order of the material's axes.
FIBRE_FAMILIES = ("fibre_direction_1", "fibre_direction_2")

# Fields that later stages cannot do without: a hole in one of them stops the mapping.
NEEDED = ("thickness", "fibre_volume_fraction", "areal_fibre_mass", "shear_angle", *FIBRE_FAMILIES)

# Principal permeabilities and their axes, which are mapped together, as tensors.
PERMEABILITIES = tuple(f"permeability_{number}" for number in (1, 2, 3))
PERMEABILITY_AXES = tuple(f"permeability_direction_{number}" for number in (1, 2, 3))

# What a forming result says of itself and a mapped one repeats.
_PROVENANCE = (
    "title", "history", "source", "institution", "comment", "state",
    "material", "areal_mass_kg_m2", "fibre_density_kg_m3",
)  # fmt: skip

_KEPT = ("units", "long_name", "comment")
_COMPONENT = re.compile(r"(.+)_([xyz])")


class PrincipalPermeability(NamedTuple):
    """Principal permeabilities of faces or cells, and their axes.

    values : two in the plane of the sheet, the larger one first, and through it [m2], shape (F, 3).
    axes : unit vectors without a sense, one a row, shape (F, 3, 3).
    """

    values: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True)
class Sheet:
    """Formed mid-surface with its face fields.

    Parameters
    ----------
    surface : mid-surface at the chosen frame.
    scalars : face fields by name, each of shape (F,); those of nodes as the mean of each face.
    directions : unit vectors by name (``fibre_direction_1`` ...), each of shape (F, 3).
    attributes : unit, name and definition of every field.
    unused : names of face fields that are not mapped: vectors that are no directions, and
        fields with holes.
    provenance : what the source file says about where it comes from, its name and its hash.
    permeability : principal values and axes, if the result has them all.
    time : of the saved state [s], if it is known.
    """

    surface: Surface
    scalars: Mapping[str, np.ndarray]
    directions: Mapping[str, np.ndarray]
    attributes: Mapping[str, dict] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = "forming result"
    permeability: PrincipalPermeability | None = None
    time: float | None = None


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
        sheet = _sheet_from_dataset(dataset, frame, str(path))
    origin = {"source_file": path.name, "source_sha256": file_sha256(path)}
    return replace(sheet, provenance={**sheet.provenance, **origin})


def file_sha256(path: Path | str) -> str:
    """Return the SHA-256 of a file's contents."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
    # Files of earlier versions have the dimension `frame` with the coordinate `frame_time`.
    states, clock = ("frame", "frame_time") if "frame" in dataset.dims else (TIME, TIME)
    if states in dataset.dims:
        frame_count = dataset.sizes[states]
        if not -frame_count <= frame < frame_count:
            raise InputError(f"frame {frame} does not exist; there are {frame_count}", file=name)
        dataset = dataset.isel({states: frame})
    points = _node_positions(dataset, mesh, name)
    faces = _faces(dataset[mesh["face_node_connectivity"]], len(points), name)
    fields, attributes = _face_fields(dataset, mesh, faces)
    permeability = _take_permeability(fields)

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
    provenance = {
        key: value if isinstance(value, int | float | np.number) else str(value)
        for key, value in dataset.attrs.items()
        if key in _PROVENANCE or key.startswith("scene")
    }
    time = float(dataset[clock]) if clock in dataset and dataset[clock].ndim == 0 else None
    return Sheet(
        Surface(points, faces), scalars, directions, attributes, unused, provenance, name,
        permeability, time,
    )  # fmt: skip


def _face_fields(
    dataset: xr.Dataset, mesh: Mapping, faces: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, dict]]:
    """Return values on the faces (F,) and attributes of every field of faces or nodes.

    Of the nodes only scalars are taken, such as the pressure of tools: a displacement or position
    of the sheet says nothing of the target.
    """
    face_dimension = mesh.get("face_dimension") or dataset[mesh["face_node_connectivity"]].dims[0]
    node_dimension = dataset[mesh["node_coordinates"].split()[0]].dims[0]
    corners = faces >= 0
    fields, attributes = {}, {}
    for key, variable in dataset.data_vars.items():
        name = str(key)
        if variable.dtype.kind != "f":
            continue
        about = {a: variable.attrs[a] for a in _KEPT if a in variable.attrs}
        values = np.asarray(variable.values, dtype=float)
        if variable.dims == (face_dimension,):
            fields[name], attributes[name] = values, about
        elif variable.dims == (node_dimension,) and not _COMPONENT.fullmatch(name):
            at_corners = np.where(corners, values[faces], 0.0)
            fields[name] = at_corners.sum(axis=1) / corners.sum(axis=1)
            told = f"{about.get('comment', '')}; mean of the nodes of each face of the sheet"
            attributes[name] = about | {"comment": told.removeprefix("; ")}
    return fields, attributes


def _take_permeability(fields: dict[str, np.ndarray]) -> PrincipalPermeability | None:
    """Take principal permeabilities and their axes out of the fields, if all are there."""
    components = [[f"{axis}_{c}" for c in "xyz"] for axis in PERMEABILITY_AXES]
    if not {*PERMEABILITIES, *sum(components, [])} <= fields.keys():
        return None
    values = np.stack([fields.pop(name) for name in PERMEABILITIES], axis=1)
    axes = np.stack([np.stack([fields.pop(c) for c in row], axis=1) for row in components], axis=1)
    return PrincipalPermeability(values, axes)


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
            # Their order is the writer's own (x z y in a mapped file); `axis` says which is which.
            keys = mesh["node_coordinates"].split()
            if all(dataset[key].attrs.get("axis") for key in keys):
                keys.sort(key=lambda key: dataset[key].attrs["axis"])
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
