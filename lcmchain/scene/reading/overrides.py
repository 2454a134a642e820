"""Changes to a scene from the command line: ``--set tools.punch.friction=0.2``."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Sequence
from typing import Any

from lcmchain.errors import InputError, shortened

#: A table as TOML gives it: texts, numbers, truths, times, and lists and tables of them.
TomlTable = dict[str, Any]

_STEP = re.compile(r"(?P<name>[A-Za-z0-9_-]+)(?P<indices>(?:\[[0-9]{1,9}\])*)")


def apply_overrides(data: TomlTable, overrides: Sequence[str]) -> None:
    """Write ``key=value`` texts into a parsed scene, in place and in order.

    Keys are dotted; an entry of a list is named by its index (``tools[0]`` or ``tools.0``) or by
    its name (``tools.punch``). Values are read as TOML where that is possible, else as text, so
    that ``blank.edge_length=2.5 mm`` needs no inner quotes.

    Raises
    ------
    InputError : no ``=``, a key that is not dotted names, or a list entry that does not exist.
    """
    for override in overrides:
        key, separator, value_text = override.partition("=")
        key = key.strip()
        if not separator or not key:
            raise InputError(
                f'"{shortened(override)}" is not key=value; for example '
                "--set tools.punch.friction=0.2",
                key="--set",
            )
        _assign(data, key, parse_value(value_text.strip()))


def parse_value(text: str) -> Any:
    """Read the value of an override as TOML, or as plain text where it is none."""
    try:
        document = tomllib.loads(f"value = {text}")
    except RecursionError:
        raise InputError("a value has brackets nested far too deeply", key="--set") from None
    except ValueError:  # no TOML, or a number of thousands of digits
        return text
    # A text of several lines may be a whole document; all of it is the value.
    return document["value"] if list(document) == ["value"] else text


def _assign(data: TomlTable, key: str, value: object) -> None:
    node: Any = data
    steps: list[Any] = _steps(key)
    for position, step in enumerate(steps):
        last = position == len(steps) - 1
        if isinstance(node, list):
            step = _index_in(node, steps, position)
        elif not isinstance(node, dict) or isinstance(step, int):
            before = ".".join(str(part) for part in steps[:position])
            raise InputError(
                f'cannot set "{shortened(key)}": "{before}" holds no entries', key="--set"
            )
        if last:
            node[step] = value
        elif isinstance(node, list):
            node = node[step]
        else:
            node = node.setdefault(step, {})


def _steps(key: str) -> list[str | int]:
    steps: list[str | int] = []
    for part in key.split("."):
        match = _STEP.fullmatch(part)
        if match is None:
            raise InputError(
                f'"{shortened(key)}" is not a dotted key; for example '
                "tools.punch.motion.distance or tools[0].friction",
                key="--set",
            )
        steps.append(match["name"])
        steps += [int(index) for index in re.findall(r"\d+", match["indices"])]
    return steps


def _index_in(entries: list[Any], steps: list[Any], position: int) -> int:
    """Return the index in a list of the entry that a step of a key names."""
    step, key = steps[position], shortened(".".join(str(part) for part in steps))
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if step in names:
        return names.index(step)
    if isinstance(step, int) or step.isdigit():
        if len(str(step)) < 10 and int(step) < len(entries):
            return int(step)
        raise InputError(
            f'cannot set "{key}": there is no entry {shortened(str(step))}, the list has '
            f"{len(entries)} (counted from 0)",
            key="--set",
        )
    known = [name for name in names if isinstance(name, str)]
    close = difflib.get_close_matches(step, known, n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    there = f"; there is {', '.join(known)}" if known and not close else ""
    if entries and not close:
        there += _how_entries_are_named(entries, known, steps, position)
    raise InputError(f'cannot set "{key}": there is no "{step}"{hint}{there}', key="--set")


def _how_entries_are_named(
    entries: list[Any], known: list[str], steps: list[Any], position: int
) -> str:
    """Say how a key goes on where a list stands in it, and the step names none of its entries.

    That step is mostly the key of an entry, as in ``interfaces.friction``; else it stands for one.
    """
    before = ".".join(str(part) for part in steps[:position])
    is_key = position == len(steps) - 1 or any(
        isinstance(entry, dict) and steps[position] in entry for entry in entries
    )
    rest = ".".join(str(part) for part in steps[position if is_key else position + 1 :])
    ways = [f"{before}.{way}.{rest}" for way in (0, *known[:1])]
    many = f"{len(entries)} entries" if len(entries) > 1 else "one entry"
    by_name = " or its name" if known else ""
    return shortened(
        f'; "{before}" is a list of {many}: name one by its number from 0{by_name}, as in '
        f"{' or '.join(ways)}",
        300,
    )
