"""What readers of solver decks share: lines, real numbers, and sets listed by their numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    FileMesh,
    LeftOutElements,
    Numbering,
    keep_as_nodes,
)

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")


def real_number(text: str) -> float:
    """Return a real number as Fortran writes it; ``1.5-3`` and ``1.5D-3`` are 1.5e-3.

    Raises
    ------
    ValueError : it is none.
    """
    found = _REAL.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return float(found[1] + ("e" + found[2] if found[2] else ""))


def deck_lines(path: Path) -> list[str]:
    """Return the lines of a deck; comments may be in any one-byte encoding.

    Raises
    ------
    InputError : the file is absent, a folder, empty or no text.
    """
    if path.is_dir():
        raise InputError("this is a folder; name the deck in it", file=path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"the deck cannot be read ({error.strerror or error})", file=path
        ) from None
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(
            f"line {line}: holds a zero byte, so this is no text deck; export it as text",
            file=path,
        )
    if not content.strip():
        raise InputError("the file is empty; export the mesh again", file=path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


# --- sets -----------------------------------------------------------------------------------------


class NumberedSets:
    """Sets that are filled one after the other, with notes about those that lose members.

    Members that the mesh does not have are counted. Elements that are no cells leave their nodes.

    Parameters
    ----------
    mesh : whose sets are filled.
    nodes : numbers of its nodes.
    """

    def __init__(self, mesh: FileMesh, nodes: Numbering) -> None:
        self.mesh = mesh
        self.nodes = nodes
        self.missing: dict[str, int] = {}
        self.moved: list[str] = []

    def add_nodes(self, name: str, numbers: np.ndarray) -> None:
        """Add a set of nodes by their numbers."""
        rows = self.nodes.rows(numbers)
        self._count(name, int((rows < 0).sum()))
        self.mesh.node_sets[_free(name, self.mesh.node_sets)] = np.unique(rows[rows >= 0])

    def add_cells(
        self,
        name: str,
        numbers: np.ndarray,
        cells: Numbering,
        first: int,
        left_out: LeftOutElements,
    ) -> None:
        """Add a set of elements by their numbers.

        Parameters
        ----------
        cells : numbers of the cells that the members are looked up in.
        first : row in the mesh of the first of these cells.
        left_out : elements that are no cells.
        """
        rows = cells.rows(numbers)
        lost = numbers[rows < 0]
        nodes, found = left_out.nodes(lost) if len(lost) else (NO_IDS, 0)
        self._count(name, len(lost) - found)
        if found:
            of_nodes = self.nodes.rows(nodes)
            keep_as_nodes(self.mesh, name, of_nodes[of_nodes >= 0])
            self.moved.append(name)
        if (rows >= 0).any() or not found:
            free = _free(name, self.mesh.cell_sets)
            self.mesh.cell_sets[free] = np.unique(rows[rows >= 0]) + first

    def _count(self, name: str, lost: int) -> None:
        if lost:
            self.missing[name] = self.missing.get(name, 0) + lost

    def tell(self) -> None:
        """Add to the notes of the mesh what the sets lost."""
        if self.moved:
            self.mesh.notes_of_sets.append(
                "sets of elements left aside are kept as the sets of their nodes: "
                f"{listed(self.moved)}"
            )
        if self.missing:
            counted = [f"{name} ({count})" for name, count in self.missing.items()]
            self.mesh.notes_of_sets.append(
                "sets list elements or nodes that the mesh does not have, of left-out types or not "
                f"defined: {listed(counted)}"
            )


def _free(name: str, taken: dict[str, np.ndarray]) -> str:
    """Return the name, with a number behind it where another set has it already."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} ({number})"
    return free


def listed(names: list[str]) -> str:
    """Return the first names, and how many more there are."""
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
