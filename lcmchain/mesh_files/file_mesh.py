"""What a reader takes from a mesh file, before any of it is chosen, scaled or checked.

A reader fills a :class:`FileMesh`. The rest is what several readers need: numbers of nodes and
cells with gaps, cells that are listed twice, elements that are no cells, errors that name the line.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError

NO_IDS = np.empty(0, dtype=np.int64)
#: What is said of a file without any.
NO_CELLS = "the mesh has no cells to map onto; export it with its shells or solids"


class Place(NamedTuple):
    """A line of a text file."""

    file: Path
    line: int

    def error(self, message: str) -> InputError:
        """Return the error that names the line."""
        return InputError(f"line {self.line}: {message}", file=self.file)


@dataclass
class FileMesh:
    """Nodes and cells of a mesh file, with their numbers, sets and parts.

    Parameters
    ----------
    points : node positions in the unit of the file, shape (N, 3).
    blocks : cell type (meshio's name) and rows of the nodes of each block, shape (C_b, K).
    cell_ids, node_ids : numbers in the file, shapes (C,) and (N,); empty where it has none.
    cell_sets, node_sets, parts : rows of cells or nodes by name.
    left_aside : number of cells of kinds that are no cells of a mesh to map onto, by kind.
    notes : sentences about what the file holds and this does not. notes_of_sets : the same about
        sets, parts and numbers, which are nothing to those that take only the shape.
    unit : metres to the unit of length that the file itself states, None where it states none. The
        points are not changed by it.
    """

    points: np.ndarray
    blocks: list[tuple[str, np.ndarray]]
    cell_ids: np.ndarray = field(default_factory=lambda: NO_IDS)
    node_ids: np.ndarray = field(default_factory=lambda: NO_IDS)
    cell_sets: dict[str, np.ndarray] = field(default_factory=dict)
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    parts: dict[str, np.ndarray] = field(default_factory=dict)
    left_aside: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    notes_of_sets: list[str] = field(default_factory=list)
    unit: float | None = None

    @property
    def cell_count(self) -> int:
        return sum(len(nodes) for _, nodes in self.blocks)


class Cells(NamedTuple):
    """Cells of one type as a deck lists them, by the numbers of their nodes.

    Parameters
    ----------
    name : meshio's name of the type.
    ids : numbers, shape (C,). nodes : numbers of the nodes in VTK's order, shape (C, K).
    place : returns the line of a row.
    """

    name: str
    ids: np.ndarray
    nodes: np.ndarray
    place: Callable[[int], Place]


class Numbering:
    """Rows of numbers that need be neither sorted nor without gaps."""

    def __init__(self, ids: np.ndarray) -> None:
        self.ids = np.asarray(ids, dtype=np.int64)
        self._order = np.argsort(self.ids, kind="stable")
        self._sorted = self.ids[self._order]

    def rows(self, wanted: np.ndarray) -> np.ndarray:
        """Return the row of each number, -1 where there is none."""
        wanted = np.asarray(wanted, dtype=np.int64)
        if len(self.ids) == 0:
            return np.full(wanted.shape, -1, dtype=np.int64)
        at = np.minimum(np.searchsorted(self._sorted, wanted), len(self.ids) - 1)
        return np.where(self._sorted[at] == wanted, self._order[at], -1)


class LeftOutElements:
    """Elements of kinds that are no cells, by the numbers of their nodes: sets of them keep these.

    Parameters
    ----------
    elements : number of each, and the numbers of its nodes, shape (K,).
    """

    def __init__(self, elements: Sequence[tuple[int, Sequence[int]]] = ()) -> None:
        self._numbering = Numbering(np.array([number for number, _ in elements], dtype=np.int64))
        self._nodes = [np.array(nodes, dtype=np.int64) for _, nodes in elements]

    @property
    def numbers(self) -> np.ndarray:
        """Numbers of the elements (E,)."""
        return self._numbering.ids

    def nodes(self, wanted: np.ndarray) -> tuple[np.ndarray, int]:
        """Return the numbers of the nodes of elements, and how many of these are left-out ones."""
        rows = self._numbering.rows(wanted)
        rows = rows[rows >= 0]
        return np.unique(np.concatenate([NO_IDS, *[self._nodes[row] for row in rows]])), len(rows)


def keep_as_nodes(mesh: FileMesh, name: str, nodes: np.ndarray) -> None:
    """Keep a set or part of left-out elements as the set of its nodes, by their rows (N,)."""
    free = name if name not in mesh.node_sets else f"{name} (cells)"
    mesh.node_sets[free] = np.unique(nodes)


def unique_nodes(
    ids: np.ndarray, points: np.ndarray, place: Callable[[int], Place]
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes without those that are listed twice at the same place.

    Raises
    ------
    InputError : a number stands for two places.
    """
    _, first, back = np.unique(ids, return_index=True, return_inverse=True)
    if len(first) == len(ids):
        return ids, points
    twice = np.any(points != points[first[back]], axis=1)
    if twice.any():
        row = int(np.argmax(twice))
        raise place(row).error(
            f"node {ids[row]} was at another place before; give every node its own number"
        )
    kept = np.sort(first)
    return ids[kept], points[kept]


def merged_blocks(groups: Sequence[Cells], nodes: Numbering) -> tuple[list, np.ndarray]:
    """Return blocks with rows of nodes, one per type, and the numbers of their cells.

    Cells that are listed twice with the same nodes are taken once.

    Raises
    ------
    InputError : a cell has a node that the file does not define, or a number stands for two cells.
    """
    by_type: dict[str, list[Cells]] = {}
    for group in groups:
        by_type.setdefault(group.name, []).append(group)
    blocks: list[tuple[str, np.ndarray]] = []
    ids: list[np.ndarray] = []
    defined: dict[int, tuple] | None = None
    every = np.concatenate([group.ids for group in groups]) if groups else NO_IDS
    if len(np.unique(every)) < len(every):
        defined = {}
    for name, same in by_type.items():
        rows_of_type = []
        for group in same:
            rows = nodes.rows(group.nodes)
            if (rows < 0).any():
                row, column = np.argwhere(rows < 0)[0]
                raise group.place(int(row)).error(
                    f"element {group.ids[row]} has node {group.nodes[row, column]}, which the file "
                    "does not define; the file is incomplete, export it again"
                )
            keep = np.ones(len(rows), dtype=bool)
            if defined is not None:
                for row, cell in enumerate(group.ids):
                    now = (name, *rows[row])
                    if defined.setdefault(int(cell), now) != now:
                        raise group.place(row).error(
                            f"element {cell} had other nodes before; give every element its own "
                            "number"
                        )
                _, first = np.unique(group.ids, return_index=True)
                seen = np.concatenate([NO_IDS, *ids[len(blocks) :]])
                keep[:] = False
                keep[first] = True
                keep &= ~np.isin(group.ids, seen)
            rows_of_type.append(rows[keep])
            ids.append(group.ids[keep])
        # one entry of ids per type, as there is one block
        ids[len(blocks) :] = [np.concatenate(ids[len(blocks) :])]
        blocks.append((name, np.concatenate(rows_of_type)))
    return blocks, np.concatenate(ids) if ids else NO_IDS


def parts_of_numbers(numbers: np.ndarray, names: Mapping[int, str]) -> dict[str, np.ndarray]:
    """Rows of the cells with each number, by name; an unnamed number stands for itself.

    Two numbers with the same name stay apart: the number follows the name.
    """
    order = np.argsort(numbers, kind="stable")
    known, first = np.unique(numbers[order], return_index=True)
    rows = np.split(order, first)[1:]
    spelt = [names.get(int(number), str(number)) for number in known]
    often = Counter(spelt)
    return {
        (name if often[name] == 1 else f"{name} {number}"): of_number
        for number, name, of_number in zip(known, spelt, rows, strict=True)
    }


@contextmanager
def only_sound(title: str, path: Path) -> Iterator[None]:
    """Tell what goes wrong within the block as damage of the file.

    Parameters
    ----------
    title : of the format, as ``"MED"``.

    Raises
    ------
    InputError : the one of the block, or one with what h5py, netCDF4 or numpy said of the file.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # the libraries raise what the damage makes of the file
        raise InputError(
            f"cannot read the mesh: no sound {title} file ({' '.join(str(error).split())[:200]})"
            "; export it again",
            file=path,
        ) from None
