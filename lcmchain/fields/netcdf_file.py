"""netCDF files, written whole or not at all, and by one thread at a time; and ``forming.nc``.

HDF5 is not safe for threads, and masters of co-simulation step their units in parallel ones.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import netCDF4
import xarray as xr
from xarray.backends import NetCDF4DataStore

from lcmchain.atomic import replacing
from lcmchain.errors import InputError, OutputError

ROOT = "/"

_one_thread = threading.RLock()


@contextmanager
def open_netcdf(
    path: Path | str,
    group: str | None = None,
    *,
    mask_and_scale: bool | None = None,
    decode_cf: bool | None = None,
) -> Iterator[xr.Dataset]:
    """Open a group of a file as `xarray.open_dataset` does; load what is needed before the end.

    Raises
    ------
    OSError, ValueError : the file is absent, not netCDF, or has no such group.
    """
    with _one_thread, _opened(path, "r") as file:
        store = NetCDF4DataStore(file, group=group, mode="r")
        with xr.open_dataset(store, mask_and_scale=mask_and_scale, decode_cf=decode_cf) as dataset:
            yield dataset


def write_netcdf(path: Path | str, groups: Mapping[str, xr.Dataset]) -> None:
    """Write datasets as the groups of a netCDF-4 file, whole or not at all.

    The netCDF4 engine is used because it writes attributes as character arrays, which is how
    VTK's UGRID reader knows a mesh. Numbers are stored in double precision, without loss.

    Parameters
    ----------
    groups : datasets by the path of their group, ``"/"`` for the root.

    Raises
    ------
    InputError : the place cannot be written.
    OutputError : writing failed on the way.
    """
    with _one_thread, replacing(path) as temporary:
        try:
            with _opened(temporary, "w") as file:
                for name, dataset in groups.items():
                    group = file if name == ROOT else file.createGroup(name)
                    dataset.dump_to_store(NetCDF4DataStore(group), encoding=_encoding(dataset))
        except RuntimeError as error:  # netCDF4 wraps what goes wrong below it, a full disk too
            raise OutputError(f"{error}; is the disk full?", file=path) from error


@contextmanager
def _opened(path: Path | str, mode: Literal["r", "w"]) -> Iterator[netCDF4.Dataset]:
    """Open a file so that nothing is left of it afterwards.

    Groups and their variables hold one another: of files that are only closed megabytes wait for
    the collection of garbage, in a process that forms part after part.
    """
    file = netCDF4.Dataset(path, mode, format="NETCDF4")
    try:
        yield file
    finally:
        if file.isopen():  # xarray closes what it has opened a dataset of
            file.close()
        _forget(file)


def _forget(group: netCDF4.Dataset) -> None:
    for nested in group.groups.values():
        _forget(nested)
    for held in (group.groups, group.variables, group.dimensions):
        held.clear()


def _encoding(dataset: xr.Dataset) -> dict[str, dict]:
    encoding: dict[str, dict] = {}
    for name, variable in dataset.variables.items():
        options: dict = {}
        if "_FillValue" not in variable.attrs:
            options["_FillValue"] = None
        if variable.ndim and variable.dtype.kind in "fi":
            # Shuffled bytes compress smooth fields to about two thirds.
            options |= {"zlib": True, "complevel": 4, "shuffle": True}
        encoding[str(name)] = options
    return encoding


# --- forming.nc -----------------------------------------------------------------------------------


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
    dataset = read_group(path, ROOT)
    if "sheet_face_nodes" not in dataset:
        raise InputError("this is no forming result: it has no mesh named sheet", file=path)
    if "reference_position_x" not in dataset:  # the file of a filling keeps the formed shape alone
        raise InputError(
            "this is no forming result: it does not say where its nodes were before forming; name "
            "the forming.nc of the run",
            file=path,
        )
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
