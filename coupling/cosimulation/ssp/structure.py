"""What the files of SSP 1.0 and 2.0 hold: names, values, and systems flattened to components."""

from __future__ import annotations

import math
import posixpath
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.description import TRUTHS, Variable
from lcmchain.coupling.cosimulation.physical_units import (
    BASE,
    Conversion,
    PhysicalUnit,
    UnitError,
    unit_from_base,
    unit_from_name,
)
from lcmchain.errors import InputError, shortened

# --- names of SSP 1.0 and 2.0, which share their XML namespaces -----------------------------------


COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
DESCRIPTION = "http://ssp-standard.org/SSP1/SystemStructureDescription"
VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
MAPPING = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
SSC, SSD, SSV, SSM = (f"{{{name}}}" for name in (COMMON, DESCRIPTION, VALUES, MAPPING))

STRUCTURE_FILE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"


# --- values in parameter sets: numbers, texts and arrays, with units ------------------------------


_WHOLE = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))
#: Types of a value or connector, by those in the files; the types of FMI 3 came with SSP 2.0.
KINDS = {
    **dict.fromkeys(("Real", "Float64", "Float32"), "Real"),
    **dict.fromkeys(("Integer", *_WHOLE), "Integer"),
    **{kind: kind for kind in ("Boolean", "String", "Enumeration", "Binary", "Clock")},
}


def type_of(variable: Variable) -> str:
    """Return the type of a variable's connector in SSP 1.0; an enumeration is a whole number."""
    if variable.is_text:
        return "String"
    if variable.kind in TRUTHS:
        return "Boolean"
    return "Real" if variable.is_real else "Integer"


#: Types whose values are not exchanged.
NOT_EXCHANGED = ("Binary", "Clock")

#: Numbers of the items of an enumeration, by its name and theirs.
Items = Mapping[str, Mapping[str, int]]


@dataclass(frozen=True)
class Given:
    """A value of a parameter set: its type, its text and its unit.

    Parameters
    ----------
    kind : ``Real``, ``Integer``, ``Boolean``, ``String``, ``Enumeration`` or ``Binary``.
    texts : one for a single value, one for each entry of an array in row-major order.
    is_array : whether it is one, even of a single entry.
    measure : the unit where the parameter set or the structure defines it.
    items : of the enumeration, as the archive defines them.
    change : by a mapping, of the value in the unit of its target.
    """

    kind: str
    texts: tuple[str, ...]
    is_array: bool = False
    unit: str | None = None
    measure: PhysicalUnit | None = None
    items: Mapping[str, int] | None = None
    change: Conversion | None = None


def given_of(parameter: Element, measures: Mapping[str, PhysicalUnit], items: Items) -> Given:
    """Return the value of a parameter.

    Parameters
    ----------
    measures, items : units and enumerations that the parameter set or the structure defines.

    Raises
    ------
    InputError : a type that is not known, or another number of values than the dimensions say.
    """
    name = shortened(parameter.get("name", ""))
    for value in parameter:
        kind = KINDS.get(value.tag.removeprefix(SSV))
        if kind is None or kind == "Clock":
            continue
        listed = tuple(entry.get("value", "") for entry in value.findall(f"{SSV}Value"))
        single = value.get("value", "")
        if not listed:
            one_text = kind in ("String", "Enumeration", "Binary")
            listed = (single,) if one_text else tuple(single.split()) or ("",)
        size = _size(parameter, name)
        if size is not None and size != len(listed):
            raise InputError(
                f'the parameter "{name}" has {len(listed)} values, its dimensions are for {size}'
            )
        unit = value.get("unit")
        return Given(
            kind, listed, size is not None or len(listed) > 1, unit, measures.get(unit or ""),
            items.get(value.get("name", "")) if kind == "Enumeration" else None,
        )  # fmt: skip
    raise InputError(f'the value of parameter "{name}" is of a type that is not read')


def _size(parameter: Element, name: str) -> int | None:
    """Return the number of entries by the dimensions of a parameter; None where it has none."""
    sizes = [dimension.get("size") for dimension in parameter.findall(f"{SSC}Dimension")]
    if not sizes or None in sizes:  # a size is left open
        return None
    try:
        return math.prod(int(size or "") for size in sizes)
    except ValueError:
        raise InputError(f'the dimensions of the parameter "{name}" are no whole numbers') from None


def value_of_text(given: Given, text: str, what: str) -> bool | int | str:
    """Return a value that is no real number: a text, a switch or a whole number.

    what : the parameter, for messages.

    Raises
    ------
    InputError : the text is none of its type.
    """
    try:
        if given.kind == "String":
            return text
        if given.kind == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[text]
        if given.kind == "Enumeration" and given.items is not None and text in given.items:
            return given.items[text]
        return int(text)
    except (ValueError, KeyError):
        hint = ""
        if given.kind == "Enumeration":
            known = ", ".join(given.items or ())
            hint = f"; the archive defines {known}" if known else "; give the number of the item"
        raise InputError(f'the value of {what}, "{text}", is no {given.kind}{hint}') from None


def items_of(element: Element, space: str) -> dict[str, dict[str, int]]:
    """Return the enumerations that a structure or a parameter set defines.

    Raises
    ------
    InputError : the value of an item is no whole number.
    """
    enumerations: dict[str, dict[str, int]] = {}
    for enumeration in element.findall(f"{space}Enumerations/{SSC}Enumeration"):
        name = enumeration.get("name", "")
        try:
            enumerations[name] = {
                item.get("name", ""): int(item.get("value", ""))
                for item in enumeration.findall(f"{SSC}Item")
            }
        except ValueError:
            raise InputError(
                f'an item of the enumeration "{shortened(name)}" has no whole number'
            ) from None
    return enumerations


def measures_of(element: Element, space: str) -> dict[str, PhysicalUnit]:
    """Return the units that a structure or a parameter set defines.

    Raises
    ------
    InputError : a number is none, or a factor is not positive.
    """
    measures = {}
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
        measures[name] = _as_usual(own)
    return measures


def _as_usual(own: PhysicalUnit) -> PhysicalUnit:
    """Return the usual unit of this name where the definition means the same, but for rounding."""
    try:
        usual = unit_from_name(own.name)
    except UnitError:
        return own
    same = usual.exponents == own.exponents and all(
        math.isclose(a, b, rel_tol=1e-14, abs_tol=1e-300)
        for a, b in ((usual.factor, own.factor), (usual.offset, own.offset))
    )
    return usual if same else own


# --- nested systems, flattened to components and their links --------------------------------------


#: Kinds of connectors that a value leaves an element by, and those that it enters one by. To the
#: inside of a system its own connectors are the other way round.
LEAVING = ("output", "calculatedParameter", "local", "constant")
ENTERING = ("input", "parameter", "structuralParameter", "inout")

#: Versions of the standard that are read; 1.1 is 1.0 with other diagrams.
VERSIONS = ("1.0", "1.1", "2.0")

#: The names of the systems that enclose an element, and its own.
Path = tuple[str, ...]
#: A connector: the path of its component or system, and its name.
Node = tuple[Path, str]


@dataclass(frozen=True)
class Transformation:
    """Change of a value by a connection: unit conversion if wanted, then ``factor v + offset``."""

    factor: float = 1.0
    offset: float = 0.0
    convert_units: bool = True

    @property
    def is_plain(self) -> bool:
        return self == Transformation()


@dataclass(frozen=True)
class Connection:
    """A connection as it stands in the file: its start need not be where the value comes from.

    owner : path of the system that it stands in.
    """

    owner: Path
    start: Node
    end: Node
    step: Transformation


@dataclass
class Structure:
    """Components by their paths, their connections, and the values of parameters.

    Parameters
    ----------
    sources : archives of the units by component.
    connector_units : units of measurement that connectors state.
    connector_types, connector_kinds : types and kinds that connectors state.
    connections : as they stand in the file.
    edges : from a connector to the one that feeds it; see :meth:`direct`.
    values : later ones replace earlier ones.
    measures, items : units of measurement and enumerations that the structure defines.
    dimensions : sizes of array connectors: a number, the name of the connector that holds it, or
        None where it is open.
    not_exchanged : type of connectors of binary values and clocks.
    window_remark : on the communication step, where the archive leaves it open.
    end_remark : on the end of the simulation, likewise.
    """

    sources: dict[Path, str] = field(default_factory=dict)
    connector_units: dict[Node, str] = field(default_factory=dict)
    connector_types: dict[Node, str] = field(default_factory=dict)
    connector_kinds: dict[Node, str] = field(default_factory=dict)
    connections: list[Connection] = field(default_factory=list)
    edges: dict[Node, tuple[Node, Transformation]] = field(default_factory=dict)
    values: list[tuple[Node, Given]] = field(default_factory=list)
    measures: dict[str, PhysicalUnit] = field(default_factory=dict)
    items: Items = field(default_factory=dict)
    dimensions: dict[Node, tuple[int | str | None, ...]] = field(default_factory=dict)
    not_exchanged: dict[Node, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    window_remark: str = ""
    end_remark: str = ""

    def direct(self, kinds: Mapping[Node, str]) -> None:
        """Find out which way values go through the connections.

        Parameters
        ----------
        kinds : of connectors, for components those of the variables of their units.

        Raises
        ------
        InputError : two connections lead to the same connector.
        """
        for connection in self.connections:
            start, end = connection.start, connection.end
            at_start, at_end = (_is_source(node, connection.owner, kinds) for node in (start, end))
            if at_start is not True and at_end is not False and at_start is not at_end:
                start, end = end, start
            elif at_start is at_end is not None and not {start[0], end[0]} <= self.sources.keys():
                self.remarks.append(
                    f"the connection between {node_text(start)} and {node_text(end)} joins two "
                    f"connectors that {'give' if at_start else 'take'} values, which SSP does not "
                    "allow; the first is taken for the one that gives, correct its kind"
                )
            if end in self.edges:
                raise InputError(f"two connections lead to {node_text(end)}")
            self.edges[end] = (start, connection.step)

    def links(self) -> Iterator[tuple[Node, Node, Transformation]]:
        """Yield connections to components, each from a component or from an outer system."""
        for node in self.edges:
            if node[0] in self.sources:
                start, transformation = self.fed_by(node)
                yield start, node, transformation

    def fed_by(self, node: Node) -> tuple[Node, Transformation]:
        """Follow connections back to their begin; return it and the transformation on the way.

        Raises
        ------
        InputError : they lead in a circle, transform a value more than once, or transform it in
            another unit of measurement than that of their ends.
        """
        transformation, seen, last = Transformation(), {node}, node
        transformed: tuple[Node, Node] | None = None
        while node in self.edges:
            end = node
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
                transformation, transformed = step, (node, end)
            if node[0] in self.sources:
                break
        if transformed is not None:
            self._require_unit(transformed[1], last)
            if not transformation.convert_units:
                self._require_unit(transformed[0], node)
        return node, transformation

    def _require_unit(self, passed: Node, end: Node) -> None:
        """Refuse a connection that is transformed at a connector with another unit than its end's.

        The one connection that is read transforms the value in the unit of its end.
        """
        there, here = self.connector_units.get(passed), self.connector_units.get(end)
        if there is not None and here is not None and there != here:
            raise InputError(
                f"a value is transformed, or its unit not converted, at {node_text(passed)} in "
                f'"{there}", but {node_text(end)} is in "{here}"; give both the same unit, and the '
                "transformation to it"
            )


def _is_source(node: Node, owner: Path, kinds: Mapping[Node, str]) -> bool | None:
    """Whether values of a connection in the system ``owner`` come from a connector.

    None if its kind does not say so.
    """
    kind = kinds.get(node)
    leaving, entering = (LEAVING, ENTERING) if node[0] != owner else (ENTERING, LEAVING)
    return True if kind in leaving else False if kind in entering else None


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
    InputError : it is no description of SSP 1.0 or 2.0, or uses what is not read.
    """
    if root.tag != f"{SSD}SystemStructureDescription":
        raise InputError(f"is no system structure of SSP 1.0 or 2.0, but <{shortened(root.tag)}>")
    version = root.get("version")
    if version is not None and version not in VERSIONS:
        raise InputError(
            f'is of SSP "{shortened(version)}"; {", ".join(VERSIONS)} are read, so export it for '
            "one of these"
        )
    system = root.find(f"{SSD}System")
    if system is None:
        raise InputError("describes no system")
    structure = Structure(measures=measures_of(root, SSD), items=items_of(root, SSD))
    _read_system(structure, system, (), load)
    return structure


def _read_system(
    structure: Structure, system: Element, path: Path, load: Callable[[str], Element]
) -> None:
    _read_connectors(structure, system, path)
    names: set[str] = set()
    for element in system.find(f"{SSD}Elements") or ():
        name = element.get("name", "")
        inner = (*path, name)
        if name in names:
            raise InputError(
                f'two elements have the name "{".".join(inner)}", so that connections and '
                "parameters do not say which they mean; rename one"
            )
        names.add(name)
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
            wanted = element.get("implementation", "any")
            if wanted not in ("any", "CoSimulation"):
                structure.remarks.append(
                    f'component "{".".join(inner)}" is meant as {wanted}; its co-simulation is '
                    "taken"
                )
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
        for node in (start, end):
            if not node[1] or (len(node[0]) > len(path) and node[0][-1] not in names):
                what = f'the element "{node[0][-1]}"' if node[1] else "one of its connectors"
                raise InputError(
                    f'the connection from "{node_text(start)}" to "{node_text(end)}" lacks {what}, '
                    "which the system does not have; correct or remove it"
                )
        if connection.get("startIndices") or connection.get("endIndices"):
            raise InputError(
                f"the connection to {node_text(end)} is one of single entries of an array "
                "(startIndices, endIndices), which is not read; connect whole arrays"
            )
        structure.connections.append(Connection(path, start, end, _transformation(connection)))
    # outer ones come later, and take precedence
    _read_bindings(structure, system, path, load)


def _read_connectors(structure: Structure, element: Element, path: Path) -> None:
    for connector in element.findall(f"{SSD}Connectors/{SSD}Connector"):
        node = path, connector.get("name", "")
        structure.connector_kinds[node] = connector.get("kind", "")
        for child in connector:
            kind = KINDS.get(child.tag.removeprefix(SSC))
            if kind in NOT_EXCHANGED:
                structure.not_exchanged[node] = kind
            elif kind is not None:
                structure.connector_types[node] = kind
            unit = child.get("unit")
            if unit:
                structure.connector_units[node] = unit
        sizes = connector.findall(f"{SSC}Dimension")
        if sizes:
            structure.dimensions[node] = tuple(_size_of(size, node) for size in sizes)


def _size_of(dimension: Element, node: Node) -> int | str | None:
    size, owner = dimension.get("size"), dimension.get("sizeConnector")
    if size is not None and owner is not None:
        raise InputError(f"a dimension of {node_text(node)} has both a size and a sizeConnector")
    if size is None:
        return owner
    if not size.isdecimal():
        raise InputError(f'a dimension of {node_text(node)} has the size "{shortened(size)}"')
    return int(size)


def _transformation(element: Element) -> Transformation:
    convert = element.get("suppressUnitConversion", "false") not in ("true", "1")
    step = Transformation(convert_units=convert)
    for child in element:
        name = child.tag.removeprefix(SSC)
        if name == "LinearTransformation":
            factor, offset = (
                number_of(child.get(key, usual), f"{key} of a LinearTransformation")
                for key, usual in (("factor", "1"), ("offset", "0"))
            )
            step = replace(step, factor=factor, offset=offset)
        elif name.endswith("MappingTransformation"):
            raise InputError(f"a connection with a {name} is not read; linear transformations are")
    return step


def number_of(text: str, what: str) -> float:
    """Return a finite number that an attribute holds.

    what : the attribute, for messages.

    Raises
    ------
    InputError : it holds none.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f'the {what} is "{shortened(text)}", which is no finite number')
    return number


# --- parameters -----------------------------------------------------------------------------------


def _read_bindings(
    structure: Structure, element: Element, path: Path, load: Callable[[str], Element]
) -> None:
    for binding in element.findall(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
        mapping = binding.find(f"{SSD}ParameterMapping")
        for source in (binding, mapping):
            if source is not None and source.get("sourceBase", "SSD") != "SSD":
                raise InputError(
                    f'parameters of "{".".join(path)}" stand within its unit (sourceBase), which '
                    "is not read; put the file into the archive"
                )
        inline = binding.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
        values = inline
        if values is None:
            values = _loaded(binding, load, f"{SSV}ParameterSet")
        prefix = binding.get("prefix", "")
        measures = {**structure.measures, **measures_of(values, SSV)}
        items = {**structure.items, **items_of(values, SSV)}
        given = {
            prefix + parameter.get("name", ""): given_of(parameter, measures, items)
            for parameter in values.findall(f"{SSV}Parameters/{SSV}Parameter")
        }
        if mapping is not None:
            given = _mapped(structure, given, mapping, load)
        for name, value in given.items():
            node = _place(structure, path, name)
            if node is not None:
                structure.values.append((node, value))


def _loaded(owner: Element, load: Callable[[str], Element], tag: str) -> Element:
    """Return the root of the file that a binding or mapping names; it has this tag.

    Raises
    ------
    InputError : there is no such file, or it holds something else.
    """
    name = local_name(owner.get("source", ""))
    root = load(name)
    if root.tag != tag:
        wanted, found = tag.rpartition("}")[2], root.tag.rpartition("}")[2]
        raise InputError(f"{shortened(name)} is no {wanted} of SSP, but <{shortened(found)}>")
    return root


def _mapped(
    structure: Structure,
    given: dict[str, Given],
    mapping: Element,
    load: Callable[[str], Element],
) -> dict[str, Given]:
    """Return the values under the names of a mapping."""
    root = mapping.find(f"{SSM}ParameterMapping")
    if root is None:
        root = _loaded(mapping, load, f"{SSM}ParameterMapping")
    mapped = {}
    for entry in root.findall(f"{SSM}MappingEntry"):
        source, target = entry.get("source", ""), entry.get("target", "")
        value = given.get(source)
        if value is None:
            structure.remarks.append(
                f'the mapping of "{source}" to "{target}" is left out: the parameter set has no '
                f'"{source}"'
            )
            continue
        if target in mapped:
            raise InputError(
                f'a mapping leads more than one parameter to "{shortened(target)}", the last of '
                f'them "{shortened(source)}"; remove all entries for it but one'
            )
        step = _transformation(entry)
        if not step.convert_units:
            value = replace(value, unit=None, measure=None)
        if (step.factor, step.offset) != (1.0, 0.0):
            value = _transformed(value, step, source)
        mapped[target] = value
    return mapped


def _transformed(value: Given, step: Transformation, name: str) -> Given:
    """Return a number that a mapping changes; a whole one stays one, where it is whole.

    One with a unit is changed later, in the unit of the variable that it goes to.
    """
    if value.kind not in ("Real", "Integer"):
        raise InputError(
            f'the mapping of "{shortened(name)}" has a LinearTransformation, but its value is a '
            f"{value.kind}, no number"
        )
    numbers = [
        step.factor * number_of(text, f'value of "{shortened(name)}"') + step.offset
        for text in value.texts
    ]
    if value.unit:
        return replace(value, change=Conversion(step.factor, step.offset))
    whole = value.kind == "Integer" and all(number.is_integer() for number in numbers)
    return replace(value, texts=tuple(str(int(n)) if whole else repr(n) for n in numbers))


def _place(structure: Structure, path: Path, name: str) -> Node | None:
    """Return the connector or variable with a hierarchical name below a system or component."""
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
    """Return the path of a file within the archive.

    Raises
    ------
    InputError : it lies elsewhere.
    """
    address = urlsplit(source)
    name = posixpath.normpath(unquote(address.path))
    outside = name.startswith(("/", "..")) or "\\" in name or name in (".", "")
    if address.scheme or address.netloc or outside:
        raise InputError(
            f'"{shortened(source)}" does not lie in the archive (of a bare .ssd: in its folder); '
            "only what it holds is read"
        )
    return name


def text_of(element: Element | None) -> str | None:
    """Return the text of an element, None where it is absent or empty."""
    return None if element is None or not (element.text or "").strip() else element.text
