"""VMAP: the vendor-neutral HDF5 file of the VMAP Standards Community, version 0.5.2 of its layout.

Source: VMAP Standard Specifications (vmap-standard.org), and files that the community's own
library wrote, for the numbers of element and integration types.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.report import ExportReport, Loss, Saver, worst
from lcmchain.mapping.formats.vmap_system import (
    GLOBAL,
    MATERIAL,
    ONLY_SECTION,
    fixed_text,
    unit_number,
    write_material,
    write_system,
)
from lcmchain.mapping.formats.vmap_types import ELEMENT, ELEMENT_TYPES
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.surfaces.averages import perpendicular_family_error

NAME = "vmap"

GEOMETRY = "1"
STATE = "STATE-1"

# Where values lie, and what they are made of.
ON_ELEMENTS = 3
REAL = 1

LARGEST_IDENTIFIER = np.iinfo(np.int32).max


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write mesh, sets, both fibre directions and every other field of the cells.

    The coordinate system of an element has the first fibre direction as its first axis and the
    normal of the sheet as its third one.

    Raises
    ------
    InputError : no fibre directions, cells of a type that VMAP does not name, or numbers of cells
        or nodes beyond 32 bits.
    """
    target = cells.target
    families = _with_plane(cells, cells.families(NAME))
    for what, numbers in (("cell", target.cell_ids), ("node", target.node_ids)):
        if numbers.max(initial=0) > LARGEST_IDENTIFIER:
            raise InputError(
                f"the {what} number {numbers.max()} does not fit into the 32 bits of VMAP",
                file=target.file,
            )
    unknown = sorted({name for name, _ in target.blocks} - set(ELEMENT_TYPES))
    if unknown:
        raise InputError(
            f"VMAP has no element type for cells of the type {', '.join(unknown)}; mesh the "
            f"target with {', '.join(ELEMENT_TYPES)}",
            file=target.file,
        )
    return partial(_write, path, cells, families)


def _with_plane(
    cells: MappedCells, families: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return two directions (C, 3) that span the sheet: both families, or one and that across it.

    Raises
    ------
    InputError : a single family in solids, which have no normal.
    """
    if len(families) > 1:
        return families[0], families[1]
    cells.require_shells(f"{NAME} of a fabric with one family")
    return families[0], np.cross(cells.normals, families[0])


def _write(path: Path, cells: MappedCells, families: tuple[np.ndarray, np.ndarray]) -> ExportReport:
    # Families that lie on each other span no plane (not a number, too, is not above nought).
    spanned = np.linalg.norm(np.cross(*families), axis=1) > 0.0
    oriented = cells.mapped & spanned
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        root = file.create_group("VMAP")
        root.attrs["VERSION"] = np.array(
            (0, 5, 2), dtype=[("myMajor", "<i4"), ("myMinor", "<i4"), ("myPatch", "<i4")]
        )
        _write_geometry(root.create_group(f"GEOMETRY/{GEOMETRY}"), cells, oriented)
        write_material(root.create_group("MATERIAL"), cells)
        write_system(root.create_group("SYSTEM"), cells, families, oriented)
        _write_variables(root.create_group(f"VARIABLES/{STATE}"), cells)
    dropped = worst(
        "an element's coordinate system is orthonormal, so that a reader that takes it alone has "
        "the second family perpendicular to the first (both directions are variables of the file)",
        perpendicular_family_error(*families),
        cells.target.cell_ids,
        unit="rad",
    )
    losses = [dropped] if FIBRE_FAMILIES[1] in cells.vectors else []
    return ExportReport(
        NAME,
        [path.name],
        int(cells.mapped.sum()),
        [*losses, *_unmapped(cells)],
        details={"geometry": GEOMETRY, "state": STATE},
    )


def _unmapped(cells: MappedCells) -> list[Loss]:
    count = int((~cells.mapped).sum())
    return [Loss(f"{count} unmapped cells are in the mesh and in no variable")] if count else []


def _write_geometry(group: h5py.Group, cells: MappedCells, oriented: np.ndarray) -> None:
    target = cells.target
    group.attrs["MYNAME"] = fixed_text(target.file.stem if target.file else "target")
    points = group.create_group("POINTS")
    points.attrs["MYSIZE"] = np.uint64(len(target.points))
    points.attrs["MYCOORDINATESYSTEM"] = np.int32(GLOBAL)
    points["MYCOORDINATES"] = np.asarray(target.points, dtype="<f8")
    points["MYIDENTIFIERS"] = target.node_ids.astype("<i4")[:, None]

    rows = np.empty((target.cell_count, 1), dtype=ELEMENT)
    rows["myIdentifier"][:, 0] = target.cell_ids
    rows["myCoordinateSystem"][:, 0] = np.where(
        oriented, GLOBAL + 1 + np.arange(target.cell_count), GLOBAL
    )
    rows["myMaterialType"], rows["mySectionType"] = MATERIAL, ONLY_SECTION
    first = 0
    for number, (_, nodes) in enumerate(target.blocks):
        block = slice(first, first + len(nodes))
        rows["myElementType"][block] = number
        for row, of_cell in zip(rows["myConnectivity"][block], nodes, strict=True):
            row[0] = target.node_ids[of_cell].astype("<i4")
        first += len(nodes)
    elements = group.create_group("ELEMENTS")
    elements.attrs["MYSIZE"] = np.uint64(target.cell_count)
    elements.create_dataset("MYELEMENTS", data=rows, dtype=ELEMENT)

    sets = group.create_group("GEOMETRYSETS")
    found = [
        *((name, 0, target.node_ids[rows_]) for name, rows_ in target.node_sets.items()),
        *((name, 1, target.cell_ids[rows_]) for name, rows_ in target.cell_sets.items()),
        *(
            (name, 1, target.cell_ids[rows_])
            for name, rows_ in target.parts.items()
            if name not in target.cell_sets
        ),
    ]
    sets.attrs["MYSIZE"] = np.int32(len(found))
    for number, (name, kind, ids) in enumerate(found):
        one = sets.create_group(f"{number:06d}")
        one.attrs["MYIDENTIFIER"] = np.int32(number)
        one.attrs["MYSETINDEXTYPE"] = np.int32(1)  # members are given by their identifiers
        one.attrs["MYSETNAME"] = fixed_text(name)
        one.attrs["MYSETTYPE"] = np.int32(kind)  # 0 nodes, 1 elements
        one["MYGEOMETRYSETDATA"] = ids.astype("<i4")[:, None]


def _write_variables(state: h5py.Group, cells: MappedCells) -> None:
    time = 0.0 if cells.time is None else cells.time
    state.attrs["MYSTATEINCREMENT"] = np.int32(0)
    state.attrs["MYSTATENAME"] = fixed_text("formed")
    state.attrs["MYSTEPTIME"], state.attrs["MYTOTALTIME"] = time, time
    group = state.create_group(GEOMETRY)
    fields = {
        **{name: values[:, None] for name, values in cells.scalars.items()},
        **{name: cells.vectors[name] for name in _families_first(cells)},
    }
    number = 0
    for name, values in fields.items():
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            continue
        number += 1
        component = name if name in cells.scalars else f"{name}_x"
        about = cells.attributes.get(component, {})
        unit = str(about.get("units", "1"))
        variable = group.create_group(name.upper())
        attributes: dict[str, Any] = {
            "MYCOORDINATESYSTEM": np.int32(-1),  # components along the global axes
            "MYDIMENSION": np.int32(values.shape[1]),
            "MYENTITY": np.int32(REAL),
            "MYIDENTIFIER": np.int32(number),
            "MYINCREMENTVALUE": np.int32(0),
            "MYLOCATION": np.int32(ON_ELEMENTS),
            "MYMULTIPLICITY": np.int32(1),
            "MYTIMEVALUE": time,
            "MYUNIT": np.int32(unit_number(unit)),
            "MYVARIABLEDEPENDENCY": fixed_text(" "),
            "MYVARIABLEDESCRIPTION": fixed_text(f"{about.get('long_name', name)} [{unit}]"),
            "MYVARIABLENAME": fixed_text(name.upper()),
        }
        for key, value in attributes.items():
            variable.attrs[key] = value
        variable["MYGEOMETRYIDS"] = cells.target.cell_ids[known].astype("<i4")[:, None]
        variable["MYVALUES"] = values[known].astype("<f8")
    group.attrs["MYSIZE"] = np.int32(number)


def _families_first(cells: MappedCells) -> list[str]:
    others = [name for name in cells.vectors if name not in FIBRE_FAMILIES]
    return [*(name for name in FIBRE_FAMILIES if name in cells.vectors), *others]
