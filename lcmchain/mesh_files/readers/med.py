"""Meshes of MED files (Salome, Code_Aster), with numbers and groups.

Source: MED-fichier documentation, "Représentation interne HDF5"; groups are unions of families.
MED numbers the nodes of solids such that the normal of the first face points outwards, VTK inwards
(Gmsh, ``GModelIO_MED.cpp``, turns them in the same way).
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, FileMesh, only_sound
from lcmchain.mesh_files.shapes import SOLID_EDGES, reordered

_TYPES = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6",
    "TR7": "triangle7", "QU4": "quad", "QU8": "quad8", "QU9": "quad9", "TE4": "tetra",
    "T10": "tetra10", "PY5": "pyramid", "P13": "pyramid13", "PE6": "wedge", "P15": "wedge15",
    "HE8": "hexahedron", "H20": "hexahedron20", "H27": "hexahedron20", "P18": "wedge15",
}  # fmt: skip
_TURNED = {
    "tetra": [0, 2, 1, 3],
    "pyramid": [0, 3, 2, 1, 4],
    "wedge": [0, 2, 1, 3, 5, 4],
    "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
}


def read_med(path: Path) -> FileMesh:
    """Read the mesh of a MED file.

    Raises
    ------
    InputError : the file is no MED file, is broken, or holds no mesh or several.
    """
    with only_sound("MED", path), h5py.File(path, "r") as file:
        return _mesh(file, path)


def _mesh(file: h5py.File, path: Path) -> FileMesh:
    meshes = list(file["ENS_MAA"])
    if len(meshes) != 1:
        raise InputError(
            f"holds {len(meshes)} meshes ({', '.join(meshes)}); export the one to map onto",
            file=path,
        )
    name = meshes[0]
    group = file["ENS_MAA"][name]
    dimension = int(group.attrs["ESP"])
    step = group if "NOE" in group else group[list(group)[-1]]  # the last state of a moving mesh
    points = _columns(step["NOE"]["COO"], dimension)
    mesh = FileMesh(points, [])
    mesh.node_ids = _numbers(step["NOE"], len(points), mesh.notes, "nodes")
    ids, families, numbered = [], [], True
    for code, cells in step["MAI"].items():
        if code not in _TYPES:
            mesh.left_aside[code] = int(cells["NOD"].attrs["NBR"]) if "NOD" in cells else 0
            continue
        count = int(cells["NOD"].attrs["NBR"])
        nodes = np.asarray(cells["NOD"][()]).reshape(-1, count).T.astype(np.int64) - 1
        mesh.blocks.append((_TYPES[code], nodes[:, _order(_TYPES[code], nodes.shape[1])]))
        numbers = _numbers(cells, count, mesh.notes, "cells")
        numbered &= len(numbers) == count
        ids.append(numbers)
        known = np.asarray(cells["FAM"][()]) if "FAM" in cells else np.zeros(count)
        families.append(known.astype(np.int64))
    every = np.concatenate([NO_IDS, *ids])
    if numbered and len(np.unique(every)) == mesh.cell_count:
        mesh.cell_ids = every
    elif numbered and mesh.cell_count:
        mesh.notes.append(
            "MED numbers the cells of each type from 1: they are counted through instead"
        )
    tree = step["FAS"] if "FAS" in step else file["FAS"][name] if "FAS" in file else {}
    of_cells = np.concatenate([NO_IDS, *families])
    mesh.cell_sets = _groups(tree.get("ELEME", {}), of_cells)
    if "FAM" in step["NOE"]:
        of_nodes = np.asarray(step["NOE"]["FAM"][()]).astype(np.int64)
        mesh.node_sets = _groups(tree.get("NOEUD", {}), of_nodes)
    return mesh


def _columns(dataset: h5py.Dataset, dimension: int) -> np.ndarray:
    """Table that MED stores column after column."""
    return np.asarray(dataset[()], dtype=float).reshape(dimension, -1).T


def _order(name: str, node_count: int) -> np.ndarray:
    """Places of VTK's nodes among MED's."""
    shape = name.rstrip("0123456789")
    if shape not in _TURNED:
        return np.arange(node_count)
    return reordered(name, _TURNED[shape], SOLID_EDGES[shape])


def _numbers(group: h5py.Group, count: int, notes: list[str], of: str) -> np.ndarray:
    """Numbers that the file gives to nodes or cells, if it does."""
    if "NUM" not in group:
        return NO_IDS
    numbers = np.asarray(group["NUM"][()]).astype(np.int64)
    if numbers.shape != (count,) or len(np.unique(numbers)) < count:
        notes.append(f"the numbers of {of} repeat: they are counted from 1 instead")
        return NO_IDS
    return numbers


def _groups(tree: h5py.Group, families: np.ndarray) -> dict[str, np.ndarray]:
    """Rows of the members of each group: those of all families that belong to it."""
    members: dict[str, list[np.ndarray]] = {}
    for family in tree.values():
        if "GRO" not in family:
            continue
        rows = np.flatnonzero(families == int(family.attrs["NUM"]))
        for letters in np.atleast_2d(family["GRO"]["NOM"][()]):
            name = bytes(int(letter) % 256 for letter in np.ravel(letters)).split(b"\0")[0]
            text = name.decode("utf-8", errors="replace").strip()
            if text:
                members.setdefault(text, []).append(rows)
    return {name: np.unique(np.concatenate(rows)) for name, rows in members.items()}
