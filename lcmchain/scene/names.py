"""Names of the entries of a list of tables: each has its own."""

from __future__ import annotations

from typing import Any

from lcmchain.quantities.entry_types import wrong


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
