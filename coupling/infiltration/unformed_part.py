"""A part on a mesh that was not formed here, and permeabilities along axes of their own.

The axis of a permeability is a direction in space. In a cell of the normal n it is laid into the
plane, a - (a·n) n, and the second axis stands across it there.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lcmchain.coupling.infiltration.formed_part import (
    AXES,
    PERMEABILITIES,
    FormedPart,
    read_formed_part,
)
from lcmchain.errors import InputError
from lcmchain.fields.table import FIELDS
from lcmchain.fields.ugrid import UgridMesh, Variable
from lcmchain.mapping.sheet import file_sha256
from lcmchain.mapping.structure.stage import open_mapped
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.mesh_files.readers.nastran_sets import AMBIGUOUS_SETS
from lcmchain.scene.preform import OwnPermeability, Preform

#: Attribute of the dataset of a part that was not formed here: the name of its mesh file.
UNFORMED = "unformed_mesh"
# An axis that leaves less than this part of it in the plane of a cell has no direction there.
_LEAST_IN_PLANE = 1e-6


def unformed_part(path: Path | str, preform: Preform, *, length_unit: str = "m") -> FormedPart:
    """Return the mesh of a file with a preform that is the same everywhere.

    Parameters
    ----------
    path : mesh file of triangles and quadrilaterals (:func:`lcmchain.mapping.target.read_target`).
    length_unit : of its coordinates.

    Raises
    ------
    InputError : a file that cannot be read, one that was formed, or an axis that stands on a cell.
    """
    path = Path(path)
    if _is_result(path):
        raise InputError(
            "is of a mesh that was not formed, but this file is a result; leave the table out, "
            "and give [[regions]] where the formed values do not hold",
            key="preform",
        )
    target = read_target(path, kind="infiltration", length_unit=length_unit)
    if preform.sets_hold == "cells":
        nodes = {n: rows for n, rows in target.node_sets.items() if n not in target.cell_sets}
        notes = tuple(note for note in target.notes if AMBIGUOUS_SETS not in note)
        target = replace(target, node_sets=nodes, notes=notes)
    mesh = UgridMesh("target")
    count = target.cell_count
    values = {
        "thickness": np.full(count, preform.thickness),
        "fibre_volume_fraction": np.full(count, preform.fibre_volume_fraction),
    }
    variables: dict[str, Variable] = {
        **mesh.topology(target.corners, long_name="preform"),
        **mesh.node_positions(target.points),
    }
    for name, own in values.items():
        variables[name] = mesh.on_cells(own, _about(name))
    attributes = {
        "title": path.stem, UNFORMED: path.name, "source_file": path.name,
        "source_sha256": file_sha256(path),
    }  # fmt: skip
    part = FormedPart(target, mesh.dataset(variables, attributes), str(path), tuple(target.notes))
    return with_own_permeability(part, preform.permeability, np.arange(count))


def part_of_case(
    path: Path | str,
    preform: Preform | None,
    *,
    length_unit: str = "m",
    frame: int = -1,
    allow_incomplete: bool = False,
) -> FormedPart:
    """Return what a case fills: the mesh of its preform, or a part that was formed.

    Parameters
    ----------
    path : mesh file, or forming result or mapped file (:func:`.formed_part.read_formed_part`).
    preform : of the case; None where its part was formed.
    length_unit : of the coordinates of a mesh. frame, allow_incomplete : of a part that was formed.

    Raises
    ------
    InputError : the file cannot be read, or there is a frame of a mesh, or a unit of a result.
    """
    if preform is None:
        if length_unit != "m":
            raise InputError(
                "is of a mesh that was not formed; a result is in metres: leave it out, or give "
                "[preform] in the case",
                key="length_unit",
            )
        return read_formed_part(path, frame=frame, allow_incomplete=allow_incomplete)
    if frame != -1:
        raise InputError(
            f"is {frame}, but a mesh that was not formed has no frames; leave it out", key="frame"
        )
    if not Path(path).is_file():
        raise InputError("there is no such file", file=path)
    return unformed_part(path, preform, length_unit=length_unit)


def require_origin(part: FormedPart, preform: Preform | None) -> None:
    """Refuse the preform of a case for a part that was formed.

    Raises
    ------
    InputError : there is one, and the part was formed.
    """
    if preform is not None and UNFORMED not in part.dataset.attrs:
        raise InputError(
            "is of a mesh that was not formed here, but this part was; leave the table out",
            key="preform",
        )


def with_own_permeability(part: FormedPart, own: OwnPermeability, cells: np.ndarray) -> FormedPart:
    """Return the part with a permeability along axes of its own in some cells.

    The larger value is the first, as in every result.

    Parameters
    ----------
    cells : rows.

    Raises
    ------
    InputError : the axis stands on one of the cells.
    """
    first, second = axes_in_plane(part.target, cells, np.array(own.axis), part)
    values = np.array([own.k1, own.ratio * own.k1])
    if own.ratio > 1.0:
        first, second, values = second, -first, values[::-1]
    normals = part.target.surface.normals[cells]
    given: dict[str, np.ndarray | float] = dict(zip(PERMEABILITIES, values))
    if own.k3 is not None:
        given[PERMEABILITIES[2]] = own.k3
    for number, axis in enumerate((first, second, normals)):
        for place in range(3):
            given[AXES[3 * number + place]] = axis[:, place]
    dataset = part.dataset.copy()
    for name, value in given.items():
        there = name in dataset
        field = part.cell(name).copy() if there else np.full(part.target.cell_count, np.nan)
        field[cells] = value
        if there:
            dataset[name] = dataset[name].copy(data=field)
        else:
            dataset[name] = part.mesh.on_cells(field, _about(name))
    return replace(part, dataset=dataset)


def axes_in_plane(
    target: TargetMesh, cells: np.ndarray, axis: np.ndarray, part: FormedPart
) -> tuple[np.ndarray, np.ndarray]:
    """Return a direction laid into the planes of cells, and that across it, (n, 3) each.

    Raises
    ------
    InputError : it stands on a cell.
    """
    normals = target.surface.normals[cells]
    laid = axis - (normals @ axis)[:, None] * normals
    length = np.linalg.norm(laid, axis=1)
    if not np.all(length > _LEAST_IN_PLANE):
        cell = int(cells[np.argmin(length)])
        raise InputError(
            f"the axis ({', '.join(f'{x:g}' for x in axis)}) of the permeability stands on "
            f"{part.place(cell)}; give one that has a direction in its plane, or regions",
            key="permeability.axis",
        )
    laid /= length[:, None]
    return laid, np.cross(normals, laid)


def _about(name: str) -> dict:
    stem = name[:-2] if name in AXES else name
    return FIELDS[stem].attributes(name) | {"_FillValue": np.nan}


def _is_result(path: Path) -> bool:
    """Tell whether a file is a forming result or a mapped file."""
    try:
        dataset = open_mapped(path)
    except InputError:
        return False
    return str(dataset.attrs.get("Conventions", "")).startswith("CF")
