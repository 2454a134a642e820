"""The files that a scene names: which entries of a document do so is said by their types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from lcmchain.quantities.entry_types import FileName
from lcmchain.scene.walk import field_at

Location = tuple[str | int, ...]


def named_files(data: dict[str, Any]) -> Iterator[tuple[Location, str]]:
    """Yield location and value of every entry of a document that names a file.

    Works on documents with errors too; values that are no names are left out.
    """
    for location, value in _texts(data, ()):
        entry = field_at(location, data)
        if entry is not None and any(isinstance(own, FileName) for own in entry.metadata):
            yield location, value


def dotted(location: Location) -> str:
    """Write a location as the key of an override: ``tools[2].shape.file``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in location)
    return text.removeprefix(".")


def _texts(node: Any, location: Location) -> Iterator[tuple[Location, str]]:
    entries: list[tuple[str | int, Any]] = []
    if isinstance(node, dict):
        entries = list(node.items())
    elif isinstance(node, list):
        entries = list(enumerate(node))
    for step, value in entries:
        here = (*location, step)
        if isinstance(value, str) and isinstance(step, str) and value.strip():
            yield here, value
        else:
            yield from _texts(value, here)
