"""Lists of a scene that stand in files of their own, read where the scene is read.

What such a file holds becomes an entry of the scene, and an override of its text: a result holds
the scene with all numbers, whatever becomes of the file.
"""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import OrFile
from lcmchain.scene.explain import key_text
from lcmchain.scene.named_files import Location, dotted, named_files
from lcmchain.scene.walk import field_at


def with_tables(data: dict[str, Any], directory: Path) -> tuple[dict[str, Any], list[str]]:
    """Return a copy of a document with the contents of these files, and these as overrides.

    A file that is not there is left out: who reads the scene tells of all files that are missing.

    Raises
    ------
    InputError : a file does not hold what it should; names key, file and line.
    """
    expanded, overrides = copy.deepcopy(data), []
    for location, value in list(named_files(data)):
        entry = field_at(location, data)
        marks = [own for own in entry.metadata if isinstance(own, OrFile)] if entry else []
        if not marks:
            continue
        holder: Any = expanded
        for step in location[:-1]:
            holder = holder[step]
        path = directory / value
        if not _is_file(path):
            del holder[location[-1]]
            continue
        holder[location[-1]] = content = _content(marks[0], path, location, data)
        overrides.append(f"{dotted(location)}={_as_toml(content)}")
    return expanded, overrides


def _content(mark: OrFile, path: Path, location: Location, data: dict[str, Any]) -> Any:
    try:
        return mark.read(path)
    except InputError as error:
        text = f"{error.file}: {error.message}"
        raise InputError(text, key=key_text(location, data), file=error.file) from None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # no name that a file can have
        return False


def _as_toml(content: Any) -> str:
    """Write lists, tables, texts and numbers as a TOML value on one line."""
    if isinstance(content, dict):
        return "{" + ", ".join(f"{key} = {_as_toml(own)}" for key, own in content.items()) + "}"
    if isinstance(content, list):
        return "[" + ", ".join(map(_as_toml, content)) + "]"
    return json.dumps(content)
