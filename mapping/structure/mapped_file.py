"""A mapped file as later stages read it: whether it is one, and the plies in every cell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError, first_few, shortened
from lcmchain.fields.netcdf_file import open_netcdf
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.files import SKIN, SOLID
from lcmchain.mapping.sheet import FIBRE_FAMILIES, HEIGHT, ORDER, SHARE, UNREADABLE, file_sha256
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr

#: Families closer to each other than this have no plane between them.
CLOSEST_FAMILIES = np.radians(1.0)


def read_mapped(path: Path | str) -> xr.Dataset:
    """Read a mapped file.

    Raises
    ------
    InputError : it is absent or no mapped file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("there is no such mapped file", file=path)
    loaded = open_mapped(path)
    if not is_mapped(loaded):
        raise InputError("this is no mapped file: it has no mesh named target", file=path)
    return loaded


def open_mapped(path: Path) -> xr.Dataset:
    """Read the group of a file that has all cells of a mapping: ``/solid`` for solids, or the root.

    Raises
    ------
    InputError : it is no netCDF file.
    """
    try:
        with open_netcdf(path, mask_and_scale=False) as root:
            loaded = root.load()
        if not is_mapped(loaded) and SKIN.name in loaded:
            with open_netcdf(path, mask_and_scale=False, group=SOLID) as solid:
                loaded = solid.load()
    except UNREADABLE as error:
        reason = shortened(str(error), 300)
        raise InputError(f"this is no netCDF result ({reason})", file=path) from None
    return loaded


def is_mapped(dataset: xr.Dataset) -> bool:
    """Whether a dataset is that of a mapping, rather than of a forming run."""
    return "target" in dataset and dataset["target"].attrs.get("cf_role") == "mesh_topology"


def mapped_onto(dataset: xr.Dataset, target_mesh: Path | str) -> bool:
    """Whether a dataset is that of a mapping onto the mesh of a file."""
    stored = dataset.attrs.get("target_sha256")
    return is_mapped(dataset) and stored == file_sha256(target_mesh)


def mapped_state(mapped: xr.Dataset) -> xr.Dataset:
    """Return the saved state that the target belongs to, where a file holds all of them."""
    if TIME not in mapped.dims:
        return mapped
    if "mapping_time_s" not in mapped.attrs:
        return mapped.isel({TIME: -1})
    return mapped.sel({TIME: mapped.attrs["mapping_time_s"]}, method="nearest")


@dataclass(frozen=True)
class FormedPly:
    """Formed textile of one ply.

    Parameters
    ----------
    share : of the cell's thickness or volume, zero where the cell has nothing of the ply, (C,).
    fibre_volume_fraction : (C,).
    directions : unit vectors along every fibre family, (C, 3) each. They mean nothing where the
        share is zero.
    height : place of the ply along the normal of a shell [m], (C,), None where the file does not
        tell it; not a number where the share is zero.
    """

    share: np.ndarray
    fibre_volume_fraction: np.ndarray
    directions: tuple[np.ndarray, ...]
    height: np.ndarray | None = None


@dataclass(frozen=True)
class FormedCells:
    """Formed textile of the cells of a target.

    Parameters
    ----------
    thickness : of all plies [m], (C,).
    leading : the ply with the largest share in each cell, whose families give the axes.
    plies : all of them.
    fibre_density : that the fibre volume fraction belongs to [kg/m3], if the file tells it.
    order : 1 where the plies of a stack follow each other along the normal of a shell, -1 where
        against it, (C,); None where the file does not tell it.
    """

    thickness: np.ndarray
    leading: FormedPly
    plies: tuple[FormedPly, ...]
    fibre_density: float | None = None
    order: np.ndarray | None = None


def formed_cells(mapped: xr.Dataset, target: TargetMesh, file: str) -> FormedCells:
    """Take the fields of every cell of a target from a mapped dataset.

    Raises
    ------
    InputError : a field is missing, belongs to another mesh, or has cells without a value.
    """
    thickness = _field(mapped, "thickness", target, file)
    names = [str(n).removeprefix(SHARE) for n in mapped.data_vars if str(n).startswith(SHARE)]
    leading = _ply(mapped, "", np.ones(target.cell_count), target, file)
    # plies may have fewer families than others
    directions = leading.directions[:1] if names else leading.directions
    values = [leading.fibre_volume_fraction[:, None], *directions]
    known = np.isfinite(np.hstack([thickness[:, None], *values])).all(axis=1)
    if not known.all():
        unmapped = np.flatnonzero(~known)
        raise InputError(
            f"{len(unmapped)} of {target.cell_count} cells have no sheet and so no material "
            f"({first_few(target.cell_ids[unmapped])}); trim the mesh to the sheet, or map with a "
            "larger maximum distance",
            file=file,
        )
    plies = tuple(_named_ply(mapped, name, leading, target, file) for name in names)
    density = mapped.attrs.get("fibre_density_kg_m3")
    return FormedCells(
        thickness,
        leading,
        plies or (leading,),
        None if density is None else float(density),
        _field(mapped, ORDER, target, file) if ORDER in mapped else None,
    )


def _ply(
    mapped: xr.Dataset, prefix: str, share: np.ndarray, target: TargetMesh, file: str
) -> FormedPly:
    further = [
        name
        for name in FIBRE_FAMILIES[1:]
        if f"{prefix}{name}_x" in mapped and np.isfinite(mapped[f"{prefix}{name}_x"]).any()
    ]
    directions = tuple(
        np.stack(
            [_field(mapped, f"{prefix}{family}_{axis}", target, file) for axis in "xyz"], axis=1
        )
        for family in (FIBRE_FAMILIES[0], *further)
    )
    return FormedPly(
        share, _field(mapped, f"{prefix}fibre_volume_fraction", target, file), directions
    )


def _named_ply(
    mapped: xr.Dataset, name: str, leading: FormedPly, target: TargetMesh, file: str
) -> FormedPly:
    """One ply of a stack; cells without it have values that no result depends on."""
    share = _field(mapped, f"{SHARE}{name}", target, file)
    ply = _ply(mapped, f"{name}_", share, target, file)
    there = share > 0.0
    height = f"{HEIGHT}{name}"
    return FormedPly(
        share,
        np.where(there, ply.fibre_volume_fraction, leading.fibre_volume_fraction),
        tuple(
            np.where(there[:, None], own, other)
            for own, other in zip(ply.directions, _apart(leading, len(ply.directions)), strict=True)
        ),
        _field(mapped, height, target, file) if height in mapped else None,
    )


def _apart(leading: FormedPly, count: int) -> list[np.ndarray]:
    """Return directions (C, 3) that no two cells' families share, for cells without a ply."""
    first = leading.directions[0]
    third = np.eye(3)[np.abs(first).argmin(axis=1)]
    across = np.cross(third, first)
    across /= np.linalg.norm(across, axis=1)[:, None]
    angles = np.pi / count * np.arange(count)
    directions = [np.cos(angle) * first + np.sin(angle) * across for angle in angles]
    if len(leading.directions) == count and all(np.isfinite(d).all() for d in leading.directions):
        return list(leading.directions)
    return directions


def _field(mapped: xr.Dataset, name: str, target: TargetMesh, file: str) -> np.ndarray:
    if name not in mapped:
        raise InputError(f"the mapped file has no {name}; {_remedy(name)}", file=file)
    values = np.asarray(mapped[name].values, dtype=float)
    if values.shape != (target.cell_count,):
        raise InputError(
            f"the mapped file holds {values.size} cells and the mesh {target.cell_count}: they do "
            "not belong together; give the mesh that the fields were mapped onto",
            file=file,
        )
    return values


def _remedy(name: str) -> str:
    if name == "thickness":
        return 'form the sheet with element = "solid-shell", which predicts it'
    if name.endswith("fibre_volume_fraction"):
        return "give material.fibre_density and material.areal_mass in the scene, and form again"
    return "map a forming result with fibre directions"
