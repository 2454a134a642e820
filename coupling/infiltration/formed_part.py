"""The part that resin flows through: a mesh with its sets, and the fields of its cells.

It comes from a forming result or a mapped file, or it is the mesh of a part that was not formed
here. A part can also be written into a folder, and read without its source.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.coupling.permeability import principal_permeabilities
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fields.ugrid import TIME, UgridMesh, Variable
from lcmchain.mapping.files import compact
from lcmchain.mapping.plies import on_faces_of_one
from lcmchain.mapping.sheet import (
    FIBRE_FAMILIES,
    SHARE,
    PrincipalPermeability,
    file_sha256,
    read_sheet,
)
from lcmchain.mapping.structure.mapped_file import is_mapped, mapped_state, open_mapped
from lcmchain.mapping.surfaces.averages import through_layers
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.mesh.places import place_text
from lcmchain.mesh_files.formats import format_of
from lcmchain.mesh_files.readers.decks.nastran_sets import AMBIGUOUS_SETS
from lcmchain.quantities.fields import FIELDS
from lcmchain.results import require_complete
from lcmchain.scene.infiltration import OwnPermeability, Preform
from lcmchain.scene.infiltration.laws import Permeability

if TYPE_CHECKING:
    import xarray as xr

#: Fields that every infiltration needs.
NEEDED = ("thickness", "fibre_volume_fraction")
PERMEABILITIES = ("permeability_1", "permeability_2", "permeability_3")
AXES = tuple(f"permeability_direction_{k}_{a}" for k in (1, 2, 3) for a in "xyz")


@dataclass(frozen=True)
class FormedPart:
    """Mesh and fields of a formed part.

    Parameters
    ----------
    target : triangles and quadrilaterals, with sets, parts and numbers; every node is a corner.
    dataset : UGRID dataset of one state on this mesh; results contain its fields.
    file : that it was read from, for messages.
    warnings : for the user.
    """

    target: TargetMesh
    dataset: xr.Dataset
    file: str
    warnings: tuple[str, ...] = ()

    @property
    def mesh(self) -> UgridMesh:
        """Mesh in the dataset."""
        return UgridMesh("target" if is_mapped(self.dataset) else "sheet")

    def cell(self, name: str) -> np.ndarray:
        """Return the values of a field of the cells, (C,).

        Raises
        ------
        InputError : there is no such field.
        """
        if name not in self.dataset:
            raise InputError(f"there is no {name}; {_remedy(name)}", file=self.file)
        return np.asarray(self.dataset[name].values, dtype=float)

    @property
    def ply_names(self) -> tuple[str, ...]:
        """Names of the plies of a stack, which are prefixes of their fields; none of one sheet."""
        names = map(str, self.dataset.data_vars)
        return tuple(name.removeprefix(SHARE) for name in names if name.startswith(SHARE))

    def number(self, cell: int) -> int:
        """Return the number of a cell in the user's file."""
        return int(self.target.cell_ids[cell])

    def place(self, cell: int) -> str:
        """Return number and centroid of a cell in words, for messages."""
        return f"cell {self.number(cell)} at {place_text(self.target.centroids[cell])}"


def read_formed_part(
    path: Path | str, *, frame: int = -1, allow_incomplete: bool = False
) -> FormedPart:
    """Read a mapped file, or a forming result, whose sheet is the mesh of the part.

    A stack of plies becomes one sheet on the faces of its largest ply, with all plies that overlap
    there (:func:`lcmchain.mapping.plies.on_faces_of_one`).

    Raises
    ------
    InputError : it is neither, its run was not complete (unless allowed), or a needed field is
        missing.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the forming.nc or the mapped file in it", file=path)
    if not path.is_file():
        raise InputError("there is no such file", file=path)
    try:
        dataset = open_mapped(path)
    except InputError:
        if not format_of(path):
            raise
        raise InputError(
            "is a mesh and no result of forming; to fill a part that was not formed, give "
            "[preform] in the case",
            file=path,
        ) from None
    if is_mapped(dataset):
        if frame != -1:
            raise InputError(
                f"is {frame}, but {path.name} holds one state; choose the frame when it is mapped, "
                "or start from the forming result",
                key="--frame",
            )
        part = _mapped_part(mapped_state(dataset), str(path))
    else:
        part = _sheet_part(path, frame)
    unfinished = require_complete(
        part.dataset.attrs.get("state"), file=path, allowed=allow_incomplete
    )
    for name in NEEDED:
        part.cell(name)
    attributes = part.dataset.attrs | {"source_file": path.name, "source_sha256": file_sha256(path)}
    return replace(
        part,
        dataset=part.dataset.assign_attrs(attributes),
        warnings=(*part.warnings, *unfinished),
    )


def with_permeability(
    part: FormedPart, law: Permeability | None, directory: Path | None = None
) -> FormedPart:
    """Return the part with the permeabilities of a law; without one it must have them.

    Out of the range of the law they are not a number; a region may replace them.

    Parameters
    ----------
    directory : folder to which a file of the law is relative.

    Raises
    ------
    InputError : there is neither a law nor a permeability.
    """
    if law is None:
        if any(name not in part.dataset for name in (*PERMEABILITIES[:2], *AXES[:6])):
            raise InputError(
                "there is no permeability: form with a [permeability] law in the scene, or give "
                "one in the table of the infiltration, such as "
                'permeability = { law = "gebart", fibre_radius = "3.5 um" }',
                file=part.file,
            )
        return part
    principal = _by_law(part, law, directory)
    dataset = part.dataset.copy()
    for number in (1, 2, 3):
        field = FIELDS[f"permeability_{number}"]
        about = field.attributes(field.name)
        about["long_name"] = f"{field.long_name} ({law.law})"
        values = principal.values[:, number - 1].copy()
        dataset[field.name] = part.mesh.on_cells(values, _open(about))
        axes = FIELDS[f"permeability_direction_{number}"]
        for axis, values in zip("xyz", principal.axes[:, number - 1].T, strict=True):
            name = f"{axes.name}_{axis}"
            dataset[name] = part.mesh.on_cells(
                np.ascontiguousarray(values), _open(axes.attributes(name))
            )
    return replace(part, dataset=dataset)


def fibre_directions(part: FormedPart, prefix: str = "") -> list[np.ndarray]:
    """Return the directions of all families of fibres in the cells, (C, 3) each; nan if missing.

    prefix : of the fields, for a ply of a stack.
    """
    present = [name for name in FIBRE_FAMILIES if f"{prefix}{name}_x" in part.dataset]
    return [
        np.stack([part.cell(f"{prefix}{family}_{axis}") for axis in "xyz"], axis=1)
        for family in present or FIBRE_FAMILIES[:1]
    ]


def _by_law(part: FormedPart, law: Permeability, directory: Path | None) -> PrincipalPermeability:
    """Return the permeability of every cell by a law; of a stack that of its layers together."""

    def of_textile(prefix: str) -> PrincipalPermeability:
        families = fibre_directions(part, prefix)
        fraction = part.cell(f"{prefix}fibre_volume_fraction")
        found = principal_permeabilities(
            law,
            fraction,
            *families,
            normal=part.target.surface.normals,
            out_of_range="nan",
            directory=directory,
        )
        return PrincipalPermeability(np.stack(found[:3], axis=1), np.stack(found[3:], axis=1))

    plies = part.ply_names
    if not plies:
        return of_textile("")
    shares = np.stack([np.nan_to_num(part.cell(f"{SHARE}{name}")) for name in plies])
    layers = [of_textile(f"{name}_") for name in plies]
    return through_layers(shares, layers, part.target.surface.normals)


# --- reading --------------------------------------------------------------------------------------


def _mapped_part(dataset: xr.Dataset, file: str) -> FormedPart:
    topology = dataset["target"].attrs
    if int(topology["topology_dimension"]) != 2:
        raise InputError(
            "the fields are mapped onto solids; infiltration takes a mesh of triangles and "
            "quadrilaterals: map onto the mid-surface",
            file=file,
        )
    names = str(topology["node_coordinates"]).split()
    by_axis = {str(dataset[name].attrs["axis"]): name for name in names}
    points = np.stack([dataset[by_axis[axis]].values for axis in "XYZ"], axis=1).astype(float)
    corners = np.asarray(dataset[str(topology["face_node_connectivity"])].values, dtype=np.int64)
    ids = {
        name: np.asarray(dataset[name].values, dtype=np.int64)
        for name in ("cell_id", "node_id")
        if name in dataset
    }
    target = TargetMesh(
        points,
        blocks_of(triangles_of_three(corners)),
        {},
        file=Path(file),
        cell_ids=ids.get("cell_id", np.empty(0, dtype=np.int64)),
        node_ids=ids.get("node_id", np.empty(0, dtype=np.int64)),
        cell_sets=_sets(dataset, "cell_set_"),
        node_sets=_sets(dataset, "node_set_"),
        parts=_parts(dataset),
    )
    return FormedPart(target, _one_state(dataset), file)


def blocks_of(corners: np.ndarray) -> tuple[tuple[str, np.ndarray], ...]:
    """Return blocks of consecutive cells of one type; -1 in ``corners`` (C, 4) is no corner."""
    count = (corners >= 0).sum(axis=1)
    blocks, first = [], 0
    for sides, alike in groupby(count.tolist()):
        last = first + len(list(alike))
        name = "triangle" if sides == 3 else "quad"
        blocks.append((name, corners[first:last, :sides]))
        first = last
    return tuple(blocks)


def triangles_of_three(corners: np.ndarray) -> np.ndarray:
    """Return cells (C, 4) in which a quadrilateral that names a corner twice is a triangle.

    Decks write triangles so. Only corners that follow each other may be the same.
    """
    following = np.roll(corners, -1, axis=1)
    same = (corners == following) & (corners >= 0)
    cells = np.flatnonzero(same.sum(axis=1) == 1)
    second = np.minimum(np.argmax(same[cells], axis=1) + 1, 3)  # the last may be the first again
    kept = np.sort((second[:, None] + np.arange(1, 4)) % 4, axis=1)
    found = corners.copy()
    found[cells, :3] = np.take_along_axis(corners[cells], kept, axis=1)
    found[cells, 3] = -1
    return found


def _sets(dataset: xr.Dataset, kind: str) -> dict[str, np.ndarray]:
    return {
        str(variable.attrs["set_name"]): np.flatnonzero(variable.values == 1)
        for name, variable in dataset.data_vars.items()
        if str(name).startswith(kind) and "set_name" in variable.attrs
    }


def _parts(dataset: xr.Dataset) -> dict[str, np.ndarray]:
    if "part" not in dataset or "part_names" not in dataset["part"].attrs:
        return {}
    names = str(dataset["part"].attrs["part_names"]).split("\n")
    numbers = dataset["part"].values
    return {name: np.flatnonzero(numbers == k) for k, name in enumerate(names, start=1)}


def _sheet_part(path: Path, frame: int) -> FormedPart:
    """Return the sheet of a forming result as a part."""
    sheet = read_sheet(path, frame=frame)
    warnings: tuple[str, ...] = ()
    if sheet.is_stack:
        sheet, warnings = on_faces_of_one(sheet)
    # one block of each shape, and no node without a face
    order = np.argsort(sheet.surface.faces[:, 3] < 0, kind="stable")
    used, faces = compact(sheet.surface.faces[order])
    target = TargetMesh(
        sheet.surface.points[used], blocks_of(faces), {}, file=path, cell_ids=order + 1,
        node_ids=used + 1,
    )  # fmt: skip
    mesh = UgridMesh("sheet")
    variables: dict[str, Variable] = {
        **mesh.topology(target.corners, long_name="formed sheet"),
        **mesh.node_positions(target.points),
    }
    fields = dict(sheet.scalars)
    for stem, vectors in sheet.directions.items():
        fields |= {f"{stem}_{axis}": values for axis, values in zip("xyz", vectors.T)}
    if sheet.permeability is not None:
        for number in range(3):
            fields[PERMEABILITIES[number]] = sheet.permeability.values[:, number]
            for axis in range(3):
                fields[AXES[3 * number + axis]] = sheet.permeability.axes[:, number, axis]
    for name, values in fields.items():
        about = {"long_name": name, "units": "1", **sheet.attributes.get(name, {})}
        variables[name] = mesh.on_cells(np.ascontiguousarray(values[order]), _open(about))
    attributes = dict(sheet.provenance)
    if sheet.time is not None:
        attributes["forming_time_s"] = sheet.time
    return FormedPart(target, mesh.dataset(variables, attributes), str(path), warnings)


def _one_state(dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset without its time, which is that of forming and not of the filling."""
    if TIME not in dataset.variables:
        return dataset
    time = float(dataset[TIME].values)
    return dataset.drop_vars(TIME).assign_attrs(forming_time_s=time)


def _open(about: dict) -> dict:
    """Return the attributes of a field with gaps."""
    return about | {"_FillValue": np.nan}


def _remedy(name: str) -> str:
    if name == "thickness":
        return 'form the sheet with element = "solid-shell", which predicts it'
    if name == "fibre_volume_fraction":
        return "give material.fibre_density and material.areal_mass in the scene, and form again"
    return "form again with this version, or map a whole forming result"


# --- a mesh that was not formed here, and permeabilities along an axis ----------------------------
# The axis of a permeability is a direction a in space. It is projected into the plane of a cell
# with the normal n, a - (a·n) n. The second axis is perpendicular to it in this plane.


#: Attribute of the dataset of a part that was not formed here: the name of its mesh file.
UNFORMED = "unformed_mesh"
# Least length of the projection of an axis, over that of the axis, which gives a direction.
_LEAST_IN_PLANE = 1e-6


def unformed_part(path: Path | str, preform: Preform, *, length_unit: str = "m") -> FormedPart:
    """Return the mesh of a file with a uniform preform.

    Parameters
    ----------
    path : mesh file of triangles and quadrilaterals (:func:`lcmchain.mapping.target.read_target`).
    length_unit : of its coordinates.

    Raises
    ------
    InputError : a file that cannot be read, a forming result, or an axis normal to a cell.
    """
    path = Path(path)
    if _is_result(path):
        raise InputError(
            "is of a mesh that was not formed, but this file is a result; leave the table out, "
            "and give [[regions]] where the formed values do not hold",
            key="preform",
        )
    target = read_target(path, kind="infiltration", length_unit=length_unit).by_corners()
    if not target.is_solid:
        target = replace(target, blocks=blocks_of(triangles_of_three(target.corners)))
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
    for name, of_cells in values.items():
        variables[name] = mesh.on_cells(of_cells, _about(name))
    attributes = {
        "title": path.stem, UNFORMED: path.name, "source_file": path.name,
        "source_sha256": file_sha256(path),
    }  # fmt: skip
    part = FormedPart(target, mesh.dataset(variables, attributes), str(path), tuple(target.notes))
    rows = np.arange(count)
    return with_own_permeability(part, preform.permeability, rows, "preform.permeability")


def part_of_case(
    path: Path | str,
    preform: Preform | None,
    *,
    length_unit: str = "m",
    frame: int = -1,
    allow_incomplete: bool = False,
) -> FormedPart:
    """Return the part of a case: the mesh of its preform, or a part that was formed.

    Parameters
    ----------
    path : mesh file, or forming result or mapped file (:func:`read_formed_part`).
    preform : of the case; None where its part was formed.
    length_unit : of the coordinates of a mesh.
    frame, allow_incomplete : of a part that was formed.

    Raises
    ------
    InputError : the file cannot be read, or a mesh has a frame, or a result a length unit.
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


def with_own_permeability(
    part: FormedPart, own: OwnPermeability, cells: np.ndarray, key: str
) -> FormedPart:
    """Return the part with a permeability along an axis in some cells.

    The larger value is the first, as in every result.

    Parameters
    ----------
    own : the permeability and its axis.
    cells : rows.
    key : of the permeability, for a message.

    Raises
    ------
    InputError : the axis is normal to one of the cells, and there is a ratio.
    """
    first, second = axes_in_plane(part, cells, own, key)
    values = np.array([own.k1, own.ratio * own.k1])
    if own.ratio > 1.0:
        first, second, values = second, -first, values[::-1]
    normals = part.target.surface.normals[cells]
    fields: dict[str, np.ndarray | float] = dict(zip(PERMEABILITIES, values))
    if own.k3 is not None:
        fields[PERMEABILITIES[2]] = own.k3
    for number, axis in enumerate((first, second, normals)):
        for component in range(3):
            fields[AXES[3 * number + component]] = axis[:, component]
    dataset = part.dataset.copy()
    for name, value in fields.items():
        exists = name in dataset
        field = part.cell(name).copy() if exists else np.full(part.target.cell_count, np.nan)
        field[cells] = value
        if exists:
            dataset[name] = dataset[name].copy(data=field)
        else:
            dataset[name] = part.mesh.on_cells(field, _about(name))
    return replace(part, dataset=dataset)


def axes_in_plane(
    part: FormedPart, cells: np.ndarray, own: OwnPermeability, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the axis of a permeability in the planes of cells, and the one across it, (n, 3) each.

    Without a ratio every direction is as good: a cell that the axis is normal to takes another one.

    Raises
    ------
    InputError : the axis is normal to a cell, and its direction counts; names the ``key``.
    """
    normals = part.target.surface.normals[cells]
    axis = np.array(own.axis)
    projected = axis - (normals @ axis)[:, None] * normals
    length = np.linalg.norm(projected, axis=1)
    normal_to = ~(length > _LEAST_IN_PLANE)
    if normal_to.any() and own.ratio != 1.0:
        cell = int(cells[np.argmax(normal_to)])
        raise InputError(
            f"the axis ({', '.join(f'{x:g}' for x in axis)}) of the permeability stands on "
            f"{part.place(cell)}; give one that has a direction in its plane, or regions",
            key=f"{key}.axis",
        )
    if normal_to.any():
        n = normals[normal_to]
        other = np.eye(3)[np.argmin(np.abs(n), axis=1)]
        projected[normal_to] = other - np.einsum("ci,ci->c", other, n)[:, None] * n
        length = np.linalg.norm(projected, axis=1)
    projected /= length[:, None]
    return projected, np.cross(normals, projected)


def _about(name: str) -> dict:
    stem = name[:-2] if name in AXES else name
    return _open(FIELDS[stem].attributes(name))


def _is_result(path: Path) -> bool:
    """Whether a file is a forming result or a mapped file."""
    try:
        dataset = open_mapped(path)
    except InputError:
        return False
    return str(dataset.attrs.get("Conventions", "")).startswith("CF")


# --- a part in a folder, without its source -------------------------------------------------------


_FIELDS_FILE, _MESH_FILE = "part.nc", "part_mesh.npz"
# Tables of sets of a target mesh.
_SETS = ("cell_sets", "node_sets", "parts")


def write_part(folder: Path, part: FormedPart) -> None:
    """Write the fields of a part (``part.nc``, UGRID) and its mesh with numbers and sets."""
    folder.mkdir(parents=True, exist_ok=True)
    write_netcdf(folder / _FIELDS_FILE, {ROOT: part.dataset})
    target = part.target
    arrays = {"points": target.points, "cell_ids": target.cell_ids, "node_ids": target.node_ids}
    about: dict[str, Any] = {
        "file": Path(part.file).name,
        "warnings": list(part.warnings),
        "blocks": [name for name, _ in target.blocks],
        "notes": list(target.notes),
        "coordinates": [str(name) for name in part.dataset.coords],
    }
    for number, (_, cells) in enumerate(target.blocks):
        arrays[f"block_{number}"] = cells
    for table in _SETS:
        entries = getattr(target, table)
        about[table] = list(entries)
        arrays |= {f"{table}_{number}": rows for number, rows in enumerate(entries.values())}
    arrays["about"] = np.array(json.dumps(about))
    np.savez(folder / _MESH_FILE, **arrays)  # type: ignore[arg-type]  # numpy 2.4 types its options so


def read_part(folder: Path) -> FormedPart:
    """Read a part that :func:`write_part` has written; it fills bit-identically.

    Raises
    ------
    InputError : the files are missing, or are no part.
    """
    try:
        with open_netcdf(folder / _FIELDS_FILE, mask_and_scale=False) as dataset:
            dataset = dataset.load()
        with np.load(folder / _MESH_FILE, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            dataset = dataset.set_coords(about["coordinates"])
            blocks = tuple(
                (name, data[f"block_{number}"]) for number, name in enumerate(about["blocks"])
            )
            sets: dict[str, Any] = {
                table: {name: data[f"{table}_{k}"] for k, name in enumerate(about[table])}
                for table in _SETS
            }
            target = TargetMesh(
                data["points"], blocks, {}, cell_ids=data["cell_ids"], node_ids=data["node_ids"],
                notes=tuple(about["notes"]), **sets,
            )  # fmt: skip
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"this is no formed part ({error})", file=folder) from None
    return FormedPart(target, dataset, about["file"], tuple(about["warnings"]))
