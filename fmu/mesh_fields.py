"""Fields of a unit on their mesh: a layered standard, so that any importer can place them.

FMI knows arrays, but not where their entries lie. A unit that keeps this standard has a folder
``extra/org.lcmchain.fmi-ls-fields`` with three files (manual, page ``fields-of-units``):

- ``fmi-ls-manifest.xml``: name and version of the standard, as FMI 3.0.2 asks of layered standards.
- ``fields.xml``: for every field its mesh, the location, the variable of the mesh file that says
  which entry a face has, unit, and how entries combine.
- ``fields.nc``: the meshes, by the conventions of UGRID.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from lcmchain.coupling.cosimulation.archive import read_member, read_xml
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fmu.description import as_bytes
from lcmchain.fmu.variables import Variable
from lcmchain.mapping.interface import MESH, PATCH, Interface

if TYPE_CHECKING:
    import xarray as xr

NAME, VERSION = "org.lcmchain.fmi-ls-fields", "1.0.0"
FOLDER = f"extra/{NAME}"
MANIFEST_FILE, FIELDS_FILE, MESH_FILE = "fmi-ls-manifest.xml", "fields.xml", "fields.nc"

_MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"
_DESCRIPTION = "Where on which mesh the entries of the arrays of a unit lie."

#: How the value of several faces follows from those of each: of contents, of states, and of
#: resistances side by side.
Combination = Literal["sum", "mean", "parallel"]
_CONTENTS = ("volume", "volume_rate", "volume_rate_slope", "area", "area_rate", "preform_volume")
_RESISTANCES = ("pore_resistance",)


@dataclass(frozen=True)
class MeshField:
    """A field of a unit.

    Parameters
    ----------
    variable : FMI 3.0: name of an array of one dimension; FMI 2.0: ``variable[1]`` to
        ``variable[size]`` are its entries.
    size : number of entries.
    mesh : name of a mesh topology in the mesh file.
    location : what of the mesh has values, by the words of UGRID.
    entries : integer variable of the mesh file at that location: the entry of each face from 0, -1
        where it has none. Several faces may share one.
    unit : in the grammar of UDUNITS.
    combines : how values combine.
    vector, component : name of the vector that it belongs to, and its axis; empty for others.
    """

    variable: str
    size: int
    mesh: str
    location: str
    entries: str
    unit: str
    combines: Combination
    vector: str = ""
    component: str = ""


_OPTIONAL = ("vector", "component")
_NEEDED = tuple(field.name for field in fields(MeshField) if field.name not in _OPTIONAL)


# --- writing --------------------------------------------------------------------------------------


def layered_files(
    variables: Sequence[Variable],
    interface: Interface,
    faces: Mapping[str, np.ndarray] | None = None,
) -> dict[str, bytes]:
    """Return the files of the standard by their places in a unit; none for one without fields.

    Parameters
    ----------
    variables : of the unit.
    interface : the mesh whose entries all fields have, but those in ``faces``.
    faces : entry of every face, shape (C,), of the fields with this name, or whose names begin with
        this text.
    """
    dataset = interface.dataset({"title": "where the fields of a unit lie"})
    found: list[MeshField] = []
    numbered: dict[str, str] = {}
    arrays = [variable for variable in variables if variable.size is not None]
    names = {variable.name for variable in arrays}
    for variable in arrays:
        place = _place(variable.name, faces or {})
        if place is None:
            entries = PATCH
        elif place in numbered:
            entries = numbered[place]
        else:
            entries = numbered[place] = f"{MESH.name}_entry_{len(numbered)}"
            meaning = {"long_name": "entry from 0, -1 without", "units": "1"}
            assert faces is not None
            dataset[entries] = MESH.on_cells(faces[place].astype(np.int32), meaning)
        found.append(_field_of(variable, entries, names))
    if not found:
        return {}
    root = Element("MeshFields", version=VERSION)
    SubElement(root, "Mesh", name=MESH.name, file=MESH_FILE)
    for field in found:
        SubElement(root, "Field", {name: str(v) for name, v in asdict(field).items() if v != ""})
    manifest = Element("fmiLayeredStandardManifest", {"xmlns:fmi-ls": _MANIFEST})
    for name, text in (("name", NAME), ("version", VERSION), ("description", _DESCRIPTION)):
        manifest.set(f"fmi-ls:fmi-ls-{name}", text)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, MESH_FILE)
        write_netcdf(path, {ROOT: dataset})
        mesh = path.read_bytes()
    files = {MANIFEST_FILE: as_bytes(manifest), FIELDS_FILE: as_bytes(root), MESH_FILE: mesh}
    return {f"{FOLDER}/{name}": content for name, content in files.items()}


def _place(name: str, faces: Mapping[str, np.ndarray]) -> str | None:
    """Return the entry of ``faces`` that holds for a variable: its own, or that of its prefix."""
    if name in faces:
        return name
    return next((prefix for prefix in faces if name.startswith(prefix)), None)


def _field_of(variable: Variable, entries: str, names: set[str]) -> MeshField:
    assert variable.size is not None
    base = variable.name.rpartition(".")[2]
    combines: Combination = (
        "sum" if base in _CONTENTS else "parallel" if base in _RESISTANCES else "mean"
    )
    vector, _, component = variable.name.rpartition("_")
    is_vector = component in tuple("xyz") and {f"{vector}_{axis}" for axis in "xyz"} <= names
    return MeshField(
        variable.name, variable.size, MESH.name, "face", entries, variable.unit or "1", combines,
        *((vector, component) if is_vector else ()),
    )  # fmt: skip


# --- reading --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MeshFields:
    """What a unit says of its fields.

    Parameters
    ----------
    fields : by the names of their variables.
    meshes : content of the mesh file.
    """

    fields: Mapping[str, MeshField]
    meshes: xr.Dataset

    def on_faces(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the values of a field, shape (size,), on all faces, not a number without one."""
        entries = self.meshes[self.fields[name].entries].values
        return np.where(entries >= 0, np.asarray(values)[np.maximum(entries, 0)], np.nan)


def read_mesh_fields(unit: Path | str) -> MeshFields:
    """Read where the fields of a unit lie.

    Parameters
    ----------
    unit : ``*.fmu``, of lcmchain or of another tool that keeps the standard.

    Raises
    ------
    InputError : the unit does not keep the standard, in this version or at all.
    """
    content, mesh = (read_member(unit, f"{FOLDER}/{n}") for n in (FIELDS_FILE, MESH_FILE))
    root = read_xml(content, f"{unit}: {FIELDS_FILE}")
    found = {field.variable: field for field in fields_in(root)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, MESH_FILE)
        path.write_bytes(mesh)
        with open_netcdf(path, decode_cf=False) as dataset:
            return MeshFields(found, dataset.load())


def fields_in(root: Element) -> Iterator[MeshField]:
    """Yield the fields of a ``fields.xml``.

    Raises
    ------
    InputError : an attribute is missing, or no number.
    """
    for element in root.iter("Field"):
        given = dict(element.attrib)
        name = given.get("variable", "without a name")
        missing = [key for key in _NEEDED if key not in given]
        if missing:
            raise InputError(f"{FIELDS_FILE}: the field {name} has no {', '.join(missing)}")
        if not given["size"].isdecimal():
            raise InputError(f'{FIELDS_FILE}: the field {name} has the size "{given["size"]}"')
        known: dict[str, Any] = {key: given[key] for key in (*_NEEDED, *_OPTIONAL) if key in given}
        yield MeshField(**known | {"size": int(given["size"])})
