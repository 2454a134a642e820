"""Systems from SSP 1.0 and 2.0 archives, as the tables of a system's file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.archive import read_xml, unpack
from lcmchain.coupling.cosimulation.description import UnitDescription, Variable, read_description
from lcmchain.coupling.cosimulation.physical_units import (
    BASE,
    PhysicalUnit,
    UnitError,
    conversion,
    is_usual,
    unit_from_name,
)
from lcmchain.coupling.cosimulation.ssp.structure import (
    SSC,
    SSD,
    STRUCTURE_FILE,
    Given,
    Node,
    Structure,
    node_text,
    number_of,
    read_structure,
    text_of,
    type_of,
    value_of_text,
)
from lcmchain.coupling.cosimulation.ssp.structure import Path as Place
from lcmchain.coupling.cosimulation.start_values import configure
from lcmchain.coupling.cosimulation.system_file import System, system_from
from lcmchain.errors import InputError
from lcmchain.scene.reading.overrides import TomlTable

#: Type of the annotation that holds, as JSON, the settings that SSP cannot express.
ANNOTATION = "lcmchain.cosimulation"
#: Simulated time of a system that does not state its end [s].
LENGTH = 1.0
#: Number of windows of a system that does not state its communication step.
WINDOWS = 500
#: Attributes in which annotations of other tools state the communication step [s].
STEP_SIZES = ("stepSize", "baseStepSize", "initialStepSize", "communicationStepSize")


def read_ssp(path: Path | str, folder: Path, overrides: Sequence[str] = ()) -> System:
    """Unpack an SSP archive and return its system.

    Nested systems are flattened: ``outer.inner`` becomes the unit ``outer_inner``.

    Parameters
    ----------
    folder : an empty one to unpack into; it is needed as long as the system is used.

    Raises
    ------
    InputError : no SSP 1.0 or 2.0, damaged, or with content that is not read; names the archive.
    """
    path = Path(path)
    unpack(path, folder)
    return _system(path, STRUCTURE_FILE, folder, folder / ".described", overrides)


def read_ssd(path: Path | str, scratch: Path, overrides: Sequence[str] = ()) -> System:
    """Return the system of a description without archive; its files lie in the same folder.

    Parameters
    ----------
    scratch : an empty folder to unpack the units into.

    Raises
    ------
    InputError : as for :func:`read_ssp`.
    """
    path = Path(path)
    return _system(path, path.name, path.resolve().parent, scratch, overrides)


def _system(
    path: Path, structure: str, folder: Path, scratch: Path, overrides: Sequence[str]
) -> System:
    """Return the system of a description ``structure`` in a folder; ``path`` is for messages."""
    try:
        data, parsed = _tables(folder, structure, scratch, path)
        system = system_from(data, path, overrides, directory=folder)
    except InputError as error:
        if error.file is not None:
            raise
        key = f"{error.key}: " if error.key else ""
        raise InputError(f"{key}{error.message}", file=path) from None
    if not any(re.match(r"\s*window(\.size)?\s*=", text) for text in overrides):
        parsed.remarks.append(parsed.window_remark)
    if not any(re.match(r"\s*stop_time\s*=", text) for text in overrides):
        parsed.remarks.append(parsed.end_remark)
    system._remarks.extend(text for text in parsed.remarks if text)
    system._measures.update(parsed.measures)
    return system


def _tables(folder: Path, name: str, scratch: Path, path: Path) -> tuple[TomlTable, Structure]:
    """Return the tables of a system's file and the structure that they are made from."""
    root = _load(folder, name, path)
    structure = read_structure(root, lambda name: _load(folder, name, path))
    if not structure.sources:
        raise InputError("the system has no components")
    names = _unit_names(structure)
    by_source = {
        s: _described(folder, s, scratch) for s in dict.fromkeys(structure.sources.values())
    }
    descriptions = {place: by_source[source] for place, source in structure.sources.items()}
    structure.direct(_kinds(structure, descriptions))
    kept = _annotation(root)
    data: TomlTable = {"title": root.get("name") or "Co-simulation"}
    data |= _experiment(root, structure)
    if "window" not in kept:
        kept["window"] = _window(root, data, structure)
    starts = _starts(structure, descriptions)
    for place, start in starts.items():
        descriptions[place], _ = configure(names[place], descriptions[place], start)
    _require_sizes(structure, descriptions)
    _tell_other_types(structure, descriptions)
    _tell_other_kinds_and_units(structure, descriptions)
    _tell_systems_that_do_not_fit(structure, descriptions)
    links = _links(structure, names, descriptions)
    data["connections"] = [
        link if table == {"link": link} else table for link, table in links.items()
    ]
    data["units"] = []
    for place, source in structure.sources.items():
        table: TomlTable = {"name": names[place], "fmu": source}
        if starts[place]:
            table["start"] = starts[place]
        quantities = _quantities(structure, place, descriptions[place])
        if quantities:
            table["quantities"] = quantities
        data["units"].append(table)
    _merge(data, kept)
    return data, structure


def _window(root: Element, data: TomlTable, structure: Structure) -> str:
    """Return the communication step: from an annotation, or a fraction of the whole time."""
    stated = _step_sizes(root)
    if stated:
        smallest = min(size for size, _ in stated)
        if len({size for size, _ in stated}) > 1:
            steps = ", ".join(f"{size:g} s ({where})" for size, where in stated)
            structure.window_remark = (
                f"the archive gives more than one communication step: {steps}; the smallest is "
                "taken, --set window=... another one"
            )
        return f"{smallest!r} s"
    length = _seconds(data.get("stop_time", "1 s")) - _seconds(data.get("start_time", "0 s"))
    window = f"{length / WINDOWS!r} s"
    structure.window_remark = (
        f"the archive does not say how long a communication step is; {window} is taken, --set "
        "window=... another one"
    )
    return window


def _step_sizes(root: Element) -> list[tuple[float, str]]:
    """Return communication steps [s] in annotations of the whole system, and who states them."""
    owners = [root, *root.findall(f"{SSD}DefaultExperiment"), *root.findall(f"{SSD}System")]
    steps = []
    for owner in owners:
        for annotation in owner.findall(f"{SSD}Annotations/{SSC}Annotation"):
            for element in annotation.iter():
                for key in STEP_SIZES:
                    size = _positive(element.get(key))
                    if size is not None:
                        name = element.tag.rpartition("}")[2]
                        steps.append((size, f"{key} of {name}, {annotation.get('type', '')}"))
    return steps


def _positive(text: str | None) -> float | None:
    try:
        number = float(text or "")
    except ValueError:
        return None
    return number if 0.0 < number < math.inf else None


def _load(folder: Path, name: str, path: Path) -> Element:
    file = folder / name
    if not file.is_file():
        raise InputError(f"the archive holds no {name}")
    return read_xml(file.read_bytes(), path if path.name == name else f"{path} ({name})")


def _described(folder: Path, source: str, scratch: Path) -> UnitDescription:
    file = folder / source
    if not file.is_file():
        raise InputError(f"the archive holds no {source}")
    inner = unpack(file, scratch / source.replace("/", "_"))
    return read_description(inner, Path(source))


def _unit_names(structure: Structure) -> dict[Place, str]:
    """Return names of the components that are valid for units in the file of a system."""
    names: dict[Place, str] = {}
    for place in structure.sources:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", "_".join(place))
        name = name if re.match(r"[A-Za-z]", name) else f"unit_{name}"
        unique, number = name, 2
        while unique in names.values():
            unique, number = f"{name}_{number}", number + 1
        names[place] = unique
        if unique != ".".join(place):
            structure.remarks.append(f'component "{".".join(place)}" is the unit "{unique}"')
    return names


def _experiment(root: Element, structure: Structure) -> TomlTable:
    """Return begin and end of the simulation."""
    experiment = root.find(f"{SSD}DefaultExperiment")
    times = {}
    for key, name in (("start_time", "startTime"), ("stop_time", "stopTime")):
        value = None if experiment is None else experiment.get(name)
        if value is not None:
            number_of(value, f"{name} of the DefaultExperiment")
            times[key] = f"{value} s"
    if "stop_time" not in times:
        end = f"{_seconds(times.get('start_time', '0 s')) + LENGTH!r} s"
        times["stop_time"] = end
        structure.end_remark = (
            f"the archive does not say when it ends; {end} is taken, --set stop_time=... another "
            "time"
        )
    return times


def _seconds(text: str) -> float:
    return float(text.removesuffix(" s"))


def _require_sizes(structure: Structure, descriptions: dict[Place, UnitDescription]) -> None:
    """Compare the dimensions of connectors with the arrays of their units.

    Raises
    ------
    InputError : they are of other sizes, or refer to what holds none.
    """
    for (place, name), sizes in structure.dimensions.items():
        if place not in structure.sources:
            continue
        description = descriptions[place]
        variable = description.variables.get(name)
        if variable is None or None in sizes:
            continue  # not used, or a size is left open
        stated = [
            size if isinstance(size, int) else _size_in(description, str(size)) for size in sizes
        ]
        if math.prod(stated) != variable.size:
            raise InputError(
                f"the connector {node_text((place, name))} is an array of "
                f"{' x '.join(map(str, stated))}, but the "
                f"variable of its unit has {variable.size} values; {_remedy(variable)}"
            )


def _kinds(structure: Structure, descriptions: dict[Place, UnitDescription]) -> dict[Node, str]:
    """Return kinds of connectors; of components those of the variables of their units."""
    kinds = dict(structure.connector_kinds)
    ends = [node for one in structure.connections for node in (one.start, one.end)]
    for node in (*kinds, *ends):
        place, name = node
        variable = _variable(descriptions[place], name) if place in descriptions else None
        if variable is not None:
            kinds[node] = variable.causality
    return kinds


def _variable(description: UnitDescription, name: str) -> Variable | None:
    """Return a variable or one value of a field of FMI 2; None where there is none."""
    return description.variables.get(name) or description.elements.get(name)


def _tell_other_kinds_and_units(
    structure: Structure, descriptions: dict[Place, UnitDescription]
) -> None:
    """Warn of connectors whose kind or unit of measurement is not that of their variable."""
    for node, kind in structure.connector_kinds.items():
        place, name = node
        variable = _variable(descriptions[place], name) if place in descriptions else None
        if variable is None:
            continue
        if kind not in ("", "unspecified", variable.causality):
            structure.remarks.append(
                f"the connector {node_text(node)} is of the kind {kind}, but the variable of its "
                f"unit is {variable.causality}, which is taken; correct the connector"
            )
        stated = structure.connector_units.get(node)
        if stated is None or variable.unit is None or stated == variable.unit.name:
            continue
        try:
            same = conversion(unit_from_name(stated, structure.measures), variable.unit).is_identity
        except UnitError:
            same = False
        if not same:
            structure.remarks.append(
                f"the connector {node_text(node)} is in {stated}, but the variable of its unit is "
                f"in {variable.unit.name}, which is taken; correct the connector"
            )


#: Types of values that reach a type as they are, beside the type itself.
_REACH = {"Real": ("Integer", "Boolean"), "Integer": ("Boolean",)}


def _tell_systems_that_do_not_fit(
    structure: Structure, descriptions: dict[Place, UnitDescription]
) -> None:
    """Warn of connectors of systems with a type or unit that no value of the other end has.

    Between components, these are errors later on.
    """

    def stated(node: Node) -> tuple[str | None, PhysicalUnit | None]:
        place, name = node
        variable = _variable(descriptions[place], name) if place in descriptions else None
        kind = structure.connector_types.get(node) if variable is None else type_of(variable)
        measure = None if variable is None else variable.unit
        if measure is None and node in structure.connector_units:
            with suppress(UnitError):
                measure = unit_from_name(structure.connector_units[node], structure.measures)
        return "Integer" if kind == "Enumeration" else kind, measure

    for end, (start, step) in structure.edges.items():
        if {start[0], end[0]} <= structure.sources.keys():
            continue
        (source, given), (target, taken) = stated(start), stated(end)
        reason = ""
        if source and target and source != target and source not in _REACH.get(target, ()):
            reason = f"{source} is no {target}"
        elif given and taken and step.convert_units:
            try:
                conversion(given, taken)
            except UnitError as error:
                reason = str(error)
        if reason:
            structure.remarks.append(
                f"the connection from {node_text(start)} to {node_text(end)} does not fit: "
                f"{reason}; correct the connector of the system"
            )


def _tell_other_types(structure: Structure, descriptions: dict[Place, UnitDescription]) -> None:
    """Warn of connectors whose type is not that of their variable, which the standard forbids."""
    for (place, name), stated in structure.connector_types.items():
        if place not in structure.sources:
            continue
        description = descriptions[place]
        variable = _variable(description, name)
        if variable is None or stated == variable.type_name == "Enumeration":
            continue
        if stated != type_of(variable):
            structure.remarks.append(
                f"the connector {node_text((place, name))} is {stated}, but the variable of its "
                f"unit is {variable.type_name}, which is taken; correct the connector"
            )


def _remedy(variable: Variable) -> str:
    """Return how an array can get another size."""
    owners = [owner for owner in variable.dimensions if isinstance(owner, str)]
    if owners:
        return f"give {', '.join(owners)} of the unit, which hold its size, other values"
    return "export the unit with that size"


def _size_in(description: UnitDescription, owner: str) -> int:
    """Return the size that a structural parameter or constant of a unit holds at its start."""
    variable = description.variables.get(owner)
    try:
        return int(variable.start[0])  # type: ignore[union-attr]
    except (AttributeError, IndexError, ValueError):
        raise InputError(
            f'the dimension by "{owner}" (sizeConnector) has no size in {description.model_name}'
        ) from None


def _links(
    structure: Structure, names: dict[Place, str], descriptions: dict[Place, UnitDescription]
) -> dict[str, TomlTable]:
    """Return the tables of connections by link; those of all scalars of two fields become one."""
    single: dict[tuple[Node, Node], TomlTable] = {}
    for start, end, step in structure.links():
        if start[0] not in structure.sources:
            continue  # an input of the whole system, which may have a start value
        kind = structure.not_exchanged.get(start) or structure.not_exchanged.get(end)
        if kind is not None:
            what = "binary values" if kind == "Binary" else "the ticks of a clock"
            structure.remarks.append(
                f"the connection from {node_text(start)} to {node_text(end)} carries {what}, which "
                "lcmchain cosim does not exchange: it is left out"
            )
            continue
        options: TomlTable = {}
        if step.factor != 1.0 or step.offset != 0.0:
            options = {"factor": step.factor, "offset": step.offset}
        if not step.convert_units:
            options["convert_units"] = False
        single[start, end] = options
    whole: dict[tuple[Node, Node], TomlTable] = {}
    counts: dict[tuple[Node, Node], int] = {}
    for start, end in single:
        fields = _fields(start, end, descriptions)
        if fields is not None:
            counts[fields] = counts.get(fields, 0) + 1
    for (start, end), options in single.items():
        fields = _fields(start, end, descriptions)
        if fields is None or any(
            descriptions[place].variables[name].size != counts[fields] for place, name in fields
        ):
            fields = start, end
        whole.setdefault(fields, options)
    links = {}
    for (start, end), options in whole.items():
        link = f"{names[start[0]]}.{start[1]} -> {names[end[0]]}.{end[1]}"
        links[link] = {"link": link, **options}
    return links


def _fields(
    start: Node, end: Node, descriptions: dict[Place, UnitDescription]
) -> tuple[Node, Node] | None:
    """Return the fields of FMI 2 that a connection belongs to, of scalars with the same index."""
    one, other = _field(start, descriptions), _field(end, descriptions)
    if one is None or other is None or _index(start) != _index(end):
        return None
    return (start[0], one), (end[0], other)


def _field(node: Node, descriptions: dict[Place, UnitDescription]) -> str | None:
    """Return the field of FMI 2 that a scalar belongs to."""
    description = descriptions[node[0]]
    name = node[1].partition("[")[0]
    return name if node[1] in description.elements and name in description.variables else None


def _index(node: Node) -> str:
    return node[1].partition("[")[2]


def _starts(
    structure: Structure,
    descriptions: dict[Place, UnitDescription],
) -> dict[Place, TomlTable]:
    """Return the start values of every component; later ones replace earlier ones."""
    starts: dict[Place, TomlTable] = {place: {} for place in structure.sources}
    fed: dict[Node, list[Node]] = {}
    for start, end, step in structure.links():
        if start[0] not in structure.sources:
            fed.setdefault(start, []).append(end)
            if not step.is_plain and any(node == start for node, _ in structure.values):
                raise InputError(
                    f"the value of {node_text(start)} is transformed on its way to a component, "
                    "which is not read; give the component its own value"
                )
    for node, given in structure.values:
        if given.kind == "Binary":
            structure.remarks.append(
                f"the binary value of {node_text(node)} is left out, as binary variables are"
            )
            continue
        targets = [node] if node[0] in structure.sources else fed.get(node, [])
        known = [
            target
            for target in targets
            if _variable(descriptions[target[0]], target[1]) is not None
        ]
        if not known:
            structure.remarks.append(f"the value of {node_text(node)} has no variable to go to")
        for place, name in known:
            variable = descriptions[place].find(name)
            measure = _measure_at(node, structure, variable)
            names = {**structure.measures, **descriptions[place].units}
            values = [_start(given, text, node, variable, measure, names) for text in given.texts]
            starts[place][name] = values if given.is_array else values[0]
    return starts


def _measure_at(node: Node, structure: Structure, variable: Variable) -> PhysicalUnit | None:
    """Return the unit of a connector, None where there is none.

    That of a connector of a system need not be that of the variable that its value goes to.
    """
    stated = structure.connector_units.get(node)
    if stated is None or (node[0] in structure.sources and variable.unit is not None):
        return variable.unit
    try:
        return unit_from_name(stated, structure.measures)
    except UnitError:
        return variable.unit


def _start(
    given: Given,
    text: str,
    node: Node,
    variable: Variable,
    measure: PhysicalUnit | None,
    known: Mapping[str, PhysicalUnit],
) -> bool | int | str | dict[str, float]:
    """Return a value, or one of an array, as the file of a system states it.

    Parameters
    ----------
    node, measure : the connector or variable that it is given for, and its unit.
    variable : that it goes to.
    known : units of measurement by name.

    Raises
    ------
    InputError : it is none of its type, or in a unit that does not fit.
    """
    if given.kind != "Real":
        return value_of_text(given, text, node_text(node))
    try:
        number = float(text)
    except ValueError:
        raise InputError(f'the value of {node_text(node)}, "{text}", is no {given.kind}') from None
    try:
        if not given.unit:
            return {"value": _in_unit_of(variable, number, measure)}
        if given.change is not None and measure is not None:
            own = given.measure or unit_from_name(given.unit, known)
            change = conversion(own, measure, relative=variable.relative).then(given.change)
            return {"value": _in_unit_of(variable, change.factor * number + change.offset, measure)}
    except UnitError as error:
        raise InputError(f"the value of {node_text(node)}: {error}") from None
    unit = given.measure
    if unit is None or is_usual(unit):
        return f"{number!r} {given.unit}"
    # a name with another meaning in the archive than usual is written in base units
    base = "*".join(f"{name}^{power:g}" for name, power in zip(BASE, unit.exponents) if power)
    value = unit.factor * number + (0.0 if variable.relative else unit.offset)
    return f"{value!r} {base}".strip()


def _in_unit_of(variable: Variable, number: float, measure: PhysicalUnit | None) -> float:
    if measure is None or variable.unit is None:
        return number
    change = conversion(measure, variable.unit, relative=variable.relative)
    return number if change.is_identity else change.factor * number + change.offset


def _quantities(structure: Structure, place: Place, description: UnitDescription) -> dict[str, str]:
    """Return units of measurement of connectors for variables to which the FMU gives none."""
    quantities = {}
    for (owner, name), unit in structure.connector_units.items():
        variable = description.variables.get(name)
        if owner == place and variable is not None and variable.is_real and variable.unit is None:
            try:
                unit_from_name(unit, structure.measures)
            except UnitError:
                structure.remarks.append(
                    f'the unit "{unit}" of {node_text((owner, name))} is not known'
                )
            else:
                quantities[name] = unit
    return quantities


def _annotation(root: Element) -> TomlTable:
    """Return the settings that an export of this program keeps in an annotation."""
    for annotation in root.findall(f"{SSD}Annotations/{SSC}Annotation"):
        if annotation.get("type") == ANNOTATION:
            text = next((text_of(child) for child in annotation), None)
            try:
                kept = json.loads(text or "{}")
            except ValueError:
                raise InputError(f"the annotation {ANNOTATION} is damaged; remove it") from None
            if isinstance(kept, dict) and all(
                isinstance(table, dict)
                for key in ("units", "connections")
                for table in (kept.get(key, {}), *_entries(kept.get(key)))
            ):
                return kept
            raise InputError(f"the annotation {ANNOTATION} is damaged; remove it")
    return {}


def _entries(table: object) -> Sequence[object]:
    return tuple(table.values()) if isinstance(table, dict) else ()


def _merge(data: TomlTable, kept: TomlTable) -> None:
    """Add the settings of an annotation: options of connections and units, scheme, windows."""
    for key in ("title", "window", "scheme", "recorder", "unit_tolerance"):
        if key in kept:
            data[key] = kept[key]
    options = kept.get("connections", {})
    data["connections"] = [
        {**(entry if isinstance(entry, dict) else {"link": entry}),
         **options.get(entry if isinstance(entry, str) else entry["link"], {})}
        for entry in data["connections"]
    ]  # fmt: skip
    for unit in data["units"]:
        unit |= kept.get("units", {}).get(unit["name"], {})
    order = list(kept.get("units", {}))
    data["units"].sort(key=lambda unit: order.index(unit["name"]) if unit["name"] in order else 0)
