"""VTU files of the elements, and a time series (PVD) that ParaView opens at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import meshio
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.dataset import HISTORY, SHEET, SOLID
from lcmchain.fields.sheet import vector
from lcmchain.fields.stack import PLY, plies_of
from lcmchain.mesh_files.shapes import base_type, corner_count, is_known_to_vtk
from lcmchain.quantities.fields import BETWEEN_PLIES, FIELDS

if TYPE_CHECKING:
    import xarray as xr


#: Scalars of the nodes of the mid-surface.
OF_MID_SURFACE = ("wrinkle_height", "springback")


def write_vtu(path: Path | str, datasets: Mapping[str, xr.Dataset], frame: int = -1) -> None:
    """Write the elements in one frame with all face fields as cell data; whole or not at all.

    Points are the positions of the frame. They have the ``displacement``, ``tool_pressure``,
    ``wrinkle_height`` and, where the part is released, ``springback``. In a stack they also have
    the contact with other plies on their face: ``ply_pressure``, ``slip_path`` and so on. Vectors
    have three components.

    Cells are hexahedra, then the wedges of halved cells at a cut edge, or the triangles of the 2D
    approach. The cell data ``element`` holds the numbers of the elements, in a stack ``ply`` those
    of the plies, 0 the lowest.

    Raises
    ------
    InputError : the place cannot be written.
    """
    write_mesh(path, _mesh(datasets, frame))


def write_mesh(path: Path | str, mesh: meshio.Mesh) -> None:
    """Write a mesh with its data as VTU; whole or not at all.

    Raises
    ------
    InputError : the place cannot be written, or the mesh has cells that meshio does not write.
    OutputError : writing failed on the way.
    """
    with replacing(path) as temporary:
        try:
            meshio.write(temporary, mesh, file_format="vtu")
        except (meshio.WriteError, KeyError) as error:
            raise InputError(f"meshio cannot write this mesh as VTU ({error})", file=path) from None


def vtk_blocks(blocks: Sequence[tuple[str, np.ndarray]]) -> list[tuple[str, np.ndarray]]:
    """Return blocks of cells as a VTU file holds them.

    Parameters
    ----------
    blocks : meshio's name of the type and rows of the nodes of each block, shape (C_b, K).

    Returns
    -------
    The blocks as they are where VTK has a cell type of that name, else with their corners alone.
    """
    return [
        (name, nodes)
        if is_known_to_vtk(name)
        else (base_type(name), nodes[:, : corner_count(name)])
        for name, nodes in blocks
    ]


def without_middles(blocks: Sequence[tuple[str, np.ndarray]]) -> list[str]:
    """Return the sentence that names the cells of which a VTU file holds the corners alone."""
    names = sorted({name for name, _ in blocks if not is_known_to_vtk(name)})
    if not names:
        return []
    return [
        f"VTK has no type for {', '.join(names)} cells: the VTU file joins their corners alone, "
        "and keeps the other nodes as points without a cell"
    ]


def write_pvd(path: Path | str, datasets: Mapping[str, xr.Dataset]) -> None:
    """Write every frame as VTU into the folder ``<name>_frames`` and a PVD file that lists them.

    The PVD file comes last and names the frames by relative paths: the two can be moved together.
    """
    times = datasets[HISTORY]["time"].values
    for frame in range(len(times)):
        write_vtu(frame_file(path, frame), datasets, frame)
    write_frame_list(path, times)


def frame_file(path: Path | str, frame: int) -> Path:
    """Return the VTU file of one frame of the series that a PVD file lists."""
    path = Path(path)
    return path.with_name(f"{path.stem}_frames") / f"{path.stem}_{frame:04d}.vtu"


def write_frame_list(path: Path | str, times: Iterable[float]) -> None:
    """Write the PVD file that lists the VTU files of frames at their times [s].

    Raises
    ------
    InputError : the place cannot be written.
    """
    path = Path(path)
    entries = []
    for frame, time in enumerate(times):
        place = frame_file(path, frame)
        file = quoteattr(f"{place.parent.name}/{place.name}")
        entries.append(f'    <DataSet timestep="{float(time)!r}" group="" part="0" file={file}/>')
    with replacing(path) as temporary:
        temporary.write_text(
            '<?xml version="1.0"?>\n'
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
            "  <Collection>\n" + "\n".join(entries) + "\n  </Collection>\n</VTKFile>\n",
            encoding="utf-8",
        )


def _mesh(datasets: Mapping[str, xr.Dataset], frame: int) -> meshio.Mesh:
    """Return the mesh of one sheet, or of all plies one after the other."""
    plies = [groups for _, groups in plies_of(datasets)]
    return _stack_mesh(datasets, plies, frame) if plies else _sheet_mesh(datasets, frame)


def _stack_mesh(
    datasets: Mapping[str, xr.Dataset], plies: Sequence[Mapping[str, xr.Dataset]], frame: int
) -> meshio.Mesh:
    """Return all plies as one mesh: ``ply`` is the number of each cell's, 0 the lowest.

    Fields that a ply lacks are not a number there. ``element`` counts through all plies.
    """
    meshes = [_sheet_mesh(groups, frame) for groups in plies]
    kinds = dict.fromkeys(block.type for mesh in meshes for block in mesh.cells)
    first_point, first_element = 0, 0
    of_stack = _cell_fields(datasets[SHEET], frame)
    nodes: dict[str, list[np.ndarray]] = {kind: [] for kind in kinds}
    numbers: dict[str, list[np.ndarray]] = {kind: [] for kind in kinds}
    for mesh in meshes:
        for block, own in zip(mesh.cells, mesh.cell_data["element"], strict=True):
            nodes[block.type].append(block.data + first_point)
            numbers[block.type].append(own + first_element)
        first_point += len(mesh.points)
        first_element += sum(len(block.data) for block in mesh.cells)
    order = [np.concatenate(numbers[kind]) for kind in kinds]
    element = np.arange(first_element)
    ply = np.repeat(np.arange(len(meshes)), [sum(map(len, m.cell_data["element"])) for m in meshes])
    fields = {"ply": ply, **of_stack, "element": element}
    return meshio.Mesh(
        np.concatenate([mesh.points for mesh in meshes]),
        [(kind, np.concatenate(nodes[kind])) for kind in kinds],
        point_data=_joined_point_data(meshes),
        cell_data={name: [values[own] for own in order] for name, values in fields.items()},
    )


def _joined_point_data(meshes: Sequence[meshio.Mesh]) -> dict[str, np.ndarray]:
    names = dict.fromkeys(name for mesh in meshes for name in mesh.point_data)
    joined = {}
    for name in names:
        shape = next(m.point_data[name].shape[1:] for m in meshes if name in m.point_data)
        joined[name] = np.concatenate(
            [m.point_data.get(name, np.full((len(m.points), *shape), np.nan)) for m in meshes]
        )
    return joined


def _sheet_mesh(datasets: Mapping[str, xr.Dataset], frame: int) -> meshio.Mesh:
    sheet = datasets[SHEET]
    mesh = datasets.get(SOLID, sheet)  # without volumes the faces are the sheet itself
    reference = vector(mesh, "reference_position")
    displacement = vector(mesh, "displacement", frame)
    blocks = _solid_blocks(mesh) if SOLID in datasets else _face_blocks(mesh)
    element_count = sum(len(numbers) for _, numbers, _ in blocks)
    fields = _cell_fields(sheet, frame) | {"element": np.arange(element_count)}
    on_points = {"displacement": displacement}
    if "tool_pressure" in mesh:
        on_points["tool_pressure"] = mesh["tool_pressure"].values[frame]
    for name in OF_MID_SURFACE:
        if name in sheet:
            values = sheet[name].values[frame]
            # the same for the lower node and the upper node above it
            on_points[name] = np.tile(values, len(reference) // len(values))
    on_points |= _between_plies(sheet, frame)
    return meshio.Mesh(
        reference + displacement,
        [(kind, nodes) for kind, _, nodes in blocks],
        point_data=on_points,
        cell_data={
            name: [values[numbers] for _, numbers, _ in blocks] for name, values in fields.items()
        },
    )


def _between_plies(sheet: xr.Dataset, frame: int) -> dict[str, np.ndarray]:
    """Return what other plies do to the nodes of the solid: lower ones first, then upper ones."""
    fields = {}
    for top in (name for name in BETWEEN_PLIES if name.endswith("_top")):
        stem = top.removesuffix("_top")
        sides = [f"{stem}_{side}" for side in ("bottom", "top")]
        if FIELDS[top].variables[0] not in sheet:
            continue
        if FIELDS[top].is_vector:
            values = [vector(sheet, name, frame) for name in sides]
        else:
            values = [sheet[name].values[frame] for name in sides]
        fields[stem] = np.concatenate(values)
    return fields


def _solid_blocks(solid: xr.Dataset) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Kind of cell, element numbers and nodes of the solid-shells, kind by kind."""
    volumes = solid["solid_volume_nodes"].values.astype(np.int64)
    wedge = volumes[:, 6] < 0
    return [
        (kind, numbers, volumes[numbers, :corners])
        for kind, numbers, corners in (
            ("hexahedron", np.flatnonzero(~wedge), 8),
            ("wedge", np.flatnonzero(wedge), 6),
        )
        if len(numbers)
    ]


def _face_blocks(sheet: xr.Dataset) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Kind of cell, element numbers and nodes of the faces of a sheet, kind by kind."""
    faces = sheet["sheet_face_nodes"].values.astype(np.int64)
    triangle = faces[:, -1] < 0 if faces.shape[1] == 4 else np.ones(len(faces), dtype=bool)
    return [
        (kind, numbers, faces[numbers, :corners])
        for kind, numbers, corners in (
            ("quad", np.flatnonzero(~triangle), 4),
            ("triangle", np.flatnonzero(triangle), 3),
        )
        if len(numbers)
    ]


def _cell_fields(sheet: xr.Dataset, frame: int) -> dict[str, np.ndarray]:
    """Scalars (E,) and vectors (E, 3) of all face variables, in the order of the file."""
    names = [
        str(name)
        for name, variable in sheet.data_vars.items()
        if variable.attrs.get("location") == "face" and name != PLY
    ]
    fields = {}
    for name in names:
        stem = name[:-2]
        if all(f"{stem}_{axis}" in names for axis in "xyz"):
            fields[stem] = vector(sheet, stem, frame)
        else:
            fields[name] = sheet[name].values[frame]
    return fields
