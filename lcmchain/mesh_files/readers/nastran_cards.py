"""Cards of Nastran bulk data: small, large and free fields, continuations, includes, comments.

Source: MSC/NX Nastran Quick Reference Guide, "Format of bulk data entries".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.deck_text import deck_lines
from lcmchain.mesh_files.readers.nastran_card import Card
from lcmchain.mesh_files.readers.nastran_replication import is_increment, replicated

DEEPEST_INCLUDE = 10

# Lines of the case control in a deck that has no BEGIN BULK: a word, maybe a number or options, and
# an equals sign, which begins no entry of the bulk data.
_CONTROL = re.compile(r"\s*[A-Z]+[ \t]*(?:\d+[ \t]*|\([^)]*\)[ \t]*)?=[ \t]*[^\s=*]", re.IGNORECASE)


@dataclass
class NastranDeck:
    """A deck in its parts.

    Parameters
    ----------
    case_control : lines before the bulk data, with their places. comments : texts after ``$``.
    ended : whether the bulk data end with ENDDATA.
    """

    case_control: list[tuple[Place, str]] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    cards: list[Card] = field(default_factory=list)
    ended: bool = False
    has_control: bool = False


def read_deck(path: Path) -> NastranDeck:
    """Read a deck and what it includes.

    Raises
    ------
    InputError : a file cannot be read, a continuation continues nothing, or a replication
        replicates nothing.
    """
    lines = list(_lines(path, path.parent, ()))
    deck = NastranDeck()
    begin = _begin_of_bulk(lines)
    deck.has_control = begin > 0
    listing = False  # a set of the case control goes on in the next line
    for number, (place, text) in enumerate(lines):
        stated, dollar, comment = text.partition("$")
        if dollar and comment.strip():
            deck.comments.append(comment.strip())
        if not stated.strip():
            continue
        if number < begin or (begin == 0 and (listing or _CONTROL.match(stated))):
            deck.case_control.append((place, stated.strip()))
            listing = stated.rstrip().endswith(",")
            continue
        if stated.strip().upper() == "ENDDATA":
            deck.ended = True
            break
        _add(deck.cards, stated.rstrip(), place)
    deck.cards = replicated(deck.cards)
    return deck


def _begin_of_bulk(lines: list[tuple[Place, str]]) -> int:
    """First line of the bulk data; 0 in a file that holds nothing else."""
    for number, (_, text) in enumerate(lines):
        if re.match(r"\s*BEGIN\s*(BULK|SUPER|=|$)", text, re.IGNORECASE):
            return number + 1
    return 0


def _lines(path: Path, folder: Path, within: tuple[Path, ...]) -> Iterator[tuple[Place, str]]:
    lines = iter(enumerate(deck_lines(path), start=1))
    for number, text in lines:
        if text[:7].upper() != "INCLUDE":
            yield Place(path, number), text
            continue
        place = Place(path, number)
        name = text[7:].strip()
        while name[:1] in "'\"" and name.count(name[:1]) < 2:
            more = next(lines, None)
            if more is None or not name:
                raise place.error("INCLUDE has no end of its file name")
            name += more[1].strip()
        name = name.strip("'\" ").replace("\\", "/")
        file = next((f for f in (folder / name, path.parent / name) if f.is_file()), None)
        if file is None:
            raise place.error(f"INCLUDE names {name}, which does not exist beside the deck")
        if file in (*within, path) or len(within) >= DEEPEST_INCLUDE:
            raise place.error(f"INCLUDE leads back to {name}, or too deep")
        yield from _lines(file, folder, (*within, path))


def _add(cards: list[Card], text: str, place: Place) -> None:
    """Add a line to the cards: a new one, or the continuation of the last."""
    first, fields = _fields(text, after_replication=bool(cards) and cards[-1].name[:1] == "=")
    if first[:1] not in ("", "+", "*"):
        name = first.rstrip("*").upper()
        cards.append(Card(name, fields, place))
        return
    if not cards:
        raise place.error("continues an entry, but there is none before")
    last = cards[-1].fields
    # a line in large fields holds four of the eight
    half = len(fields)
    last += [""] * (-len(last) % half)
    last += fields


def _fields(text: str, *, after_replication: bool = False) -> tuple[str, list[str]]:
    """First field of a line, and its four or eight data fields.

    Behind a replication, ``*1`` in the first field increments a continuation mark, and makes the
    fields of the line no large ones.
    """
    if "," in text[:10] or ("," in text and "\t" not in text and not text[:1].isspace()):
        entries = [entry.strip() for entry in text.split(",")]
        count = 4 if _is_large(entries[0], after_replication) else 8
        return entries[0], (entries[1 : 1 + count] + [""] * count)[:count]
    line = text.expandtabs(8)
    first = line[:8].strip()
    if _is_large(first, after_replication):
        return first, [line[at : at + 16].strip() for at in range(8, 72, 16)]
    return first, [line[at : at + 8].strip() for at in range(8, 72, 8)]


def _is_large(first: str, after_replication: bool) -> bool:
    if after_replication and is_increment(first):
        return False
    return first.startswith("*") or first.endswith("*")
