"""The rule of fields on meshes: the layered standard of :mod:`lcmchain.fmu.mesh_fields`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.cosimulation.archive import read_xml
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import open_netcdf
from lcmchain.fmu.doctor.rules.interface import Interface, rule
from lcmchain.fmu.doctor.rules.variables import size_of
from lcmchain.fmu.mesh_fields import (
    FIELDS_FILE,
    FOLDER,
    MANIFEST_FILE,
    MESH_FILE,
    NAME,
    MeshField,
    fields_in,
)

if TYPE_CHECKING:
    import xarray as xr


@rule(
    "fields on meshes",
    "a manifest with the name of the standard, and for every field a variable of its size, a mesh "
    "of the mesh file, and an integer variable there that gives each face one of its entries or -1",
    f"manual of lcmchain, page fields-of-units; asked of units with the folder {FOLDER}",
)
def mesh_fields(interface: Interface) -> Iterator[str]:
    folder = None if interface.folder is None else interface.folder / FOLDER
    if folder is None or not folder.is_dir():
        return
    missing = [n for n in (MANIFEST_FILE, FIELDS_FILE, MESH_FILE) if not (folder / n).is_file()]
    if missing:
        yield f"{FOLDER} has no {' and no '.join(missing)}"
        return
    try:
        yield from _manifest(folder)
        root = read_xml((folder / FIELDS_FILE).read_bytes(), FIELDS_FILE)
        with open_netcdf(folder / MESH_FILE, decode_cf=False) as meshes:
            for field in fields_in(root):
                yield from _field(interface, field, meshes)
    except InputError as error:
        yield error.message
    except (OSError, ValueError) as error:
        yield f"{MESH_FILE} cannot be read ({error})"


def _manifest(folder: Path) -> Iterator[str]:
    root = read_xml((folder / MANIFEST_FILE).read_bytes(), MANIFEST_FILE)
    stated = {name.rpartition("}")[2]: text for name, text in root.attrib.items()}
    if stated.get("fmi-ls-name") != NAME:
        yield f'{MANIFEST_FILE} names the standard "{stated.get("fmi-ls-name", "")}"'
    if not stated.get("fmi-ls-version"):
        yield f"{MANIFEST_FILE} names no version"


def _field(interface: Interface, field: MeshField, meshes: xr.Dataset) -> Iterator[str]:
    """Yield what is wrong with a field."""
    size = _size(interface, field.variable)
    if size is None:
        yield f"{field.variable} is no array of the unit"
    elif size != field.size:
        yield f"{field.variable} has {size} entries, and {field.size} in {FIELDS_FILE}"
    topology = meshes.get(field.mesh)
    if topology is None or topology.attrs.get("cf_role") != "mesh_topology":
        yield f"{field.variable} lies on {field.mesh}, which is no mesh of {MESH_FILE}"
        return
    entries = meshes.get(field.entries)
    if entries is None or not np.issubdtype(entries.dtype, np.integer):
        yield f"{field.variable} has the entries {field.entries}, no integers of {MESH_FILE}"
        return
    if entries.attrs.get("mesh") != field.mesh or entries.attrs.get("location") != field.location:
        yield f"{field.entries} does not lie on each {field.location} of {field.mesh}"
    numbers = np.unique(entries.values)
    if not np.array_equal(numbers[numbers >= 0], np.arange(field.size)) or numbers.min() < -1:
        yield f"{field.entries} does not number the {field.size} entries of {field.variable} from 0"


def _size(interface: Interface, name: str) -> int | None:
    """Return the number of entries of an array, None where there is no such array."""
    if not interface.is_three:
        count = 0
        while f"{name}[{count + 1}]" in interface.by_name:
            count += 1
        return count or None
    entry = interface.by_name.get(name)
    if entry is None or len(entry.dimensions) != 1:
        return None
    size = size_of(interface, entry.dimensions[0])
    return size if isinstance(size, int) else None
