"""Terminals of FMI 3.0: variables of a unit that belong together (FMI 3.0.2, 2.4.9).

The file that describes them is optional, and says nothing that a unit needs to run.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.archive import read_xml
from lcmchain.errors import InputError, shortened

#: Where a unit of FMI 3.0 keeps its icons, and describes them and its terminals.
ICONS_FOLDER = "terminalsAndIcons"
TERMINALS_FILE = f"{ICONS_FOLDER}/terminalsAndIcons.xml"
#: How the members of two terminals are matched: by their names all of them, by their names what
#: there is, by their places.
PLUG, BUS, SEQUENCE = "plug", "bus", "sequence"
#: The kind of variable whose connected values are equal; flows sum up to 0 instead.
SIGNAL = "signal"


@dataclass(frozen=True)
class Member:
    """A variable of a terminal: its name there, the variable of the unit, and its kind."""

    name: str
    variable: str
    kind: str


@dataclass(frozen=True)
class Terminal:
    """A terminal; of a nested one ``name`` is the whole path, ``outer.inner``.

    ``has_streams``: it has stream members, which nothing here connects.
    """

    name: str
    rule: str
    members: tuple[Member, ...]
    has_streams: bool = False


def read_terminals(folder: Path, file: Path) -> dict[str, Terminal]:
    """Return the terminals of an unpacked unit by name; none where it describes none.

    Parameters
    ----------
    file : the archive, for messages.

    Raises
    ------
    InputError : the description is no XML, or none of terminals.
    """
    path = folder / TERMINALS_FILE
    if not path.is_file():
        return {}
    root = read_xml(path.read_bytes(), f"{file} ({TERMINALS_FILE})")
    if root.tag != "fmiTerminalsAndIcons":
        raise InputError(
            f"{TERMINALS_FILE} describes no terminals, but <{shortened(root.tag)}>", file=file
        )
    found: dict[str, Terminal] = {}
    for element in root.findall("Terminals/Terminal"):
        _read(element, "", found)
    return found


def _read(element: Element, outer: str, found: dict[str, Terminal]) -> None:
    name = outer + element.get("name", "")
    members = tuple(
        Member(
            member.get("memberName", ""),
            member.get("variableName", ""),
            member.get("variableKind", SIGNAL),
        )
        for member in element.findall("TerminalMemberVariable")
    )
    streams = element.find("TerminalStreamMemberVariable") is not None
    found[name] = Terminal(name, element.get("matchingRule", ""), members, streams)
    for inner in element.findall("Terminal"):
        _read(inner, f"{name}.", found)
