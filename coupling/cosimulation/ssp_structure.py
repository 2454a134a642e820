"""The structure of an SSP archive: nested systems flattened to components and their links."""

from __future__ import annotations

import math
import posixpath
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.physical_units import (
    BASE,
    PhysicalUnit,
    UnitError,
    unit_from_base,
    unit_from_name,
)
from lcmchain.errors import InputError, shortened

COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
DESCRIPTION = "http://ssp-standard.org/SSP1/SystemStructureDescription"
VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
MAPPING = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
SSC, SSD, SSV, SSM = (f"{{{name}}}" for name in (COMMON, DESCRIPTION, VALUES, MAPPING))

STRUCTURE_FILE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"

#: The names of the systems that enclose an element, and its own.
Path = tuple[str, ...]
#: A connector of a component or of a system: its place and its name.
Node = tuple[Path, str]


@dataclass(frozen=True)
class Transformation:
    """What a connection does to a value: unit conversion if wanted, then ``factor v + offset``."""

    factor: float = 1.0
    offset: float = 0.0
    convert_units: bool = True

    @property
    def is_plain(self) -> bool:
        return self == Transformation()


@dataclass(frozen=True)
class Given:
    """A value of a parameter set: its type in the standard, its text and its unit.

    ``measure`` is that unit where the parameter set or the structure defines it.
    """

    kind: str
    text: str
    unit: str | None
    measure: PhysicalUnit | None = None


@dataclass
class Structure:
    """Components by their paths, what leads where, and the values that are given.

    ``sources`` are archives by component; ``edges`` lead from a connector to the one that feeds
    it. ``values`` come in the order in which later ones replace earlier ones. ``measures`` are the
    units that the structure defines. ``window_remark`` says what is taken as communication step
    where the archive leaves that open.
    """

    sources: dict[Path, str] = field(default_factory=dict)
    connector_units: dict[Node, str] = field(default_factory=dict)
    edges: dict[Node, tuple[Node, Transformation]] = field(default_factory=dict)
    values: list[tuple[Node, Given]] = field(default_factory=list)
    measures: dict[str, PhysicalUnit] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    window_remark: str = ""

    def links(self) -> Iterator[tuple[Node, Node, Transformation]]:
        """Yield what reaches the connectors of components: from a component, or from a system."""
        for node in self.edges:
            if node[0] in self.sources:
                start, transformation = self.fed_by(node)
                yield start, node, transformation

    def fed_by(self, node: Node) -> tuple[Node, Transformation]:
        """Follow connections back to where they begin.

        Raises
        ------
        InputError : they lead in a circle, or transform a value more than once.
        """
        transformation, seen = Transformation(), {node}
        while node in self.edges:
            node, step = self.edges[node]
            if node in seen:
                raise InputError(f"the connections of {node_text(node)} lead in a circle")
            seen.add(node)
            if not step.is_plain:
                if not transformation.is_plain:
                    raise InputError(
                        f"a value from {node_text(node)} is transformed more than once on its way; "
                        "one transformation for a connection is read"
                    )
                transformation = step
            if node[0] in self.sources:
                break
        return node, transformation


def node_text(node: Node) -> str:
    """Return a connector in words."""
    return ".".join((*node[0], node[1]))


def read_structure(root: Element, load: Callable[[str], Element]) -> Structure:
    """Return the structure of a parsed description.

    Parameters
    ----------
    load : returns the root of a file of the archive, for parameter sets and mappings.

    Raises
    ------
    InputError : it is no description of SSP 1.0, or uses what is not read.
    """
    if root.tag != f"{SSD}SystemStructureDescription":
        raise InputError(f"is no system structure of SSP 1.0, but <{shortened(root.tag)}>")
    system = root.find(f"{SSD}System")
    if system is None:
        raise InputError("describes no system")
    structure = Structure(measures=_measures(root, SSD))
    _read_system(structure, system, (), load)
    return structure


def _read_system(
    structure: Structure, system: Element, path: Path, load: Callable[[str], Element]
) -> None:
    _read_connectors(structure, system, path)
    for element in system.find(f"{SSD}Elements") or ():
        name = element.get("name", "")
        inner = (*path, name)
        if element.tag == f"{SSD}System":
            _read_system(structure, element, inner, load)
        elif element.tag == f"{SSD}Component":
            kind = element.get("type", FMU_TYPE)
            if kind != FMU_TYPE:
                raise InputError(
                    f'component "{".".join(inner)}" is of type {kind}; only FMUs are read, so '
                    "unpack the inner system into this one"
                )
            structure.sources[inner] = local_name(element.get("source", ""))
            _read_connectors(structure, element, inner)
            _read_bindings(structure, element, inner, load)
        else:
            raise InputError(
                f'element "{name}" is a {element.tag.rpartition("}")[2]}, which is not read; '
                "connect the components directly"
            )
    for connection in system.find(f"{SSD}Connections") or ():
        start, end = (
            ((*path, connection.get(f"{side}Element", "")) if connection.get(f"{side}Element")
             else path, connection.get(f"{side}Connector", ""))
            for side in ("start", "end")
        )  # fmt: skip
        _connect(structure, start, end, _transformation(connection))
    # outer ones come later, and take precedence
    _read_bindings(structure, system, path, load)


def _connect(structure: Structure, start: Node, end: Node, step: Transformation) -> None:
    if end in structure.edges:
        raise InputError(f"two connections lead to {node_text(end)}")
    structure.edges[end] = (start, step)


def _read_connectors(structure: Structure, element: Element, path: Path) -> None:
    for connector in element.findall(f"{SSD}Connectors/{SSD}Connector"):
        for kind in connector:
            unit = kind.get("unit")
            if unit:
                structure.connector_units[path, connector.get("name", "")] = unit


def _transformation(element: Element) -> Transformation:
    convert = element.get("suppressUnitConversion", "false") not in ("true", "1")
    step = Transformation(convert_units=convert)
    for child in element:
        name = child.tag.removeprefix(SSC)
        if name == "LinearTransformation":
            factor, offset = float(child.get("factor", "1")), float(child.get("offset", "0"))
            step = replace(step, factor=factor, offset=offset)
        elif name.endswith("MappingTransformation"):
            raise InputError(f"a connection with a {name} is not read; linear transformations are")
    return step


# --- parameters -----------------------------------------------------------------------------------


def _read_bindings(
    structure: Structure, element: Element, path: Path, load: Callable[[str], Element]
) -> None:
    for binding in element.findall(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
        inline = binding.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
        values = inline if inline is not None else load(local_name(binding.get("source", "")))
        prefix = binding.get("prefix", "")
        measures = {**structure.measures, **_measures(values, SSV)}
        given = {
            prefix + parameter.get("name", ""): _given(parameter, measures)
            for parameter in values.findall(f"{SSV}Parameters/{SSV}Parameter")
        }
        mapping = binding.find(f"{SSD}ParameterMapping")
        if mapping is not None:
            given = _mapped(given, mapping, load)
        for name, value in given.items():
            node = _place(structure, path, name)
            if node is not None:
                structure.values.append((node, value))


def _measures(element: Element, space: str) -> dict[str, PhysicalUnit]:
    """Return the units that a structure or a parameter set defines.

    Raises
    ------
    InputError : one whose numbers are none, or whose factor is not positive.
    """
    found = {}
    for unit in element.findall(f"{space}Units/{SSC}Unit"):
        name, base = unit.get("name", ""), unit.find(f"{SSC}BaseUnit")
        if base is None:
            continue
        try:
            exponents = tuple(float(base.get(key, "0")) for key in BASE)
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
            own = unit_from_base(name, exponents, factor, offset)
        except (UnitError, ValueError) as error:
            raise InputError(
                f'the definition of the unit "{shortened(name)}" is wrong: {error}'
            ) from None
        found[name] = _as_usual(own)
    return found


def _as_usual(own: PhysicalUnit) -> PhysicalUnit:
    """Return a unit as its name is usually understood where the definition means the same."""
    try:
        usual = unit_from_name(own.name)
    except UnitError:
        return own
    same = usual.exponents == own.exponents and all(
        math.isclose(a, b, rel_tol=1e-14, abs_tol=1e-300)
        for a, b in ((usual.factor, own.factor), (usual.offset, own.offset))
    )
    return usual if same else own


def _given(parameter: Element, measures: dict[str, PhysicalUnit]) -> Given:
    name = parameter.get("name", "")
    for value in parameter:
        kind = value.tag.removeprefix(SSV)
        if kind in ("Real", "Integer", "Boolean", "String", "Enumeration"):
            unit = value.get("unit")
            return Given(kind, value.get("value", ""), unit, measures.get(unit or ""))
    raise InputError(f'the value of parameter "{shortened(name)}" is of a type that is not read')


def _mapped(
    given: dict[str, Given], mapping: Element, load: Callable[[str], Element]
) -> dict[str, Given]:
    """Return the values under the names that a mapping gives them."""
    inline = mapping.find(f"{SSM}ParameterMapping")
    root = inline if inline is not None else load(local_name(mapping.get("source", "")))
    found = {}
    for entry in root.findall(f"{SSM}MappingEntry"):
        value = given.get(entry.get("source", ""))
        if value is None:
            continue
        step = _transformation(entry)
        if (step.factor, step.offset) != (1.0, 0.0):
            number = step.factor * float(value.text) + step.offset
            value = replace(value, text=repr(number))
        if not step.convert_units:
            value = replace(value, unit=None, measure=None)
        found[entry.get("target", "")] = value
    return found


def _place(structure: Structure, path: Path, name: str) -> Node | None:
    """Return the connector or variable of a hierarchical name below a system or component."""
    if path in structure.sources:
        return path, name
    owners = [p for p in structure.sources if p[: len(path)] == path]
    for owner in sorted(owners, key=len, reverse=True):
        inner = ".".join(owner[len(path) :]) + "."
        if name.startswith(inner):
            return owner, name[len(inner) :]
    parts = name.split(".")
    return (*path, *parts[:-1]), parts[-1]


def local_name(source: str) -> str:
    """Return the place of a file within the archive.

    Raises
    ------
    InputError : it lies elsewhere.
    """
    place = urlsplit(source)
    name = posixpath.normpath(unquote(place.path))
    outside = name.startswith(("/", "..")) or "\\" in name or name in (".", "")
    if place.scheme or place.netloc or outside:
        raise InputError(
            f'"{shortened(source)}" does not lie in the archive (of a bare .ssd: in its folder); '
            "only what it holds is read"
        )
    return name


def text_of(element: Element | None) -> Any:
    """Return the text of an element, None where it is absent or empty."""
    return None if element is None or not (element.text or "").strip() else element.text
