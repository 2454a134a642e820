"""Sets and surfaces of an Abaqus deck as rows of cells and nodes of the whole mesh."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    FileMesh,
    LeftOut,
    Numbering,
    Place,
    keep_as_nodes,
)
from lcmchain.mesh_files.readers.abaqus_elements import FACES
from lcmchain.mesh_files.readers.abaqus_scope import Entry, Scope, Side
from lcmchain.mesh_files.readers.numbered_sets import listed
from lcmchain.mesh_files.shapes import SOLID_CORNERS, base_type, corner_count


@dataclass
class Placed:
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
    def left_out(self) -> LeftOut:
        return LeftOut([element for scope in self.scopes for element in scope.left_out])

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


class DeckSets:
    """Rows of the sets and surfaces of a deck.

    What a set lists and the mesh does not have is left out, counted or named in the notes; elements
    that are no cells keep their nodes.
    """

    def __init__(self, mesh: FileMesh, by_name: dict[str, Placed]) -> None:
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
        self, one: Placed, key: str, of_nodes: bool, name: str, within: tuple = ()
    ) -> np.ndarray:
        """Return the rows in the mesh of a set, ascending."""
        _, entries = one.sets(of_nodes)[key]
        found = [self._of_entry(one, entry, of_nodes, name, (*within, (one.name, key)))
                 for entry in entries]  # fmt: skip
        return np.unique(np.concatenate([NO_IDS, *found]))

    def _of_entry(
        self, one: Placed, entry: Entry, of_nodes: bool, name: str, within: tuple
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
            return np.concatenate([cell_nodes(self.mesh.blocks, cells), *nodes_of_left_out])
        owner, key = self._owner(one, entry, of_nodes)
        if owner is None:
            return self._left_undefined(f"set {entry.name}", entry)
        if (owner.name, key) in within:
            self.unread[f"{entry.name} (line {entry.place.line}: it lists itself)"] = None
            return NO_IDS
        return self.rows(owner, key, of_nodes, name, within)

    def _that_exist(
        self, one: Placed, numbers: range, of_nodes: bool, name: str, place: Place
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

    def _of_numbers(self, one: Placed, numbers: np.ndarray, of_nodes: bool) -> np.ndarray:
        if of_nodes:
            rows = one.node_numbering.rows(numbers)
            return np.where(rows >= 0, rows + one.first_node, -1)
        rows = one.cell_numbering.rows(numbers)
        return np.where(rows >= 0, one.cell_rows[rows] if len(one.cell_rows) else -1, -1)

    def _owner(self, one: Placed, entry: Entry, of_nodes: bool) -> tuple[Placed | None, str]:
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

    def _nodes_of_side(self, one: Placed, side: Side, name: str) -> np.ndarray | None:
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
        return face_nodes(self.mesh.blocks, rows, side.face)


def cell_nodes(blocks: list[tuple[str, np.ndarray]], rows: np.ndarray) -> np.ndarray:
    """Rows of all nodes of cells (C,)."""
    found = [NO_IDS]
    first = 0
    for _, nodes in blocks:
        own = rows[(rows >= first) & (rows < first + len(nodes))] - first
        first += len(nodes)
        found.append(nodes[own].reshape(-1))
    return np.unique(np.concatenate(found))


def face_nodes(
    blocks: list[tuple[str, np.ndarray]], rows: np.ndarray, face: str
) -> np.ndarray | None:
    """Rows of the corner nodes of a face (``S1``, ``SPOS``, ``E2``) of cells; None if unknown."""
    found = [NO_IDS]
    first = 0
    for name, nodes in blocks:
        own = rows[(rows >= first) & (rows < first + len(nodes))] - first
        first += len(nodes)
        if len(own) == 0:
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
        found.append(nodes[own][:, list(corners)].reshape(-1))
    return np.unique(np.concatenate(found))
