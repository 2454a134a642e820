"""The formed sheet, the source of a mapping: read from a forming result, in one saved state."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from lcmchain.errors import InputError, shortened
from lcmchain.fields.netcdf_file import open_netcdf
from lcmchain.fields.stack import film_names
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.quantities.fields import FIELD_OF_VARIABLE, OF_STACK

if TYPE_CHECKING:
    import xarray as xr

# Fibre families that a fabric may have: one to three.
FIBRE_FAMILIES = ("fibre_direction_1", "fibre_direction_2", "fibre_direction_3")

# Principal permeabilities and their axes, which are mapped together, as tensors.
PERMEABILITIES = tuple(f"permeability_{number}" for number in (1, 2, 3))
PERMEABILITY_AXES = tuple(f"permeability_direction_{number}" for number in (1, 2, 3))

#: Beginning of the name of the field with the share of a ply in the cells; the ply's name follows.
SHARE = "ply_share_"
#: The same of the field with its height along the normal of a shell.
HEIGHT = "ply_height_"
#: Field of a shell: which way along the normal of a cell the plies follow each other.
ORDER = "ply_order"


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
    _require_sound_fields(sheet.scalars, sheet.directions, str(path))
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


# --- from a dataset to the sheet ------------------------------------------------------------------

# Fields that later stages cannot do without: a hole in one of them stops the mapping.
NEEDED = ("thickness", "fibre_volume_fraction", "areal_fibre_mass", "shear_angle", *FIBRE_FAMILIES)

# Attributes of a forming result that a mapped one repeats.
_PROVENANCE = (
    "title", "history", "source", "institution", "comment", "state",
    "material", "areal_mass_kg_m2", "fibre_density_kg_m3",
)  # fmt: skip

_KEPT = ("units", "long_name", "comment")
_COMPONENT = re.compile(r"(.+)_([xyz])")


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
    mesh, connectivity = _mesh_of(dataset, name)
    films = film_names(dataset)
    if films:  # taken off after forming: nothing of them is mapped
        dataset = _without_films(dataset, connectivity.dims[0], films)
        mesh, connectivity = _mesh_of(dataset, name)
    points = _node_positions(dataset, mesh, name)
    faces = _faces(connectivity, name)
    _require_whole_faces(points, faces, name)
    node_dimension = dataset[_position_names(dataset, mesh)[0]].dims[0]
    fields, attributes = _face_fields(dataset, connectivity.dims[0], node_dimension, faces)
    permeability = _take_permeability(fields, name)

    ply, ply_names = _plies_of(dataset, connectivity.dims[0], name)
    if ply_names or films:
        fields = {key: values for key, values in fields.items() if key not in OF_STACK}

    holes = {key: _holes_of(values, ply) for key, values in fields.items()}
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

    Only scalars are taken from nodes, such as the pressure of tools: a displacement or position of
    the sheet says nothing of the target.
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
    _require_si(dataset, keys, name)
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


# --- to which of the bodies formed together each face belongs -------------------------------------

BODY = "body"


def _plies_of(
    dataset: xr.Dataset, face_dimension: Hashable, name: str
) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """Return the number of the ply of each face, shape (F,), and the plies' names.

    A result with one body has neither.

    Raises
    ------
    InputError : the flags of the faces do not say which body they mean.
    """
    variable = dataset.get(BODY)
    if variable is None or variable.dtype.kind not in "iu" or variable.dims != (face_dimension,):
        return None, ()
    names = tuple(str(variable.attrs.get("flag_meanings", "")).split())
    flags = np.atleast_1d(variable.attrs.get("flag_values", np.arange(len(names))))
    values = np.asarray(variable.values)
    if len(set(names)) != len(flags) or not np.isin(values, flags).all():
        raise InputError(
            f'the faces of several bodies are marked by "{BODY}", but its flag_values and '
            "flag_meanings do not name them all",
            file=name,
        )
    # bodies without a face are no plies
    used, ply = np.unique(values, return_inverse=True)
    if len(used) < 2:
        return None, ()
    order = {int(flag): word for flag, word in zip(flags, names, strict=True)}
    return ply.reshape(-1).astype(np.int64), tuple(order[int(flag)] for flag in used)


def _without_films(
    dataset: xr.Dataset, face_dimension: Hashable, films: tuple[str, ...]
) -> xr.Dataset:
    """Return a forming result without the faces of its films."""
    names = str(dataset[BODY].attrs.get("flag_meanings", "")).split()
    flags = np.atleast_1d(dataset[BODY].attrs.get("flag_values", np.arange(len(names))))
    gone = [flag for flag, name in zip(flags, names, strict=True) if name in films]
    kept = np.flatnonzero(~np.isin(dataset[BODY].values, gone))
    return dataset.isel({face_dimension: kept})


def _holes_of(values: np.ndarray, ply: np.ndarray | None) -> np.ndarray:
    """Faces without a value, shape (H,); a ply that does not have the field at all has no holes."""
    bad = ~np.isfinite(values)
    if ply is not None and bad.any() and not bad.all():
        absent = np.bincount(ply, weights=~bad) == 0.0
        bad &= ~absent[ply]
    return np.flatnonzero(bad)


# --- whether a file is a whole forming result: a mesh, its faces, and fields in SI units ----------

#: Errors that the netCDF libraries raise on a damaged file, when it is opened or when values are
#: read.
UNREADABLE = (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError, IndexError)

# Farthest place of a node [m] that squares and products of lengths can be computed with.
FARTHEST = 1e9

# Lowest and highest values that a formed textile may have, far from any that one has (SI).
PLAUSIBLE = {
    "thickness": (0.0, 1.0),
    "areal_fibre_mass": (0.0, 1e4),
    "fibre_volume_fraction": (0.0, 100.0),
    "shear_angle": (-np.pi, np.pi),
}

_POSITION_UNITS = ("m", "metre", "meter")


def _mesh_of(dataset: xr.Dataset, name: str) -> tuple[Mapping[str, Any], xr.DataArray]:
    """Return attributes and connectivity of the only two-dimensional mesh.

    Raises
    ------
    InputError : there is none or several, or its connectivity is no table of whole numbers.
    """
    meshes = [
        variable.attrs
        for variable in dataset.variables.values()
        if str(variable.attrs.get("cf_role")) == "mesh_topology"
        and str(variable.attrs.get("topology_dimension")) == "2"
    ]
    if len(meshes) != 1:
        raise InputError(
            f"a forming result has one two-dimensional mesh, this has {len(meshes)}", file=name
        )
    if "skin_of" in meshes[0]:
        raise InputError(
            "this holds fields on a solid mesh, which is no formed sheet; map from forming.nc",
            file=name,
        )
    key = str(meshes[0].get("face_node_connectivity"))
    if key not in dataset.variables:
        raise InputError(f'the mesh has no faces: there is no variable "{key}"', file=name)
    connectivity = dataset[key]
    if connectivity.ndim != 2 or connectivity.dtype.kind not in "iuf":
        raise InputError(f'the faces of the mesh ("{key}") are no table of node numbers', file=name)
    if meshes[0].get("face_dimension") not in (None, connectivity.dims[0]):
        raise InputError("the mesh says two things about the dimension of its faces", file=name)
    return meshes[0], connectivity


def _require_si(dataset: xr.Dataset, positions: list[str], name: str) -> None:
    """Refuse positions and fields that say they are in another unit than forming writes.

    Raises
    ------
    InputError : names the variable and both units.
    """
    wanted: dict[str, tuple[str, ...]] = dict.fromkeys(positions, _POSITION_UNITS)
    wanted |= {key: (field.units,) for key, field in FIELD_OF_VARIABLE.items() if key not in wanted}
    for key, units in wanted.items():
        unit = dataset[key].attrs.get("units") if key in dataset else None
        if unit is not None and str(unit) not in units:
            raise InputError(
                f'{key} is in "{unit}", but a forming result has it in "{units[0]}"; convert it '
                "or form again",
                file=name,
            )


def _require_whole_faces(points: np.ndarray, faces: np.ndarray, name: str) -> None:
    """Refuse faces whose nodes do not exist, lie nowhere, or enclose no area.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    faces : node numbers, shape (F, 4); -1 in the last column marks a triangle.
    """
    if len(faces) == 0:
        raise InputError("the mesh has no faces", file=name)
    if faces[:, :3].min() < 0 or faces.max() >= len(points):
        raise InputError("faces point to nodes that do not exist", file=name)
    if not np.isfinite(points).all() or np.abs(points).max() > FARTHEST:
        raise InputError("the mesh has node positions that are not finite", file=name)
    last = np.where(faces[:, 3] < 0, faces[:, 2], faces[:, 3])
    a, b, c, d = (points[nodes] for nodes in (*faces[:, :3].T, last))
    flat = np.flatnonzero(~np.any(np.cross(c - a, d - b), axis=1))
    if len(flat):
        raise InputError(
            f"{len(flat)} faces of the mesh have no area, the first is face {flat[0]}", file=name
        )


def _require_sound_fields(
    scalars: Mapping[str, np.ndarray], directions: Mapping[str, np.ndarray], name: str
) -> None:
    """Refuse fields with values that no forming result has.

    Raises
    ------
    InputError : there is no field; a value that no formed textile has; a fibre direction whose
        length is not one, or whose components are not all there.
    """
    if not scalars and not directions:
        raise InputError("the forming result has no field on the faces of its mesh", file=name)
    for key, (low, high) in PLAUSIBLE.items():
        values = scalars.get(key, np.zeros(0))
        outside = np.flatnonzero((values < low) | (values > high))
        if len(outside):
            value = values[outside[0]]
            raise InputError(
                f"{key} of face {outside[0]} is {value:g} in SI units; in a formed textile it lies "
                f"between {low:g} and {high:g}: look at the forming result",
                file=name,
            )
    for family in FIBRE_FAMILIES:
        alone = [key for key in scalars if key in {f"{family}_{axis}" for axis in "xyz"}]
        if alone:
            raise InputError(f"{family} has only the components {', '.join(alone)}", file=name)
        length = np.linalg.norm(directions.get(family, np.zeros((0, 3))), axis=1)
        wrong = np.flatnonzero(np.abs(length - 1.0) > 1e-6)
        if len(wrong):
            raise InputError(f"{family} of face {wrong[0]} is no unit vector", file=name)
