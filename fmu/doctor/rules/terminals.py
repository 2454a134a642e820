"""The rule of terminals (FMI 3.0), which are described in a file of their own."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from lcmchain.fmu.doctor.rules.interface import Interface, repeated
from lcmchain.fmu.doctor.rules.rule import rule

#: Rules of matching that the standard defines; those of others have a name with dots.
MATCHING = ("plug", "bus", "sequence", "none")
FLOWS = ("inflow", "outflow")
#: Causalities of what a terminal exchanges.
EXCHANGED = ("input", "output", "parameter", "calculatedParameter")


@rule(
    "terminals",
    "terminals with names of their own and a rule of matching; members that are inputs, outputs or "
    "parameters, with names of their own where they are matched by name; one flow beside stream "
    "members",
    "FMI 3.0.2, 2.4.9",
)
def terminals(interface: Interface) -> Iterator[str]:
    root = interface.terminals
    if root is None:
        return
    if root.tag != "fmiTerminalsAndIcons":
        yield f"the file describes <{root.tag[:40]}>"
        return
    if not root.get("fmiVersion", "").startswith("3."):
        yield f'the file is of FMI "{root.get("fmiVersion", "")[:20]}"'
    yield from _level(interface, root.findall("Terminals/Terminal"), "")


def _level(interface: Interface, listed: list[Element], outer: str) -> Iterator[str]:
    for name in repeated(element.get("name", "") for element in listed):
        yield f'"{outer}{name}" stands twice'
    for element in listed:
        name = outer + element.get("name", "")
        matching = element.get("matchingRule", "")
        if matching not in MATCHING and "." not in matching:
            yield f'{name} has the rule "{matching[:40]}"'
        yield from _members(interface, element, name, matching)
        yield from _level(interface, element.findall("Terminal"), f"{name}.")


def _members(interface: Interface, element: Element, name: str, matching: str) -> Iterator[str]:
    members = element.findall("TerminalMemberVariable")
    streams = element.findall("TerminalStreamMemberVariable")
    if matching in ("plug", "bus"):
        names = [member.get("memberName", "") for member in members]
        names += [s.get(f"{way}StreamMemberName", "") for s in streams for way in ("in", "out")]
        if not all(names):
            yield f"{name} has a member without a name, which {matching} matches by"
        for twice in repeated(filter(None, names)):
            yield f'the member "{twice}" of {name} stands twice'
    flows = sum(member.get("variableKind") in FLOWS for member in members)
    if streams and flows > 1:
        yield f"{name} has {flows} flows beside stream members"
    used: list[tuple[str, tuple[str, ...]]] = [
        (member.get("variableName", ""), EXCHANGED) for member in members
    ]
    for stream in streams:
        used.append((stream.get("inStreamVariableName", ""), ("input", "parameter")))
        used.append((stream.get("outStreamVariableName", ""), ("output", "calculatedParameter")))
    for variable, allowed in used:
        entry = interface.by_name.get(variable)
        if entry is None:
            yield f'{name} has the variable "{variable[:60]}", which there is not'
        elif entry.causality not in allowed:
            yield f"{name} has {variable}, which is {entry.causality}"
