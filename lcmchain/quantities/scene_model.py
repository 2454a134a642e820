"""The base of every table of a scene file, and the names of entries in lists of tables."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from lcmchain.quantities.entry_types import wrong


class SceneModel(BaseModel):
    """Base of all scene tables: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


def with_own_names(items: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return entries that have a ``name``; refuse two with the same one."""
    names = [item.name for item in items]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise wrong(
                f'has the name "{name}" twice, at [{names.index(name)}] and [{index}]; '
                "give each its own name"
            )
    return items


def no_such(name: str, known: Sequence[str], what: str) -> str:
    """Say that nothing has a name that an entry gives, and what may be meant instead."""
    if not known:
        return f"but there is no {what}"
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f'did you mean "{close[0]}"?' if close else f"there is {', '.join(known)}"
    return f"but there is no {what} of this name; {hint}"
