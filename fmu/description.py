"""Files that describe a unit: model descriptions of FMI 2.0 and 3.0, terminals, documentation."""

from __future__ import annotations

import datetime
import sys
from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from lcmchain import __version__
from lcmchain.coupling.cosimulation.description import BUS, SIGNAL
from lcmchain.fmu.conduct import CATEGORIES
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import (
    DECLARED_TYPES,
    DISPLAY_UNITS,
    ENUMERATIONS,
    TYPE_OF_KIND,
    UNITS,
    Kind,
    Variable,
)

#: What the one binary in a unit needs outside of it, for masters that ask.
TOOL = f"lcmchain {__version__}"


def model_description(definition: UnitDefinition, fmi: int, *, needs_tool: bool = True) -> Element:
    """Return ``modelDescription.xml`` of a version of FMI.

    Outputs at a communication point depend on no input at that point: they are those of the state
    that the last step has reached. Masters that know this see no algebraic loop.

    Parameters
    ----------
    fmi : version of the standard, 2 or 3.
    needs_tool : say that the unit needs a tool that is installed (``needsExecutionTool``); some
        masters refuse a unit that does.
    """
    return (_of_fmi_2 if fmi == 2 else _of_fmi_3)(definition, needs_tool=needs_tool)


def as_bytes(root: Element) -> bytes:
    """Return the document; one variable a line."""
    indent(root, " ")
    return tostring(root, "UTF-8", xml_declaration=True)


# --- FMI 2.0: every entry of a field is a scalar variable -----------------------------------------


def _of_fmi_2(definition: UnitDefinition, *, needs_tool: bool) -> Element:
    """Return ``modelDescription.xml`` of FMI 2.0; every entry of a field is a scalar variable."""
    variables = definition.variables
    # Every entry of a field has a name, and reading a structured one costs masters time (fmpy
    # 1.7 ms): the names are declared as plain texts, however many there are.
    root = Element("fmiModelDescription", _head(definition, "2.0", structured=False))
    root.set("guid", definition.guid)
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": definition.model_name,
            "needsExecutionTool": str(needs_tool).lower(),
            "canHandleVariableCommunicationStepSize": "true",
            "canInterpolateInputs": "false",
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
        },
    )
    _add_units(root, variables)
    types = SubElement(root, "TypeDefinitions")
    for name, own in _used_types(variables).items():
        simple = SubElement(types, "SimpleType", {"name": name})
        kind = "Enumeration" if own.items else own.kind.value
        declared = SubElement(simple, kind, own.attributes)
        for item in own.items:
            SubElement(declared, "Item", item)
    _add_categories(root)
    _add_experiment(root, definition)
    listed = SubElement(root, "ModelVariables")
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    place = _places(variables)
    reference = 0
    for variable in variables:
        dependencies = " ".join(place[name] for name in variable.dependencies)
        for name, text in variable.scalars():
            _add_scalar(listed, variable, name, text, reference)
            reference += 1
            if variable.causality == "output":
                unknown = {"index": str(reference), "dependencies": dependencies}
                SubElement(outputs, "Unknown", unknown)
                SubElement(unknowns, "Unknown", unknown)
    return root


def _add_scalar(listed: Element, variable: Variable, name: str, text: str, reference: int) -> None:
    attributes = {
        "name": name,
        "valueReference": str(reference),
        "description": text,
        "causality": variable.causality,
        "variability": variable.variability,
        **_initial(variable),
    }
    scalar = SubElement(listed, "ScalarVariable", attributes)
    kind = "Enumeration" if variable.is_enumeration else variable.kind.value
    typed = SubElement(scalar, kind, _limits(variable))
    if variable.start is not None:
        typed.set("start", _start_text(variable))


def _places(variables: tuple[Variable, ...]) -> dict[str, str]:
    """Return the indices of the scalars of every variable, as a list in XML."""
    first, places = 1, {}
    for variable in variables:
        places[variable.name] = " ".join(str(first + i) for i in range(variable.count))
        first += variable.count
    return places


# --- FMI 3.0: a field is one array ----------------------------------------------------------------

_ELEMENTS = {
    Kind.REAL: "Float64",
    Kind.INTEGER: "Int32",
    Kind.BOOLEAN: "Boolean",
    Kind.STRING: "String",
}


def _of_fmi_3(definition: UnitDefinition, *, needs_tool: bool) -> Element:
    """Return ``modelDescription.xml`` of FMI 3.0; a field is one array."""
    variables = definition.variables
    root = Element("fmiModelDescription", _head(definition, "3.0", structured=True))
    root.set("instantiationToken", definition.guid)
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": definition.model_name,
            "needsExecutionTool": str(needs_tool).lower(),
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "canHandleVariableCommunicationStepSize": "true",
        },
    )
    _add_units(root, variables)
    types = SubElement(root, "TypeDefinitions")
    for name, own in _used_types(variables).items():
        kind = "Enumeration" if own.items else _ELEMENTS[own.kind]
        declared = SubElement(types, f"{kind}Type", {"name": name, **own.attributes})
        for item in own.items:
            SubElement(declared, "Item", item)
    _add_categories(root)
    _add_experiment(root, definition)
    listed = SubElement(root, "ModelVariables")
    reference = {variable.name: str(index) for index, variable in enumerate(variables)}
    for variable in variables:
        _add_variable(listed, variable, reference[variable.name])
    structure = SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for variable in variables:
            if variable.causality == "output":
                dependencies = " ".join(reference[name] for name in variable.dependencies)
                unknown = {
                    "valueReference": reference[variable.name],
                    "dependencies": dependencies,
                }
                SubElement(structure, kind, unknown)
    return root


def _add_variable(listed: Element, variable: Variable, reference: str) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        **_initial(variable),
        **_limits(variable),
    }
    kind = "Enumeration" if variable.is_enumeration else _ELEMENTS[variable.kind]
    element = SubElement(listed, kind, attributes)
    if variable.size is not None:
        SubElement(element, "Dimension", {"start": str(variable.size)})
    if variable.start is None:
        return
    if variable.kind is Kind.STRING:
        SubElement(element, "Start", {"value": str(variable.start)})
    else:
        text = _start_text(variable)
        element.set("start", " ".join([text] * variable.count))


# --- what both versions share ---------------------------------------------------------------------


def _head(definition: UnitDefinition, version: str, *, structured: bool) -> dict[str, str]:
    """Return the attributes of the root that both versions have; the time is that of the build.

    structured : declare that names follow the structured naming convention, which they do.
    """
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return {
        "fmiVersion": version,
        "modelName": definition.model_name,
        "description": definition.title,
        "author": "lcmchain",
        "version": __version__,
        "copyright": "of the scene: its author; of lcmchain: lcmchain contributors",
        "license": "of lcmchain and the exporter: MIT",
        "generationTool": TOOL,
        "generationDateAndTime": now.replace("+00:00", "Z"),
        "variableNamingConvention": "structured" if structured else "flat",
    }


def _add_units(root: Element, variables: Iterable[Variable]) -> None:
    """Add the definitions of the units that variables have."""
    used = {variable.unit for variable in variables}
    definitions = SubElement(root, "UnitDefinitions")
    for name, exponents in UNITS.items():
        if name in used:
            unit = SubElement(definitions, "Unit", {"name": name})
            SubElement(unit, "BaseUnit", {base: str(power) for base, power in exponents.items()})
            for shown, factor in DISPLAY_UNITS.get(name, {}).items():
                SubElement(unit, "DisplayUnit", {"name": shown, "factor": repr(factor)})


class DeclaredType(NamedTuple):
    """A type that variables have: its kind, attributes, and the items of an enumeration."""

    kind: Kind
    attributes: dict[str, str]
    items: tuple[dict[str, str], ...] = ()


def _used_types(variables: Iterable[Variable]) -> dict[str, DeclaredType]:
    """Return the declared types that variables have, by name."""
    used = {variable.type_name for variable in variables}
    found = {}
    for name, own in DECLARED_TYPES.items():
        attributes = {"quantity": name, "unit": own.unit}
        if own.shown_in is not None:
            attributes["displayUnit"] = own.shown_in
        if own.nominal is not None:
            attributes["nominal"] = repr(own.nominal)
        found[name] = DeclaredType(Kind.REAL, attributes)
    for name, items in ENUMERATIONS.items():
        told = tuple(
            {"name": item, "value": str(value), "description": text} for item, value, text in items
        )
        found[name] = DeclaredType(Kind.INTEGER, {"quantity": name}, told)
    for kind, name in TYPE_OF_KIND.items():
        found[name] = DeclaredType(kind, {"quantity": name} if kind is Kind.INTEGER else {})
    return {name: own for name, own in found.items() if name in used}


def _add_categories(root: Element) -> None:
    """Add the categories of log messages."""
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": description})


def _add_experiment(root: Element, definition: UnitDefinition) -> None:
    """Add the proposed experiment."""
    times = {"startTime": 0.0, "stopTime": definition.stop_time, "stepSize": definition.step_size}
    SubElement(root, "DefaultExperiment", {name: repr(value) for name, value in times.items()})


def _limits(variable: Variable) -> dict[str, str]:
    """Return the attributes for type, unit and limits of a variable."""
    attributes = {"min": variable.minimum, "max": variable.maximum}
    texts = {"declaredType": variable.type_name}
    if variable.kind is Kind.REAL:
        attributes["nominal"] = variable.nominal
        texts["unit"] = variable.unit
    number = repr if variable.kind is Kind.REAL else lambda value: str(int(value))
    return {name: text for name, text in texts.items() if text is not None} | {
        name: number(value) for name, value in attributes.items() if value is not None
    }


def _start_text(variable: Variable) -> str:
    """Return the start value of one scalar as XML has it."""
    if variable.kind is Kind.BOOLEAN:
        return str(bool(variable.start)).lower()
    if variable.kind is Kind.REAL:
        return repr(float(variable.start))  # type: ignore[arg-type]
    return str(variable.start)


def _initial(variable: Variable) -> dict[str, str]:
    """Return the attribute that says where the value at the start comes from."""
    if variable.causality in ("input", "independent"):
        return {}
    return {"initial": "calculated" if variable.causality == "output" else "exact"}


# --- terminals (FMI 3.0): what a master connects by one line --------------------------------------
# A tool that moves has a mechanical port of its name. The sheet or the part has a port ``preform``
# for the whole fields that a fluid exchanges with it. Members have the same names in the units of
# forming and of infiltration, so that they match; what the other side does not have is left alone
# (``bus``).
#
# Source: FMI 3.0.2, 2.4.9.

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
    terminals = []
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
            terminals.append(UnitTerminal(tool, ROTATION if turns else TRANSLATION, what, members))
    taken = any(terminal.name == "preform" for terminal in terminals)
    return terminals + _of_preform(known, "preform_fields" if taken else "preform")


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
    terminals = [UnitTerminal(port, PREFORM, "fields that solid and fluid exchange", members)]
    if "pore_pressure_at_rest" in known:
        at_rest = {
            "pressure_at_rest" if member == "pore_pressure" else member: own
            for member, own in members.items()
        }
        what = "the same with pore_pressure at rest, for pore_pressure_at_rest = true"
        terminals.append(UnitTerminal(f"{port}_at_rest", PREFORM, what, at_rest))
    return terminals


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
    places = _on_the_edges(terminals)
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


def _on_the_edges(terminals: Sequence[UnitTerminal]) -> dict[str, dict[str, str]]:
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


# --- documentation inside a unit: what it is, its variables, and what it needs --------------------

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .5em;text-align:left}"
)


def documentation(definition: UnitDefinition, exporter: str, version: str) -> dict[str, bytes]:
    """Return the files of the folder ``documentation`` by their places in the unit."""
    dependencies = _dependencies(exporter, version)
    return {
        "documentation/index.html": _index(definition).encode(),
        "documentation/externalDependencies.txt": dependencies.encode(),
    }


def _index(definition: UnitDefinition) -> str:
    rows = "\n".join(_row(variable) for variable in definition.variables)
    title = escape(definition.title)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style></head>
<body><h1>{title}</h1>
<p>A unit of lcmchain {escape(__version__)} for co-simulation, {definition.stop_time:g} s long.
It computes in the Python of the importing process; see
<a href="externalDependencies.txt">what it needs</a>.</p>
<p>Inputs are held over a communication step, outputs are those of the last communication point.
A step that cannot be done is undone and discarded with a message; so is the step after a call that
was refused. The master may then change inputs and try again, restore a state, or terminate.</p>
<table><tr><th>variable</th><th>kind</th><th>unit</th><th>values</th><th>meaning</th></tr>
{rows}
</table></body></html>
"""


def _row(variable: Variable) -> str:
    kind = variable.causality if variable.variability != "constant" else "constant"
    cells = (
        variable.name, kind, variable.unit or "", str(variable.count), variable.description,
    )  # fmt: skip
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _dependencies(exporter: str, version: str) -> str:
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return f"""This unit computes in the Python of the importing process.

Python    3.11 or later (built with {python})
Packages  lcmchain {__version__} and what it depends on, {exporter} {version} among it
Systems   Linux and Windows on x86-64

A program that is no Python must be given Python's shared library and be started from the activated
environment that has lcmchain. On Linux:

  LD_PRELOAD=$(python -c "import sysconfig as s; print(s.get_config_var('LIBDIR') + '/' \\
      + s.get_config_var('INSTSONAME'))") master ...
"""
