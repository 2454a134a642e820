"""Limits of a scene document, far above any use: what is larger was not written for a scene.

They keep a wrong file from being read for minutes, and from reaching code that walks through a
document by recursion.
"""

from __future__ import annotations

from typing import Any

from lcmchain.errors import shortened
from lcmchain.scene.explain import Problem, key_text

MOST_BYTES = 2_000_000
MOST_LEVELS = 20
LONGEST_KEY = 100
LONGEST_TEXT = 200_000
#: TOML's own range of whole numbers.
LARGEST_WHOLE_NUMBER = 2**63


def beyond_limits(data: dict[str, Any]) -> Problem | None:
    """Return the first entry of a parsed document that is nested too deeply or far too long."""
    waiting: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    while waiting:
        place, value = waiting.pop()
        inner: list[tuple[str | int, Any]] = []
        complaint = None
        if isinstance(value, dict):
            inner = list(value.items())
            longest = max(value, key=len, default="")
            if len(longest) > LONGEST_KEY:
                complaint = (
                    f'has a key of {len(longest):,} characters, "{shortened(longest)}"; at most '
                    f"{LONGEST_KEY} are read"
                )
        elif isinstance(value, list):
            inner = list(enumerate(value))
        else:
            complaint = _complaint(value)
        if inner and len(place) == MOST_LEVELS:
            complaint = f"is nested more than {MOST_LEVELS} levels deep; no entry of a scene is"
        if complaint:
            return Problem(shortened(key_text(place, data)), complaint)
        waiting += [((*place, step), entry) for step, entry in inner]
    return None


def _complaint(value: Any) -> str | None:
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            return f"is a text of {len(value):,} characters; at most {LONGEST_TEXT:,} are read"
        if not value.isprintable() and any(map(_is_unwritable, value)):
            return "holds characters that cannot be written to a file"
    elif isinstance(value, int) and not -LARGEST_WHOLE_NUMBER <= value < LARGEST_WHOLE_NUMBER:
        return "is a whole number too large to compute with"
    return None


def _is_unwritable(character: str) -> bool:
    """Whether a character is half of a pair (from a command line that is no text), or a zero."""
    return character == "\0" or "\ud800" <= character <= "\udfff"
