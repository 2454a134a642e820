"""What the sections of Gmsh's MSH files hold, in the versions 2.2 and 4.1.

Source: Gmsh reference manual, "MSH file format", "MSH file format version 2", "Node ordering".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.mesh_files.file_mesh import NO_IDS
from lcmchain.mesh_files.readers.gmsh_numbers import Numbers, sections
from lcmchain.mesh_files.shapes import reordered

_TETRA = [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]
_HEXAHEDRON = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7),
               (5, 6), (6, 7)]  # fmt: skip
_WEDGE = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
_PYRAMID = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]


class Kind(NamedTuple):
    """An element type of Gmsh: meshio's name, dimension, node count, and places of VTK's nodes."""

    name: str
    dimension: int
    node_count: int
    order: np.ndarray


def _kind(name: str, dimension: int, node_count: int, order: np.ndarray | None = None) -> Kind:
    return Kind(name, dimension, node_count, np.arange(node_count) if order is None else order)


def _solid(name: str, corner_count: int, edges: list, node_count: int) -> Kind:
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


class Batch(NamedTuple):
    """Elements of one type on one entity.

    Parameters
    ----------
    ids : (C,). nodes : tags in VTK's order, (C, K). physical : tags of the groups they are in.
    """

    kind: Kind
    ids: np.ndarray
    nodes: np.ndarray
    entity: int
    physical: tuple[int, ...]


@dataclass
class Content:
    """Nodes, elements, and names and members of physical groups of a file."""

    node_ids: np.ndarray = field(default_factory=lambda: NO_IDS)
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    batches: list[Batch] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)
    physical: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def read_sections(path: Path, content: bytes, version_4: bool, options: dict) -> Content:
    read = Content()
    walk = sections(path, content)
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
                numbers = Numbers(path, name, content, start, end, **options)
                if options["binary"] and not version_4:
                    numbers = _counted_binary(path, name, content, start, options)
                _READERS[name, version_4](numbers, read, options["binary"])
                taken = numbers.end if options["binary"] else 0
            elif name in ("PartitionedEntities", "Parametrizations"):
                read.notes.append(f"the section ${name} of the mesh is not read")
            section = walk.send(taken)
    except StopIteration:
        return read


def _counted_binary(path: Path, name: str, content: bytes, start: int, options: dict) -> Numbers:
    """Numbers behind the count that version 2 writes as text also in a binary file."""
    line = content.find(b"\n", start) + 1
    numbers = Numbers(path, name, content, max(line, start), len(content), **options)
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


def _entities_4(numbers: Numbers, read: Content, binary: bool) -> None:
    for dimension, count in enumerate(numbers.take("size", 4)):
        for _ in range(count):
            tag = numbers.one("int")
            numbers.take("real", 3 if dimension == 0 else 6)
            groups = numbers.take("int", numbers.one("size"))
            if dimension > 0:
                numbers.take("int", numbers.one("size"))
            read.physical[dimension, tag] = tuple(int(abs(group)) for group in groups)


def _nodes_4(numbers: Numbers, read: Content, binary: bool) -> None:
    blocks = numbers.take("size", 4)[0]
    ids, points = [NO_IDS], [np.empty((0, 3))]
    for _ in range(blocks):
        dimension, _, parametric = numbers.take("int", 3)
        count = numbers.one("size")
        ids.append(numbers.take("size", count))
        width = 3 + (int(dimension) if parametric else 0)
        points.append(numbers.take("real", width * count).reshape(count, width)[:, :3])
    read.node_ids, read.points = np.concatenate(ids), np.concatenate(points)


def _elements_4(numbers: Numbers, read: Content, binary: bool) -> None:
    for _ in range(numbers.take("size", 4)[0]):
        dimension, entity, code = (int(value) for value in numbers.take("int", 3))
        kind = _known(numbers, code)
        count = numbers.one("size")
        table = numbers.take("size", count * (1 + kind.node_count)).reshape(
            count, 1 + kind.node_count
        )
        groups = read.physical.get((dimension, entity), ())
        nodes = table[:, 1:][:, kind.order]
        read.batches.append(Batch(kind, table[:, 0], nodes, entity, groups))


def _nodes_2(numbers: Numbers, read: Content, binary: bool) -> None:
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


def _parametric_nodes_2(numbers: Numbers, read: Content, binary: bool) -> None:
    """Nodes with the entity on which they lie, and their parameters there (Mesh.SaveParametric)."""
    ids, points = [], []
    for _ in range(numbers.count if binary else numbers.one("int")):
        ids.append(numbers.one("int"))
        points.append(numbers.take("real", 3))
        dimension, _ = numbers.take("int", 2)
        numbers.take("real", int(dimension) if dimension in (1, 2) else 0)
    read.node_ids, read.points = np.array(ids, dtype=np.int64), np.array(points).reshape(-1, 3)


def _elements_2(numbers: Numbers, read: Content, binary: bool) -> None:
    rows: dict[tuple[int, int, tuple[int, ...]], list[np.ndarray]] = {}
    for code, tags, row in _rows_2(numbers, binary):
        groups = tuple(int(abs(tag)) for tag in tags[:1] if tag)
        entity = int(tags[1]) if len(tags) > 1 else 0
        rows.setdefault((code, entity, groups), []).append(row)
    for (code, entity, within), listed in rows.items():
        kind = KINDS[code]
        table = np.stack(listed)
        nodes = table[:, 1:][:, kind.order]
        read.batches.append(Batch(kind, table[:, 0], nodes, entity, within))


def _rows_2(numbers: Numbers, binary: bool) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
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


def _known(numbers: Numbers, code: int, tag_count: int = 0) -> Kind:
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
