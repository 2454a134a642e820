"""Whether a netCDF file is a whole forming result: a mesh, its faces, and fields in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.table import FIELD_OF_VARIABLE

if TYPE_CHECKING:
    import xarray as xr

#: What the netCDF libraries raise on a damaged file, when it is opened or when values are read.
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


def mesh_of(dataset: xr.Dataset, name: str) -> tuple[Mapping[str, Any], xr.DataArray]:
    """Return attributes and connectivity of the only two-dimensional mesh.

    Raises
    ------
    InputError : there is none or several, or its connectivity is no table of whole numbers.
    """
    found = [
        variable.attrs
        for variable in dataset.variables.values()
        if str(variable.attrs.get("cf_role")) == "mesh_topology"
        and str(variable.attrs.get("topology_dimension")) == "2"
    ]
    if len(found) != 1:
        raise InputError(
            f"a forming result has one two-dimensional mesh, this has {len(found)}", file=name
        )
    if "skin_of" in found[0]:
        raise InputError(
            "this holds fields on a solid mesh, which is no formed sheet; map from forming.nc",
            file=name,
        )
    key = str(found[0].get("face_node_connectivity"))
    if key not in dataset.variables:
        raise InputError(f'the mesh has no faces: there is no variable "{key}"', file=name)
    connectivity = dataset[key]
    if connectivity.ndim != 2 or connectivity.dtype.kind not in "iuf":
        raise InputError(f'the faces of the mesh ("{key}") are no table of node numbers', file=name)
    if found[0].get("face_dimension") not in (None, connectivity.dims[0]):
        raise InputError("the mesh says two things about the dimension of its faces", file=name)
    return found[0], connectivity


def require_si(dataset: xr.Dataset, positions: list[str], name: str) -> None:
    """Refuse positions and fields that say they are in another unit than forming writes.

    Raises
    ------
    InputError : names the variable and both units.
    """
    wanted: dict[str, tuple[str, ...]] = dict.fromkeys(positions, _POSITION_UNITS)
    wanted |= {key: (field.units,) for key, field in FIELD_OF_VARIABLE.items() if key not in wanted}
    for key, units in wanted.items():
        found = dataset[key].attrs.get("units") if key in dataset else None
        if found is not None and str(found) not in units:
            raise InputError(
                f'{key} is in "{found}", but a forming result has it in "{units[0]}"; convert it '
                "or form again",
                file=name,
            )


def require_whole_faces(points: np.ndarray, faces: np.ndarray, name: str) -> None:
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


def require_sound_fields(
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
            raise InputError(f"{key} of face {outside[0]} is {value:g}, which is none", file=name)
    for family in ("fibre_direction_1", "fibre_direction_2", "fibre_direction_3"):
        alone = [key for key in scalars if key in {f"{family}_{axis}" for axis in "xyz"}]
        if alone:
            raise InputError(f"{family} has only the components {', '.join(alone)}", file=name)
        length = np.linalg.norm(directions.get(family, np.zeros((0, 3))), axis=1)
        wrong = np.flatnonzero(np.abs(length - 1.0) > 1e-6)
        if len(wrong):
            raise InputError(f"{family} of face {wrong[0]} is no unit vector", file=name)
