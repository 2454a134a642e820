"""Meshes of Nastran and OptiStruct bulk data (.bdf, .nas, .fem), with numbers, properties and sets.

Source: MSC/NX Nastran Quick Reference Guide, entries of the elements.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.mesh_files.file_mesh import (
    Cells,
    FileMesh,
    LeftOutElements,
    Numbering,
    keep_as_nodes,
    merged_blocks,
    parts_of_numbers,
    unique_nodes,
)
from lcmchain.mesh_files.readers.decks.nastran_cards import Card, NastranDeck, read_deck
from lcmchain.mesh_files.readers.decks.nastran_sets import fill_sets, property_names
from lcmchain.mesh_files.shapes import SOLID_EDGES, reordered

# Blank, which stands for a property of the element's own number: no part of the mesh.
NO_PROPERTY = 0


class Element(NamedTuple):
    """Shape with corners only, and with all mid-side nodes; edges in Nastran's order of these."""

    corners: int
    shape: str
    full: int = 0
    edges: tuple[tuple[int, int], ...] = ()

    @property
    def order(self) -> np.ndarray:
        """Places of VTK's nodes among Nastran's, with all mid-side nodes."""
        name = f"{self.shape}{self.full}"
        if self.edges:
            return reordered(name, list(range(self.corners)), list(self.edges))
        return np.arange(self.full)


_HEXAHEDRON = SOLID_EDGES["hexahedron"]
_WEDGE = SOLID_EDGES["wedge"]
# The edges across lie between those of the lower and of the upper face.
_ELEMENTS = {
    "CTRIA3": Element(3, "triangle"),
    "CTRIAR": Element(3, "triangle"),
    "CTRIA6": Element(3, "triangle", 6),
    "CQUAD4": Element(4, "quad"),
    "CQUADR": Element(4, "quad"),
    "CQUAD8": Element(4, "quad", 8),
    "CTETRA": Element(4, "tetra", 10, tuple(SOLID_EDGES["tetra"])),
    "CPYRAM": Element(5, "pyramid", 13, tuple(SOLID_EDGES["pyramid"])),
    "CPYRA": Element(5, "pyramid", 13, tuple(SOLID_EDGES["pyramid"])),
    "CPENTA": Element(6, "wedge", 15, (*_WEDGE[:3], *_WEDGE[6:], *_WEDGE[3:6])),
    "CHEXA": Element(8, "hexahedron", 20, (*_HEXAHEDRON[:4], *_HEXAHEDRON[8:], *_HEXAHEDRON[4:8])),
}


class Aside(NamedTuple):
    """Fields of the nodes of an element that is no cell, and of its property (-1 where none)."""

    nodes: tuple[int, ...]
    property: int = -1


# Counted, so that the report says that they are no cells of the mapping; sets and properties of
# those with nodes on known fields are kept as their nodes.
_LINE = Aside((2, 3), 1)
_OTHERS: dict[str, Aside] = {
    "CBAR": _LINE, "CBEAM": _LINE, "CBEAM3": Aside((2, 3, 4), 1), "CBEND": _LINE, "CROD": _LINE,
    "CONROD": Aside((1, 2)), "CTUBE": _LINE, "CBUSH": _LINE, "CBUSH1D": _LINE, "CVISC": _LINE,
    "CGAP": _LINE, "CELAS1": Aside((2, 4), 1), "CELAS2": Aside((2, 4)),
    "CDAMP1": Aside((2, 4), 1), "CDAMP2": Aside((2, 4)), "CONM1": Aside((1,)),
    "CONM2": Aside((1,)), "PLOTEL": Aside((1, 2)), "RBAR": Aside((1, 2)), "RROD": Aside((1, 2)),
    "CMASS1": Aside((2, 4), 1), "CMASS2": Aside((2, 4)), "CSHEAR": Aside((2, 3, 4, 5), 1),
    "CHBDYG": Aside(tuple(range(8, 16))), "CHBDYP": Aside((5, 6), 1),
    "PLOTEL3": Aside((1, 2, 3)), "PLOTEL4": Aside((1, 2, 3, 4)), "RBAR1": Aside((1, 2)),
    **dict.fromkeys(
        ("CELAS3", "CELAS4", "CDAMP3", "CDAMP4", "CDAMP5", "CMASS3", "CMASS4", "CFAST", "CWELD",
         "CSEAM", "RBE1", "RBE2", "RBE2GS", "RBE3", "RJOINT", "RSPLINE", "RSSCON", "RTRPLT",
         "RTRPLT1", "GENEL", "CHBDYE", "CHBDY", "CQUAD", "CQUADX", "CQUADX4", "CQUADX8", "CTRIAX",
         "CTRIAX3", "CTRIAX6", "CTRAX3", "CTRAX6", "CPLSTN3", "CPLSTN4", "CPLSTN6", "CPLSTN8",
         "CPLSTS3", "CPLSTS4", "CPLSTS6", "CPLSTS8", "CHEXCZ", "CPENTCZ", "CIFHEX", "CIFPENT",
         "CIFQUAD", "CAABSF", "CACINF3", "CACINF4", "CHACAB", "CHACBR", "CCONEAX", "CRAC2D",
         "CRAC3D", "CINTC", "CSLOT3", "CSLOT4", "CFLUID2", "CFLUID3", "CFLUID4", "CAXIF2",
         "CAXIF3", "CAXIF4", "PLOTEL6", "PLOTEL8", "PLOTTET", "PLOTPYR", "PLOTPEN", "PLOTHEX",
         "SPOINT"),
        Aside(()),
    ),
}  # fmt: skip
# Coordinate systems that are read.
_SYSTEMS = {"CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S"}

# Entries whose names begin with C as those of elements do, and that connect no nodes.
_NO_ELEMENTS = {
    "CAERO1", "CAERO2", "CAERO3", "CAERO4", "CAERO5", "CAMPBLL", "CASECC", "CBARAO", "CEND",
    "CLOAD", "CMETHOD", "CNTSTB", "CONCTL", "CONTACT", "CONTPRM", "CONTRLT", "CONV", "CONVM",
    "CREEP", "CSET", "CSET1", "CSSCHD", "CSUPER", "CSUPEXT", "CYAX", "CYJOIN", "CYSUP", "CYSYM",
    "CORD3R", "CORD4R", "CORD1RX", "CORD2RX", "CORD3G", *_SYSTEMS,
}  # fmt: skip


def read_nastran(path: Path) -> FileMesh:
    """Read the mesh of a deck.

    Raises
    ------
    InputError : wrong or incomplete entries, or no mesh at all; names file and line.
    """
    deck = read_deck(path)
    by_name: dict[str, list[Card]] = {}
    for card in deck.cards:
        by_name.setdefault(card.name, []).append(card)
    grids = by_name.get("GRID", [])
    if not grids:
        raise InputError("the deck has no GRID, so no mesh; is it bulk data?", file=path)
    ids, points = _nodes(grids, by_name)
    numbering = Numbering(ids)
    groups = [
        group
        for name, element in _ELEMENTS.items()
        for group in _groups(by_name.get(name, []), element)
    ]
    blocks, cell_ids = merged_blocks([group.cells for group in groups], numbering)
    mesh = FileMesh(points, blocks, cell_ids, ids)
    mesh.left_aside = {name: len(by_name[name]) for name in _OTHERS if name in by_name}
    properties = {
        int(cell): int(number)
        for group in groups
        for cell, number in zip(group.cells.ids, group.properties, strict=True)
    }
    numbers = np.array([properties[cell] for cell in cell_ids.tolist()], dtype=np.int64)
    said = property_names(deck)
    names = {number: said.get(number, f"property {number}") for number in numbers.tolist()}
    names[NO_PROPERTY] = ""
    mesh.parts = parts_of_numbers(numbers, names)
    mesh.parts.pop("", None)
    left_out, of_property = _left_out(by_name)
    fill_sets(mesh, deck, numbering, left_out)
    _keep_properties(mesh, of_property, said, numbering)
    _note(mesh, deck, groups)
    _note_unknown(mesh, by_name)
    return mesh


def _note_unknown(mesh: FileMesh, by_name: dict[str, list[Card]]) -> None:
    """Name entries that may be elements: their names begin as those of elements do."""
    unknown = [
        f"{name} ({len(cards)})"
        for name, cards in by_name.items()
        if name[:1] == "C" and not {name} & (_ELEMENTS.keys() | _OTHERS.keys() | _NO_ELEMENTS)
    ]
    if unknown:
        mesh.notes.append(
            "entries that may be elements and are not known are left out: "
            f"{', '.join(unknown[:8])}{', ...' if len(unknown) > 8 else ''}"
        )


def _left_out(by_name: dict[str, list[Card]]) -> tuple[LeftOutElements, dict[int, list[int]]]:
    """Elements that are no cells, and the nodes of each property of line elements."""
    elements = []
    of_property: dict[int, list[int]] = {}
    for name, aside in _OTHERS.items():
        for card in by_name.get(name, []) if aside.nodes else []:
            texts = [card.text(field) for field in aside.nodes]
            nodes = [int(text) for text in texts if _is_number(text)]
            if _is_number(card.text(0)):
                elements.append((int(card.text(0)), nodes))
            if aside.property >= 0 and _is_number(number := card.text(aside.property)):
                of_property.setdefault(int(number), []).extend(nodes)
    return LeftOutElements(elements), of_property


def _is_number(text: str) -> bool:
    return text.isdigit() and len(text) < 18


def _keep_properties(
    mesh: FileMesh, of_property: dict[int, list[int]], said: dict[int, str], numbering: Numbering
) -> None:
    """Keep properties of line elements as the sets of their nodes."""
    kept = []
    for number, nodes in sorted(of_property.items()):
        rows = numbering.rows(np.array(nodes, dtype=np.int64))
        name = said.get(number, f"property {number}")
        keep_as_nodes(mesh, name, rows[rows >= 0])
        kept.append(name)
    if kept:
        mesh.notes_of_sets.append(
            "properties of elements left aside are kept as the sets of their nodes: "
            f"{', '.join(kept[:8])}{', ...' if len(kept) > 8 else ''}"
        )


def _nodes(grids: list[Card], by_name: dict[str, list[Card]]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and places of the nodes in the basic coordinate system."""
    ids = np.array([card.whole(0) for card in grids], dtype=np.int64)
    given = np.array([[card.real(2), card.real(3), card.real(4)] for card in grids])
    default = by_name.get("GRDSET", [])
    usual = default[0].whole(1, 0) if default else 0
    system = np.array([card.whole(1, usual) for card in grids])
    if system.any():
        systems = _Systems([card for name in _SYSTEMS for card in by_name.get(name, [])])
        nodes = {int(number): card for number, card in zip(ids, grids, strict=True)}
        for number in np.unique(system[system > 0]):
            rows = system == number
            first = grids[int(np.argmax(rows))]
            given[rows] = systems.place(int(number), given[rows], first, nodes)
    return unique_nodes(ids, given, lambda row: grids[row].place)


class _Group(NamedTuple):
    """Cells of one type, the numbers of their properties, and how many lost mid-side nodes."""

    cells: Cells
    properties: np.ndarray
    partly: np.ndarray


def _groups(cards: list[Card], element: Element) -> list[_Group]:
    """Cells with all mid-side nodes, and those without: their corners only."""
    with_all: list[tuple[Card, list[int]]] = []
    corners: list[tuple[Card, list[int]]] = []
    partly = []
    for card in cards:
        nodes = [card.whole(2 + k) for k in range(element.corners)]
        middle = [card.whole(2 + k, 0) for k in range(element.corners, element.full)]
        if middle and all(middle):
            with_all.append((card, nodes + middle))
            continue
        corners.append((card, nodes))
        if any(middle):
            partly.append(card.whole(0))
    found = []
    for name, rows, order in (
        (element.shape, corners, np.arange(element.corners)),
        (f"{element.shape}{element.full}", with_all, element.order),
    ):
        if rows:
            listed = [card for card, _ in rows]
            ids = np.array([card.whole(0) for card in listed], dtype=np.int64)
            table = np.array([nodes for _, nodes in rows], dtype=np.int64)[:, order]
            numbers = np.array([card.whole(1, NO_PROPERTY) for card in listed])
            place = [card.place for card in listed]
            cells = Cells(name, ids, table, place.__getitem__)
            found.append(_Group(cells, numbers, np.array(partly if name == element.shape else [])))
    return found


def _note(mesh: FileMesh, deck: NastranDeck, groups: list[_Group]) -> None:
    """Say what is lost, and that the deck has no end."""
    partly = [int(number) for group in groups for number in group.partly]
    if partly:
        mesh.notes.append(
            f"{len(partly)} elements have some of their mid-side nodes only and are taken without "
            f"({first_few(np.array(partly))})"
        )
    if deck.has_control and not deck.ended:
        mesh.notes.append("the deck does not end with ENDDATA: it may be cut off")


# --- coordinate systems, and places given in them -------------------------------------------------
# Source: MSC/NX Nastran Quick Reference Guide, CORD1R/C/S and CORD2R/C/S: A is the origin, B lies
# on the z axis, C in the plane of x and z.


class _System(NamedTuple):
    """Kind (R, C or S), origin (3,), and unit vectors of the axes as rows (3, 3)."""

    kind: str
    origin: np.ndarray
    axes: np.ndarray

    def places(self, given: np.ndarray) -> np.ndarray:
        """Return the places (N, 3) in the basic system of coordinates (N, 3) in this one."""
        a, b, c = given.T
        if self.kind == "C":
            turn = np.radians(b)
            given = np.stack([a * np.cos(turn), a * np.sin(turn), c], axis=1)
        elif self.kind == "S":
            polar, turn = np.radians(b), np.radians(c)
            given = np.stack(
                [a * np.sin(polar) * np.cos(turn), a * np.sin(polar) * np.sin(turn),
                 a * np.cos(polar)], axis=1,
            )  # fmt: skip
        return given @ self.axes + self.origin


class _Systems:
    """The coordinate systems of a deck, made when they are first asked for.

    Parameters
    ----------
    cards : CORD entries. node_place : returns the place of a node for those defined by nodes.
    """

    def __init__(self, cards: list[Card]) -> None:
        self._definitions: dict[int, tuple[Card, int]] = {}
        for card in cards:
            self._definitions[card.whole(0)] = (card, 0)
            if card.name[4] == "1" and card.text(4):
                self._definitions[card.whole(4)] = (card, 4)  # two to a line
        self._made: dict[int, _System] = {}
        self._in_work: list[int] = []

    def place(
        self, number: int, given: np.ndarray, card: Card, nodes: dict[int, Card]
    ) -> np.ndarray:
        """Return places (N, 3) in the basic system of coordinates in a system.

        Parameters
        ----------
        card : that names the system. nodes : GRID entries by number, for systems defined by nodes.

        Raises
        ------
        InputError : the system does not exist, has no axes, or is defined by itself.
        """
        if number == 0:
            return given
        if number not in self._made:
            if number not in self._definitions:
                raise card.place.error(
                    f"{card.name} {card.text(0)} is given in the coordinate system {number}, which "
                    "the file does not define"
                )
            if number in self._in_work:
                raise card.place.error(f"coordinate system {number} is defined by itself")
            self._in_work.append(number)
            self._made[number] = self._system(*self._definitions[number], nodes)
            self._in_work.pop()
        return self._made[number].places(given)

    def _system(self, card: Card, first: int, nodes: dict[int, Card]) -> _System:
        if card.name[4] == "2":
            given = np.array([card.real(field) for field in range(2, 11)]).reshape(3, 3)
            points = self.place(card.whole(1, 0), given, card, nodes)
        else:
            points = np.concatenate(
                [self._of_node(card, card.whole(first + k), nodes) for k in (1, 2, 3)]
            )
        with np.errstate(over="ignore", invalid="ignore"):
            z = points[1] - points[0]
            y = np.cross(z, points[2] - points[0])
            lengths = float(np.linalg.norm(z)), float(np.linalg.norm(y))
        if not np.isfinite(lengths).all() or min(lengths) <= 1e-12 * max(1.0, *lengths):
            raise card.place.error(f"{card.name} {card.text(first)} has no three different axes")
        z, y = z / lengths[0], y / lengths[1]
        return _System(card.name[5], points[0], np.stack([np.cross(y, z), y, z]))

    def _of_node(self, card: Card, number: int, nodes: dict[int, Card]) -> np.ndarray:
        if number not in nodes:
            raise card.place.error(f"{card.name} names the node {number}, which does not exist")
        grid = nodes[number]
        given = np.array([[grid.real(field) for field in (2, 3, 4)]])
        return self.place(grid.whole(1, 0), given, grid, nodes)
