"""Meshes of Gmsh (.msh, versions 2.2 and 4.1), with numbers and physical groups.

Source: Gmsh reference manual, "MSH file format", "MSH file format version 2", "Node ordering".
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, FileMesh, Numbering
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio
from lcmchain.mesh_files.readers.gmsh_sections import Batch, Content, read_sections

_ENTITIES = ("point", "curve", "surface", "volume")


def read_gmsh(path: Path) -> FileMesh:
    """Read a mesh; other files with this ending, and other versions, go to meshio.

    Raises
    ------
    InputError : the file is incomplete or broken, or has elements above the second order.
    """
    content = path.read_bytes()
    found = re.match(rb"\s*\$MeshFormat\s+(\d+\.?\d*)\s+([01])\s+(\d+)[^\n]*\n", content)
    if found is None:
        return read_by_meshio(path)  # Ansys has this ending too
    if found[1] not in (b"2", b"2.2", b"4.1") or found[3] not in (b"4", b"8"):
        return _of_other_version(path, found[1].decode())
    first = content[found.end() : found.end() + 4]
    numbers = {
        "binary": found[2] == b"1",
        "order": ">" if first == b"\0\0\0\1" else "<",
        "sizes": f"u{found[3].decode()}",
    }
    read = read_sections(path, content, found[1] == b"4.1", numbers)
    if not len(read.node_ids) or not read.batches:
        raise InputError("the file has no nodes or no elements", file=path)
    return _mesh(path, read)


def _of_other_version(path: Path, version: str) -> FileMesh:
    """Mesh as meshio reads it, without numbers."""
    try:
        mesh = read_by_meshio(path)
    except InputError as error:
        raise InputError(
            f"MSH {version} cannot be read here; save as version 4.1 (Mesh.MshFileVersion = 4.1): "
            f"{error.message}",
            file=path,
        ) from None
    mesh.notes_of_sets.append(
        f"numbers of nodes and elements of MSH {version} are not read, they are counted from 1; "
        "save as version 4.1"
    )
    return mesh


def _mesh(path: Path, read: Content) -> FileMesh:
    numbering = Numbering(read.node_ids)
    if len(np.unique(read.node_ids)) < len(read.node_ids):
        raise InputError("the section $Nodes lists a node twice", file=path)
    by_name: dict[str, list[Batch]] = {}
    for batch in read.batches:
        by_name.setdefault(batch.kind.name, []).append(batch)
    mesh = FileMesh(read.points, [], node_ids=read.node_ids, notes=read.notes)
    groups: dict[tuple[int, int], list[np.ndarray]] = {}
    ids = [NO_IDS]
    first = 0
    for name, batches in by_name.items():
        nodes = numbering.rows(np.concatenate([batch.nodes for batch in batches]))
        own = np.concatenate([batch.ids for batch in batches])
        if (nodes < 0).any():
            wrong = own[(nodes < 0).any(axis=1)][0]
            raise InputError(f"element {wrong} has a node that the file does not define", file=path)
        entity = np.concatenate([np.full(len(batch.ids), batch.entity) for batch in batches])
        # version 2 writes elements that are in several groups once for each
        _, kept, same = np.unique(
            np.column_stack([entity, nodes]), axis=0, return_index=True, return_inverse=True
        )
        order = np.sort(kept)
        row = first + np.searchsorted(order, kept)[same.reshape(-1)]
        at = 0
        for batch in batches:
            for group in batch.physical:
                rows = row[at : at + len(batch.ids)]
                groups.setdefault((batch.kind.dimension, group), []).append(rows)
            at += len(batch.ids)
        mesh.blocks.append((name, nodes[order]))
        ids.append(own[order])
        first += len(order)
    mesh.cell_ids = np.concatenate(ids)
    _fill_groups(mesh, read.names, groups)
    return mesh


def _fill_groups(
    mesh: FileMesh,
    names: dict[tuple[int, int], str],
    groups: dict[tuple[int, int], list[np.ndarray]],
) -> None:
    """Physical groups are the parts of the mesh, or sets of cells where they overlap."""
    spelt = [names.get(key, f"physical {_ENTITIES[key[0]]} {key[1]}") for key in groups]
    sets = {}
    for (key, rows), name in zip(groups.items(), spelt, strict=True):
        free = name if spelt.count(name) == 1 else f"{name} ({_ENTITIES[key[0]]} {key[1]})"
        sets[free] = np.unique(np.concatenate(rows))
    members = np.concatenate([NO_IDS, *sets.values()])
    if len(np.unique(members)) == len(members):
        mesh.parts = sets
    else:
        mesh.cell_sets = sets
