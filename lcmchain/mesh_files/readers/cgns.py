"""Meshes of CGNS files, with sections, families and boundary conditions.

Source: CGNS Standard Interface Data Structures, chapters "Elements" (numbering conventions) and
"Boundary conditions"; CGNS HDF5 file mapping. meshio reads tetrahedra of one zone alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, FileMesh, only_sound
from lcmchain.mesh_files.shapes import edges_across_first

#: Types by their number: meshio's name without nodes in the middle of faces and solids, and nodes.
_TYPES = {
    2: ("vertex", 1), 3: ("line", 2), 4: ("line3", 3), 5: ("triangle", 3), 6: ("triangle6", 6),
    7: ("quad", 4), 8: ("quad8", 8), 9: ("quad9", 9), 10: ("tetra", 4), 11: ("tetra10", 10),
    12: ("pyramid", 5), 13: ("pyramid13", 14), 14: ("wedge", 6), 15: ("wedge15", 15),
    16: ("wedge15", 18), 17: ("hexahedron", 8), 18: ("hexahedron20", 20),
    19: ("hexahedron20", 27), 21: ("pyramid13", 13),
}  # fmt: skip
_MIXED = 20
#: Faces of any number of corners, and what they enclose: their elements are left aside.
_POLYGONS = {22: "NGON", 23: "NFACE"}
_METRES = {"Meter": 1.0, "Centimeter": 1e-2, "Millimeter": 1e-3, "Foot": 0.3048, "Inch": 0.0254}


def read_cgns(path: Path) -> FileMesh:
    """Read the mesh of a file; its unstructured zones stand beside each other.

    Raises
    ------
    InputError : the file is broken, structured, or has no mesh or several.
    """
    with only_sound("CGNS", path), h5py.File(path, "r") as file:
        return _Reader(file, path).mesh


def _label(group: h5py.Group) -> str:
    label = group.attrs.get("label", b"")
    return label.decode() if isinstance(label, bytes) else str(label)


def _children(group: h5py.Group, label: str) -> Iterator[tuple[str, h5py.Group]]:
    for name, child in group.items():
        if isinstance(child, h5py.Group) and _label(child) == label:
            yield name, child


def _values(group: h5py.Group) -> np.ndarray:
    return np.asarray(group[" data"][()]).ravel()


def _text(group: h5py.Group) -> str:
    return bytes(int(letter) % 256 for letter in _values(group)).decode("utf-8", "replace").strip()


class _Reader:
    """Mesh of a file as it grows zone by zone."""

    def __init__(self, file: h5py.File, path: Path) -> None:
        self.path = path
        bases = list(_children(file, "CGNSBase_t"))
        if len(bases) != 1:
            raise InputError(
                f"holds {len(bases)} bases ({', '.join(name for name, _ in bases)}); export the "
                "one with the mesh",
                file=path,
            )
        base = bases[0][1]
        self.mesh = FileMesh(np.empty((0, 3)), [])
        self.mesh.unit = self._unit(base)
        self.families = {
            name: next((_text(alias) for _, alias in _children(family, "FamilyName_t")), name)
            for name, family in _children(base, "Family_t")
        }
        zones = list(_children(base, "Zone_t"))
        points = []
        for name, zone in zones:
            points.append(self._points(zone, name))
            prefix = f"{name}." if len(zones) > 1 else ""
            self._take(zone, prefix, sum(map(len, points[:-1])), len(points[-1]))
        if not points:
            raise InputError("the file has no zones, so no mesh", file=path)
        self.mesh.points = np.concatenate(points)
        if len(zones) > 1:
            self.mesh.notes.append(
                f"{len(zones)} zones are taken side by side; nodes at their borders are not joined"
            )

    @staticmethod
    def _unit(base: h5py.Group) -> float | None:
        for _, units in _children(base, "DimensionalUnits_t"):
            return _METRES.get(_text(units)[32:64].strip())
        return None

    def _points(self, zone: h5py.Group, name: str) -> np.ndarray:
        kinds = [_text(kind) for _, kind in _children(zone, "ZoneType_t")]
        if kinds != ["Unstructured"]:
            raise InputError(
                f"the zone {name} is structured; export it unstructured", file=self.path
            )
        for _, grid in _children(zone, "GridCoordinates_t"):
            columns = [grid[f"Coordinate{axis}"] for axis in "XYZ" if f"Coordinate{axis}" in grid]
            if len(columns) > 1:
                placed = [_values(column).astype(float) for column in columns]
                return np.stack([*placed, *[0.0 * placed[0]] * (3 - len(placed))], axis=1)
        raise InputError(f"the zone {name} has no coordinates x and y", file=self.path)

    def _take(self, zone: h5py.Group, prefix: str, first_node: int, node_count: int) -> None:
        """Take sections and boundary conditions of a zone; its elements are numbered from 1."""
        rows_of = np.full(1, -1, dtype=np.int64)
        sections = sorted(
            (int(_values(section["ElementRange"])[0]), name, section)
            for name, section in _children(zone, "Elements_t")
        )
        for first, name, section in sections:
            last = int(_values(section["ElementRange"])[1])
            if last >= len(rows_of):
                rows_of = np.concatenate([rows_of, np.full(last + 1 - len(rows_of), -1)])
            begun = self.mesh.cell_count
            for kind, ordinals, nodes in self._elements(section, last + 1 - first):
                row = self.mesh.cell_count
                name_of_type = _TYPES[kind][0]
                if ((nodes < 1) | (nodes > node_count)).any():
                    raise InputError(
                        f"the section {name} has nodes that do not exist; the file is incomplete, "
                        "export it again",
                        file=self.path,
                    )
                table = nodes[:, edges_across_first(name_of_type, nodes.shape[1])] - 1 + first_node
                self.mesh.blocks.append((name_of_type, table))
                rows_of[first + ordinals] = row + np.arange(len(table))
            self.mesh.parts[prefix + name] = np.arange(begun, self.mesh.cell_count)
        if not prefix:
            numbers = np.flatnonzero(rows_of >= 0)
            self.mesh.cell_ids = numbers[np.argsort(rows_of[numbers])]
        for _, conditions in _children(zone, "ZoneBC_t"):
            for name, condition in _children(conditions, "BC_t"):
                self._take_condition(name, condition, rows_of, first_node, node_count)

    def _elements(
        self, section: h5py.Group, count: int
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Type, places in the section and nodes of the elements of a section."""
        kind = int(_values(section)[0])
        listed = _values(section["ElementConnectivity"]).astype(np.int64)
        if kind in _TYPES:
            yield kind, np.arange(count), listed.reshape(count, _TYPES[kind][1])
        elif kind == _MIXED:
            by_type: dict[int, list[tuple[int, int]]] = {}
            at = 0
            for ordinal in range(count):
                of_element = int(listed[at])
                by_type.setdefault(of_element, []).append((ordinal, at + 1))
                at += 1 + _TYPES[of_element][1]
            for of_elements, places in by_type.items():
                ordinals, begins = np.array(places, dtype=np.int64).T
                nodes = listed[begins[:, None] + np.arange(_TYPES[of_elements][1])]
                yield of_elements, ordinals, nodes
        else:
            called = _POLYGONS.get(kind, f"type {kind}")
            self.mesh.left_aside[called] = self.mesh.left_aside.get(called, 0) + count

    def _take_condition(
        self,
        name: str,
        condition: h5py.Group,
        rows_of: np.ndarray,
        first_node: int,
        node_count: int,
    ) -> None:
        """Keep a boundary condition as a set by the name of its family, else its own."""
        family = next((_text(of) for _, of in _children(condition, "FamilyName_t")), "")
        name = self.families.get(family, family) or name
        places = [_text(where) for _, where in _children(condition, "GridLocation_t")]
        numbers = [NO_IDS]
        of_elements = bool(places) and places[0] != "Vertex"
        for entry, is_range in (("PointRange", True), ("PointList", False),
                                ("ElementRange", True), ("ElementList", False)):  # fmt: skip
            if entry in condition:
                listed = _values(condition[entry]).astype(np.int64)
                numbers.append(np.arange(listed[0], listed[-1] + 1) if is_range else listed)
                of_elements |= entry.startswith("Element")
        every = np.concatenate(numbers)
        if of_elements:
            sets, rows = self.mesh.cell_sets, rows_of[every[(every > 0) & (every < len(rows_of))]]
            rows = rows[rows >= 0]
        else:
            rows = every[(every > 0) & (every <= node_count)] - 1 + first_node
            sets = self.mesh.node_sets
        if len(rows) < len(every):
            what = "elements that are left aside" if of_elements else "nodes that do not exist"
            self.mesh.notes_of_sets.append(f"{name} lists {len(every) - len(rows)} {what}")
        sets[name] = np.union1d(sets.get(name, NO_IDS), rows)
