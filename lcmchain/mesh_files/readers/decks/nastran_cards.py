"""Cards of Nastran bulk data: small, large and free fields, continuations, includes, replication.

Source: MSC/NX Nastran Quick Reference Guide, "Format of bulk data entries" and "Replication".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path

from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.decks.common import deck_lines, real_number


@dataclass
class Card:
    """A bulk data entry: name in upper case without ``*``, and its data fields as text.

    Fields are counted from 0 behind the name; the eight of each line follow each other.
    """

    name: str
    fields: list[str]
    place: Place

    def text(self, field: int) -> str:
        return self.fields[field] if field < len(self.fields) else ""

    def whole(self, field: int, default: int | None = None) -> int:
        """Return a field as a number.

        Raises
        ------
        InputError : it is none, or blank and there is no default.
        """
        text = self.text(field)
        if not text and default is not None:
            return default
        try:
            number = int(text)
        except ValueError:
            number = -1
        if not 0 <= number < 10**17:
            raise self.place.error(f'field {field + 2} of {self.name} is "{text}", not a number')
        return number

    def real(self, field: int) -> float:
        """Return a field as a real number; ``1.5-3`` is 1.5e-3, a blank one 0.

        Raises
        ------
        InputError : it is none.
        """
        text = self.text(field)
        if not text:
            return 0.0
        try:
            return real_number(text)
        except ValueError:
            raise self.place.error(
                f'field {field + 2} of {self.name} is "{text}", not a number'
            ) from None


# --- replication: entries that are made of the entry before ---------------------------------------
# ``=`` repeats a field, ``==`` all fields behind it as well, ``*x`` or ``*(x)`` adds x to it, and
# ``=n`` or ``=(n)`` in the first field makes n more entries by the increments of the entry before.
# Continuations are replicated like the line that they continue.


_INCREMENT = re.compile(r"\*\(?([+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd]?[+-]?\d{1,4})?)\)?")
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d{1,4}))?")
_TIMES = re.compile(r"=\(?(\d{1,9})\)?")
#: Entries whose fields hold a text, in which these signs mean something else.
_OF_TEXT = ("DEQATN",)
#: More entries of one line than this are a slip.
_MOST = 10**7


def _is_increment(text: str) -> bool:
    """Whether a field adds to the one of the entry before: ``*1``, ``*(0.5)``."""
    return _INCREMENT.fullmatch(text) is not None


def _replicated(cards: Sequence[Card]) -> list[Card]:
    """Return the entries with all that replication makes, in order.

    A field that cannot be made keeps its sign, so that whoever asks for its number gets the error
    with its line; entries that nobody reads stand in nobody's way.

    Raises
    ------
    InputError : a replication follows no entry, or repeats one that has no increments.
    """
    found: list[Card] = []
    pattern: Card | None = None  # the last entry as it was written, where it replicates
    for card in cards:
        times = _TIMES.fullmatch(card.name)
        if times is not None:
            if pattern is None:
                raise card.place.error(
                    f"{card.name} repeats an entry with increments, but there is none before"
                )
            count = int(times[1])
            if count > _MOST:
                raise card.place.error(f"{card.name} repeats an entry too often")
            for _ in range(count):
                found.append(_next(found[-1], pattern, card))
        elif card.name[:1] == "=":
            if card.name != "=" or not found:
                raise card.place.error(
                    f'"{card.name}" replicates an entry, but '
                    + ("is no = or =n" if found else "there is none before")
                )
            pattern = card
            found.append(_next(found[-1], pattern, card))
        elif found and card.name == found[-1].name and _replicates(card):
            pattern = card
            found.append(_next(found[-1], pattern, card))
        else:
            pattern = None
            found.append(card)
    return found


def _replicates(card: Card) -> bool:
    """Whether an entry that is named replicates fields of the one before."""
    if card.name in _OF_TEXT:
        return False
    return any(text in ("=", "==") or _is_increment(text) for text in card.fields)


def _next(before: Card, pattern: Card, at: Card) -> Card:
    """The entry that a pattern makes of the one before."""
    fields: list[str] = []
    for place, text in enumerate(pattern.fields):
        old = before.text(place)
        if text == "==":
            # to the end of the line where the pattern goes on, else of the whole entry
            end = (place // 8 + 1) * 8 if len(pattern.fields) > place // 8 * 8 + 8 else None
            fields += before.fields[place:end]
            if end is None:
                break
            fields += [""] * (end - len(fields))
        elif place < len(fields):
            continue  # behind == in the same line
        elif text == "=":
            fields.append(old)
        elif _is_increment(text):
            fields.append(_sum(old, text))
        else:
            fields.append(text)
    return replace(before, fields=fields, place=at.place)


def _sum(old: str, increment: str) -> str:
    """A number with an increment, exactly; the increment itself where there is no number."""
    added = _INCREMENT.fullmatch(increment)
    if _NUMBER.fullmatch(old) is None or added is None:
        return increment
    result = _exact(old) + _exact(added[1])
    whole = old.lstrip("+-").isdigit() and added[1].lstrip("+-").isdigit()
    return str(int(result)) if whole else f"{result:E}"


def _exact(text: str) -> Decimal:
    found = _NUMBER.fullmatch(text)
    assert found is not None
    return Decimal(found[1] + ("E" + found[2] if found[2] else ""))


# --- decks ----------------------------------------------------------------------------------------


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
    deck.cards = _replicated(deck.cards)
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
    if after_replication and _is_increment(first):
        return False
    return first.startswith("*") or first.endswith("*")
