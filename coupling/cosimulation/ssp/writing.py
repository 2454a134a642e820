"""Systems as SSP 1.0 or 2.0 archives, for other tools."""

from __future__ import annotations

import json
import shutil
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.coupling.cosimulation.archive import sha256_of, unpack
from lcmchain.coupling.cosimulation.description import (
    STRUCTURAL,
    UnitDescription,
    Variable,
    VariableValues,
    read_description,
)
from lcmchain.coupling.cosimulation.physical_units import BASE, PhysicalUnit
from lcmchain.coupling.cosimulation.ssp.reading import ANNOTATION
from lcmchain.coupling.cosimulation.ssp.structure import (
    COMMON,
    DESCRIPTION,
    FMU_TYPE,
    SSC,
    SSD,
    SSV,
    STRUCTURE_FILE,
    VALUES,
    type_of,
)
from lcmchain.coupling.cosimulation.start_values import (
    Configuration,
    configure,
    start_values,
    value_text,
    with_declared_units,
)
from lcmchain.coupling.cosimulation.system_file import System
from lcmchain.coupling.cosimulation.terminal_links import with_variables
from lcmchain.errors import InputError

#: Versions that are written, the default first.
Version = Literal["1.0", "2.0"]
VERSIONS: tuple[Version, ...] = get_args(Version)

_KINDS = ("input", "output", "parameter", "calculatedParameter", STRUCTURAL)


def write_ssp(system: System, target: Path, version: Version = "1.0") -> None:
    """Write a system with its units as an SSP archive.

    An annotation holds scheme, windows and recorder, which the standard cannot express. A field of
    FMI 2 has a connector for each of its values, an array of FMI 3 has one connector. A connection
    between a field and an array names both as a whole, which other tools do not read.

    Parameters
    ----------
    version : of the standard. Only 2.0 has arrays with dimensions and the types of FMI 3.

    Raises
    ------
    InputError : a unit cannot be read, a start value does not fit it, or an array has start values
        that differ and version 1.0 is to hold them.
    """
    with tempfile.TemporaryDirectory(prefix="lcmchain-ssp-") as folder:
        units = _units(system, Path(folder))
        # the standard has no connections of terminals
        system = with_variables(system, {name: unit.description for name, unit in units.items()})
        root = _document(system, units, version)
        with replacing(target) as path, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(
                STRUCTURE_FILE, ElementTree.tostring(root, "utf-8", xml_declaration=True)
            )
            for file, name in {unit.file: unit.source for unit in units.values()}.items():
                with archive.open(f"resources/{name}", "w") as packed, open(file, "rb") as source:
                    shutil.copyfileobj(source, packed)


class _Unit(NamedTuple):
    """A unit: its archive, the name of that in the resources, and what it is configured to."""

    file: Path
    source: str
    description: UnitDescription
    configuration: Configuration


#: Units by their names.
_Units = dict[str, _Unit]


def _units(system: System, folder: Path) -> _Units:
    units: _Units = {}
    names: dict[str, str] = {}  # in the resources, by hash
    for number, entry in enumerate(system.units):
        file = system.directory / entry.fmu
        description = read_description(unpack(file, folder / str(number)), file)
        with_declared_units(entry.name, description, entry.quantities, system.measures)
        description, configuration = configure(entry.name, description, entry.start)
        content = sha256_of(file)
        name = Path(entry.fmu).name
        if content not in names and name in names.values():
            name = f"{entry.name}.fmu"
        source = names.setdefault(content, name)
        units[entry.name] = _Unit(file, source, description, configuration)
    return units


def _document(system: System, units: _Units, version: Version) -> Element:
    for prefix, name in (("ssc", COMMON), ("ssd", DESCRIPTION), ("ssv", VALUES)):
        ElementTree.register_namespace(prefix, name)
    root = Element(f"{SSD}SystemStructureDescription", version=version, name=system.title)
    root.set("generationTool", f"lcmchain {__version__}")
    structure = SubElement(root, f"{SSD}System", name="system")
    elements = SubElement(structure, f"{SSD}Elements")
    used = _used(system, units)
    measures: dict[str, PhysicalUnit] = {}
    for entry in system.units:
        _, source, description, configuration = units[entry.name]
        component = SubElement(elements, f"{SSD}Component", name=entry.name, type=FMU_TYPE)
        component.set("source", f"resources/{source}")
        _require_sizes_as_exported(entry.name, configuration, version)
        values = [*configuration.settings, *start_values(entry.name, description, entry.start)]
        connected = {**used[entry.name], **{variable.name: variable for variable, _ in values}}
        writer = _Writer(version, description, measures)
        writer.connectors(component, connected)
        writer.values(component, values)
    _connections(structure, system, units)
    if measures:
        _measures(SubElement(root, f"{SSD}Units"), measures)
    SubElement(
        root, f"{SSD}DefaultExperiment",
        startTime=repr(system.start_time), stopTime=repr(system.stop_time),
    )  # fmt: skip
    annotations = SubElement(root, f"{SSD}Annotations")
    annotation = SubElement(annotations, f"{SSC}Annotation", type=ANNOTATION)
    SubElement(annotation, "settings").text = json.dumps(_kept(system))
    return root


def _require_sizes_as_exported(unit: str, configuration: Configuration, version: Version) -> None:
    """Refuse structural parameters in a version that has none."""
    if configuration.settings and version == "1.0":
        raise InputError(
            "is a structural parameter, for which SSP 1.0 has no place; write SSP 2.0 "
            "(--ssp-version 2.0)",
            key=f"units.{unit}.start.{configuration.settings[0][0].name}",
        )


def _used(system: System, units: _Units) -> dict[str, dict[str, Variable]]:
    """Return the variables that connections use, by unit."""
    used: dict[str, dict[str, Variable]] = {name: {} for name in units}
    for connection in system.connections:
        source, output, target, taken = connection.ends
        for unit, name in ((source, output), (target, taken)):
            used[unit][name] = units[unit].description.find(name)
    return used


def _names(variable: Variable, description: UnitDescription) -> list[str]:
    """Return the names of the scalars of a field of FMI 2, else the name of the variable."""
    if description.major == 3 or not variable.is_field:
        return [variable.name]
    by_reference = {int(e.references[0]): e.name for e in description.elements.values()
                    if e.kind == variable.kind}  # fmt: skip
    return [by_reference[int(reference)] for reference in variable.references]


def _names_in(unit: _Unit, name: str) -> list[str]:
    return _names(unit.description.find(name), unit.description)


@dataclass(frozen=True)
class _Writer:
    """Writes connectors and values of a component.

    Parameters
    ----------
    description : of its unit.
    measures : units of measurement that were used, which it adds to.
    """

    version: Version
    description: UnitDescription
    measures: dict[str, PhysicalUnit]

    def connectors(self, component: Element, variables: dict[str, Variable]) -> None:
        """Add the connectors of variables whose causality the standard has."""
        connectors = SubElement(component, f"{SSD}Connectors")
        for variable in variables.values():
            if variable.causality not in _KINDS:
                continue
            for name in _names(variable, self.description):
                connector = SubElement(
                    connectors, f"{SSD}Connector", name=name, kind=variable.causality
                )
                kind = SubElement(connector, f"{SSC}{self._type(variable)}")
                self._note_unit(kind, variable)
                self._dimension(connector, variable)
        if len(connectors) == 0:
            component.remove(connectors)

    def values(self, component: Element, settings: list[tuple[Variable, VariableValues]]) -> None:
        """Add start values.

        Raises
        ------
        InputError : those of an array differ, and the version has no arrays.
        """
        if not settings:
            return
        bindings = SubElement(component, f"{SSD}ParameterBindings")
        inline = SubElement(SubElement(bindings, f"{SSD}ParameterBinding"), f"{SSD}ParameterValues")
        parameters = SubElement(
            SubElement(inline, f"{SSV}ParameterSet", version=self.version, name="start"),
            f"{SSV}Parameters",
        )
        for variable, values in settings:
            names = _names(variable, self.description)
            entries = list(np.broadcast_to(values, (variable.size,)))
            if self._is_array(variable):
                self._parameter(parameters, names[0], variable, entries)
                continue
            if len(names) == 1 and any(entry != entries[0] for entry in entries):
                raise InputError(
                    f"has {len(entries)} start values that differ, for which SSP 1.0 has no place; "
                    "write SSP 2.0 (--ssp-version 2.0)",
                    key=f"units.{component.get('name')}.start.{variable.name}",
                )
            for name, entry in zip(names, entries):
                self._parameter(parameters, name, variable, [entry])

    def _parameter(
        self, parameters: Element, name: str, variable: Variable, entries: list[Any]
    ) -> None:
        parameter = SubElement(parameters, f"{SSV}Parameter", name=name)
        kind = SubElement(parameter, f"{SSV}{self._type(variable)}")
        texts = [value_text(variable, entry) for entry in entries]
        if variable.is_text and len(texts) > 1:
            for text in texts:
                SubElement(kind, f"{SSV}Value", value=text)
        else:
            kind.set("value", " ".join(texts))
        self._note_unit(kind, variable)
        self._dimension(parameter, variable)

    def _is_array(self, variable: Variable) -> bool:
        return self.version != "1.0" and self.description.major == 3 and variable.is_field

    def _dimension(self, parent: Element, variable: Variable) -> None:
        if self._is_array(variable):
            SubElement(parent, f"{SSC}Dimension", size=str(variable.size))

    def _type(self, variable: Variable) -> str:
        found = type_of(variable)
        if self.version == "1.0" or self.description.major != 3 or found in ("String", "Boolean"):
            return found
        return "Int64" if variable.kind == "Enumeration" else variable.kind

    def _note_unit(self, element: Element, variable: Variable) -> None:
        if variable.is_real and variable.unit is not None:
            element.set("unit", variable.unit.name)
            self.measures.setdefault(variable.unit.name, variable.unit)


def _connections(structure: Element, system: System, units: _Units) -> None:
    connections = SubElement(structure, f"{SSD}Connections")
    for entry in system.connections:
        source, output, target, taken = entry.ends
        starts = _names_in(units[source], output)
        ends = _names_in(units[target], taken)
        if len(starts) != len(ends):  # an array of FMI 3 and the values of a field of FMI 2
            starts, ends = [output], [taken]
        for start, end in zip(starts, ends):
            connection = SubElement(
                connections, f"{SSD}Connection", startElement=source, startConnector=start,
                endElement=target, endConnector=end,
            )  # fmt: skip
            if not entry.convert_units:
                connection.set("suppressUnitConversion", "true")
            if (entry.factor, entry.offset) != (1.0, 0.0):
                SubElement(
                    connection, f"{SSC}LinearTransformation",
                    factor=repr(entry.factor), offset=repr(entry.offset),
                )  # fmt: skip
    if len(connections) == 0:
        structure.remove(connections)


def _measures(parent: Element, measures: dict[str, PhysicalUnit]) -> None:
    for name, unit in sorted(measures.items()):
        base = SubElement(SubElement(parent, f"{SSC}Unit", name=name), f"{SSC}BaseUnit")
        for key, power in zip(BASE, unit.exponents):
            if power:
                base.set(key, f"{power:g}")
        base.set("factor", repr(unit.factor))
        base.set("offset", repr(unit.offset))


def _kept(system: System) -> dict[str, Any]:
    """Return the settings that the standard cannot express, as tables of a system's file."""
    window = {key: f"{value!r} s" if key != "residual" else value
              for key, value in system.window.model_dump(exclude_none=True).items()}  # fmt: skip
    return {
        "title": system.title,
        "window": window,
        "scheme": system.scheme.model_dump(exclude_defaults=True),
        "recorder": system.recorder.model_dump(mode="json", exclude_defaults=True),
        "connections": {
            connection.link: options
            for connection in system.connections
            if (options := connection.model_dump(
                mode="json", exclude_defaults=True,
                exclude={"link", "factor", "offset", "convert_units"},
            ))
        },
        "units": {
            unit.name: unit.model_dump(
                exclude_defaults=True, include={"substeps", "quantities", "debug", "process"}
            )
            | ({} if unit.step_limit is None else {"step_limit": f"{unit.step_limit!r} s"})
            for unit in system.units
        },
        **({} if system.unit_tolerance is None else {"unit_tolerance": system.unit_tolerance}),
    }  # fmt: skip
