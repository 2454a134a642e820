"""Meshes of Universal files (.unv), with numbers, properties, groups and the unit of length.

I-deas, NX, Salome, Gmsh, Code_Aster and programs of measured vibrations write them.

Source: SDRC, "I-DEAS Universal file formats": datasets 15, 781 and 2411 (nodes), 780 and 2412
(elements), 2417 to 2477 (groups), 164 (units), 2420 (coordinate systems). The nodes of elements of
the second order go around: corner, middle of the side, corner, and so on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import (
    Cells,
    FileMesh,
    LeftOutElements,
    Numbering,
    Place,
    merged_blocks,
    parts_of_numbers,
    unique_nodes,
)
from lcmchain.mesh_files.readers.decks.common import NumberedSets, deck_lines, listed, real_number

_NODES_IN_ONE_LINE, _NODES, _ELEMENTS = (15,), (781, 2411), (780, 2412)
#: Datasets of groups, and how many numbers each member has; the first two are its kind and number.
_GROUPS = {2417: 2, 2429: 2, 2430: 2, 2432: 2, 2435: 4, 2452: 4, 2467: 4, 2477: 4}
_UNITS, _HEADER, _SYSTEMS, _OLD_SYSTEMS = 164, 151, 2420, 18
_NODE, _ELEMENT = 7, 8  # kinds of the members of groups

#: Shells (descriptors 41 to 96) and solids (101 to 118) by the number of their nodes: the shape,
#: and the places of VTK's nodes among those of the file.
_SHELLS: dict[int, tuple[str, list[int]]] = {
    3: ("triangle", [0, 1, 2]),
    4: ("quad", [0, 1, 2, 3]),
    6: ("triangle6", [0, 2, 4, 1, 3, 5]),
    7: ("triangle7", [0, 2, 4, 1, 3, 5, 6]),
    8: ("quad8", [0, 2, 4, 6, 1, 3, 5, 7]),
    9: ("quad9", [0, 2, 4, 6, 1, 3, 5, 7, 8]),
}
_SOLIDS: dict[int, tuple[str, list[int]]] = {
    4: ("tetra", list(range(4))),
    5: ("pyramid", list(range(5))),
    6: ("wedge", list(range(6))),
    8: ("hexahedron", list(range(8))),
    10: ("tetra10", [0, 2, 4, 9, 1, 3, 5, 6, 7, 8]),
    13: ("pyramid13", [0, 2, 4, 6, 12, 1, 3, 5, 7, 8, 9, 10, 11]),
    15: ("wedge15", [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8]),
    20: ("hexahedron20", [*range(0, 8, 2), *range(12, 20, 2), *range(1, 8, 2), *range(13, 20, 2),
                          *range(8, 12)]),
}  # fmt: skip
# Rods and beams; most have a line of their own with orientations before the nodes.
_BEAMS = (11, 21, 22, 23, 24, 25)
#: Metres to a unit by the code of dataset 164; other codes go by the factor alone.
_METRES = {1: 1.0, 2: 0.3048, 3: 1.0, 4: 0.3048, 5: 1e-3, 6: 1e-2, 7: 0.0254, 8: 1e-3, 10: 1e-3}

_NUMBER = re.compile(r"\s*(\d+)b?\b")
_REAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+|[+-]\d+)?")


class _Dataset(NamedTuple):
    """Number of a dataset, its lines, and the number of its first line in the file."""

    number: int
    lines: list[str]
    first: int


class _Element(NamedTuple):
    """An element as the file lists it."""

    label: int
    descriptor: int
    property: int
    nodes: list[int]
    line: int


def read_universal(path: Path) -> FileMesh:
    """Read the mesh of a file; other datasets than those of a mesh are named in the notes.

    Raises
    ------
    InputError : wrong or incomplete data, or no mesh at all; names file and line.
    """
    known = {*_NODES_IN_ONE_LINE, *_NODES, *_ELEMENTS, *_GROUPS, _UNITS, _HEADER, _SYSTEMS,
             _OLD_SYSTEMS}  # fmt: skip
    by_number: dict[int, list[_Lines]] = {}
    for dataset in _datasets(path):
        by_number.setdefault(dataset.number, []).append(_Lines(path, dataset))
    labels, points, node_lines, systems = [], [], [], set()
    for number in (*_NODES_IN_ONE_LINE, *_NODES):
        for lines in by_number.get(number, []):
            for label, system, point, line in _nodes(lines):
                labels.append(label)
                points.append(point)
                node_lines.append(line)
                systems.add(system)
    if not labels:
        raise InputError("the file has no nodes (dataset 15, 781 or 2411), so no mesh", file=path)
    ids, places = unique_nodes(
        np.array(labels, dtype=np.int64),
        np.array(points),
        lambda row: Place(path, node_lines[row]),
    )
    numbering = Numbering(ids)
    elements = [e for number in _ELEMENTS for lines in by_number.get(number, [])
                for e in _elements(lines)]  # fmt: skip
    mesh, left_out = _mesh(path, elements, ids, places, numbering)
    _take_groups(mesh, by_number, numbering, left_out)
    for lines in by_number.get(_UNITS, []):
        mesh.unit = _unit(lines, mesh.notes)
    _note_systems(mesh, by_number, systems, path)
    if others := [str(number) for number in by_number if number not in known]:
        mesh.notes_of_sets.append(f"datasets that are no part of a mesh here: {listed(others)}")
    return mesh


def _datasets(path: Path) -> Iterator[_Dataset]:
    """Datasets of the file in order.

    Raises
    ------
    InputError : one has no number or no end.
    """
    open_set: _Dataset | None = None
    begins = False  # whether the number of a dataset comes next
    for number, text in enumerate(deck_lines(path), start=1):
        delimiter = text[:6].strip() == "-1" and not text[6:].strip()
        if begins:
            found = _NUMBER.match(text)
            if found is None:
                raise Place(path, number).error(
                    f'"{text.strip()[:40]}" is no number of a dataset, which stands behind a -1'
                )
            open_set, begins = _Dataset(int(found[1]), [], number + 1), False
        elif delimiter and open_set is None:
            begins = True
        elif delimiter and open_set is not None:
            yield open_set
            open_set = None
        elif open_set is not None:
            open_set.lines.append(text)
    if open_set is not None or begins:
        raise InputError(
            f"dataset {open_set.number if open_set else ''} has no end (-1); the file is cut off, "
            "export it again",
            file=path,
        )


class _Lines:
    """Lines of a dataset, read one after the other."""

    def __init__(self, path: Path, dataset: _Dataset) -> None:
        self.path = path
        self.dataset = dataset
        self.at = 0

    def __bool__(self) -> bool:
        while self.at < len(self.dataset.lines) and not self.dataset.lines[self.at].strip():
            self.at += 1
        return self.at < len(self.dataset.lines)

    @property
    def line(self) -> int:
        """Number in the file of the line that was read last."""
        return self.dataset.first + self.at - 1

    def error(self, message: str) -> InputError:
        return Place(self.path, self.line).error(f"dataset {self.dataset.number}: {message}")

    def text(self) -> str:
        """Return the next line.

        Raises
        ------
        InputError : there is none.
        """
        if self.at >= len(self.dataset.lines):
            raise self.error("ends in the middle of a record; export the file again")
        self.at += 1
        return self.dataset.lines[self.at - 1]

    def peek(self) -> list[str]:
        """Return the words of the next line; none at the end."""
        return self.dataset.lines[self.at].split() if self.at < len(self.dataset.lines) else []

    def whole(self, least: int) -> list[int]:
        """Return the whole numbers of the next line, which has at least so many."""
        text = self.text()
        words = text.split()
        if len(words) < least:  # numbers that fill their ten columns touch each other
            words = [text[k : k + 10] for k in range(0, len(text.rstrip()), 10)]
        try:
            numbers = [int(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) < least or any(abs(number) >= 10**17 for number in numbers):
            raise self.error(f'"{text.strip()[:60]}" is not {least} or more whole numbers')
        return numbers

    def reals(self, text: str) -> list[float]:
        """Return three real numbers; exponents may be Fortran's."""
        words = _REAL.findall(text)
        if len(words) != 3 or _REAL.sub("", text).strip():
            raise self.error(f'"{text.strip()[:80]}" is not three numbers')
        return [real_number(word) for word in words]


def _nodes(lines: _Lines) -> Iterator[tuple[int, int, list[float], int]]:
    """Label, coordinate system, place and line of each node."""
    while lines:
        if lines.dataset.number in _NODES_IN_ONE_LINE:
            text = lines.text()
            words = text.split()[:4] if len(text.split()) == 7 else [
                text[k : k + 10] for k in range(0, 40, 10)
            ]  # fmt: skip
            rest = text.split(maxsplit=4)[4] if len(text.split()) == 7 else text[40:]
            try:
                label, system = int(words[0]), int(words[1])
            except ValueError:
                raise lines.error(f'"{text.strip()[:60]}" is no node') from None
            yield label, system, lines.reals(rest), lines.line
        else:
            label, system = lines.whole(2)[:2]
            line = lines.line
            yield label, system, lines.reals(lines.text()), line


def _elements(lines: _Lines) -> Iterator[_Element]:
    # 780 has a second number of each property: label, descriptor, then two and two of them
    table, count_at = (3, 7) if lines.dataset.number == 780 else (2, 5)
    while lines:
        head = lines.whole(count_at + 1)
        line, count = lines.line, head[count_at]
        if not 0 <= count <= 10_000:
            raise lines.error(f"element {head[0]} has {count} nodes")
        if head[1] in _BEAMS and (count > 2 or len(lines.peek()) != count):
            lines.text()
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += lines.whole(min(8, count - len(nodes)))
        yield _Element(head[0], head[1], head[table], nodes[:count], line)


def _shape(element: _Element) -> tuple[str, list[int]] | None:
    """Shape of an element and the places of its nodes; None where it is no cell."""
    if 41 <= element.descriptor <= 96 and element.descriptor % 10 not in (3, 6):  # cubic ones
        return _SHELLS.get(len(element.nodes))
    if 101 <= element.descriptor <= 118:
        return _SOLIDS.get(len(element.nodes))
    return None


def _mesh(
    path: Path, elements: list[_Element], ids: np.ndarray, points: np.ndarray, nodes: Numbering
) -> tuple[FileMesh, LeftOutElements]:
    """Mesh of nodes and elements, and the elements that are none of its cells."""
    by_shape: dict[str, list[_Element]] = {}
    orders: dict[str, list[int]] = {}
    aside: list[_Element] = []
    for element in elements:
        shape = _shape(element)
        if shape is None:
            aside.append(element)
        else:
            by_shape.setdefault(shape[0], []).append(element)
            orders[shape[0]] = shape[1]
    groups = []
    for name, alike in by_shape.items():
        table = np.array([element.nodes for element in alike], dtype=np.int64)[:, orders[name]]
        places = [Place(path, element.line) for element in alike]
        labels = np.array([element.label for element in alike], dtype=np.int64)
        groups.append(Cells(name, labels, table, places.__getitem__))
    blocks, cell_ids = merged_blocks(groups, nodes)
    mesh = FileMesh(points, blocks, cell_ids, ids)
    for element in aside:
        kind = "beam" if element.descriptor in _BEAMS else f"descriptor {element.descriptor}"
        mesh.left_aside[kind] = mesh.left_aside.get(kind, 0) + 1
    properties = {element.label: element.property for element in elements}
    numbers = np.array([properties[label] for label in cell_ids.tolist()], dtype=np.int64)
    named = {number: f"property {number}" for number in numbers.tolist()}
    mesh.parts = parts_of_numbers(numbers, named)
    return mesh, LeftOutElements([(element.label, element.nodes) for element in aside])


def _take_groups(
    mesh: FileMesh,
    by_number: dict[int, list[_Lines]],
    nodes: Numbering,
    left_out: LeftOutElements,
) -> None:
    """Take groups of nodes and of elements; one of both becomes a set of each."""
    sets = NumberedSets(mesh, nodes)
    cells = Numbering(mesh.cell_ids)
    others: list[str] = []
    for number, size in _GROUPS.items():
        for lines in by_number.get(number, []):
            while lines:
                head = lines.whole(2)
                name = lines.text().strip() or f"group {head[0]}"
                count = head[7] if len(head) > 7 else head[-1]
                listing: list[int] = []
                while len(listing) < count * size:
                    listing += lines.whole(min(8, count * size - len(listing)))
                members = np.array(listing[: count * size], dtype=np.int64).reshape(-1, size)
                kinds, labels = members[:, 0], members[:, 1]
                if (kinds == _NODE).any():
                    sets.add_nodes(name, labels[kinds == _NODE])
                if (kinds == _ELEMENT).any() or count == 0:
                    sets.add_cells(name, labels[kinds == _ELEMENT], cells, 0, left_out)
                unknown = int(((kinds != _NODE) & (kinds != _ELEMENT)).sum())
                if unknown:
                    others.append(f"{name} ({unknown})")
    sets.tell()
    if others:
        mesh.notes_of_sets.append(
            f"members of groups that are neither nodes nor elements are left out: {listed(others)}"
        )


def _unit(lines: _Lines, notes: list[str]) -> float | None:
    """Metres to the unit of length that dataset 164 states, None where it contradicts itself.

    Its factors divide a number of the file to make it one of SI.
    """
    text = lines.text()
    code = int(text[:10]) if text[:10].strip().isdigit() else 0
    factor = lines.reals(lines.text())[0]
    known = _METRES.get(code)
    by_factor = 1.0 / factor if factor > 0.0 else None
    if known is None or by_factor is None:
        return known or by_factor
    if abs(by_factor / known - 1.0) < 1e-3:
        return known
    notes.append(
        f"the units (dataset 164) contradict themselves: the code {code} stands for {known:g} m, "
        f"the factor for {by_factor:g} m; they are not looked at, length_unit alone counts"
    )
    return None


def _note_systems(
    mesh: FileMesh, by_number: dict[int, list[_Lines]], used: set[int], path: Path
) -> None:
    """Refuse or name coordinate systems that nodes refer to and that are not the global one."""
    if by_number.get(15) and by_number.get(_OLD_SYSTEMS) and max(used, default=0) > 0:
        raise InputError(
            "nodes are given in coordinate systems of their own (dataset 18), which are not "
            "followed; export them in the global one",
            file=path,
        )
    moved = [system for lines in by_number.get(_SYSTEMS, []) for system in _moving(lines)]
    named = sorted(used & set(moved))
    if named:
        mesh.notes.append(
            f"nodes name the coordinate systems {listed([str(n) for n in named])}, which are moved "
            "against that of the part; their places are taken as those in the part, as the format "
            "says: look at the mesh"
        )


def _moving(lines: _Lines) -> Iterator[int]:
    """Numbers of the systems of dataset 2420 whose matrix moves anything."""
    lines.text()
    lines.text()
    while lines:
        label, kind = lines.whole(2)[:2]
        lines.text()
        matrix = np.array([lines.reals(lines.text()) for _ in range(4)])
        if kind != 0 or not np.allclose(matrix, np.vstack([np.eye(3), np.zeros(3)]), atol=1e-12):
            yield label
