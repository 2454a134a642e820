"""The formed sheet as the source of a mapping: its surface and its face fields in one frame."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from lcmchain.errors import InputError, shortened
from lcmchain.fields.netcdf_file import open_netcdf
from lcmchain.fields.stack import film_names
from lcmchain.fields.table import OF_STACK
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.bodies import holes_of, plies_of, without_films
from lcmchain.mapping.source_checks import (
    UNREADABLE,
    mesh_of,
    require_si,
    require_sound_fields,
    require_whole_faces,
)
from lcmchain.mapping.surface import Surface

# Fibre families that a fabric may have: one to three.
FIBRE_FAMILIES = ("fibre_direction_1", "fibre_direction_2", "fibre_direction_3")

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
    ply : number of the ply of each face, shape (F,), where there are several.
    ply_names : names of the plies.
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
    ply: np.ndarray | None = None
    ply_names: tuple[str, ...] = ()

    @property
    def is_stack(self) -> bool:
        """Whether there are several plies."""
        return len(self.ply_names) > 1

    @property
    def plies(self) -> np.ndarray:
        """Number of the ply of each face, shape (F,); zero where there is only one."""
        if self.ply is None:
            return np.zeros(self.surface.face_count, dtype=np.int64)
        return self.ply


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
    if path.is_dir():
        raise InputError("this is a folder; name the forming.nc in it", file=path)
    if not path.is_file():
        raise InputError("the forming result does not exist", file=path)
    try:
        with open_netcdf(path, mask_and_scale=False) as dataset:
            loaded = _frame_of(dataset, frame, str(path)).load()
    except UNREADABLE as error:
        reason = shortened(str(error), 300)
        raise InputError(f"this is not a netCDF forming result ({reason})", file=path) from None
    sheet = _sheet_from_dataset(loaded, -1, str(path))
    require_sound_fields(sheet.scalars, sheet.directions, str(path))
    origin = {"source_file": path.name, "source_sha256": file_sha256(path)}
    return replace(sheet, provenance={**sheet.provenance, **origin})


def saved_times_of(source: Path | str | xr.Dataset) -> np.ndarray:
    """Return the times [s] of the saved states of a forming result, shape (S,); empty without any.

    Raises
    ------
    InputError : the file cannot be read.
    """
    if isinstance(source, xr.Dataset):
        dimension, clock = _states_of(source)
        known = dimension in source.dims and clock in source.variables
        return np.array(source[clock].values, dtype=float) if known else np.zeros(0)
    try:
        with open_netcdf(source, mask_and_scale=False) as dataset:
            return saved_times_of(dataset)
    except UNREADABLE as error:
        reason = shortened(str(error), 300)
        raise InputError(f"this is not a netCDF forming result ({reason})", file=source) from None


def frame_at(source: Path | str | xr.Dataset, time: float) -> int:
    """Return the saved frame nearest to a time [s].

    Raises
    ------
    InputError : the time is outside those of the saved states, or there are none.
    """
    times = saved_times_of(source)
    file = "dataset" if isinstance(source, xr.Dataset) else source
    if len(times) == 0:
        raise InputError("the forming result has no saved states with times", file=file)
    if not times.min() <= time <= times.max():
        raise InputError(
            f"there is no saved state at {1e3 * time:.4g} ms; they go from "
            f"{1e3 * times.min():.4g} to {1e3 * times.max():.4g} ms",
            file=file,
        )
    return int(np.argmin(np.abs(times - time)))


def file_sha256(path: Path | str) -> str:
    """Return the SHA-256 of a file's contents."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _frame_of(dataset: xr.Dataset, frame: int, name: str) -> xr.Dataset:
    """One saved frame of a dataset; a dataset without saved frames as it is."""
    states = _states_of(dataset)[0]
    if states not in dataset.dims:
        if frame not in (-1, 0):
            raise InputError(f"frame {frame} does not exist; there is one state", file=name)
        return dataset
    frame_count = dataset.sizes[states]
    if not -frame_count <= frame < frame_count:
        raise InputError(f"frame {frame} does not exist; there are {frame_count}", file=name)
    return dataset.isel({states: frame})


def _states_of(dataset: xr.Dataset) -> tuple[str, str]:
    """Dimension of the saved states and the coordinate with their times.

    Files of earlier versions have the dimension ``frame`` with the coordinate ``frame_time``.
    """
    earlier = "frame" in dataset.dims or "frame_time" in dataset.variables
    return ("frame", "frame_time") if earlier else (TIME, TIME)


def _sheet_from_dataset(dataset: xr.Dataset, frame: int, name: str) -> Sheet:
    dataset = _frame_of(dataset, frame, name)
    mesh, connectivity = mesh_of(dataset, name)
    films = film_names(dataset)
    if films:  # taken off after forming: nothing of them is mapped
        dataset = without_films(dataset, connectivity.dims[0], films)
        mesh, connectivity = mesh_of(dataset, name)
    points = _node_positions(dataset, mesh, name)
    faces = _faces(connectivity, name)
    require_whole_faces(points, faces, name)
    node_dimension = dataset[_position_names(dataset, mesh)[0]].dims[0]
    fields, attributes = _face_fields(dataset, connectivity.dims[0], node_dimension, faces)
    permeability = _take_permeability(fields, name)

    ply, ply_names = plies_of(dataset, connectivity.dims[0], name)
    if ply_names or films:
        fields = {key: values for key, values in fields.items() if key not in OF_STACK}

    holes = {key: holes_of(values, ply) for key, values in fields.items()}
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
    return Sheet(
        Surface(points, faces), scalars, directions, attributes, unused, provenance, name,
        permeability, _time_of(dataset), ply, ply_names,
    )  # fmt: skip


def _time_of(dataset: xr.Dataset) -> float | None:
    """Time of the saved state that the dataset was cut down to [s], if it tells it."""
    clock = _states_of(dataset)[1]
    if clock not in dataset or dataset[clock].ndim or dataset[clock].dtype.kind != "f":
        return None
    return float(dataset[clock])


def _face_fields(
    dataset: xr.Dataset, face_dimension: Hashable, node_dimension: Hashable, faces: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, dict]]:
    """Return values on the faces (F,) and attributes of every field of faces or nodes.

    Of the nodes only scalars are taken, such as the pressure of tools: a displacement or position
    of the sheet says nothing of the target.
    """
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


def _take_permeability(fields: dict[str, np.ndarray], name: str) -> PrincipalPermeability | None:
    """Take principal permeabilities and their axes out of the fields, if all are there.

    Raises
    ------
    InputError : a permeability below zero, or an axis that is no unit vector.
    """
    components = [[f"{axis}_{c}" for c in "xyz"] for axis in PERMEABILITY_AXES]
    if not {*PERMEABILITIES, *sum(components, [])} <= fields.keys():
        return None
    values = np.stack([fields.pop(name) for name in PERMEABILITIES], axis=1)
    axes = np.stack([np.stack([fields.pop(c) for c in row], axis=1) for row in components], axis=1)
    below = np.flatnonzero((values < 0.0).any(axis=1))
    if len(below):
        raise InputError(f"a permeability of face {below[0]} is negative", file=name)
    wrong = np.flatnonzero((np.abs(np.linalg.norm(axes, axis=2) - 1.0) > 1e-6).any(axis=1))
    if len(wrong):
        raise InputError(
            f"an axis of the permeability of face {wrong[0]} is no unit vector", file=name
        )
    return PrincipalPermeability(values, axes)


def _stem(variable: str) -> str:
    """Name of the field that a variable, perhaps a component, belongs to."""
    match = _COMPONENT.fullmatch(variable)
    return match[1] if match and match[1] in FIBRE_FAMILIES else variable


def _position_names(dataset: xr.Dataset, mesh: Mapping) -> list[str]:
    """Names of x, y and z of the nodes, or of their parts that have to be added."""
    moved = [f"{field}_{a}" for field in ("reference_position", "displacement") for a in "xyz"]
    # The coordinates of the mesh are those of the last frame, for programs that draw it.
    if all(key in dataset for key in moved):
        return moved
    keys = str(mesh.get("node_coordinates", "")).split()
    # Their order is the writer's own (x z y in a mapped file); `axis` says which is which.
    if all(key in dataset and dataset[key].attrs.get("axis") for key in keys):
        keys.sort(key=lambda key: str(dataset[key].attrs["axis"]))
    return keys


def _node_positions(dataset: xr.Dataset, mesh: Mapping, name: str) -> np.ndarray:
    """Node positions in the frame that the dataset was cut down to."""
    keys = _position_names(dataset, mesh)
    require_si(dataset, keys, name)
    try:
        parts = np.stack([np.asarray(dataset[key].values, dtype=float) for key in keys], 1)
        if parts.ndim != 2 or parts.shape[1] not in (3, 6):
            raise ValueError
    except (KeyError, ValueError, TypeError):
        raise InputError("the mesh has no x, y and z node coordinates", file=name) from None
    return parts[:, :3] + parts[:, 3:] if parts.shape[1] == 6 else parts


def _faces(connectivity: xr.DataArray, name: str) -> np.ndarray:
    values = np.asarray(connectivity.values)
    fill = connectivity.attrs.get("_FillValue", connectivity.encoding.get("_FillValue", -1))
    # xarray turns integers with a fill value into floating point numbers when it masks them.
    missing = ~np.isfinite(values) if values.dtype.kind == "f" else values == fill
    missing |= values == fill
    faces = np.where(missing, 0, values).astype(np.int64)
    start_index = connectivity.attrs.get("start_index", 0)
    if str(start_index) not in ("0", "1"):
        raise InputError(f"start_index of the faces is {start_index}, not 0 or 1", file=name)
    faces -= int(start_index)
    faces[missing] = -1
    if faces.shape[1] == 3:
        faces = np.concatenate([faces, np.full((len(faces), 1), -1)], axis=1)
    if faces.shape[1] != 4 or missing[:, :3].any():
        raise InputError("faces have to be triangles or quadrilaterals", file=name)
    return faces
