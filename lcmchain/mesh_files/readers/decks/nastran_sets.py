"""Sets of Nastran decks: case control SET, bulk SET1 and SET3, and what comments say of them.

Source: MSC/NX Nastran Quick Reference Guide; the comments are those that HyperMesh, ANSA, Patran
and Femap write.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    FileMesh,
    LeftOutElements,
    Numbering,
    Place,
    keep_as_nodes,
)
from lcmchain.mesh_files.readers.decks.nastran_cards import Card, NastranDeck

NODES, ELEMENTS = "nodes", "elements"

# What a set lists follows from the output request that names it.
_OF_NODES = re.compile(
    r"(?:DISP|DISPLACEMENT|VELO|VELOCITY|ACCE|ACCELERATION|SPCF|SPCFORCES?|MPCF|MPCFORCES?|OLOAD|"
    r"GPFORCE|SVECTOR|VECTOR|TEMPERATURE|THERMAL)\b"
)
_OF_ELEMENTS = re.compile(
    r"(?:STRE|STRESS|ELSTRESS|STRA|STRAIN|FORC|FORCE|ELFORCE|ESE|EKE|EDE|FLUX|CSTRESS|GPSTRESS)\b"
)
_SET = re.compile(r"SET\s+(\d+)\s*=\s*(.*)", re.IGNORECASE)
_REQUEST = re.compile(r"([A-Z]+)\s*(?:\([^)]*\))?\s*=\s*(\d+)\s*$", re.IGNORECASE)
_NAMED_SET = re.compile(r"HMSET\s+(\d+)\s+(\d+)\s+\"(.*)\"")
_ANSA_SET = re.compile(r"ANSA_NAME_COMMENT;(\d+);SET;([^;]*);")
_HYPERMESH_KINDS = {"1": NODES, "2": ELEMENTS}
_KINDS = {"GRID": NODES, "ELEM": ELEMENTS}

_NAMED_PROPERTY = (
    re.compile(r"HMNAME\s+PROP\s+(\d+)\s*\"(.*?)\""),
    re.compile(r"ANSA_NAME_COMMENT;(\d+);P[A-Z]+;([^;]*);"),
    re.compile(r"Femap(?:\s+with\s+NX\s+Nastran)?\s+Property\s+(\d+)\s*:\s*(.*)"),
)

#: What is noted of sets that may be of nodes or of elements.
AMBIGUOUS_SETS = "the deck does not say whether these sets list nodes or elements"


class Members(NamedTuple):
    """Numbers that a set lists, and those listed singly: ranges may well have gaps."""

    numbers: np.ndarray
    single: np.ndarray


def property_names(deck: NastranDeck) -> dict[int, str]:
    """Return names of properties by their numbers, from comments."""
    names: dict[int, str] = {}
    for comment in deck.comments:
        for pattern in _NAMED_PROPERTY:
            if (found := pattern.match(comment)) is not None and found[2].strip():
                names[int(found[1][:17])] = found[2].strip()
    return names


def fill_sets(
    mesh: FileMesh, deck: NastranDeck, ids_of_nodes: Numbering, left_out: LeftOutElements
) -> None:
    """Set the sets of a mesh, with notes about those that are doubtful or lose entries.

    Elements that are no cells are kept as their nodes; a set that lists something that is no number
    is left out.
    """
    names, kinds = _said(deck)
    if others := _of_others(deck, names):
        mesh.notes_of_sets.append(
            "sets of other things than nodes and elements, or not given as a list, are left out: "
            f"{', '.join(others[:8])}"
        )
    cells = Numbering(mesh.cell_ids)
    doubtful, lost, moved = [], [], []
    for number, kind, words, place in [*_of_case_control(deck), *_of_bulk(deck)]:
        name = names.get(number, f"SET {number}")
        if words == ["ALL"]:
            every = np.union1d(cells.ids, ids_of_nodes.ids)
            members = Members(every, every[:0])
        else:
            try:
                members = _members(words, place)
            except InputError as error:
                mesh.notes_of_sets.append(f"{name} is left out: {error.message}")
                continue
        kind = kind or kinds.get(number, "")
        if not kind:
            doubtful.append(name)
        found = 0
        for wanted, numbering, sets in (
            (NODES, ids_of_nodes, mesh.node_sets),
            (ELEMENTS, cells, mesh.cell_sets),
        ):
            if kind not in ("", wanted):
                continue
            rows = numbering.rows(members.numbers)
            rows = np.unique(rows[rows >= 0])
            found = max(found, int((numbering.rows(members.single) >= 0).sum()))
            nodes, of_left_out = NO_IDS, 0
            if wanted == ELEMENTS:
                nodes, of_left_out = left_out.nodes(members.numbers)
                singly = members.single[numbering.rows(members.single) < 0]
                found += left_out.nodes(singly)[1]
            if len(rows) or (kind and not of_left_out):
                free = name if name not in sets else f"{name} ({number})"
                sets[free] = rows
            if of_left_out:
                nodes = ids_of_nodes.rows(nodes)
                keep_as_nodes(mesh, name, nodes[nodes >= 0])
                moved.append(name)
        if found < len(members.single):
            lost.append(f"{name} ({len(members.single) - found})")
    if moved:
        mesh.notes_of_sets.append(
            "sets of elements left aside are kept as the sets of their nodes: "
            f"{', '.join(moved[:8])}"
        )
    if doubtful:
        mesh.notes_of_sets.append(
            f"{AMBIGUOUS_SETS}, they are kept as both: {', '.join(doubtful[:8])}"
        )
    if lost:
        mesh.notes_of_sets.append(
            f"sets list numbers that the mesh does not have, of left-out elements or not defined: "
            f"{', '.join(lost[:8])}"
        )


def _said(deck: NastranDeck) -> tuple[dict[int, str], dict[int, str]]:
    """Names and kinds of sets, from comments and from the requests that use them."""
    names: dict[int, str] = {}
    kinds: dict[int, str] = {}
    for comment in deck.comments:
        if (found := _NAMED_SET.match(comment)) is not None:
            names[int(found[1][:17])] = found[3]
            if found[2] in _HYPERMESH_KINDS:
                kinds[int(found[1][:17])] = _HYPERMESH_KINDS[found[2]]
        elif (found := _ANSA_SET.match(comment)) is not None and found[2]:
            names[int(found[1][:17])] = found[2]
    for _, text in deck.case_control:
        found = _REQUEST.match(text)
        if found is None or text.upper().startswith("SET"):
            continue
        word = found[1].upper()
        if _OF_NODES.match(word):
            kinds.setdefault(int(found[2][:17]), NODES)
        elif _OF_ELEMENTS.match(word):
            kinds.setdefault(int(found[2][:17]), ELEMENTS)
    return names, kinds


def _of_case_control(deck: NastranDeck) -> list[tuple[int, str, list[str], Place]]:
    """Number and what is listed of each SET of the case control; ``ALL`` is all there is."""
    found = []
    lines = iter(deck.case_control)
    for place, text in lines:
        match = _SET.match(text)
        if match is None:
            continue
        listed = match[2]
        while listed.rstrip().endswith(","):
            more = next(lines, None)
            if more is None:
                break
            listed += more[1]
        words = [word for word in re.split(r"[\s,]+", listed.upper()) if word]
        number = int(match[1][:17])
        if words == ["ALL"] or all(
            word[0].isdigit() or word in ("THRU", "EXCEPT") for word in words
        ):
            found.append((number, "", words, place))
        # others list names of outputs or places, no members of a mesh
    return found


def _of_bulk(deck: NastranDeck) -> Iterable[tuple[int, str, list[str], Place]]:
    """Number, kind and what is listed of the sets in the bulk data."""
    for card in deck.cards:
        if card.name == "SET1":
            yield card.whole(0), "", _listed(card, 1), card.place
        elif card.name in ("SET3", "SET") and _is_listed(card):
            # that of OptiStruct begins its list on the second line
            kind = _KINDS[card.text(1).upper()[:4]]
            yield card.whole(0), kind, _listed(card, 2 if card.name == "SET3" else 8), card.place


def _is_listed(card: Card) -> bool:
    """Whether a SET3, or a SET of OptiStruct, lists nodes or elements one by one."""
    by_list = card.name == "SET3" or card.text(2).upper() in ("", "LIST")
    return by_list and card.text(1).upper()[:4] in _KINDS


def _of_others(deck: NastranDeck, names: dict[int, str]) -> list[str]:
    """Sets of the bulk data that are not kept, in words."""
    found = []
    for card in deck.cards:
        if card.name in ("SET3", "SET") and not _is_listed(card):
            number = card.text(0)
            name = names.get(int(number)) if number.isdigit() and len(number) < 18 else None
            how = [card.text(1), *([card.text(2)] if card.name == "SET" else [])]
            found.append(f"{name or f'SET {number}'} ({' '.join(filter(None, how))})")
    return found


def _listed(card: Card, first: int) -> list[str]:
    return [text.upper() for text in card.fields[first:] if text and text.upper() != "SKIN"]


def _members(words: list[str], place: Place) -> Members:
    """Return the numbers of a list with THRU and EXCEPT, which takes them out of the last range.

    Raises
    ------
    InputError : an entry is no number, or a range is none.
    """
    kept: list[np.ndarray] = []
    single: list[int] = []
    range_end = -1  # of the range that an EXCEPT cuts, while one is in force
    at = 0
    while at < len(words):
        if words[at] == "EXCEPT":
            if not kept:
                raise place.error("EXCEPT follows no range")
            range_end, at = int(kept[-1][-1]), at + 1
            continue
        first = _number(words[at], place)
        if words[at + 1 : at + 2] == ["THRU"]:
            last = _number(words[at + 2] if at + 2 < len(words) else "", place)
            if not first <= last < first + 10**8:
                raise place.error(f"no range of numbers: {first} THRU {last}")
            numbers = np.arange(first, last + 1)
            at += 3
        else:
            numbers = np.array([first])
            at += 1
        # numbers beyond the range that an EXCEPT cuts belong to the list again
        if first <= range_end:
            kept[-1] = np.setdiff1d(kept[-1], numbers)
        else:
            range_end = -1
            kept.append(numbers)
            single += [first] if len(numbers) == 1 else []
    every = np.concatenate([NO_IDS, *kept])
    return Members(np.unique(every), np.array(single, dtype=np.int64))


def _number(word: str, place: Place) -> int:
    if not word.isdigit() or len(word) > 17:
        raise place.error(f'"{word}" is no number of a node or element')
    return int(word)
