"""Fields that a coupled system offers as a part."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

from lcmchain.errors import InputError


@dataclass(frozen=True)
class Port:
    """An input or output of a part that the system offers under a name of its own.

    ``of_step``: an output is the value at the ``end`` of the system's step or its ``mean``.
    """

    part: str
    field: str
    of_step: Literal["end", "mean"] = "end"


def find_port(name: str, ports: Mapping[str, Port], parts: Collection[str], kind: str) -> Port:
    """Return the port of that name; ``"part.field"`` names a field of a part directly.

    Raises
    ------
    InputError : there is none; names those that there are.
    """
    if name in ports:
        return ports[name]
    part, _, field = name.partition(".")
    if part in parts and field:
        return Port(part, field)
    known = ", ".join([*ports, *(f"{part}.<field>" for part in parts)])
    raise InputError(f'the coupled system has no {kind} "{name}"; there are {known}')
