"""Meshes of LS-DYNA keyword decks (.k, .key), with the numbers, parts and sets.

Source: LS-DYNA Keyword User's Manual, volume I, *NODE, *ELEMENT_SHELL, *ELEMENT_SOLID,
*ELEMENT_TSHELL, *PART. Triangles, tetrahedra, wedges and pyramids are shells and solids that list
nodes twice.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    Cells,
    FileMesh,
    LeftOutElements,
    Numbering,
    Place,
    merged_blocks,
    parts_of_numbers,
    unique_nodes,
)
from lcmchain.mesh_files.readers.decks.common import NumberedSets, listed
from lcmchain.mesh_files.readers.decks.lsdyna_blocks import Block, Line, keyword_blocks

# --- sets -----------------------------------------------------------------------------------------
# Source: LS-DYNA Keyword User's Manual, volume I, *SET. Numbers of sets are counted apart for each
# kind; a set has a name where its keyword ends with _TITLE, or a comment of Gmsh.


_KINDS = ("NODE", "SHELL", "SOLID", "TSHELL", "PART", "BEAM", "DISCRETE", "SEGMENT")
#: Ways to give a set that are read; others select by boxes or by ranges of coordinates.
_OPTIONS = {"LIST", "GENERATE", "COLUMN", "ADD", "TITLE", "COLLECT"}


class _Set(NamedTuple):
    """Numbers that a set lists, first and last of its ranges, and the sets that it adds up."""

    name: str
    numbers: list[int]
    ranges: list[tuple[int, int]]
    added: list[int]


class _DynaSets:
    """Sets of a deck as they are read, by their kind and number."""

    def __init__(self) -> None:
        self.sets: dict[str, dict[int, _Set]] = {}
        self.not_read: dict[str, None] = {}

    def take(self, block: Block) -> None:
        """Take the set of a block; one that is given in a way that is not read is named."""
        _, kind, *words = block.keyword.split("_")
        options = set(words)
        lines = [line for line in block.lines if line.text.strip()]
        if kind not in _KINDS or options - _OPTIONS:
            self.not_read[f"*{block.keyword} (line {block.place.line})"] = None
            return
        title = lines.pop(0).text.strip() if "TITLE" in options and lines else ""
        if not lines:
            raise block.error("has no number; the file is cut off")
        widths = block.widths(10, 8)
        number = lines.pop(0).wholes(widths[:1])[0]
        title = title or _comment_of_gmsh(block)
        sets = self.sets.setdefault(kind, {})
        known = sets.get(number)
        if known is None:
            known = _Set(title or f"{kind.lower()} set {number}", [], [], [])
            sets[number] = known
        self._fill(known, kind, options, lines, widths)

    @staticmethod
    def _fill(
        known: _Set, kind: str, options: set[str], lines: list[Line], widths: list[int]
    ) -> None:
        for line in lines:
            if kind == "SEGMENT":
                known.numbers.extend(n for n in line.wholes(widths[:4])[:4] if n)
            elif "COLUMN" in options:
                known.numbers.append(line.wholes(widths[:1])[0])
            elif "GENERATE" in options:
                ends = line.wholes(widths)
                known.ranges.extend(pair for pair in zip(ends[::2], ends[1::2]) if any(pair))
            elif "ADD" in options:
                known.added.extend(n for n in line.wholes(widths) if n)
            else:
                known.numbers.extend(n for n in line.wholes(widths) if n)

    def fill(
        self,
        sets: NumberedSets,
        cells: Mapping[str, tuple[int, Numbering]],
        left_out: Mapping[str, LeftOutElements],
        part_of_cell: np.ndarray,
    ) -> None:
        """Set the sets of the mesh, and its notes about what they lose.

        Parameters
        ----------
        cells : first row and numbers of the shells, solids and thick shells.
        left_out : elements that are no cells, by their kind.
        part_of_cell : number of the part of each cell (C,).
        """
        none = (0, Numbering(NO_IDS))
        for kind, of_kind in self.sets.items():
            for number, one in of_kind.items():
                if kind in ("NODE", "SEGMENT"):
                    sets.add_nodes(one.name, self._members(kind, number, sets.nodes.ids))
                elif kind == "PART":
                    parts = self._members(kind, number, np.unique(part_of_cell))
                    sets.mesh.cell_sets[one.name] = np.flatnonzero(np.isin(part_of_cell, parts))
                else:
                    family = kind.lower()
                    first, numbering = cells.get(family, none)
                    aside = left_out.get(family, LeftOutElements())
                    known = np.concatenate([numbering.ids, aside.numbers])
                    members = self._members(kind, number, known)
                    sets.add_cells(one.name, members, numbering, first, aside)
        sets.tell()
        if "SEGMENT" in self.sets:
            names = [one.name for one in self.sets["SEGMENT"].values()]
            sets.mesh.notes_of_sets.append(
                f"sets of segments are kept as the sets of their nodes: {listed(names)}"
            )
        if self.not_read:
            sets.mesh.notes_of_sets.append(
                f"sets that are not given as lists are left out: {listed(list(self.not_read))}"
            )

    def _members(
        self, kind: str, number: int, ids: np.ndarray, within: tuple[int, ...] = ()
    ) -> np.ndarray:
        """Numbers of the members of a set; those of ranges that exist."""
        one = self.sets[kind][number]
        found = [np.array(one.numbers, dtype=np.int64)]
        found += [ids[(ids >= first) & (ids <= last)] for first, last in one.ranges]
        for added in one.added:
            if added not in self.sets[kind] or added in (*within, number):
                self.not_read[f"{kind.lower()} set {added}, which {one.name} names"] = None
                continue
            found.append(self._members(kind, added, ids, (*within, number)))
        return np.unique(np.concatenate(found))


def _comment_of_gmsh(block: Block) -> str:
    """Name that Gmsh writes as the only comment below the keyword of a set."""
    if len(block.comments) != 1:
        return ""
    found = re.fullmatch(r"\$# (\S+)", block.comments[0])
    return found[1] if found is not None and found[1] != "sid" else ""


# --- decks ----------------------------------------------------------------------------------------

#: Options of shells that add lines to each element, and those that change nothing here.
_ONE_LINE = ({"THICKNESS", "BETA", "MCID"}, {"OFFSET"}, {"DOF"})
_SHELL_OPTIONS = {"THICKNESS", "BETA", "MCID", "OFFSET", "DOF", "SHL4", "TO", "SHL8"}
_SOLID_OPTIONS = {"ORTHO": 2, "DOF": 1, "TET4TOTET10": 0, "H8TOH20": 0, "H20": 0}
#: Elements that are no cells: fields of their nodes, and their kind among the sets.
_OTHERS = {
    "ELEMENT_BEAM": ((2, 3), "beam"),
    "ELEMENT_DISCRETE": ((2, 3), "discrete"),
    "ELEMENT_SEATBELT": ((2, 3), "seatbelt"),
    "ELEMENT_MASS": ((1,), "mass"),
    "ELEMENT_PLOTEL": ((1, 2), "plotel"),
}


class Element(NamedTuple):
    """An element as the deck lists it: its shape, and the numbers of its nodes in VTK's order."""

    number: int
    part: int
    shape: str
    nodes: tuple[int, ...]
    place: Place


@dataclass
class _Deck:
    """What is read from a deck."""

    nodes: list[tuple[int, float, float, float]] = field(default_factory=list)
    node_places: list[Place] = field(default_factory=list)
    elements: dict[str, list[Element]] = field(default_factory=dict)
    others: dict[str, list[tuple[int, list[int]]]] = field(default_factory=dict)
    parts: dict[int, str] = field(default_factory=dict)
    without_middles: list[int] = field(default_factory=list)
    not_read: dict[str, int] = field(default_factory=dict)
    sets: _DynaSets = field(default_factory=_DynaSets)


def read_lsdyna(path: Path) -> FileMesh:
    """Read the mesh of a deck.

    Raises
    ------
    InputError : wrong or incomplete data, what moves or makes a mesh and is not followed, or no
        mesh at all; names file and line.
    """
    deck = _Deck()
    for block in keyword_blocks(path):
        _take(deck, block)
    if not deck.nodes:
        raise InputError("the deck has no *NODE, so no mesh", file=path)
    table = np.array([node[1:] for node in deck.nodes])
    ids = np.array([node[0] for node in deck.nodes], dtype=np.int64)
    ids, points = unique_nodes(ids, table, deck.node_places.__getitem__)
    nodes = Numbering(ids)
    return _mesh(deck, ids, points, nodes)


def _take(deck: _Deck, block: Block) -> None:
    """Take what belongs to the mesh from a block."""
    keyword = block.keyword
    if keyword == "NODE":
        _take_nodes(deck, block)
    elif keyword.startswith("ELEMENT_SHELL"):
        deck.elements.setdefault("shell", []).extend(_shells(deck, block))
    elif keyword.startswith("ELEMENT_SOLID"):
        deck.elements.setdefault("solid", []).extend(_solids(deck, block))
    elif keyword.startswith("ELEMENT_TSHELL"):
        deck.elements.setdefault("tshell", []).extend(_thick_shells(deck, block))
    elif keyword in _OTHERS:
        fields, kind = _OTHERS[keyword]
        rows = deck.others.setdefault(kind, [])
        for line in _joined(block):
            numbers = _padded([_or_none(entry) for entry in line.fields(_element_widths(block))])
            rows.append((numbers[0], [numbers[k] for k in fields if numbers[k]]))
    elif keyword.startswith("ELEMENT_"):
        deck.not_read[keyword] = deck.not_read.get(keyword, 0) + 1
    elif keyword.split("_")[0] == "PART" and keyword.split("_")[-1] not in ("ADAPTIVE", "MOVE"):
        _take_parts(deck, block)
    elif keyword.startswith("SET_"):
        deck.sets.take(block)


def _take_nodes(deck: _Deck, block: Block) -> None:
    widths = {"long": [20] * 4, "i10": [10, 16, 16, 16]}.get(block.format, [8, 16, 16, 16])
    for line in block.lines:
        if not line.text.strip():
            continue
        entries = [*line.fields(widths), "", "", ""][:4]
        number = line.wholes(widths[:1])[0] if "," not in line.text else int(line.real(entries[0]))
        x, y, z = (line.real(entry) for entry in entries[1:4])
        deck.nodes.append((number, x, y, z))
        deck.node_places.append(line.place)


def _element_widths(block: Block) -> list[int]:
    return block.widths(8, 10, i10=10)


def _padded(numbers: list[int]) -> list[int]:
    return numbers + [0] * (10 - len(numbers))


def _or_none(entry: str) -> int:
    """Number of an entry, 0 where it is none, as the mass of an element."""
    return int(entry) if entry.isdigit() and len(entry) < 18 else 0


def _joined(block: Block) -> Iterator[Line]:
    """Lines that hold something; those that end with a comma go on in the next."""
    begun: Line | None = None
    for line in block.lines:
        if not line.text.strip():
            continue
        line = line if begun is None else Line(begun.text + line.text, begun.place)
        begun = line if line.text.rstrip().endswith(",") else None
        if begun is None:
            yield line
    if begun is not None:
        yield begun


def _next(lines: Iterator[Line], block: Block, what: str) -> Line:
    line = next(lines, None)
    if line is None:
        raise block.error(f"ends before {what}; the file is cut off")
    return line


def _shells(deck: _Deck, block: Block) -> Iterator[Element]:
    options = block.options("ELEMENT_SHELL", _SHELL_OPTIONS, "shells")
    lines = _joined(block)
    widths = _element_widths(block)
    for line in lines:
        numbers = _padded(line.wholes(widths))
        further = sum(bool(options & group) for group in _ONE_LINE)
        if "THICKNESS" in options and any(numbers[6:10]):
            further += 1  # thickness at the middles of the sides
        for _ in range(further):
            _next(lines, block, f"the last line of element {numbers[0]}")
        shape, nodes = _shell(numbers, line, deck.without_middles)
        yield Element(numbers[0], numbers[1], shape, nodes, line.place)


def _shell(
    numbers: list[int], line: Line, without_middles: list[int]
) -> tuple[str, tuple[int, ...]]:
    a, b, c, d, *middle = numbers[2:10]
    if not (a and b and c):
        raise line.place.error(f"element {numbers[0]} has fewer than three nodes")
    if d and d not in (a, b, c):
        if all(middle):
            return "quad8", (a, b, c, d, *middle)
        if middle[0] and middle[1] and not middle[2] and not middle[3]:
            raise line.place.error(
                f"element {numbers[0]} has six nodes; write a triangle with the third node twice, "
                "N1 N2 N3 N3, and the middles of its sides behind these"
            )
        if any(middle):
            without_middles.append(numbers[0])
        return "quad", (a, b, c, d)
    if d in (0, c) and all(middle[:3]) and middle[3] in (0, middle[2]):
        return "triangle6", (a, b, c, *middle[:3])
    if any(middle):
        without_middles.append(numbers[0])
    return "triangle", (a, b, c)


def _solids(deck: _Deck, block: Block) -> Iterator[Element]:
    options = block.options("ELEMENT_SOLID", _SOLID_OPTIONS, "solids")
    further = sum(_SOLID_OPTIONS[option] for option in options)
    lines = _joined(block)
    widths = _element_widths(block)
    for line in lines:
        numbers = line.wholes(widths)
        while numbers and not numbers[-1]:
            numbers.pop()
        nodes = numbers[2:]
        if len(numbers) <= 2:  # its nodes stand in a line of their own
            numbers = _padded(numbers)
            nodes = _next(lines, block, f"the nodes of element {numbers[0]}").wholes(widths)
            if "H20" in options:
                nodes += _next(lines, block, f"the nodes of element {numbers[0]}").wholes(widths)
        for _ in range(further):
            _next(lines, block, f"the last line of element {numbers[0]}")
        shape, nodes_of_shape = _solid(numbers[0], nodes, line, deck.without_middles)
        yield Element(numbers[0], numbers[1], shape, nodes_of_shape, line.place)


def _solid(
    number: int, nodes: list[int], line: Line, without_middles: list[int]
) -> tuple[str, tuple[int, ...]]:
    while nodes and not nodes[-1]:
        nodes = nodes[:-1]
    if len(nodes) == 4:
        return "tetra", tuple(nodes)
    if len(nodes) == 10 and len(set(nodes)) == 10:
        return "tetra10", tuple(nodes)
    if len(nodes) == 20:
        without_middles.append(number)
        nodes = nodes[:8]
    found = solid_of_eight(nodes) if len(nodes) == 8 and all(nodes) else None
    if found is None:
        raise line.place.error(
            f"element {number} has the nodes {', '.join(map(str, nodes)) or 'none'}, which make "
            "no hexahedron, wedge, pyramid or tetrahedron"
        )
    return found


def _thick_shells(deck: _Deck, block: Block) -> Iterator[Element]:
    options = block.options("ELEMENT_TSHELL", {"BETA"}, "shells")
    lines = _joined(block)
    for line in lines:
        numbers = _padded(line.wholes(_element_widths(block)))
        if options:
            _next(lines, block, f"the last line of element {numbers[0]}")
        shape, nodes = _solid(numbers[0], numbers[2:10], line, deck.without_middles)
        yield Element(numbers[0], numbers[1], shape, nodes, line.place)


def _turns() -> list[tuple[int, ...]]:
    """Orders of the nodes of a hexahedron that leave it as it is: its 24 turns."""
    about_z, about_x = (1, 2, 3, 0, 5, 6, 7, 4), (3, 2, 6, 7, 0, 1, 5, 4)
    found = [tuple(range(8))]
    for turn in found:
        for by in (about_z, about_x):
            after = tuple(turn[k] for k in by)
            if after not in found:
                found.append(after)
    return found


_TURNS = _turns()
# Nodes of a hexahedron that coincide, and the nodes that remain, in VTK's order. The first is how
# LS-DYNA writes a tetrahedron, the others are hexahedra that are squeezed.
_SQUEEZED: list[tuple[str, list[tuple[int, ...]], tuple[int, ...]]] = [
    ("tetra", [(3, 4, 5, 6, 7)], (0, 1, 2, 3)),
    ("tetra", [(2, 3), (4, 5, 6, 7)], (0, 1, 2, 4)),
    ("pyramid", [(4, 5, 6, 7)], (0, 1, 2, 3, 4)),
    ("wedge", [(2, 3), (6, 7)], (0, 1, 2, 4, 5, 6)),
]


def solid_of_eight(nodes: list[int]) -> tuple[str, tuple[int, ...]] | None:
    """Return the shape of a solid of eight nodes, some of them alike, and its nodes.

    None where they make no solid.
    """
    different = len(set(nodes))
    if different == 8:
        return "hexahedron", tuple(nodes)
    for shape, alike, remain in _SQUEEZED:
        if different != len(remain):
            continue
        for turn in _TURNS:
            turned = [nodes[k] for k in turn]
            if all(len({turned[k] for k in same}) == 1 for same in alike):
                return shape, tuple(turned[k] for k in remain)
    return None


def _take_parts(deck: _Deck, block: Block) -> None:
    """Take the names of parts; options add lines whose number varies, then the first counts."""
    lines = block.lines
    pairs = len(lines) // 2 if block.keyword == "PART" else min(1, len(lines) // 2)
    for k in range(pairs):
        card = lines[2 * k + 1]
        number = _or_none(card.fields(block.widths(10, 1))[0])
        title = lines[2 * k].text.strip()
        if number and title:
            deck.parts[number] = title


def _mesh(deck: _Deck, ids: np.ndarray, points: np.ndarray, nodes: Numbering) -> FileMesh:
    """Mesh of shells, thick shells and solids, whose numbers are counted apart."""
    mesh = FileMesh(points, [], node_ids=ids)
    cell_ids, numbers = [NO_IDS], [NO_IDS]
    sets = NumberedSets(mesh, nodes)
    first_rows: dict[str, tuple[int, Numbering]] = {}
    for kind, elements in deck.elements.items():
        first = mesh.cell_count
        blocks, labels = merged_blocks(_cells(elements), nodes)
        part_of = {element.number: element.part for element in elements}
        mesh.blocks += blocks
        cell_ids.append(labels)
        numbers.append(np.array([part_of[number] for number in labels.tolist()], dtype=np.int64))
        first_rows[kind] = first, Numbering(labels)
    every = np.concatenate(cell_ids)
    if len(np.unique(every)) == len(every):
        mesh.cell_ids = every
    else:
        mesh.notes_of_sets.append(
            "shells and solids of the deck have the same numbers: the cells are counted from 1"
        )
    of_cells = np.concatenate(numbers)
    names = {
        number: deck.parts.get(number, f"part {number}") for number in np.unique(of_cells).tolist()
    }
    mesh.parts = parts_of_numbers(of_cells, names)
    mesh.left_aside = {kind: len(rows) for kind, rows in deck.others.items() if rows}
    left_out = {kind: LeftOutElements(rows) for kind, rows in deck.others.items()}
    deck.sets.fill(sets, first_rows, left_out, of_cells)
    _note(mesh, deck)
    return mesh


def _cells(elements: list[Element]) -> list[Cells]:
    by_shape: dict[str, list[Element]] = {}
    for element in elements:
        by_shape.setdefault(element.shape, []).append(element)
    return [
        Cells(
            shape,
            np.array([element.number for element in alike], dtype=np.int64),
            np.array([element.nodes for element in alike], dtype=np.int64),
            _place_of(alike),
        )
        for shape, alike in by_shape.items()
    ]


def _place_of(elements: list[Element]) -> Callable[[int], Place]:
    return lambda row: elements[row].place


def _note(mesh: FileMesh, deck: _Deck) -> None:
    if deck.without_middles:
        shown = ", ".join(str(number) for number in deck.without_middles[:5])
        mesh.notes.append(
            f"{len(deck.without_middles)} elements are taken by their corners, without the middles "
            f"of their sides (element {shown}{', ...' if len(deck.without_middles) > 5 else ''})"
        )
    if deck.not_read:
        counted = [f"*{keyword} ({count})" for keyword, count in deck.not_read.items()]
        mesh.notes.append(f"keywords with elements that are not read: {listed(counted)}")
