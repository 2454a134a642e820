"""Terminals of an own unit (FMI 3.0): what a master connects by one line, and where it is drawn.

A tool that moves has a mechanical port of its name. The sheet or the part has a port ``preform``
for the whole fields that a fluid exchanges with it. Members have the same names in the units of
forming and of infiltration, so that they match; what the other side does not have is left alone
(``bus``).

Source: FMI 3.0.2, 2.4.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from lcmchain.coupling.cosimulation.terminals import BUS, SIGNAL
from lcmchain.fmu.variables import Variable

#: Kinds begin with the name of the tool, as the standard asks of those that no standard defines.
TRANSLATION, ROTATION, PREFORM = "_lcmchain_translation", "_lcmchain_rotation", "_lcmchain_preform"

#: Suffix of a variable of a tool, by the member that it is.
TRANSLATING = {
    "velocity": "velocity_input", "position": "position_input", "drive": "drive",
    "drive_to_position": "drive_to_position", "added_force": "force_input", "force": "force",
    "actual_velocity": "velocity", "actual_position": "travel",
}  # fmt: skip
ROTATING = {
    "velocity": "velocity_input", "position": "position_input", "drive": "drive",
    "drive_to_position": "drive_to_position", "moment": "moment",
    "actual_velocity": "angular_velocity", "actual_position": "angle",
}  # fmt: skip
#: Fields that solid and fluid exchange, by member: the first of the variables that the unit has.
#: The thickness that a fluid sees is volume over area where there is one.
FIELDS = {
    "thickness": ("fluid_thickness", "thickness"),
    "thickness_rate": ("fluid_thickness_rate", "thickness_rate"),
    "volume_rate": ("volume_rate",),
    "volume_rate_slope": ("volume_rate_slope",),
    "reference_pressure": ("reference_pressure",),
    "pore_resistance": ("pore_resistance",),
    "pore_pressure": ("pore_pressure",),
    "pressure_at_rest": ("pressure_at_rest",),
}


#: The square of the icon goes from -EXTENT to EXTENT, an eighth of a millimetre each on a screen.
EXTENT, TO_MM = 100.0, 0.125
#: Name of the picture of a terminal, and red, green and blue of its connections, by its kind.
ICON_OF_KIND = {TRANSLATION: "translation", ROTATION: "rotation", PREFORM: "preform"}
COLOUR_OF_KIND = {TRANSLATION: "34 39 46", ROTATION: "34 39 46", PREFORM: "0 114 178"}
#: Side of the square of a terminal on an edge of the icon, where there is room for it.
LARGEST_TERMINAL = 20.0


class UnitTerminal(NamedTuple):
    """A terminal: variables by the names of their members."""

    name: str
    kind: str
    description: str
    members: dict[str, str]


def terminals_of(variables: Sequence[Variable]) -> list[UnitTerminal]:
    """Return the terminals of a unit with this interface, of FMI 3.0 (a field is one variable)."""
    known = {variable.name: variable for variable in variables}
    found = []
    for name, variable in known.items():
        tool, _, suffix = name.rpartition(".")
        if suffix == "velocity_input" and variable.causality == "input":
            turns = f"{tool}.moment" in known
            members = {
                member: f"{tool}.{own}"
                for member, own in (ROTATING if turns else TRANSLATING).items()
                if f"{tool}.{own}" in known
            }
            what = f"what moves {tool} and what it feels"
            found.append(UnitTerminal(tool, ROTATION if turns else TRANSLATION, what, members))
    taken = any(terminal.name == "preform" for terminal in found)
    return found + _of_preform(known, "preform_fields" if taken else "preform")


def _of_preform(known: dict[str, Variable], port: str) -> list[UnitTerminal]:
    """Return the port of what solid and fluid exchange; with a second one for a pressure at rest.

    A solid takes one pressure, which its input ``pore_pressure_at_rest`` says the meaning of: the
    second port has it as the member ``pressure_at_rest``.
    """
    members = {}
    for member, names in FIELDS.items():
        own = next((name for name in names if name in known), None)
        if own is not None and known[own].size is not None:
            members[member] = own
    if not members:
        return []
    found = [UnitTerminal(port, PREFORM, "fields that solid and fluid exchange", members)]
    if "pore_pressure_at_rest" in known:
        at_rest = {
            "pressure_at_rest" if member == "pore_pressure" else member: own
            for member, own in members.items()
        }
        what = "the same with pore_pressure at rest, for pore_pressure_at_rest = true"
        found.append(UnitTerminal(f"{port}_at_rest", PREFORM, what, at_rest))
    return found


def document(terminals: Sequence[UnitTerminal]) -> Element:
    """Return ``terminalsAndIcons.xml``: tools on the left edge of the icon, fields on the right."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    graphics = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": f"{-EXTENT}", "y1": f"{-EXTENT}", "x2": f"{EXTENT}", "y2": f"{EXTENT}"}
    SubElement(graphics, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": f"{TO_MM}"})
    SubElement(graphics, "Icon", corners)
    if not terminals:
        return root
    listed = SubElement(root, "Terminals")
    places = _places(terminals)
    for terminal in terminals:
        element = SubElement(
            listed, "Terminal",
            {"name": terminal.name, "matchingRule": BUS, "terminalKind": terminal.kind,
             "description": terminal.description},
        )  # fmt: skip
        for member, variable in terminal.members.items():
            about = {"variableName": variable, "memberName": member, "variableKind": SIGNAL}
            SubElement(element, "TerminalMemberVariable", about)
        look = {
            "iconBaseName": ICON_OF_KIND[terminal.kind],
            "defaultConnectionColor": COLOUR_OF_KIND[terminal.kind],
            "defaultConnectionStrokeSize": "1.0",
        }
        SubElement(element, "TerminalGraphicalRepresentation", {**places[terminal.name], **look})
    return root


def _places(terminals: Sequence[UnitTerminal]) -> dict[str, dict[str, str]]:
    """Return the corners of every terminal, evenly from the top of its edge on."""
    found = {}
    for of_fields, x in ((False, -EXTENT), (True, EXTENT)):
        side = [t.name for t in terminals if (t.kind == PREFORM) == of_fields]
        pitch = 2.0 * EXTENT / (len(side) + 1)
        half = 0.5 * min(LARGEST_TERMINAL, 0.8 * pitch)
        for row, name in enumerate(side, 1):
            y = EXTENT - row * pitch
            corners = {"x1": x - half, "y1": y - half, "x2": x + half, "y2": y + half}
            found[name] = {key: f"{value:.6g}" for key, value in corners.items()}
    return found
