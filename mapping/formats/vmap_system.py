"""The groups MATERIAL and SYSTEM of a VMAP file: types, units and the axes of every element."""

from __future__ import annotations

from datetime import UTC, datetime

import h5py
import numpy as np

from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.vmap_types import (
    COORDINATE_SYSTEM,
    ELEMENT_TYPE,
    ELEMENT_TYPES,
    INTEGRATION_TYPE,
    INTEGRATION_TYPES,
    MATERIAL_PARAMETER,
    SECTION,
    SI_UNITS,
    TEXT,
    UNIT,
    UNIT_SYSTEM,
    UNITS,
)

# Identifiers of the only material and section, and of the global coordinate system.
MATERIAL, ONLY_SECTION, GLOBAL = 0, 0, 1

# An orthonormal coordinate system, given by its origin and three axes.
CARTESIAN = 2


def write_material(group: h5py.Group, cells: MappedCells) -> None:
    """Write the textile as the only material, with what the run says of it."""
    name = str(cells.provenance.get("material") or "textile")
    material = group.create_group(name.replace("/", "_"))
    material.attrs["MYIDENTIFIER"] = np.int32(MATERIAL)
    description = {
        "MYNAME": name,
        "MYDESCRIPTION": "formed textile",
        "MYSTATE": "solid",
        "MYSUPPLIER": "",
        "MYTYPE": "dry textile",
    }
    for key, text in description.items():
        material.attrs[key] = fixed_text(text)
    card = material.create_group("MATERIALCARD")
    about = {
        "MYIDEALISATION": "shell" if not cells.target.is_solid else "solid",
        "MYIDENTIFIER": name,
        "MYMODELNAME": name,
        "MYPHYSICS": "solid_mechanics",
        "MYSOLUTION": "explicit FEM",
        "MYSOLVER": "lcmchain",
        "MYSOLVERVERSION": str(cells.provenance.get("source", "")),
        "MYUNITSYSTEM": "m kg s A K mol cd",
    }
    for key, text in about.items():
        card.attrs[key] = fixed_text(text)
    parameters = [
        (key, str(cells.provenance[key]), text)
        for key, text in (
            ("areal_mass_kg_m2", "areal mass of the unformed textile [kg/m2]"),
            ("fibre_density_kg_m3", "density of the fibres [kg/m3]"),
        )
        if key in cells.provenance
    ]
    _table(card, "PARAMETERS", MATERIAL_PARAMETER, parameters)


def write_system(
    group: h5py.Group,
    cells: MappedCells,
    families: tuple[np.ndarray, np.ndarray],
    oriented: np.ndarray,
) -> None:
    """Write the types of elements, units, origin of the file, and one frame per oriented element.

    oriented : whether a cell has both fibre directions, shape (C,).
    """
    used = [name for name, _ in cells.target.blocks]
    _table(group, "ELEMENTTYPES", ELEMENT_TYPE, [
        ELEMENT_TYPES[name].row(number) for number, name in enumerate(used)
    ])  # fmt: skip
    integration = dict.fromkeys(ELEMENT_TYPES[name].integration for name in used)
    _table(group, "INTEGRATIONTYPES", INTEGRATION_TYPE,
           [(key, *INTEGRATION_TYPES[key]) for key in integration])  # fmt: skip
    _table(group, "SECTION", SECTION,
           [(ONLY_SECTION, "formed sheet", 1, MATERIAL, -1, -1, -1)])  # fmt: skip
    _table(group, "UNITSYSTEM", UNIT_SYSTEM, SI_UNITS)
    _table(group, "UNITS", UNIT, [(key, *about) for key, about in UNITS.values()])
    now = datetime.now(UTC)
    description = cells.provenance.get("title", "mapped forming fields")
    about = [
        ("ExporterName", str(cells.provenance.get("source", "lcmchain"))),
        ("FileDate", f"{now:%Y-%m-%d}"),
        ("FileTime", f"{now:%H:%M:%S}"),
        ("Description", f"{description}; SI units"),
        ("Analysis Type", "forming, mapped"),
        ("User Id", ""),
    ]
    group.create_dataset("METADATA", data=np.array(about, dtype=object), dtype=TEXT)

    rows = np.zeros((1 + int(oriented.sum()), 1), dtype=COORDINATE_SYSTEM)
    rows["myType"] = CARTESIAN
    rows["myIdentifier"][0], rows["myAxisVectors"][0, 0] = GLOBAL, np.eye(3).ravel()
    rows["myIdentifier"][1:, 0] = GLOBAL + 1 + np.flatnonzero(oriented)
    rows["myReferencePoint"][1:, 0] = cells.target.centroids[oriented]
    axes = _axes(cells, families[0][oriented], families[1][oriented], oriented)
    rows["myAxisVectors"][1:, 0] = axes.reshape(-1, 9)
    group.create_dataset("COORDINATESYSTEM", data=rows, dtype=COORDINATE_SYSTEM)


def _axes(
    cells: MappedCells, first: np.ndarray, second: np.ndarray, oriented: np.ndarray
) -> np.ndarray:
    """Orthonormal axes, one a row, shape (M, 3, 3): first family, across it, normal."""
    if cells.target.is_solid:
        normal = np.cross(first, second)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
    else:
        normal = cells.normals[oriented]
    return np.stack([first, np.cross(normal, first), normal], axis=1)


def unit_number(unit: str) -> int:
    """Return the identifier of a unit in the file; -1 of a number without one."""
    for number, _, _, symbol, _ in SI_UNITS:
        if symbol == unit:
            return number
    return UNITS[unit][0] if unit in UNITS else -1


def _table(group: h5py.Group, name: str, dtype: np.dtype, rows: list[tuple]) -> None:
    """One compound dataset of a column, shape (M, 1); lists become arrays of the column's type."""
    table = np.empty((len(rows), 1), dtype=dtype)
    lists = [h5py.check_vlen_dtype(dtype[column]) for column in dtype.names or ()]
    for row, values in enumerate(rows):
        table[row, 0] = tuple(
            np.array(value, dtype=of_list) if isinstance(value, list) else value
            for value, of_list in zip(values, lists, strict=True)
        )
    group.create_dataset(name, data=table, dtype=dtype)


def fixed_text(text: str) -> np.bytes_:
    """Return a text as the attributes of VMAP hold it."""
    # A fixed text of length nought is none in HDF5; the community's library writes a blank.
    return np.bytes_((text or " ").encode("utf-8"))
