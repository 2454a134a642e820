"""``forming.nc``: writing and reading the groups of a forming result as netCDF-4."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from lcmchain.errors import InputError
from lcmchain.fields.dataset import SHEET
from lcmchain.fields.netcdf_file import open_netcdf, write_netcdf

if TYPE_CHECKING:
    import xarray as xr


def write_forming_netcdf(path: Path | str, datasets: Mapping[str, xr.Dataset]) -> None:
    """Write the groups of :func:`lcmchain.fields.dataset.build_datasets`; whole or not at all.

    Raises
    ------
    InputError : the place cannot be written.
    """
    write_netcdf(path, datasets)


def read_forming(path: Path | str) -> xr.Dataset:
    """Read the formed sheet, the root group of ``forming.nc``, into memory.

    Raises
    ------
    InputError : the file is absent or no forming result.
    """
    dataset = read_group(path, SHEET)
    if "sheet_face_nodes" not in dataset:
        raise InputError("this is no forming result: it has no mesh named sheet", file=path)
    return dataset


def read_group(path: Path | str, group: str) -> xr.Dataset:
    """Read one group of ``forming.nc`` into memory: ``"/"``, ``"solid"`` or ``"history"``.

    Integers stay integers: the missing node of a triangle is -1.

    Raises
    ------
    InputError : the file is absent, not netCDF, or has no such group.
    """
    if not Path(path).is_file():
        raise InputError("the forming result does not exist", file=path)
    try:
        with open_netcdf(path, group=group, mask_and_scale=False) as dataset:
            return dataset.load()
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the group {group} ({error})", file=path) from None
