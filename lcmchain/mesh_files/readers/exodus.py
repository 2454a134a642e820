"""Meshes of Exodus II files, with number maps, element blocks, node sets and side sets.

Source: Schoof and Yarberry, "EXODUS II: a finite element data model", SAND92-2137, appendix A.
"""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np

from lcmchain.mesh_files.file_mesh import NO_IDS, FileMesh, only_sound
from lcmchain.mesh_files.shapes import base_type, corner_count, edges_across_first

_SHAPES = {
    "HEX": {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron20"},
    "TET": {4: "tetra", 10: "tetra10"},
    "WED": {6: "wedge", 15: "wedge15"},
    "PYR": {5: "pyramid", 13: "pyramid13"},
    "SHE": {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"},
    "QUA": {4: "quad", 8: "quad8", 9: "quad9"},
    "TRI": {3: "triangle", 6: "triangle6"},
    "BAR": {2: "line", 3: "line3"},
    "BEA": {2: "line", 3: "line3"},
    "TRU": {2: "line", 3: "line3"},
    "SPH": {1: "vertex"},
    "CIR": {1: "vertex"},
}
# Nodes of the sides by their number from 1, corners from 0.
_SIDES: dict[str, list[tuple[int, ...]]] = {
    "hexahedron": [
        *[(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3)],
        *[(0, 3, 2, 1), (4, 5, 6, 7)],
    ],
    "tetra": [(0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)],
    "wedge": [(0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)],
    "pyramid": [(0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)],
}


def read_exodus(path: Path) -> FileMesh:
    """Read the mesh of an Exodus file.

    Raises
    ------
    InputError : the file is no Exodus file, or broken.
    """
    with only_sound("Exodus", path), netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return _mesh(file)


def _mesh(file: netCDF4.Dataset) -> FileMesh:
    mesh = FileMesh(_points(file), [])
    kinds: list[str] = []
    rows_of_file: list[np.ndarray] = []  # rows in the mesh of the elements in the file's order
    count_of_blocks = len(file.dimensions["num_el_blk"]) if "num_el_blk" in file.dimensions else 0
    names = _names(file, "eb_names", "eb_prop1", count_of_blocks, "block")
    first = 0
    for number, name in enumerate(names, start=1):
        if f"connect{number}" not in file.variables:
            continue  # an empty block
        variable = file.variables[f"connect{number}"]
        kind = str(getattr(variable, "elem_type", "")).upper()
        nodes = np.asarray(variable[:]).astype(np.int64) - 1
        shape = _SHAPES.get(kind[:3], {}).get(nodes.shape[1])
        if shape is None:
            label = kind or f"block of {nodes.shape[1]} nodes"
            mesh.left_aside[label] = mesh.left_aside.get(label, 0) + len(nodes)
            rows_of_file.append(np.full(len(nodes), -1))
            continue
        mesh.blocks.append((shape, nodes[:, edges_across_first(shape, nodes.shape[1])]))
        kinds += [kind] * len(nodes)
        mesh.parts[name] = np.arange(first, first + len(nodes))
        rows_of_file.append(mesh.parts[name])
        first += len(nodes)
    rows = np.concatenate([NO_IDS, *rows_of_file])
    ids = _map(file, ("elem_num_map", "elem_map", "elem_ids"), len(rows), mesh.notes)
    if len(ids):
        mesh.cell_ids = ids[rows >= 0]
    mesh.node_ids = _map(file, ("node_num_map",), len(mesh.points), mesh.notes)
    _take_sets(file, mesh, rows, kinds)
    return mesh


def _points(file: netCDF4.Dataset) -> np.ndarray:
    if "coord" in file.variables:
        return np.asarray(file.variables["coord"][:], dtype=float).T
    columns = [np.asarray(file.variables[f"coord{axis}"][:], dtype=float)
               for axis in "xyz" if f"coord{axis}" in file.variables]  # fmt: skip
    return np.stack(columns, axis=1)


def _names(file: netCDF4.Dataset, names: str, numbers: str, count: int, kind: str) -> list[str]:
    """Names of blocks or sets; the number of one without a name."""
    known = [""] * count
    if names in file.variables:
        known = [
            b"".join(np.ravel(row).tolist()).split(b"\0")[0].decode("utf-8", "replace").strip()
            for row in file.variables[names][:]
        ]
    ids = np.arange(1, count + 1)
    if numbers in file.variables:
        ids = np.asarray(file.variables[numbers][:]).astype(np.int64)
    spelt = [name or f"{kind} {number}" for name, number in zip(known, ids, strict=True)]
    return [
        name if spelt.count(name) == 1 else f"{name} ({number})"
        for name, number in zip(spelt, ids, strict=True)
    ]


def _map(
    file: netCDF4.Dataset, variables: tuple[str, ...], count: int, notes: list[str]
) -> np.ndarray:
    """Numbers of elements or nodes, if the file has them."""
    for name in variables:
        if name not in file.variables or name == "elem_map" and "elem_num_map" in file.variables:
            continue
        ids = np.asarray(file.variables[name][:]).astype(np.int64)
        if ids.shape == (count,) and len(np.unique(ids)) == count:
            return ids
        notes.append(f'"{name}" repeats numbers or has not all: they are counted from 1 instead')
    return NO_IDS


def _take_sets(file: netCDF4.Dataset, mesh: FileMesh, rows: np.ndarray, kinds: list[str]) -> None:
    """Take node sets, and the nodes of side sets."""
    if "num_node_sets" in file.dimensions:
        count = len(file.dimensions["num_node_sets"])
        names = _names(file, "ns_names", "ns_prop1", count, "node set")
        for number, name in enumerate(names, start=1):
            if f"node_ns{number}" in file.variables:
                nodes = np.asarray(file.variables[f"node_ns{number}"][:]).astype(np.int64) - 1
                mesh.node_sets[name] = np.unique(nodes[(nodes >= 0) & (nodes < len(mesh.points))])
    if "num_side_sets" not in file.dimensions:
        return
    count = len(file.dimensions["num_side_sets"])
    names = _names(file, "ss_names", "ss_prop1", count, "side set")
    lost = 0
    for number, name in enumerate(names, start=1):
        if f"elem_ss{number}" not in file.variables:
            continue
        elements = np.asarray(file.variables[f"elem_ss{number}"][:]).astype(np.int64) - 1
        sides = np.asarray(file.variables[f"side_ss{number}"][:]).astype(np.int64) - 1
        of_sides = [NO_IDS]
        for element, side in zip(elements, sides, strict=True):
            row = int(rows[element]) if 0 <= element < len(rows) else -1
            corners = _nodes_of_side(mesh, row, int(side), kinds) if row >= 0 else None
            lost += corners is None
            of_sides.append(NO_IDS if corners is None else corners)
        free = name if name not in mesh.node_sets else f"{name} (sides)"
        mesh.node_sets[free] = np.unique(np.concatenate(of_sides))
    mesh.notes.append(
        f"side sets are kept as the sets of their nodes: {', '.join(names[:8])}"
        + (f"; {lost} sides of unknown cells are left out" if lost else "")
    )


def _nodes_of_side(mesh: FileMesh, row: int, side: int, kinds: list[str]) -> np.ndarray | None:
    """Rows of the corners of a side; None where there is no such side."""
    first = 0
    for name, nodes in mesh.blocks:
        if row >= first + len(nodes):
            first += len(nodes)
            continue
        shape, cell = base_type(name), nodes[row - first]
        if shape in _SIDES:
            return cell[list(_SIDES[shape][side])] if 0 <= side < len(_SIDES[shape]) else None
        if shape not in ("triangle", "quad"):
            return cell
        count = corner_count(name)
        # a shell has its two faces first, a plane cell only its edges
        edge = side - 2 if kinds[row][:2] == "SH" or kinds[row].startswith("TRISH") else side
        if edge < 0:
            return cell[:count] if side >= 0 else None
        return cell[[edge, (edge + 1) % count]] if edge < count else None
    return None
