"""Meshes of Gmsh (.msh, versions 2.2 and 4.1), with numbers and physical groups.

Source: Gmsh reference manual, "MSH file format", "MSH file format version 2", "Node ordering".
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, FileMesh, Numbering
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio
from lcmchain.mesh_files.shapes import reordered

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
    read = _read_sections(path, content, found[1] == b"4.1", numbers)
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


def _mesh(path: Path, read: _Content) -> FileMesh:
    numbering = Numbering(read.node_ids)
    if len(np.unique(read.node_ids)) < len(read.node_ids):
        raise InputError("the section $Nodes lists a node twice", file=path)
    by_name: dict[str, list[_Batch]] = {}
    for batch in read.batches:
        by_name.setdefault(batch.kind.name, []).append(batch)
    mesh = FileMesh(read.points, [], node_ids=read.node_ids, notes=read.notes)
    groups: dict[tuple[int, int], list[np.ndarray]] = {}
    ids = [NO_IDS]
    first = 0
    for name, batches in by_name.items():
        nodes = numbering.rows(np.concatenate([batch.nodes for batch in batches]))
        numbers = np.concatenate([batch.ids for batch in batches])
        if (nodes < 0).any():
            wrong = numbers[(nodes < 0).any(axis=1)][0]
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
        ids.append(numbers[order])
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


# --- content of the sections, in the versions 2.2 and 4.1 -----------------------------------------


_TETRA = [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]
_HEXAHEDRON = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7),
               (5, 6), (6, 7)]  # fmt: skip
_WEDGE = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
_PYRAMID = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]


class _Kind(NamedTuple):
    """An element type of Gmsh: meshio's name, dimension, node count, and places of VTK's nodes."""

    name: str
    dimension: int
    node_count: int
    order: np.ndarray


def _kind(name: str, dimension: int, node_count: int, order: np.ndarray | None = None) -> _Kind:
    return _Kind(name, dimension, node_count, np.arange(node_count) if order is None else order)


def _solid(name: str, corner_count: int, edges: list, node_count: int) -> _Kind:
    return _kind(name, 3, node_count, reordered(name, list(range(corner_count)), edges))


# Nodes within faces and cells are left out of wedges, pyramids and hexahedra.
KINDS = {
    1: _kind("line", 1, 2), 2: _kind("triangle", 2, 3), 3: _kind("quad", 2, 4),
    4: _kind("tetra", 3, 4), 5: _kind("hexahedron", 3, 8), 6: _kind("wedge", 3, 6),
    7: _kind("pyramid", 3, 5), 8: _kind("line3", 1, 3), 9: _kind("triangle6", 2, 6),
    10: _kind("quad9", 2, 9), 11: _solid("tetra10", 4, _TETRA, 10),
    12: _solid("hexahedron20", 8, _HEXAHEDRON, 27), 13: _solid("wedge15", 6, _WEDGE, 18),
    14: _solid("pyramid13", 5, _PYRAMID, 14), 15: _kind("vertex", 0, 1),
    16: _kind("quad8", 2, 8), 17: _solid("hexahedron20", 8, _HEXAHEDRON, 20),
    18: _solid("wedge15", 6, _WEDGE, 15), 19: _solid("pyramid13", 5, _PYRAMID, 13),
}  # fmt: skip


class _Batch(NamedTuple):
    """Elements of one type on one entity.

    Parameters
    ----------
    ids : (C,). nodes : tags in VTK's order, (C, K). physical : tags of the groups they are in.
    """

    kind: _Kind
    ids: np.ndarray
    nodes: np.ndarray
    entity: int
    physical: tuple[int, ...]


@dataclass
class _Content:
    """Nodes, elements, and names and members of physical groups of a file."""

    node_ids: np.ndarray = field(default_factory=lambda: NO_IDS)
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    batches: list[_Batch] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)
    physical: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _read_sections(path: Path, content: bytes, version_4: bool, options: dict) -> _Content:
    read = _Content()
    walk = _sections(path, content)
    try:
        section = next(walk)
        while True:
            name, start, end = section
            taken = 0
            known = (
                {"Nodes", "Elements", "Entities"}
                if version_4
                else {"Nodes", "ParametricNodes", "Elements"}
            )
            if name == "PhysicalNames":
                read.names = _names(content[start:end])
            elif name in known:
                numbers = _Numbers(path, name, content, start, end, **options)
                if options["binary"] and not version_4:
                    numbers = _counted_binary(path, name, content, start, options)
                _READERS[name, version_4](numbers, read, options["binary"])
                taken = numbers.end if options["binary"] else 0
            elif name in ("PartitionedEntities", "Parametrizations"):
                read.notes.append(f"the section ${name} of the mesh is not read")
            section = walk.send(taken)
    except StopIteration:
        return read


def _counted_binary(path: Path, name: str, content: bytes, start: int, options: dict) -> _Numbers:
    """Numbers behind the count that version 2 writes as text also in a binary file."""
    line = content.find(b"\n", start) + 1
    numbers = _Numbers(path, name, content, max(line, start), len(content), **options)
    try:
        numbers.count = int(content[start:line])
    except ValueError:
        raise numbers.error("does not begin with a count") from None
    return numbers


def _names(content: bytes) -> dict[tuple[int, int], str]:
    """Names of physical groups by dimension and tag."""
    text = content.decode("utf-8", errors="replace")
    found = re.findall(r'^\s*(\d)\s+(\d{1,17})\s+"(.*)"\s*$', text, re.MULTILINE)
    return {(int(dimension), int(tag)): name for dimension, tag, name in found}


def _entities_4(numbers: _Numbers, read: _Content, binary: bool) -> None:
    for dimension, count in enumerate(numbers.take("size", 4)):
        for _ in range(count):
            tag = numbers.one("int")
            numbers.take("real", 3 if dimension == 0 else 6)
            groups = numbers.take("int", numbers.one("size"))
            if dimension > 0:
                numbers.take("int", numbers.one("size"))
            read.physical[dimension, tag] = tuple(int(abs(group)) for group in groups)


def _nodes_4(numbers: _Numbers, read: _Content, binary: bool) -> None:
    blocks = numbers.take("size", 4)[0]
    ids, points = [NO_IDS], [np.empty((0, 3))]
    for _ in range(blocks):
        dimension, _, parametric = numbers.take("int", 3)
        count = numbers.one("size")
        ids.append(numbers.take("size", count))
        width = 3 + (int(dimension) if parametric else 0)
        points.append(numbers.take("real", width * count).reshape(count, width)[:, :3])
    read.node_ids, read.points = np.concatenate(ids), np.concatenate(points)


def _elements_4(numbers: _Numbers, read: _Content, binary: bool) -> None:
    for _ in range(numbers.take("size", 4)[0]):
        dimension, entity, code = (int(value) for value in numbers.take("int", 3))
        kind = _known(numbers, code)
        count = numbers.one("size")
        table = numbers.take("size", count * (1 + kind.node_count)).reshape(
            count, 1 + kind.node_count
        )
        groups = read.physical.get((dimension, entity), ())
        nodes = table[:, 1:][:, kind.order]
        read.batches.append(_Batch(kind, table[:, 0], nodes, entity, groups))


def _nodes_2(numbers: _Numbers, read: _Content, binary: bool) -> None:
    if not binary:
        table = numbers.take("real", 4 * numbers.one("int")).reshape(-1, 4)
        if not np.all(np.abs(table[:, 0]) < 2**53):
            raise numbers.error("numbers a node with something that is no number")
        read.node_ids, read.points = table[:, 0].astype(np.int64), table[:, 1:]
        return
    ids, points = [], []
    for _ in range(numbers.count):
        ids.append(numbers.one("int"))
        points.append(numbers.take("real", 3))
    read.node_ids, read.points = np.array(ids, dtype=np.int64), np.array(points).reshape(-1, 3)


def _parametric_nodes_2(numbers: _Numbers, read: _Content, binary: bool) -> None:
    """Nodes with the entity on which they lie, and their parameters there (Mesh.SaveParametric)."""
    ids, points = [], []
    for _ in range(numbers.count if binary else numbers.one("int")):
        ids.append(numbers.one("int"))
        points.append(numbers.take("real", 3))
        dimension, _ = numbers.take("int", 2)
        numbers.take("real", int(dimension) if dimension in (1, 2) else 0)
    read.node_ids, read.points = np.array(ids, dtype=np.int64), np.array(points).reshape(-1, 3)


def _elements_2(numbers: _Numbers, read: _Content, binary: bool) -> None:
    rows: dict[tuple[int, int, tuple[int, ...]], list[np.ndarray]] = {}
    for code, tags, row in _rows_2(numbers, binary):
        groups = tuple(int(abs(tag)) for tag in tags[:1] if tag)
        entity = int(tags[1]) if len(tags) > 1 else 0
        rows.setdefault((code, entity, groups), []).append(row)
    for (code, entity, within), listed in rows.items():
        kind = KINDS[code]
        table = np.stack(listed)
        nodes = table[:, 1:][:, kind.order]
        read.batches.append(_Batch(kind, table[:, 0], nodes, entity, within))


def _rows_2(numbers: _Numbers, binary: bool) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Type, tags, and number with nodes of each element."""
    if not binary:
        for _ in range(numbers.one("int")):
            number, code, tag_count = (int(value) for value in numbers.take("int", 3))
            kind = _known(numbers, code, tag_count)
            values = numbers.take("int", tag_count + kind.node_count)
            yield code, values[:tag_count], np.concatenate([[number], values[tag_count:]])
        return
    left = numbers.count
    while left > 0:
        code, count, tag_count = (int(value) for value in numbers.take("int", 3))
        kind = _known(numbers, code, tag_count)
        if count < 1:
            raise numbers.error("holds a count that cannot be right (0)")
        left -= count
        width = 1 + tag_count + kind.node_count
        for row in numbers.take("int", count * width).reshape(count, width):
            yield code, row[1 : 1 + tag_count], np.concatenate([row[:1], row[1 + tag_count :]])


def _known(numbers: _Numbers, code: int, tag_count: int = 0) -> _Kind:
    """Kind of a type's number, which stands before a count of tags in version 2."""
    if tag_count < 0:
        raise numbers.error(f"holds a count that cannot be right ({tag_count})")
    if code not in KINDS:
        raise numbers.error(
            f"holds elements of type {code}, above the second order; mesh with order 1 or 2"
        )
    return KINDS[code]


_READERS = {
    ("Entities", True): _entities_4, ("Nodes", True): _nodes_4, ("Elements", True): _elements_4,
    ("Nodes", False): _nodes_2, ("Elements", False): _elements_2,
    ("ParametricNodes", False): _parametric_nodes_2,
}  # fmt: skip


# --- sections, and the numbers in them, as text or binary -----------------------------------------


_HEADER = re.compile(rb"\s*\$(\w+)[^\S\n]*\r?\n")


class _Numbers:
    """Numbers of a section, taken one after the other.

    Parameters
    ----------
    count : what a binary section of version 2 says in front as text.
    content : bytes of the file. start, end : of the section; a binary one ends where its numbers
        do. sizes : type of counts and tags in a binary file. order : of its bytes, ``<`` or ``>``.
    """

    def __init__(
        self, path: Path, name: str, content: bytes, start: int, end: int, *,
        binary: bool, sizes: str = "u8", order: str = "<",
    ) -> None:  # fmt: skip
        self._path, self._name, self._binary = path, name, binary
        self._content, self._at = content, start
        self._types = {"int": f"{order}i4", "size": f"{order}{sizes}", "real": f"{order}f8"}
        self._words = [] if binary else content[start:end].split()
        self._next = 0
        self.count = 0

    def take(self, kind: str, count: int = 1) -> np.ndarray:
        """Return the next numbers: ``"int"``, ``"size"`` (counts and tags) or ``"real"``.

        Raises
        ------
        InputError : there are not as many, or something else than numbers.
        """
        if count < 0 or count > len(self._content):
            raise self.error(f"holds a count that cannot be right ({count})")
        if self._binary:
            kept = np.dtype(self._types[kind])
            end = self._at + count * kept.itemsize
            if end > len(self._content):
                raise self.error("ends before its last number; the file is cut off")
            found = np.frombuffer(self._content, kept, count, self._at)
            self._at = end
        else:
            words = self._words[self._next : self._next + count]
            self._next += count
            if len(words) < count:
                raise self.error("ends before its last number; the file is cut off")
            if not count:
                return np.empty(0)
            try:
                found = np.array(words, dtype="S").astype(float if kind == "real" else np.int64)
            except (ValueError, OverflowError):
                raise self.error("holds something that is no number") from None
        return found.astype(float if kind == "real" else np.int64)

    def one(self, kind: str) -> int:
        """Return the next whole number."""
        return int(self.take(kind)[0])

    @property
    def end(self) -> int:
        """Place behind what was taken from a binary section."""
        return self._at

    def error(self, message: str) -> InputError:
        return InputError(f"the section ${self._name} {message}", file=self._path)


def _sections(path: Path, content: bytes) -> Generator[tuple[str, int, int], int | None, None]:
    """Yield name, start and end of each section; send the end of a binary one back.

    Raises
    ------
    InputError : a section has no end.
    """
    at = 0
    while (found := _HEADER.match(content, at)) is not None:
        name = found[1].decode("latin-1")
        closing = b"$End" + found[1]
        end = content.find(closing, found.end())
        if end < 0:
            raise InputError(f"the section ${name} has no end; the file is cut off", file=path)
        taken = yield name, found.end(), end
        if taken:
            end = content.find(closing, taken)
            if end < 0:
                raise InputError(f"the section ${name} has no end; the file is cut off", file=path)
        at = end + len(closing)
    if content[at:].strip():
        raise InputError("something that is no section of an MSH file follows", file=path)
