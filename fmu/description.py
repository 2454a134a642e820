"""What the model descriptions of FMI 2.0 and 3.0 share."""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from lcmchain import __version__
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.status import CATEGORIES
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


def head(definition: UnitDefinition, version: str, *, structured: bool) -> dict[str, str]:
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


def add_units(root: Element, variables: Iterable[Variable]) -> None:
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


def used_types(variables: Iterable[Variable]) -> dict[str, DeclaredType]:
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


def add_categories(root: Element) -> None:
    """Add the categories of log messages."""
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": description})


def add_experiment(root: Element, definition: UnitDefinition) -> None:
    """Add the proposed experiment."""
    times = {"startTime": 0.0, "stopTime": definition.stop_time, "stepSize": definition.step_size}
    SubElement(root, "DefaultExperiment", {name: repr(value) for name, value in times.items()})


def limits(variable: Variable) -> dict[str, str]:
    """Return the attributes for type, unit and limits of a variable."""
    found = {"min": variable.minimum, "max": variable.maximum}
    texts = {"declaredType": variable.type_name}
    if variable.kind is Kind.REAL:
        found["nominal"] = variable.nominal
        texts["unit"] = variable.unit
    number = repr if variable.kind is Kind.REAL else lambda value: str(int(value))
    return {name: text for name, text in texts.items() if text is not None} | {
        name: number(value) for name, value in found.items() if value is not None
    }


def start_text(variable: Variable) -> str:
    """Return the start value of one scalar as XML has it."""
    if variable.kind is Kind.BOOLEAN:
        return str(bool(variable.start)).lower()
    if variable.kind is Kind.REAL:
        return repr(float(variable.start))  # type: ignore[arg-type]
    return str(variable.start)


def initial(variable: Variable) -> dict[str, str]:
    """Return the attribute that says where the value at the start comes from."""
    if variable.causality in ("input", "independent"):
        return {}
    return {"initial": "calculated" if variable.causality == "output" else "exact"}


def as_bytes(root: Element) -> bytes:
    """Return the document; one variable a line."""
    indent(root, " ")
    return tostring(root, "UTF-8", xml_declaration=True)
