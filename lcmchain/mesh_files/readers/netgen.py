"""Meshes of NETGEN (.vol), with the names of materials and boundaries.

Source: NETGEN, ``libsrc/meshing/meshclass.cpp``, ``Mesh::Save`` and ``Mesh::Load``. The orders of
nodes are those of meshio, whose reader refuses the files of NETGEN since 6.2.2300
(``facedescriptors``). NETGEN lists the nodes of solids turned against VTK.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from meshio.netgen._netgen import (
    netgen2d_to_meshio_type,
    netgen3d_to_meshio_type,
    netgen_to_meshio_pmap,
)

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh, Place
from lcmchain.mesh_files.readers.decks.common import deck_lines

#: Columns before the number of nodes of an element: of its boundary or material, and of the count.
_SURFACES = {"surfaceelements": (1, 4), "surfaceelementsgi": (1, 4), "surfaceelementsuv": (1, 4)}
_SOLIDS = {"volumeelements": (0, 1)}
_NAMES = ("materials", "bcnames")


def read_netgen(path: Path) -> FileMesh:
    """Read nodes, triangles, quadrilaterals and solids; materials and boundaries are the parts.

    Raises
    ------
    InputError : wrong or incomplete data, or no mesh at all; names file and line.
    """
    points = np.empty((0, 3))
    names: dict[str, dict[int, str]] = {section: {} for section in _NAMES}
    runs: list[tuple[str, list[tuple[int, list[int]]]]] = []
    aside = 0
    dimension = 3
    lines = _Sections(path)
    for section in lines:
        if section == "dimension":
            dimension = lines.whole()
        elif section == "points":
            points = np.array([lines.reals() for _ in range(lines.whole())]).reshape(-1, 3)
        elif section in _SURFACES or section in _SOLIDS:
            columns, types = (
                (_SURFACES[section], netgen2d_to_meshio_type)
                if section in _SURFACES
                else (_SOLIDS[section], netgen3d_to_meshio_type)
            )
            runs.append((section, [lines.element(*columns, types) for _ in range(lines.whole())]))
        elif section.startswith("edgesegments"):
            aside += lines.whole()
        elif section in _NAMES:
            for _ in range(lines.whole()):
                number, _, name = lines.next().strip().replace("\t", " ").partition(" ")
                if number.isdigit():
                    names[section][int(number)] = name.strip()
    if not len(points):
        raise InputError("the file has no points, so no mesh", file=path)
    mesh = FileMesh(points, [])
    if aside:
        mesh.left_aside["line"] = aside
    for section, elements in runs:
        if any(not 0 <= node < len(points) for _, nodes in elements for node in nodes):
            raise InputError(
                f"elements of the section {section} have points that do not exist; the file is "
                "incomplete, export it again",
                file=path,
            )
        solid = section in _SOLIDS or dimension == 2  # faces are the material of a plane mesh
        called = names["materials" if solid else "bcnames"]
        _add(mesh, elements, called, "material" if solid else "boundary", section in _SOLIDS)
    return mesh


class _Sections:
    """Lines of a file, which hold something, and the words that begin sections."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = deck_lines(path)
        self.at = 0

    def __iter__(self) -> Iterator[str]:
        while self.at < len(self.lines):
            word = self.lines[self.at].strip()
            self.at += 1
            if word == "endmesh":
                return
            if word[:1].isalpha():
                yield word

    def next(self) -> str:
        """Return the next line that holds something.

        Raises
        ------
        InputError : there is none.
        """
        while self.at < len(self.lines):
            text = self.lines[self.at].partition("#")[0]
            self.at += 1
            if text.strip():
                return text
        raise InputError("ends in the middle of a section; the file is cut off", file=self.path)

    def error(self, message: str) -> InputError:
        return Place(self.path, self.at).error(message)

    def whole(self) -> int:
        """Return the number of the next line."""
        text = self.next().strip()
        if not text.isdigit():
            raise self.error(f'"{text[:40]}" is no number')
        return int(text)

    def reals(self) -> list[float]:
        """Return the coordinates of the next line."""
        text = self.next()
        try:
            point = [float(word) for word in text.split()]
        except ValueError:
            point = []
        if len(point) != 3:
            raise self.error(f'"{text.strip()[:60]}" is no point: x y z')
        return point

    def element(self, kind_at: int, count_at: int, types: dict[int, str]) -> tuple[int, list[int]]:
        """Return number of the boundary or material and rows of the nodes of the next line."""
        text = self.next()
        words = text.split()
        try:
            count = int(words[count_at])
            kind = int(words[kind_at])
            nodes = [int(word) - 1 for word in words[count_at + 1 : count_at + 1 + count]]
        except (ValueError, IndexError):
            count, kind, nodes = 0, 0, []
        if count not in types or len(nodes) < count:
            raise self.error(f'"{text.strip()[:60]}" is no element of {count or "any"} nodes')
        return kind, nodes


def _add(
    mesh: FileMesh,
    elements: list[tuple[int, list[int]]],
    names: dict[int, str],
    usual: str,
    solid: bool,
) -> None:
    """Add the elements of a section, and their parts by name."""
    types = netgen3d_to_meshio_type if solid else netgen2d_to_meshio_type
    for count in dict.fromkeys(len(nodes) for _, nodes in elements):
        alike = [(kind, nodes) for kind, nodes in elements if len(nodes) == count]
        first = mesh.cell_count
        order = netgen_to_meshio_pmap[types[count]]
        table = np.array([nodes for _, nodes in alike], dtype=np.int64)[:, order]
        mesh.blocks.append((types[count], table))
        kinds = np.array([kind for kind, _ in alike])
        for number in np.unique(kinds).tolist():
            name = names.get(number) or f"{usual} {number}"
            rows = first + np.flatnonzero(kinds == number)
            before = mesh.parts.get(name, rows[:0])
            mesh.parts[name] = np.concatenate([before, rows])
