"""Surfaces of facets: Wavefront OBJ and PLY files.

Source: Wavefront, "Object files (.obj)", appendix B1 of the Advanced Visualizer manual; Turk, "The
PLY polygon file format" (1994). Normals and texture coordinates have counts of their own and play
no part here. meshio takes those of OBJ for values at the vertices, and a second list of a face of
PLY, such as its texture coordinates, for a number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh, Place
from lcmchain.mesh_files.readers.by_meshio import take_arrays
from lcmchain.mesh_files.readers.decks.common import deck_lines

#: Types of faces by the number of their vertices; all others are polygons.
_SHAPES = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


# --- OBJ ------------------------------------------------------------------------------------------


#: Statements that shape a curved surface, which is none of facets.
_FREE_FORM = ("curv", "curv2", "surf", "vp", "cstype")


def read_obj(path: Path) -> FileMesh:
    """Read vertices and faces; groups (g), else objects (o), are the parts.

    Raises
    ------
    InputError : a vertex or a face that is none; names the line.
    """
    points: list[list[float]] = []
    runs: list[tuple[str, list[list[int]]]] = []  # faces of one kind in a row
    group, known = "", ""
    owners: dict[str, list[str]] = {"g": [], "o": []}
    aside: dict[str, int] = {}
    object_name = ""
    for place, words in _statements(path):
        if words[0] == "v":
            points.append(_vertex(words, place))
        elif words[0] in ("f", "fo"):
            nodes = _face(words, len(points), place)
            shape = _SHAPES.get(len(nodes), "polygon")
            if not runs or known != group or len(runs[-1][1][-1]) != len(nodes):
                runs.append((shape, []))
            known = group
            runs[-1][1].append(nodes)
            owners["g"].append(group)
            owners["o"].append(object_name)
        elif words[0] == "g":
            group = " ".join(words[1:])
        elif words[0] == "o":
            object_name = " ".join(words[1:])
        elif words[0] in ("l", "p"):
            kind = "line" if words[0] == "l" else "vertex"
            aside[kind] = aside.get(kind, 0) + 1
        elif words[0] in _FREE_FORM:
            aside["free-form statement"] = aside.get("free-form statement", 0) + 1
    blocks = [(shape, np.array(faces, dtype=np.int64)) for shape, faces in runs]
    mesh = FileMesh(np.array(points, dtype=float).reshape(-1, 3), blocks, left_aside=aside)
    names = np.array(owners["g"] if any(owners["g"]) else owners["o"], dtype=object)
    for name in dict.fromkeys(names.tolist()):
        if name:
            mesh.parts[name] = np.flatnonzero(names == name)
    return mesh


def _statements(path: Path) -> Iterator[tuple[Place, list[str]]]:
    """Words of each statement; a backslash at the end of a line goes on in the next."""
    begun: list[str] = []
    first = 0
    for number, raw in enumerate(deck_lines(path), start=1):
        text = raw.partition("#")[0].rstrip()
        if not begun:
            first = number
        if text.endswith("\\"):
            begun += text[:-1].split()
            continue
        words = begun + text.split()
        begun = []
        if words:
            yield Place(path, first), words


def _vertex(words: list[str], place: Place) -> list[float]:
    """Coordinates of a vertex; a weight or a colour may follow them."""
    try:
        point = [float(word) for word in words[1:4]]
    except ValueError:
        point = []
    if len(point) < 3:
        raise place.error(f'"{" ".join(words)[:60]}" is no vertex: v x y z')
    return point


def _face(words: list[str], count: int, place: Place) -> list[int]:
    """Rows of the vertices of a face; numbers below zero count back from the last vertex."""
    try:
        numbers = [int(word.partition("/")[0]) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) < 3:
        raise place.error(f'"{" ".join(words)[:60]}" is no face: f and three or more vertices')
    rows = [number - 1 if number > 0 else count + number for number in numbers]
    for number, row in zip(numbers, rows, strict=True):
        if number == 0 or not 0 <= row < 2**62:
            raise place.error(f"the face has the vertex {number}, which the file does not define")
    return rows


# --- PLY ------------------------------------------------------------------------------------------


_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
#: Names that programs give to the list of the vertices of a face.
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """Name and type of a property; ``count`` is the type of a list's length, "" of a number."""

    name: str
    kind: str
    count: str = ""


@dataclass(frozen=True)
class _Element:
    """Element of the header: its name, how many of it follow, and what each has."""

    name: str
    count: int
    properties: list[_Property]


def read_ply(path: Path) -> FileMesh:
    """Read vertices and faces; numbers of each face divide them as those of other formats do.

    Raises
    ------
    InputError : the header or what follows it is broken; names the line of a header.
    """
    content = path.read_bytes()
    order, elements, start = _header(path, content)
    words = iter(content[start:].split()) if order == "" else None
    at = start
    points = np.empty((0, 3))
    faces: list[np.ndarray] = []
    numbers: dict[str, np.ndarray] = {}
    aside: dict[str, int] = {}
    notes: list[str] = []
    try:
        for element in elements:
            if words is not None:
                columns = _columns_of_text(element, words)
            else:
                columns, at = _columns_of_bytes(element, content, at, order)
            if element.name == "vertex":
                points = np.column_stack([_column(columns, name, path) for name in "xyz"])
            elif element.name == "face":
                faces, numbers = _faces(element, columns, path, notes)
            elif element.count:
                aside[element.name] = element.count
    except (StopIteration, ValueError, OverflowError):
        raise InputError(
            "the PLY file ends before its last number, or holds something that is no number; "
            "export it again",
            file=path,
        ) from None
    blocks: list[tuple[str, list[np.ndarray]]] = []
    for face in faces:
        if not blocks or len(blocks[-1][1][-1]) != len(face):
            blocks.append((_SHAPES.get(len(face), "polygon"), []))
        blocks[-1][1].append(face)
    mesh = FileMesh(points, [(name, np.stack(rows)) for name, rows in blocks])
    mesh.left_aside, mesh.notes = aside, notes
    take_arrays(mesh, numbers, {})
    return mesh


def _header(path: Path, content: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ("" for text), elements, and where the data begin."""
    end = re.search(rb"^end_header[ \t]*(?:\r\n|\n|\r)", content, re.MULTILINE)
    if end is None:
        raise InputError("the header of the PLY file has no end; it is cut off", file=path)
    orders = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
    order: str | None = None
    elements: list[_Element] = []
    lines = content[: end.start()].decode("latin-1").splitlines()
    for number, line in enumerate(lines, start=1):
        words = line.split()
        match words:
            case ["format", name, _] if name in orders:
                order = orders[name]
            case ["element", name, count] if count.isdigit() and len(count) < 18:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", count, kind, name] if (
                elements and count in _TYPES and kind in _TYPES
            ):
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(_Property(name, _TYPES[kind]))
            case [] | ["ply"] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise InputError(f'line {number}: "{line[:60]}" is no header of PLY', file=path)
    if order is None:
        raise InputError("the header of the PLY file names no format", file=path)
    return order, elements, end.end()


def _columns_of_text(element: _Element, words: Iterator[bytes]) -> dict[str, Any]:
    """Values of each property of an element, those of lists as arrays."""
    columns: dict[str, Any] = {one.name: [] for one in element.properties}
    for _ in range(element.count):
        for one in element.properties:
            whole = one.kind[0] in "iu"
            count = int(next(words)) if one.count else 1
            values = [(int if whole else float)(next(words)) for _ in range(count)]
            columns[one.name].append(np.array(values) if one.count else values[0])
    for one in element.properties:
        if not one.count:
            columns[one.name] = np.array(columns[one.name], dtype=one.kind)
    return columns


def _columns_of_bytes(
    element: _Element, content: bytes, at: int, order: str
) -> tuple[dict[str, Any], int]:
    """The same of a binary file, and where the next element begins."""
    lengths = [0] * len(element.properties)
    if element.count:
        _, lengths, _ = _row_of_bytes(element, content, at, order)
    # Nearly all files have lists of one length throughout, which make a table.
    row = np.dtype(
        [
            part
            for k, (one, length) in enumerate(zip(element.properties, lengths, strict=True))
            for part in (
                *([(f"count {k}", order + one.count)] if one.count else []),
                (f"{k}", order + one.kind, (length,) if one.count else ()),
            )
        ]
    )
    end = at + element.count * row.itemsize
    if end <= len(content):
        table = np.frombuffer(content, row, element.count, at) if row.itemsize else None
        if table is None:
            return {}, at
        if all((table[f"count {k}"] == length).all()
               for k, (one, length) in enumerate(zip(element.properties, lengths, strict=True))
               if one.count):  # fmt: skip
            return {one.name: table[f"{k}"] for k, one in enumerate(element.properties)}, end
    columns: dict[str, Any] = {one.name: [] for one in element.properties}
    for _ in range(element.count):
        values, _, at = _row_of_bytes(element, content, at, order)
        for one, value in zip(element.properties, values, strict=True):
            columns[one.name].append(value if one.count else value[0])
    return columns, at


def _row_of_bytes(
    element: _Element, content: bytes, at: int, order: str
) -> tuple[list[np.ndarray], list[int], int]:
    """Values and their number of each property of one element, and where the next one begins."""
    values, lengths = [], []
    for one in element.properties:
        length = 1
        if one.count:
            counted = np.dtype(order + one.count)
            length = int(np.frombuffer(content, counted, 1, at)[0])
            at += counted.itemsize
        if length < 0 or length > len(content):
            raise ValueError(length)
        values.append(np.frombuffer(content, order + one.kind, length, at))
        at += values[-1].nbytes
        lengths.append(length)
    return values, lengths, at


def _column(columns: dict[str, Any], name: str, path: Path) -> np.ndarray:
    if name not in columns:
        raise InputError(f"the vertices of the PLY file have no {name}", file=path)
    return np.asarray(columns[name])


def _faces(
    element: _Element, columns: dict[str, Any], path: Path, notes: list[str]
) -> tuple[list[np.ndarray], dict[str, np.ndarray]]:
    """Rows of the vertices of each face, and the numbers that each face has by their names."""
    listed = [one.name for one in element.properties if one.count]
    corners = next((name for name in _CORNERS if name in listed), None)
    if corners is None:
        if element.count:
            raise InputError("the faces of the PLY file list no vertex_indices", file=path)
        return [], {}
    if others := [name for name in listed if name != corners]:
        notes.append(f"lists of the faces are left out: {', '.join(others)}")
    faces = [np.asarray(face, dtype=np.int64) for face in columns[corners]]
    numbers = {
        one.name: np.asarray(columns[one.name]) for one in element.properties if not one.count
    }
    kept = [row for row, face in enumerate(faces) if len(face)]
    if len(kept) < len(faces):
        notes.append(f"{len(faces) - len(kept)} faces without vertices are left out")
    return [faces[row] for row in kept], {name: all_[kept] for name, all_ in numbers.items()}
