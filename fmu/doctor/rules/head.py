"""Rules of what stands around the variables: abilities, experiment, definitions."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lcmchain.fmu.doctor.rules.interface import Interface, flag, number, repeated, rule

#: Abilities that need another one: FMI 2.0.5, 3.3.1 and 4.3.1; FMI 3.0.2, 2.4.2 and 4.4.
IMPLIED = {
    "canSerializeFMUstate": "canGetAndSetFMUstate",
    "canSerializeFMUState": "canGetAndSetFMUState",
    "canReturnEarlyAfterIntermediateUpdate": "providesIntermediateUpdate",
}
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z")


@rule(
    "abilities",
    "abilities with those that they need (states that can be serialized can be saved), and an "
    "internal step above 0",
    "FMI 2.0.5, 4.3.1; FMI 3.0.2, 2.4.2 and 4.4",
)
def abilities(interface: Interface) -> Iterator[str]:
    for kind in interface.kinds:
        for name, needed in IMPLIED.items():
            if flag(kind, name) and not flag(kind, needed):
                yield f"{kind.tag} has {name} without {needed}"
        step = kind.get("fixedInternalStepSize")
        if step is not None and not (number(step) or 0.0) > 0.0:
            yield f"{kind.tag} has fixedInternalStepSize {step}"


@rule("model identifier", "a model identifier that is a name of the C language",
      "FMI 2.0.5, 2.1.1; FMI 3.0.2, 2.5")  # fmt: skip
def identifier(interface: Interface) -> Iterator[str]:
    for kind in interface.kinds:
        name = kind.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            yield f'{kind.tag} has "{name[:60]}"'


@rule(
    "experiment",
    "a default experiment that ends after it begins, with a tolerance that is not negative and a "
    "step above 0 and not longer than the whole",
    "FMI 2.0.5, 2.2.5; FMI 3.0.2, 2.4.6",
)
def experiment(interface: Interface) -> Iterator[str]:
    element = interface.root.find("DefaultExperiment")
    if element is None:
        return
    values = {}
    for name in ("startTime", "stopTime", "tolerance", "stepSize"):
        values[name] = number(element.get(name))
        if element.get(name) is not None and values[name] is None:
            yield f'{name} is "{element.get(name)}"'
    begin, end, step = values["startTime"], values["stopTime"], values["stepSize"]
    if begin is not None and end is not None and not end > begin:
        yield f"it goes from {begin:g} to {end:g}"
    if values["tolerance"] is not None and values["tolerance"] < 0.0:
        yield f"its tolerance is {values['tolerance']:g}"
    if step is not None and not step > 0.0:
        yield f"its step is {step:g}"
    elif step is not None and end is not None and step > end - (begin or 0.0):
        yield f"its step of {step:g} is longer than it takes"


@rule("date", "generationDateAndTime as YYYY-MM-DDThh:mm:ssZ",
      "FMI 2.0.5, 2.2.1; FMI 3.0.2, 2.4.1")  # fmt: skip
def date(interface: Interface) -> Iterator[str]:
    given = interface.root.get("generationDateAndTime")
    if given is not None and not _DATE.fullmatch(given):
        yield f'it is "{given[:40]}"'


@rule(
    "definitions",
    "units, display units of a unit, types, items of an enumeration (by name and value) and log "
    "categories once each, and no type named as a variable is",
    "FMI 2.0.5, 2.2.2 to 2.2.4; FMI 3.0.2, 2.4.3 to 2.4.5",
)
def definitions(interface: Interface) -> Iterator[str]:
    root = interface.root
    for what, path in (("unit", "UnitDefinitions/Unit"), ("type", "TypeDefinitions/*"),
                       ("log category", "LogCategories/Category")):  # fmt: skip
        for name in repeated(element.get("name", "") for element in root.findall(path)):
            yield f'the {what} "{name}" is defined twice'
    for name, unit in interface.units.items():
        for shown in repeated(e.get("name", "") for e in unit.findall("DisplayUnit")):
            yield f'the display unit "{shown}" of {name} is defined twice'
        for element in unit.findall("DisplayUnit"):
            if flag(element, "inverse") and number(element.get("offset", "0")) != 0.0:
                what = f'the display unit "{element.get("name")}" of {name}'
                yield f"{what} is inverse with an offset"
    for name, (_, _, items) in interface.types.items():
        rows = [item for item in items if item.tag == "Item"]
        for key in ("name", "value"):
            for text in repeated(row.get(key, "") for row in rows):
                yield f'the {key} "{text}" stands twice in the enumeration {name}'
    for name in interface.types:
        if name in interface.by_name:
            yield f'"{name}" is a type and a variable'
