"""Replication in Nastran bulk data: entries that are made of the entry before.

Source: MSC/NX Nastran Quick Reference Guide, "Replication": ``=`` repeats a field, ``==`` all
fields behind it as well, ``*x`` or ``*(x)`` adds x to it, and ``=n`` or ``=(n)`` in the first field
makes n more entries by the increments of the entry before. Continuations are replicated like the
line that they continue.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

from lcmchain.mesh_files.readers.nastran_card import Card

_INCREMENT = re.compile(r"\*\(?([+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd]?[+-]?\d{1,4})?)\)?")
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d{1,4}))?")
_TIMES = re.compile(r"=\(?(\d{1,9})\)?")
#: Entries whose fields hold a text, in which these signs mean something else.
_OF_TEXT = ("DEQATN",)
#: More entries of one line than this are a slip.
_MOST = 10**7


def is_increment(text: str) -> bool:
    """Whether a field adds to the one of the entry before: ``*1``, ``*(0.5)``."""
    return _INCREMENT.fullmatch(text) is not None


def replicated(cards: Sequence[Card]) -> list[Card]:
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
    return any(text in ("=", "==") or is_increment(text) for text in card.fields)


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
        elif is_increment(text):
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
