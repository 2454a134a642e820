"""Connections of terminals: one line for all variables that two units exchange.

Two terminals are connected member by member: an output of one sets the input of the other with the
same name (``plug``, ``bus``) or the same position (``sequence``). Each terminal has a matching rule
of its own (FMI 3.0.2, 2.4.9): all members of a plug or a sequence must be connected, of a bus only
those that the other terminal has.
"""

from __future__ import annotations

from collections.abc import Mapping

from lcmchain.coupling.cosimulation.description import (
    BUS,
    PLUG,
    SEQUENCE,
    SIGNAL,
    Member,
    Terminal,
    UnitDescription,
)
from lcmchain.coupling.cosimulation.system_file import ConnectionEntry, System
from lcmchain.errors import InputError, shortened


def with_variables(system: System, descriptions: Mapping[str, UnitDescription]) -> System:
    """Return a system in which connections of variables replace those of terminals.

    Raises
    ------
    InputError : a terminal that a unit does not have, or two that do not fit.
    """
    if not any(entry.is_of_terminals for entry in system.connections):
        return system
    connections = tuple(
        entry
        for stated in system.connections
        for entry in (_connected(stated, descriptions) if stated.is_of_terminals else (stated,))
    )
    return system.model_copy(update={"connections": connections})


def _connected(
    entry: ConnectionEntry, descriptions: Mapping[str, UnitDescription]
) -> list[ConnectionEntry]:
    """Return the connections of variables that a connection of terminals stands for."""
    unit, name, other_unit, other_name = entry.ends
    key = f'connection "{entry.link}"'
    one = _terminal(descriptions[unit], unit, name, key)
    other = _terminal(descriptions[other_unit], other_unit, other_name, key)
    nested = _nested(descriptions[unit], name, descriptions[other_unit], other_name)
    links: list[str] = []
    for mine, theirs in ((one, other), *nested):
        links += _links(
            (unit, mine, descriptions[unit]), (other_unit, theirs, descriptions[other_unit]), key
        )
    if not links:
        raise InputError(
            f"the terminals have no member in common that one gives and the other takes: "
            f"{unit}.{name} has {_names(one)}, {other_unit}.{other_name} has {_names(other)}",
            key=key,
        )
    return [entry.model_copy(update={"link": link}) for link in links]


def _terminal(description: UnitDescription, unit: str, name: str, key: str) -> Terminal:
    terminal = description.terminals.get(name)
    if terminal is None:
        known = ", ".join(description.terminals)
        has = f"it has {known}" if known else "it has none; connect its variables one by one"
        raise InputError(f'unit "{unit}" has no terminal "{shortened(name)}"; {has}', key=key)
    return terminal


def _nested(
    one: UnitDescription, name: str, other: UnitDescription, other_name: str
) -> list[tuple[Terminal, Terminal]]:
    """Return pairs of the terminals that have the same path within two terminals."""
    pairs = []
    for path, terminal in one.terminals.items():
        if path.startswith(f"{name}."):
            theirs = other.terminals.get(other_name + path[len(name) :])
            if theirs is not None:
                pairs.append((terminal, theirs))
    return pairs


_Side = tuple[str, Terminal, UnitDescription]


def _links(one: _Side, other: _Side, key: str) -> list[str]:
    """Return the connections between two terminals at the same level.

    Raises
    ------
    InputError : the rule of one of them is broken, or a member that both have is a flow.
    """
    (unit, mine, description), (other_unit, theirs, other_description) = one, other
    links: list[str] = []
    connected: tuple[set[int], set[int]] = set(), set()
    for number, other_number in _pairs(mine, theirs, key):
        member, partner = mine.members[number], theirs.members[other_number]
        is_output = _is_output(description, member)
        if is_output == _is_output(other_description, partner):
            continue
        if {member.kind, partner.kind} != {SIGNAL}:
            raise InputError(
                f'"{member.name or member.variable}" is no signal but a flow ({member.kind}, '
                f"{partner.kind}); connect the variables of these terminals one by one",
                key=key,
            )
        ends = f"{unit}.{member.variable}", f"{other_unit}.{partner.variable}"
        links.append(" -> ".join(ends if is_output else reversed(ends)))
        connected[0].add(number)
        connected[1].add(other_number)
    for (name, terminal, _), numbers in zip((one, other), connected):
        _require_complete(name, terminal, numbers, key)
    return links


def _pairs(one: Terminal, other: Terminal, key: str) -> list[tuple[int, int]]:
    """Return the numbers of the members that belong together."""
    rules = {one.rule, other.rule}
    if SEQUENCE in rules:
        if rules != {SEQUENCE} or len(one.members) != len(other.members):
            raise InputError(
                f"{one.name} has {len(one.members)} members ({one.rule}), {other.name} "
                f"{len(other.members)} ({other.rule}); in a sequence they are matched by their "
                "places, so both have to be one, of the same length",
                key=key,
            )
        return [(number, number) for number in range(len(one.members))]
    for terminal in (one, other):
        if terminal.rule not in (PLUG, BUS):
            raise InputError(
                f'"{terminal.name}" is to be matched by the rule "{shortened(terminal.rule)}", '
                "which is not known here; connect its variables one by one",
                key=key,
            )
    number_of = {member.name: number for number, member in enumerate(other.members)}
    return [
        (number, number_of[member.name])
        for number, member in enumerate(one.members)
        if member.name in number_of
    ]


def _require_complete(unit: str, terminal: Terminal, connected: set[int], key: str) -> None:
    """Refuse a plug or a sequence with a member that is not connected.

    connected : numbers of its members that are.
    """
    left = [m.name or m.variable for n, m in enumerate(terminal.members) if n not in connected]
    if terminal.rule != BUS and (left or terminal.has_streams):
        what = ", ".join(left) or "its stream members"
        raise InputError(
            f"all members of {unit}.{terminal.name} ({terminal.rule}) are to be connected, but "
            f"{what} would not be: the other terminal has none of that name, or gives and takes "
            "it alike",
            key=key,
        )


def _is_output(description: UnitDescription, member: Member) -> bool:
    """Whether a member is an output of its unit; else it is an input."""
    return description.find(member.variable).causality not in ("input", "parameter")


def _names(terminal: Terminal) -> str:
    return ", ".join(member.name or member.variable for member in terminal.members) or "none"
