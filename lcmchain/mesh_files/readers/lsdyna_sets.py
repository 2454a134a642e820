"""Sets of LS-DYNA decks: lists, ranges and sums of nodes, elements, parts and segments.

Source: LS-DYNA Keyword User's Manual, volume I, *SET. Numbers of sets are counted apart for each
kind; a set has a name where its keyword ends with _TITLE, or a comment of Gmsh.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from lcmchain.mesh_files.file_mesh import NO_IDS, LeftOut, Numbering
from lcmchain.mesh_files.readers.lsdyna_blocks import Block, Line
from lcmchain.mesh_files.readers.numbered_sets import NumberedSets, listed

_KINDS = ("NODE", "SHELL", "SOLID", "TSHELL", "PART", "BEAM", "DISCRETE", "SEGMENT")
#: Ways to give a set that are read; others select by boxes or by ranges of coordinates.
_OPTIONS = {"LIST", "GENERATE", "COLUMN", "ADD", "TITLE", "COLLECT"}


class _Set(NamedTuple):
    """Numbers that a set lists, first and last of its ranges, and the sets that it adds up."""

    name: str
    numbers: list[int]
    ranges: list[tuple[int, int]]
    added: list[int]


class DynaSets:
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
        left_out: Mapping[str, LeftOut],
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
                    own = kind.lower()
                    first, numbering = cells.get(own, none)
                    aside = left_out.get(own, LeftOut())
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
