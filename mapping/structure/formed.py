"""What the structural stage takes from a mapped file: one layer of textile in every cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping.first_few import first_few
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.target import TargetMesh

#: Families closer to each other than this have no plane between them.
CLOSEST_FAMILIES = np.radians(1.0)


@dataclass(frozen=True)
class FormedCells:
    """Formed textile of the cells of a target.

    Parameters
    ----------
    thickness : [m], (C,). fibre_volume_fraction : (C,).
    direction_1, direction_2 : unit vectors along both fibre families, (C, 3).
    fibre_density : that the fibre volume fraction belongs to [kg/m3], if the file tells it.
    """

    thickness: np.ndarray
    fibre_volume_fraction: np.ndarray
    direction_1: np.ndarray
    direction_2: np.ndarray
    fibre_density: float | None = None


def formed_cells(mapped: xr.Dataset, target: TargetMesh, file: str) -> FormedCells:
    """Take the fields of every cell of a target from a mapped dataset.

    Raises
    ------
    InputError : a field is missing, belongs to another mesh, or has cells without a value.
    """
    components = [f"{family}_{axis}" for family in FIBRE_FAMILIES for axis in "xyz"]
    fields = {
        name: _field(mapped, name, target, file)
        for name in ("thickness", "fibre_volume_fraction", *components)
    }
    unmapped = np.flatnonzero(~np.isfinite(np.stack(list(fields.values()))).all(axis=0))
    if len(unmapped):
        raise InputError(
            f"{len(unmapped)} of {target.cell_count} cells have no sheet and so no material "
            f"({first_few(target.cell_ids[unmapped])}); trim the mesh to the sheet, or map with a "
            "larger maximum distance",
            file=file,
        )
    first, second = (
        np.stack([fields[f"{family}_{axis}"] for axis in "xyz"], axis=1)
        for family in FIBRE_FAMILIES
    )
    density = mapped.attrs.get("fibre_density_kg_m3")
    return FormedCells(
        fields["thickness"],
        fields["fibre_volume_fraction"],
        first,
        second,
        None if density is None else float(density),
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
    if name == "fibre_volume_fraction":
        return "give material.fibre_density and material.areal_mass in the scene, and form again"
    return "map a forming result with both fibre directions"
