"""Nodes, elements and sets of one part, instance or whole Abaqus deck, as they are read.

Source: Abaqus Elements Guide, element index; CalculiX CrunchiX user's manual, "Element types": both
number nodes as VTK does, mid-side nodes included. Abaqus Keywords Guide, *NODE (SYSTEM=R, C, S;
angles in degrees), *SYSTEM; *NMAP says from where the angles of spherical coordinates are counted:
theta about z from the plane of x and z, phi from the plane of x and y.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, Cells, Place
from lcmchain.mesh_files.readers.decks.abaqus_blocks import (
    Block,
    element_count,
    element_table,
    elements_left_out,
    node_table,
    number_range,
    real,
    whole,
    words,
)
from lcmchain.mesh_files.shapes import base_type, corner_count

# --- element types that are cells of a mesh to map onto -------------------------------------------


_SHELL_SHAPES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
_SOLID_SHAPES = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    13: "pyramid13",
    15: "wedge15",
    20: "hexahedron20",
}
# Variants (reduced integration, hybrid, thermal, ...) follow the number of nodes as letters.
_SHELL = re.compile(r"(?:S|US|DS|M3D|CPS|CPE|CPEG|DC2D)(\d+)(?:R5|[A-Z]*5?)")
# Rigid, surface and axisymmetric elements, which are cells only where a deck has no shells. meshio
# writes triangles and quadrilaterals in this way.
_SECOND_CHOICE = re.compile(r"(?:R3D|SFM3D|CAX)(\d+)[A-Z]*")
_STRI = {"STRI3": "triangle", "STRI65": "triangle6"}
_CONTINUUM_SHELL = {"SC6": "wedge", "SC8": "hexahedron", "CSS8": "hexahedron"}
_SOLID = re.compile(r"(?:C3D|DC3D|DCC3D|Q3D|EC3D)(\d+)([A-Z]*)")

#: Faces of solids by their number from 1, corners from 0.
FACES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "pyramid": [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
    "wedge": [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    "hexahedron": [
        *[(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)],
        *[(1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    ],
}


def _second_choice(element: str) -> str | None:
    """Return meshio's name of the shape of an element that is a cell only for want of shells."""
    found = _SECOND_CHOICE.fullmatch(element.upper())
    return _SHELL_SHAPES.get(int(found[1][:3])) if found is not None else None


def _cell_type(element: str) -> str | None:
    """Return meshio's name of an element type's shape; None where it is no shell and no solid.

    Continuum shells (SC6R, SC8R) are wedges and hexahedra. Rigid, cohesive, gasket and surface
    elements, beams and those with a varying number of nodes are none.
    """
    element = element.upper()
    if element in _STRI:
        return _STRI[element]
    for begin, shape in _CONTINUUM_SHELL.items():
        if re.fullmatch(f"{begin}R?H?T?", element):
            return shape
    if (found := _SHELL.fullmatch(element)) is not None:
        return _SHELL_SHAPES.get(int(found[1][:3]))
    found = _SOLID.fullmatch(element)
    if found is None or "V" in found[2]:
        return None
    return _SOLID_SHAPES.get(int(found[1][:3]))


# --- coordinates: local systems, cylindrical and spherical ones -----------------------------------


RECTANGULAR, CYLINDRICAL, SPHERICAL = "R", "C", "S"
_KINDS = {"": RECTANGULAR, "RECTANGULAR": RECTANGULAR, "CYLINDRICAL": CYLINDRICAL,
          "SPHERICAL": SPHERICAL}  # fmt: skip


class _LocalSystem(NamedTuple):
    """Origin (3,) and unit vectors of the axes as rows (3, 3), in the system of the deck."""

    origin: np.ndarray
    axes: np.ndarray


def _coordinate_kind(block: Block) -> str:
    """Return how a *NODE block gives its nodes: ``R``, ``C`` or ``S``.

    Raises
    ------
    InputError : SYSTEM is none of these.
    """
    given = block.parameters.get("SYSTEM", "").upper()
    kind = _KINDS.get(given, given)
    if kind not in (RECTANGULAR, CYLINDRICAL, SPHERICAL):
        raise block.error(
            f"has SYSTEM={given}; it may be R (x, y, z), C (r, theta, z) or S (r, theta, phi)"
        )
    return kind


def _local_system(block: Block) -> _LocalSystem | None:
    """Return the system that a *SYSTEM block defines; None where it goes back to that of the deck.

    Three numbers move the origin; three more are a point on the x axis, which stays in the plane of
    x and y of the deck unless a second line gives a point in the local plane of x and y.

    Raises
    ------
    InputError : the numbers make no system.
    """
    numbers = _numbers(block)
    if not numbers or not numbers[0]:
        return None
    counts = [3 * -(-len(line) // 3) for line in numbers]  # blank entries at the end are zero
    if counts not in ([3], [6], [6, 3]):
        raise block.error(
            "takes the origin and maybe a point on the x axis in its first line, and maybe a point "
            "in the plane of x and y in its second: 3 or 6 numbers, and 3"
        )
    numbers = [
        line + [0.0] * (count - len(line)) for line, count in zip(numbers, counts, strict=True)
    ]
    origin = np.array(numbers[0][:3])
    if counts == [3]:
        return _LocalSystem(origin, np.eye(3))
    x = np.array(numbers[0][3:]) - origin
    if len(numbers) == 1:
        x[2] = 0.0
        z = np.array([0.0, 0.0, 1.0])
    else:
        z = np.cross(x, np.array(numbers[1]) - origin)
    lengths = float(np.linalg.norm(x)), float(np.linalg.norm(z))
    if not np.isfinite(lengths).all() or min(lengths) <= 1e-12 * max(1.0, *lengths):
        raise block.error("has no three different axes: its points coincide or lie on a line")
    x, z = x / lengths[0], z / lengths[1]
    return _LocalSystem(origin, np.stack([x, np.cross(z, x), z]))


def _numbers(block: Block) -> list[list[float]]:
    """Numbers of each data line, without blank entries at its end."""
    found: list[list[float]] = []
    for row, text in enumerate(block.data):
        entries = words(text)
        while entries and not entries[-1]:
            entries.pop()
        try:
            found.append([real(entry) if entry else 0.0 for entry in entries])
        except ValueError:
            raise block.place_of(row).error("*SYSTEM takes numbers") from None
    return found


def _places(given: np.ndarray, kind: str, system: _LocalSystem | None) -> np.ndarray:
    """Return the places (N, 3) of coordinates (N, 3) of a kind, given in a local system."""
    if kind != RECTANGULAR:
        r, theta, third = given.T
        theta = np.radians(theta)
        height = third
        if kind == SPHERICAL:
            phi = np.radians(third)
            r, height = r * np.cos(phi), r * np.sin(phi)
        given = np.stack([r * np.cos(theta), r * np.sin(theta), height], axis=1)
    if system is None:
        return given
    with np.errstate(over="ignore", invalid="ignore"):  # places far off are told by the cells
        return given @ system.axes + system.origin


# --- one scope ------------------------------------------------------------------------------------


class Entry(NamedTuple):
    """What a line of a set lists: numbers or the name of another set, maybe of an instance.

    A range stands for those of its numbers that exist. ``of_elements`` marks the nodes of an
    element set.
    """

    numbers: np.ndarray | range | None
    name: str
    instance: str
    place: Place
    of_elements: bool = False


class Side(NamedTuple):
    """Face of an element or of those of a set, as a surface lists it."""

    element: str
    face: str
    place: Place


@dataclass
class NamedEntries:
    """Sets by their name in upper case; each keeps its name as first spelt."""

    spelt: dict[str, str] = field(default_factory=dict)
    entries: dict[str, list] = field(default_factory=dict)

    def add(self, name: str, entries: list) -> None:
        """Add entries to a set, which may exist."""
        key = name.upper()
        self.spelt.setdefault(key, name)
        self.entries.setdefault(key, []).extend(entries)


@dataclass
class Scope:
    """What stands between *PART and *END PART, in an instance, or outside of both.

    Parameters
    ----------
    ids, points, node_places : of the nodes, block by block. cells : of the elements.
    second : elements that are cells only in a deck without shells, by their type.
    sections : element sets that a section is assigned to, in their order.
    aside : number of elements of types that are no shells or solids. left_out : number and nodes
        of each of these.
    system : in which nodes are given from here on; None for that of the deck. spherical : lines
        from which on they are given in spherical coordinates.
    unread : entries of sets that cannot be read, in words. other_surfaces : names of those that are
        made of neither element faces nor nodes.
    """

    name: str = ""
    ids: list[np.ndarray] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    node_blocks: list[Block] = field(default_factory=list)
    cells: list[Cells] = field(default_factory=list)
    second: list[tuple[str, Cells]] = field(default_factory=list)
    node_sets: NamedEntries = field(default_factory=NamedEntries)
    element_sets: NamedEntries = field(default_factory=NamedEntries)
    surfaces: NamedEntries = field(default_factory=NamedEntries)
    sections: list[str] = field(default_factory=list)
    aside: dict[str, int] = field(default_factory=dict)
    left_out: list[tuple[int, Sequence[int]]] = field(default_factory=list)
    system: _LocalSystem | None = None
    spherical: list[int] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    other_surfaces: list[str] = field(default_factory=list)

    def node_place(self, row: int) -> Place:
        """Return the place of a node, counted over all blocks."""
        for block in self.node_blocks:
            if row < len(block.data):
                return block.place_of(row)
            row -= len(block.data)
        raise IndexError(row)

    def all_ids(self) -> np.ndarray:
        return np.concatenate(self.ids) if self.ids else NO_IDS

    def all_points(self) -> np.ndarray:
        return np.concatenate(self.points) if self.points else np.empty((0, 3))

    def read_nodes(self, block: Block) -> None:
        """Take a *NODE block."""
        kind = _coordinate_kind(block)
        if kind == SPHERICAL:
            self.spherical.append(block.place.line)
        ids, points = node_table(block)
        self.ids.append(ids)
        self.points.append(_places(points, kind, self.system))
        self.node_blocks.append(block)
        if block.parameters.get("NSET"):
            self.node_sets.add(block.parameters["NSET"], [Entry(ids, "", "", block.place)])

    def read_system(self, block: Block) -> None:
        """Take a *SYSTEM block, which holds for the nodes behind it."""
        self.system = _local_system(block)

    def read_elements(self, block: Block) -> None:
        """Take an *ELEMENT block; elements that are no shells or solids are counted."""
        element = block.name("TYPE").upper()
        first_choice = _cell_type(element)
        shape = first_choice or _second_choice(element)
        if shape is None:
            self.aside[element] = self.aside.get(element, 0) + element_count(block)
            left_out = elements_left_out(block)
            self.left_out += left_out
            self._add_to_set(block, np.array([number for number, _ in left_out], dtype=np.int64))
            return
        node_count = int(shape[len(base_type(shape)) :] or corner_count(shape))
        table, begins = element_table(block, node_count)
        cells = Cells(shape, table[:, 0], table[:, 1:], lambda row: block.place_of(begins[row]))
        if first_choice:
            self.cells.append(cells)
        else:
            self.second.append((element, cells))
        self._add_to_set(block, table[:, 0])

    def leave_out(self, element: str, cells: Cells) -> None:
        """Count elements of second choice that are no cells of this deck."""
        self.aside[element] = self.aside.get(element, 0) + len(cells.ids)
        self.left_out += zip(cells.ids.tolist(), cells.nodes.tolist(), strict=True)

    def _add_to_set(self, block: Block, ids: np.ndarray) -> None:
        if block.parameters.get("ELSET"):
            entry = Entry(ids, "", "", block.place)
            self.element_sets.add(block.parameters["ELSET"], [entry])

    def read_set(self, block: Block) -> None:
        """Take an *NSET or *ELSET block."""
        sets = self.node_sets if block.keyword == "NSET" else self.element_sets
        name = block.name(block.keyword)
        instance = block.parameters.get("INSTANCE", "")
        generate = "GENERATE" in block.parameters
        entries: list[Entry] = []
        for row, text in enumerate(block.data):
            try:
                entries += _entries(words(text), generate, instance, block.place_of(row))
            except InputError as error:
                self.unread.append(f"{name} ({error.message})")
        if block.keyword == "NSET" and block.parameters.get("ELSET"):
            elements = block.parameters["ELSET"]
            entries.append(Entry(None, elements, instance, block.place, of_elements=True))
        sets.add(name, entries)

    def read_surface(self, block: Block) -> None:
        """Take a *SURFACE block made of element faces or nodes; others are named."""
        kind = block.parameters.get("TYPE", "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE") or "COMBINE" in block.parameters:
            name = block.parameters.get("NAME") or f"line {block.place.line}"
            self.other_surfaces.append(name)
            return
        sides = []
        for row, text in enumerate(block.data):
            entries = [*words(text), ""]
            sides.append(Side(entries[0], entries[1].upper(), block.place_of(row)))
        if kind == "NODE":
            sides = [Side(side.element, "NODE", side.place) for side in sides]
        self.surfaces.add(block.name("NAME"), sides)


def _entries(listed: list[str], generate: bool, instance: str, place: Place) -> list[Entry]:
    """Entries of one line of a set."""
    if generate:
        return [Entry(number_range(listed, place), "", instance, place)]
    numbers: dict[str, list[int]] = {}
    entries = []
    for word in listed:
        try:
            numbers.setdefault(instance, []).append(whole(word))
            continue
        except ValueError:
            pass
        owner, dot, local = word.rpartition(".")
        try:
            numbers.setdefault(owner if dot else instance, []).append(whole(local))
        except ValueError:
            if not word:
                raise place.error("an entry of the set is empty") from None
            entries.append(Entry(None, word, instance, place))
    entries += [Entry(np.array(ids), "", owner, place) for owner, ids in numbers.items()]
    return entries
