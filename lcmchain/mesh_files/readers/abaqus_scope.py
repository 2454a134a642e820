"""Nodes, elements and sets of one part, instance or whole Abaqus deck, as they are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import NO_IDS, Cells, Place
from lcmchain.mesh_files.readers.abaqus_blocks import Block, words
from lcmchain.mesh_files.readers.abaqus_coordinates import (
    SPHERICAL,
    LocalSystem,
    coordinate_kind,
    local_system,
    places,
)
from lcmchain.mesh_files.readers.abaqus_elements import cell_type, second_choice
from lcmchain.mesh_files.readers.abaqus_numbers import (
    element_count,
    element_table,
    elements_left_out,
    node_table,
    number_range,
    whole,
)
from lcmchain.mesh_files.shapes import base_type, corner_count


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
    system: LocalSystem | None = None
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
        kind = coordinate_kind(block)
        if kind == SPHERICAL:
            self.spherical.append(block.place.line)
        ids, points = node_table(block)
        self.ids.append(ids)
        self.points.append(places(points, kind, self.system))
        self.node_blocks.append(block)
        if block.parameters.get("NSET"):
            self.node_sets.add(block.parameters["NSET"], [Entry(ids, "", "", block.place)])

    def read_system(self, block: Block) -> None:
        """Take a *SYSTEM block, which holds for the nodes behind it."""
        self.system = local_system(block)

    def read_elements(self, block: Block) -> None:
        """Take an *ELEMENT block; elements that are no shells or solids are counted."""
        element = block.name("TYPE").upper()
        first_choice = cell_type(element)
        shape = first_choice or second_choice(element)
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
