"""What the structural stage takes from a mapped file: the plies of textile in every cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.plies import HEIGHT, SHARE
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr

#: Families closer to each other than this have no plane between them.
CLOSEST_FAMILIES = np.radians(1.0)


@dataclass(frozen=True)
class FormedPly:
    """Formed textile of one ply.

    Parameters
    ----------
    share : of the cell's thickness or volume, zero where the cell has nothing of the ply, (C,).
    fibre_volume_fraction : (C,). direction_1, direction_2 : unit vectors along both fibre
        families, (C, 3). They are those of the first ply where the share is zero.
    height : place of the ply along the normal of a shell [m], (C,), None where the file does not
        tell it; not a number where the share is zero.
    """

    share: np.ndarray
    fibre_volume_fraction: np.ndarray
    direction_1: np.ndarray
    direction_2: np.ndarray
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
    """

    thickness: np.ndarray
    leading: FormedPly
    plies: tuple[FormedPly, ...]
    fibre_density: float | None = None


def mapped_state(mapped: xr.Dataset) -> xr.Dataset:
    """Return the saved state that the target belongs to, where a file holds all of them."""
    if TIME not in mapped.dims:
        return mapped
    if "mapping_time_s" not in mapped.attrs:
        return mapped.isel({TIME: -1})
    return mapped.sel({TIME: mapped.attrs["mapping_time_s"]}, method="nearest")


def formed_cells(mapped: xr.Dataset, target: TargetMesh, file: str) -> FormedCells:
    """Take the fields of every cell of a target from a mapped dataset.

    Raises
    ------
    InputError : a field is missing, belongs to another mesh, or has cells without a value.
    """
    thickness = _field(mapped, "thickness", target, file)
    names = [str(n).removeprefix(SHARE) for n in mapped.data_vars if str(n).startswith(SHARE)]
    leading = _ply(mapped, "", np.ones(target.cell_count), target, file)
    values = [leading.fibre_volume_fraction[:, None], leading.direction_1, leading.direction_2]
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
        thickness, leading, plies or (leading,), None if density is None else float(density)
    )


def _ply(
    mapped: xr.Dataset, prefix: str, share: np.ndarray, target: TargetMesh, file: str
) -> FormedPly:
    families = [
        np.stack(
            [_field(mapped, f"{prefix}{family}_{axis}", target, file) for axis in "xyz"], axis=1
        )
        for family in FIBRE_FAMILIES
    ]
    return FormedPly(
        share, _field(mapped, f"{prefix}fibre_volume_fraction", target, file), *families
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
        np.where(there[:, None], ply.direction_1, leading.direction_1),
        np.where(there[:, None], ply.direction_2, leading.direction_2),
        _field(mapped, height, target, file) if height in mapped else None,
    )


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
    return "map a forming result with both fibre directions"
