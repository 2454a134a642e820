"""Meshes of Abaqus and CalculiX decks (.inp), with the numbers, sets, sections and instances.

Source: Abaqus Keywords Guide (*NODE, *SYSTEM, *ELEMENT, *NSET, *ELSET, *SURFACE, *PART, *INSTANCE);
CalculiX CrunchiX user's manual, where parts and instances do not exist.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    FileMesh,
    LeftOutElements,
    Numbering,
    Place,
    keep_as_nodes,
    merged_blocks,
    unique_nodes,
)
from lcmchain.mesh_files.readers.decks.abaqus_blocks import Block, keyword_blocks, motion
from lcmchain.mesh_files.readers.decks.abaqus_scope import FACES, Entry, Scope, Side
from lcmchain.mesh_files.readers.decks.common import listed
from lcmchain.mesh_files.shapes import SOLID_CORNERS, SURFACE_CORNERS, base_type, corner_count

# Keywords that make nodes or elements out of others: a mesh read without them has holes.
GENERATING = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")

SECTIONS = ("SHELLSECTION", "SHELLGENERALSECTION", "SOLIDSECTION", "MEMBRANESECTION")


def read_abaqus(path: Path) -> FileMesh:
    """Read the mesh of a deck.

    Raises
    ------
    InputError : wrong or incomplete data, a keyword that generates a mesh, or no mesh at all; names
        file and line.
    """
    deck = _Deck()
    scope = deck.outside
    open_block: Block | None = None  # of the part or instance that is being read
    for block in keyword_blocks(path):
        if block.keyword in GENERATING:
            raise block.error(
                "is not followed here; export the deck with all its nodes and elements"
            )
        if block.keyword in ("PART", "INSTANCE"):
            if open_block is not None:
                raise block.error(f"begins before *END {open_block.keyword}")
            open_block = block
            scope = _opened(deck, block)
        elif block.keyword in ("ENDPART", "ENDINSTANCE"):
            open_block, scope = None, deck.outside
        else:
            _take(scope, deck, block)
    if open_block is not None:
        raise open_block.error(f"has no *END {open_block.keyword}; the file is cut off")
    mesh = _merged(deck)
    if not mesh.blocks and not mesh.left_aside:
        raise InputError("the deck has no *ELEMENT of any kind", file=path)
    return mesh


def _opened(deck: _Deck, block: Block) -> Scope:
    """Scope of a part or instance that begins."""
    name = block.name("NAME") if "NAME" in block.parameters else block.name(block.keyword)
    known = deck.parts if block.keyword == "PART" else deck.own
    if name.upper() in known:
        raise block.error(f"{name} exists already")
    if block.keyword == "INSTANCE":
        if "LIBRARY" in block.parameters or "PART" not in block.parameters:
            raise block.error("takes its mesh from another analysis; export the deck with it")
        part = block.name("PART")
        if part.upper() not in deck.parts:
            raise block.error(f"is of the part {part}, which the deck does not define before")
        deck.placed.append((name, part.upper(), *motion(block)))
    known[name.upper()] = scope = Scope(name)
    return scope


def _take(scope: Scope, deck: _Deck, block: Block) -> None:
    """Take what belongs to the mesh from a block."""
    if block.keyword == "NODE":
        scope.read_nodes(block)
    elif block.keyword == "SYSTEM":
        scope.read_system(block)
    elif block.keyword == "ELEMENT":
        scope.read_elements(block)
    elif block.keyword in ("NSET", "ELSET"):
        scope.read_set(block)
    elif block.keyword == "SURFACE":
        scope.read_surface(block)
    elif block.keyword in SECTIONS and block.parameters.get("ELSET"):
        scope.sections.append(block.parameters["ELSET"])


# --- parts and instances put into one mesh --------------------------------------------------------


@dataclass
class _Deck:
    """A deck while it is read: its parts, their instances, and what stands outside.

    ``placed`` holds of each instance its name, part, rotation and translation; ``own`` what is
    defined within it.
    """

    outside: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    placed: list[tuple[str, str, np.ndarray, np.ndarray]] = field(default_factory=list)
    own: dict[str, Scope] = field(default_factory=dict)


def _merged(deck: _Deck) -> FileMesh:
    """Put all instances (or all parts, where none is placed) and what stands outside together."""
    second = _settle_second_choice(_scopes(deck))
    instances = [
        _placed(name, (deck.parts[part], deck.own[name.upper()]), rotation, shift)
        for name, part, rotation, shift in deck.placed
    ]
    if not instances:
        instances = [
            _placed(part.name, (part,), np.eye(3), np.zeros(3)) for part in deck.parts.values()
        ]
    outside = _placed("", (deck.outside,), np.eye(3), np.zeros(3))
    everything = [*instances, outside]
    blocks = _joined(everything)
    mesh = FileMesh(
        points=np.concatenate([one.points for one in everything]),
        blocks=blocks,
        cell_ids=np.empty(sum(len(one.cell_ids) for one in everything), dtype=np.int64),
        node_ids=np.concatenate([one.ids for one in everything]),
    )
    for one in everything:
        mesh.cell_ids[one.cell_rows] = one.cell_ids
    _DeckSets(mesh, {one.name.upper(): one for one in everything}).fill()
    _fill_parts(mesh, everything)
    if second:
        mesh.notes.append(
            f"the deck has no shells: {listed(second)} are taken for cells, though they are rigid, "
            "surface or axisymmetric elements"
        )
    used = {part for _, part, _, _ in deck.placed}
    unused = [part.name for key, part in deck.parts.items() if deck.placed and key not in used]
    if unused:
        mesh.notes.append(f"parts of the deck without an instance are left out: {listed(unused)}")
    if len(np.unique(mesh.cell_ids)) < len(mesh.cell_ids):
        mesh.notes_of_sets.append(
            "element numbers repeat in the instances of the deck: part and number together name an "
            "element"
        )
    spherical = sorted(line for scope in _scopes(deck) for line in scope.spherical)
    if spherical:
        mesh.notes.append(
            f"the nodes of line {spherical[0]} are given in spherical coordinates: read as radius, "
            "angle about z from x, and angle from the plane of x and y"
        )
    for one in everything:
        for scope in one.scopes:
            for element, count in scope.aside.items():
                mesh.left_aside[element] = mesh.left_aside.get(element, 0) + count
    return mesh


def _scopes(deck: _Deck) -> list[Scope]:
    return [*deck.parts.values(), *deck.own.values(), deck.outside]


def _settle_second_choice(scopes: list[Scope]) -> list[str]:
    """Take elements of second choice for cells in a deck without shells, else count them.

    Returns
    -------
    types : of the elements that are taken.
    """
    has_shells = any(base_type(cells.name) in SURFACE_CORNERS for s in scopes for cells in s.cells)
    taken = {} if has_shells else {element: None for s in scopes for element, _ in s.second}
    for scope in scopes:
        for element, cells in scope.second:
            if element in taken:
                scope.cells.append(cells)
            else:
                scope.leave_out(element, cells)
    return list(taken)


def _placed(name: str, scopes: tuple[Scope, ...], rotation, shift) -> _Placed:
    ids = np.concatenate([scope.all_ids() for scope in scopes])
    points = np.concatenate([scope.all_points() for scope in scopes])
    counts = np.cumsum([len(scope.all_ids()) for scope in scopes])

    def place(row: int):
        which = int(np.searchsorted(counts, row, side="right"))
        return scopes[which].node_place(row - (int(counts[which - 1]) if which else 0))

    ids, points = unique_nodes(ids, points, place)
    cells = [group for scope in scopes for group in scope.cells]
    blocks, cell_ids = merged_blocks(cells, Numbering(ids))
    unturned = np.array_equal(rotation, np.eye(3))
    with np.errstate(over="ignore", invalid="ignore"):  # places far off are told by the cells
        points = points + shift if unturned else points @ rotation.T + shift
    return _Placed(name, scopes, ids, points, blocks, cell_ids)


def _joined(everything: list[_Placed]) -> list[tuple[str, np.ndarray]]:
    """Blocks of all instances, one per type; sets their rows in the mesh."""
    first = 0
    for one in everything:
        one.first_node = first
        first += len(one.ids)
    names = list(dict.fromkeys(name for one in everything for name, _ in one.blocks))
    blocks = []
    pieces: dict[int, list[np.ndarray]] = {id(one): [] for one in everything}
    row = 0
    for name in names:
        of_type = []
        for one in everything:
            for type_of_block, nodes in one.blocks:
                if type_of_block == name:
                    of_type.append(nodes + one.first_node)
                    pieces[id(one)].append(np.arange(row, row + len(nodes)))
                    row += len(nodes)
        blocks.append((name, np.concatenate(of_type)))
    for one in everything:
        # the blocks of an instance follow in the same order of types, or are sorted to it
        order = [name for name, _ in one.blocks]
        by_name = dict(zip([n for n in names if n in order], pieces[id(one)], strict=True))
        one.cell_rows = np.concatenate([NO_IDS, *[by_name[name] for name in order]])
    return blocks


def _fill_parts(mesh: FileMesh, everything: list[_Placed]) -> None:
    """Parts are the instances, or the sections of a deck without any."""
    if len(everything) > 1:
        for one in everything:
            if len(one.cell_rows):
                mesh.parts[one.name or "assembly"] = np.sort(one.cell_rows)
        return
    taken = np.zeros(mesh.cell_count, dtype=bool)
    names = {name.upper(): name for name in mesh.cell_sets}
    for section in everything[0].scopes[0].sections:
        name = names.get(section.upper())
        if name is None or name in mesh.parts:
            continue
        rows = mesh.cell_sets[name]
        if taken[rows].any():
            mesh.notes_of_sets.append(
                "elements have two sections and belong to the part of the first "
                f"({first_few(mesh.cell_ids[rows[taken[rows]]])})"
            )
        mesh.parts[name] = rows[~taken[rows]]
        taken[rows] = True


# --- sets and surfaces as rows of cells and nodes of the whole mesh -------------------------------


@dataclass
class _Placed:
    """A scope with rows of its own: nodes and cells of one instance, or of the flat deck.

    Parameters
    ----------
    name : of the instance, "" outside of any.
    first_node : row of its first node in the mesh. cell_rows : rows of its cells in the mesh.
    """

    name: str
    scopes: tuple[Scope, ...]
    ids: np.ndarray
    points: np.ndarray
    blocks: list[tuple[str, np.ndarray]]
    cell_ids: np.ndarray
    first_node: int = 0
    cell_rows: np.ndarray = field(default_factory=lambda: NO_IDS)

    @cached_property
    def node_numbering(self) -> Numbering:
        return Numbering(self.ids)

    @cached_property
    def cell_numbering(self) -> Numbering:
        return Numbering(self.cell_ids)

    @cached_property
    def left_out(self) -> LeftOutElements:
        return LeftOutElements([element for scope in self.scopes for element in scope.left_out])

    def sets(self, of_nodes: bool) -> dict[str, tuple[str, list[Entry]]]:
        """Name as spelt and entries of each set, by its name in upper case."""
        found: dict[str, tuple[str, list[Entry]]] = {}
        for scope in self.scopes:
            named = scope.node_sets if of_nodes else scope.element_sets
            for key, entries in named.entries.items():
                spelt, before = found.get(key, (named.spelt[key], []))
                found[key] = spelt, before + entries
        return found

    def full_name(self, name: str) -> str:
        """Name of a set of this instance in the whole mesh, as result files have it."""
        return f"{self.name}.{name}" if self.name else name


class _DeckSets:
    """Rows of the sets and surfaces of a deck.

    What a set lists and the mesh does not have is left out, counted or named in the notes; elements
    that are no cells keep their nodes.
    """

    def __init__(self, mesh: FileMesh, by_name: dict[str, _Placed]) -> None:
        self.mesh = mesh
        self.by_name = by_name
        self.missing: dict[str, int] = {}
        self.undefined: dict[str, None] = {}
        self.past: dict[Place, str] = {}
        self.unread: dict[str, None] = {}
        self.nodes_of_left_out: dict[str, list[np.ndarray]] = {}

    def fill(self) -> None:
        """Set the mesh's sets, and its notes about what they lose."""
        for one in self.by_name.values():
            for scope in one.scopes:
                self.unread.update(dict.fromkeys(scope.unread))
        for one in self.by_name.values():
            for key, (spelt, _) in one.sets(of_nodes=True).items():
                name = one.full_name(spelt)
                self.mesh.node_sets[name] = self.rows(one, key, True, name)
        moved = []
        for one in self.by_name.values():
            for key, (spelt, _) in one.sets(of_nodes=False).items():
                name = one.full_name(spelt)
                rows = self.rows(one, key, False, name)
                nodes = self.nodes_of_left_out.pop(name, [])
                if nodes:
                    keep_as_nodes(self.mesh, name, np.concatenate(nodes))
                    moved.append(name)
                if len(rows) or not nodes:
                    self.mesh.cell_sets[name] = rows
        if moved:
            self.mesh.notes_of_sets.append(
                f"sets of elements left aside are kept as the sets of their nodes: {listed(moved)}"
            )
        self._fill_surfaces()
        if self.missing:
            missing = [f"{name} ({count})" for name, count in self.missing.items()]
            self.mesh.notes_of_sets.append(
                "sets list elements or nodes that the mesh does not have, of left-out types or not "
                f"defined: {listed(missing)}"
            )
        if self.undefined:
            self.mesh.notes_of_sets.append(
                "sets and surfaces are kept without what they name and the deck does not define: "
                f"{listed(list(self.undefined))}"
            )
        if self.past:
            self.mesh.notes_of_sets.append(
                "ranges of sets go past the numbers that there are, and hold those that there are: "
                f"{listed(list(self.past.values()))}"
            )
        if self.unread:
            self.mesh.notes_of_sets.append(
                f"entries of sets that cannot be read are left out: {listed(list(self.unread))}"
            )

    def rows(
        self, one: _Placed, key: str, of_nodes: bool, name: str, within: tuple = ()
    ) -> np.ndarray:
        """Return the rows in the mesh of a set, ascending."""
        _, entries = one.sets(of_nodes)[key]
        found = [self._of_entry(one, entry, of_nodes, name, (*within, (one.name, key)))
                 for entry in entries]  # fmt: skip
        return np.unique(np.concatenate([NO_IDS, *found]))

    def _of_entry(
        self, one: _Placed, entry: Entry, of_nodes: bool, name: str, within: tuple
    ) -> np.ndarray:
        if entry.instance:
            if entry.instance.upper() not in self.by_name:
                return self._left_undefined(f"instance {entry.instance}", entry)
            one = self.by_name[entry.instance.upper()]
        if entry.numbers is not None:
            numbers = entry.numbers
            if isinstance(numbers, range):
                numbers = self._that_exist(one, numbers, of_nodes, name, entry.place)
            rows = self._of_numbers(one, numbers, of_nodes)
            lost = numbers[rows < 0]
            if len(lost) and not of_nodes:
                nodes, found = one.left_out.nodes(lost)
                nodes = self._of_numbers(one, nodes, of_nodes=True)
                if found:
                    kept = self.nodes_of_left_out.setdefault(name, [])
                    kept.append(nodes[nodes >= 0])
                lost = lost[found:]  # their number counts
            if len(lost):
                self.missing[name] = self.missing.get(name, 0) + len(lost)
            return rows[rows >= 0]
        if entry.of_elements:
            cells = self._of_entry(one, entry._replace(of_elements=False), False, name, ())
            nodes_of_left_out = self.nodes_of_left_out.pop(name, [])
            return np.concatenate([_cell_nodes(self.mesh.blocks, cells), *nodes_of_left_out])
        owner, key = self._owner(one, entry, of_nodes)
        if owner is None:
            return self._left_undefined(f"set {entry.name}", entry)
        if (owner.name, key) in within:
            self.unread[f"{entry.name} (line {entry.place.line}: it lists itself)"] = None
            return NO_IDS
        return self.rows(owner, key, of_nodes, name, within)

    def _that_exist(
        self, one: _Placed, numbers: range, of_nodes: bool, name: str, place: Place
    ) -> np.ndarray:
        """Numbers of a range that exist; gaps between them count as missing."""
        ids = one.ids if of_nodes else np.concatenate([one.cell_ids, one.left_out.numbers])
        first, last = numbers[0], numbers[-1]
        inside = ids[(ids >= first) & (ids <= last) & ((ids - first) % numbers.step == 0)]
        inside = np.unique(inside)
        lowest, highest = (int(ids.min()), int(ids.max())) if len(ids) else (last + 1, first - 1)
        if first < lowest or last > highest:
            self.past[place] = f"{name} ({first} to {last}, line {place.line})"
        begin = first + max(-((first - lowest) // numbers.step), 0) * numbers.step
        gaps = len(range(begin, min(last, highest) + 1, numbers.step)) - len(inside)
        if gaps > 0:
            self.missing[name] = self.missing.get(name, 0) + gaps
        return inside

    def _left_undefined(self, what: str, entry: Entry) -> np.ndarray:
        self.undefined[f"{what} (line {entry.place.line})"] = None
        return NO_IDS

    def _of_numbers(self, one: _Placed, numbers: np.ndarray, of_nodes: bool) -> np.ndarray:
        if of_nodes:
            rows = one.node_numbering.rows(numbers)
            return np.where(rows >= 0, rows + one.first_node, -1)
        rows = one.cell_numbering.rows(numbers)
        return np.where(rows >= 0, one.cell_rows[rows] if len(one.cell_rows) else -1, -1)

    def _owner(self, one: _Placed, entry: Entry, of_nodes: bool) -> tuple[_Placed | None, str]:
        """Instance and key of the set that an entry names; None where there is no such set."""
        if entry.name.upper() in one.sets(of_nodes):
            return one, entry.name.upper()
        instance, dot, local = entry.name.rpartition(".")
        owner = self.by_name.get(instance.upper()) if dot else None
        if owner is not None and local.upper() in owner.sets(of_nodes):
            return owner, local.upper()
        return None, ""

    def _fill_surfaces(self) -> None:
        kept, lost = [], []
        for one in self.by_name.values():
            for scope in one.scopes:
                lost += [one.full_name(name) for name in scope.other_surfaces]
                for key, sides in scope.surfaces.entries.items():
                    name = one.full_name(scope.surfaces.spelt[key])
                    before = len(self.undefined)
                    nodes = [self._nodes_of_side(one, side, name) for side in sides]
                    unknown = any(found is None for found in nodes)
                    empty = all(found is not None and len(found) == 0 for found in nodes)
                    if unknown or (empty and len(self.undefined) > before):
                        lost.append(name)
                        continue
                    free = name if name not in self.mesh.node_sets else f"{name} (surface)"
                    found = [rows for rows in nodes if rows is not None]
                    self.mesh.node_sets[free] = np.unique(np.concatenate([NO_IDS, *found]))
                    kept.append(name)
        if kept:
            self.mesh.notes_of_sets.append(
                f"surfaces of the deck are kept as the sets of their nodes: {listed(kept)}"
            )
        if lost:
            self.mesh.notes_of_sets.append(
                f"surfaces of the deck that are not kept: {listed(lost)}"
            )

    def _nodes_of_side(self, one: _Placed, side: Side, name: str) -> np.ndarray | None:
        """Rows of the nodes of a face; None where they cannot be told."""
        of_nodes = side.face == "NODE"
        owner, dot, local = side.element.rpartition(".")
        if local.lstrip("-").isdigit():
            numbers = np.array([int(local)]) if len(local) < 18 else NO_IDS
            entry = Entry(numbers, "", owner if dot else "", side.place)
        else:
            entry = Entry(None, side.element, "", side.place)
        rows = self._of_entry(one, entry, of_nodes, name, ())
        if self.nodes_of_left_out.pop(name, []):  # which have no faces that are known
            self.missing[name] = self.missing.get(name, 0) + 1
        if of_nodes:
            return rows
        return _face_nodes(self.mesh.blocks, rows, side.face)


def _cell_nodes(blocks: list[tuple[str, np.ndarray]], rows: np.ndarray) -> np.ndarray:
    """Rows of all nodes of cells (C,)."""
    found = [NO_IDS]
    first = 0
    for _, nodes in blocks:
        local = rows[(rows >= first) & (rows < first + len(nodes))] - first
        first += len(nodes)
        found.append(nodes[local].reshape(-1))
    return np.unique(np.concatenate(found))


def _face_nodes(
    blocks: list[tuple[str, np.ndarray]], rows: np.ndarray, face: str
) -> np.ndarray | None:
    """Rows of the corner nodes of a face (``S1``, ``SPOS``, ``E2``) of cells; None if unknown."""
    found = [NO_IDS]
    first = 0
    for name, nodes in blocks:
        local = rows[(rows >= first) & (rows < first + len(nodes))] - first
        first += len(nodes)
        if len(local) == 0:
            continue
        count = corner_count(name)
        corners: tuple[int, ...]
        number = int(face[1:]) - 1 if face[1:].isdigit() else -1
        if base_type(name) in SOLID_CORNERS:
            faces = FACES[base_type(name)]
            if face[:1] != "S" or not 0 <= number < len(faces):
                return None
            corners = faces[number]
        elif face in ("", "SPOS", "SNEG", "S1", "S2"):
            corners = tuple(range(count))
        elif face[:1] == "E" and 0 <= number < count:
            corners = (number, (number + 1) % count)
        else:
            return None
        found.append(nodes[local][:, list(corners)].reshape(-1))
    return np.unique(np.concatenate(found))
