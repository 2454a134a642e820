"""Surfaces of Wavefront OBJ files: vertices, faces and groups.

Source: Wavefront, "Object files (.obj)", appendix B1 of the Advanced Visualizer manual. Normals and
texture coordinates have counts of their own and play no part here; meshio takes them for values at
the vertices.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lcmchain.mesh_files.file_mesh import FileMesh, Place
from lcmchain.mesh_files.readers.decks import deck_lines

_SHAPES = {3: "triangle", 4: "quad"}
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
