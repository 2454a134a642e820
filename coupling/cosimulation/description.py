"""What a unit is: its variables and fields, its abilities, and what depends on what.

It is read from ``modelDescription.xml`` and, in FMI 3.0, from the file of its terminals. That file
is optional: a unit runs without it. ``lcmchain cosim`` and ``lcmchain fmu doctor`` share the words
on what is left out of a unit.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.archive import read_xml
from lcmchain.coupling.cosimulation.physical_units import (
    BASE,
    PhysicalUnit,
    UnitError,
    display_unit,
    unit_from_base,
    unit_from_name,
)
from lcmchain.errors import InputError, shortened

if TYPE_CHECKING:
    from fmpy.model_description import Dimension, ModelDescription, ScalarVariable, Unknown

# --- variables: type, values in memory, unit of measurement ---------------------------------------

#: VariableValues (n,) of a variable in its own type; objects for texts.
VariableValues = NDArray[Any]

#: Types of numpy by the types of the standard; texts have none.
MEMORY = {
    "Real": "f8", "Integer": "i4", "Boolean2": "i4", "Enumeration2": "i4",
    "Float64": "f8", "Float32": "f4", "Int64": "i8", "UInt64": "u8", "Int32": "i4",
    "UInt32": "u4", "Int16": "i2", "UInt16": "u2", "Int8": "i1", "UInt8": "u1",
    "Enumeration": "i8", "Boolean": "?",
}  # fmt: skip
REALS = ("Real", "Float64", "Float32")
TEXT = "String"
TRUTHS = ("Boolean", "Boolean2")
#: Types of FMI 2 that have the name of another one of FMI 3; an Int32 ends in 2 as well.
OF_FMI2 = ("Boolean2", "Enumeration2")
#: Causality of the parameters that hold the sizes of arrays (FMI 3.0).
STRUCTURAL = "structuralParameter"
#: Types whose values are not exchanged.
LEFT_OUT = ("Binary", "Clock")


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable, or the scalars of FMI 2 that form one field.

    Parameters
    ----------
    name : of the variable; of a field of FMI 2 without the index.
    kind : its type in the standard; ``Boolean2`` and ``Enumeration2`` are those of FMI 2.
    references : value references (n,) in FMI 2, (1,) in FMI 3.
    size : number of its values.
    is_field : whether it is an array.
    start : texts of the start values, empty where there are none.
    unit : None where the description states none.
    relative : whether it measures differences.
    dimensions : of an array of FMI 3.0: numbers, and names of variables that hold them.
    limits : least and largest value of a structural parameter, None where there is no limit.
    """

    name: str
    kind: str
    causality: str
    variability: str
    initial: str | None
    references: NDArray[np.uint32]
    size: int
    is_field: bool
    start: tuple[str, ...] = ()
    unit: PhysicalUnit | None = None
    relative: bool = False
    description: str = ""
    dimensions: tuple[int | str, ...] = ()
    limits: tuple[float | None, float | None] = (None, None)

    @property
    def is_real(self) -> bool:
        return self.kind in REALS

    @property
    def is_text(self) -> bool:
        return self.kind == TEXT

    @property
    def is_signal(self) -> bool:
        """Whether it changes continuously; anything else changes at communication points."""
        return self.is_real and self.variability == "continuous"

    @property
    def dtype(self) -> np.dtype:
        """Return the type of its values in memory; objects for texts."""
        return np.dtype(object if self.is_text else MEMORY[self.kind])

    @property
    def type_name(self) -> str:
        """Name of its type in the standard."""
        return self.kind.removesuffix("2") if self.kind in OF_FMI2 else self.kind

    @property
    def unit_text(self) -> str:
        return "1" if self.unit is None else self.unit.name


# --- terminals of FMI 3.0: variables that belong together (FMI 3.0.2, 2.4.9) ----------------------

#: Where a unit of FMI 3.0 keeps its icons, and describes them and its terminals.
ICONS_FOLDER = "terminalsAndIcons"
TERMINALS_FILE = f"{ICONS_FOLDER}/terminalsAndIcons.xml"
#: Rules that match the members of two terminals: all by their names; those that both have, by their
#: names; all by their order.
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
    """A terminal.

    Parameters
    ----------
    name : of a nested terminal the whole path, ``outer.inner``.
    rule : by which its members are matched.
    has_streams : whether it has stream members, which are not connected here.
    """

    name: str
    rule: str
    members: tuple[Member, ...]
    has_streams: bool = False


def read_terminals(folder: Path, file: Path) -> dict[str, Terminal]:
    """Return the terminals of an unpacked unit by name.

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
    terminals: dict[str, Terminal] = {}
    for element in root.findall("Terminals/Terminal"):
        _read_terminal(element, "", terminals)
    return terminals


def _read_terminal(element: Element, outer: str, terminals: dict[str, Terminal]) -> None:
    """Add a terminal and those within it."""
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
    terminals[name] = Terminal(name, element.get("matchingRule", ""), members, streams)
    for inner in element.findall("Terminal"):
        _read_terminal(inner, f"{name}.", terminals)


# --- what is left out -----------------------------------------------------------------------------


#: Most names that a sentence lists.
MOST_NAMES = 5


def version_problem(version: str) -> str:
    """Return why units of a version of FMI are not read; empty where they are."""
    if re.fullmatch(r"2\.0|3\.\d+(\.\d+)?", version):
        return ""
    if re.match(r"[23]\..*[A-Za-z]", version):
        return (
            f'is of FMI "{version}", a draft whose interface is not that of the standard; 2.0 and '
            "3.0 are read: export it again for one of these"
        )
    return f'is of FMI "{version}"; 2.0 and 3.0 are read'


def names_twice(root: Element) -> list[str]:
    """Return the names that stand in a model description more than once."""
    names = [entry.get("name", "") for entry in root.find("ModelVariables") or ()]
    return [name for name, count in Counter(names).items() if count > 1]


def left_out(root: Element) -> list[str]:
    """Return sentences on what is left out of a unit, from the root of its model description."""
    variables = list(root.find("ModelVariables") or ())
    clocks = [v.get("name", "") for v in variables if v.tag == "Clock"]
    clocked = [v.get("name", "") for v in variables if v.tag != "Clock" and v.get("clocks")]
    binary = [v.get("name", "") for v in variables if v.tag == "Binary"]
    twice = names_twice(root)
    sentences = []
    if clocks:
        sentences.append(
            f"its clocks ({_some(clocks)}) do not tick, because lcmchain cosim offers none: what "
            "waits for them stands still" + (f" ({_some(clocked)})" if clocked else "")
        )
    if binary:
        sentences.append(f"its binary variables ({_some(binary)}) are left out")
    if twice:
        sentences.append(
            f"the names of variables are not unique ({_some(twice)}): lcmchain cosim cannot "
            "connect or set these; give each its own name"
        )
    return sentences


# --- fields of FMI 2.0: scalars name[1], name[2], ... are the values of one variable --------------


_INDEXED = re.compile(r"(.+)\[(\d+(?:,\s*\d+)*)\]")


def with_fields(
    scalars: Sequence[Variable],
) -> tuple[dict[str, Variable], dict[str, Variable], dict[str, str]]:
    """Join the scalars ``name[1]``, ``name[2]``... to fields, in the order of their indices.

    Returns
    -------
    Variables by name, scalars within fields by name, and the names of the fields of these scalars.
    """
    groups: dict[str, list[tuple[tuple[int, ...], Variable]]] = {}
    for scalar in scalars:
        match = _INDEXED.fullmatch(scalar.name)
        if match is not None:
            index = tuple(int(number) for number in match[2].split(","))
            groups.setdefault(match[1], []).append((index, scalar))
    taken = {scalar.name for scalar in scalars}
    fields: dict[str, Variable] = {}
    for name, members in groups.items():
        if name not in taken and _is_field(members):
            fields[name] = _joined(name, [scalar for _, scalar in sorted(members, key=_index)])
    variables: dict[str, Variable] = {}
    elements: dict[str, Variable] = {}
    owner: dict[str, str] = {}
    for scalar in scalars:
        match = _INDEXED.fullmatch(scalar.name)
        if match is not None and match[1] in fields:
            variables.setdefault(match[1], fields[match[1]])
            elements[scalar.name] = scalar
            owner[scalar.name] = match[1]
        else:
            variables[scalar.name] = scalar
    return variables, elements, owner


def _index(member: tuple[tuple[int, ...], Variable]) -> tuple[int, ...]:
    return member[0]


def _is_field(members: Sequence[tuple[tuple[int, ...], Variable]]) -> bool:
    """Whether the indices fill an array that begins at 0 or 1, and the scalars are alike."""
    indices = [index for index, _ in members]
    ranks = {len(index) for index in indices}
    alike = {(v.kind, v.causality, v.variability, v.unit) for _, v in members}
    if len(ranks) != 1 or len(alike) != 1 or len(set(indices)) != len(indices):
        return False
    least, most = np.min(indices, axis=0), np.max(indices, axis=0)
    return bool(np.all(least <= 1) and np.prod(most - least + 1) == len(indices))


def _joined(name: str, members: Sequence[Variable]) -> Variable:
    first = members[0]
    starts = [scalar.start for scalar in members]
    text = re.sub(r",? (element|cell|node|value|nr\.?|no\.?|index)? ?\d+$", "", first.description)
    return Variable(
        name,
        first.kind,
        first.causality,
        first.variability,
        first.initial,
        np.concatenate([scalar.references for scalar in members]),
        len(members),
        True,
        tuple(text for start in starts for text in start) if all(starts) else (),
        first.unit,
        first.relative,
        text,
    )


# --- the unit -------------------------------------------------------------------------------------


MODEL_DESCRIPTION = "modelDescription.xml"
#: What fmpy says where a name stands twice.
_NOT_UNIQUE = "is not unique"


@dataclass(frozen=True, eq=False)
class UnitDescription:
    """What a model description says; scalars of FMI 2 that form a field are one variable.

    Parameters
    ----------
    depends, depends_initially : the inputs that an output depends on directly, by its name, in
        steps and in the initialisation. An output that is missing there may depend on all.
    internal_step : step of a unit whose steps are fixed [s].
    only_once : whether a process can hold one instance only.
    elements : scalars of FMI 2 within fields, by name.
    units : units of measurement that the description defines, by name.
    ambiguous : names that two variables have.
    terminals : of FMI 3.0, by name.
    """

    model_name: str
    fmi_version: str
    major: int
    model_identifier: str
    token: str
    generation_tool: str
    variables: dict[str, Variable]
    depends: dict[str, frozenset[str]]
    depends_initially: dict[str, frozenset[str]]
    can_save: bool
    can_serialise: bool
    variable_steps: bool
    internal_step: float | None
    only_once: bool
    needs_tool: bool
    remarks: list[str] = field(default_factory=list)
    elements: dict[str, Variable] = field(default_factory=dict)
    log_categories: tuple[str, ...] = ()
    units: dict[str, PhysicalUnit] = field(default_factory=dict)
    ambiguous: frozenset[str] = frozenset()
    terminals: dict[str, Terminal] = field(default_factory=dict)

    def find(self, name: str) -> Variable:
        """Return a variable, a field, or one value of a field of FMI 2.

        Raises
        ------
        InputError : there is none, or two of that name; names the nearest.
        """
        if name in self.ambiguous:
            raise InputError(
                f'{self.model_name} has more than one variable "{shortened(name)}"; export it with '
                "a name of its own for each"
            )
        variable = self.variables.get(name) or self.elements.get(name)
        if variable is not None:
            return variable
        close = difflib.get_close_matches(name, self.variables, n=1, cutoff=0.5)
        known = [v.name for v in self.variables.values() if v.causality in ("input", "output")]
        hint = f'did you mean "{close[0]}"?' if close else f"there are {_some(known, 8)}"
        raise InputError(f'{self.model_name} has no variable "{shortened(name)}"; {hint}')


def read_description(folder: Path, file: Path) -> UnitDescription:
    """Read the model description of an unpacked unit.

    Parameters
    ----------
    folder : where it is unpacked.
    file : its archive, for messages.

    Raises
    ------
    InputError : no unit for co-simulation of FMI 2.0 or 3.0, or a description that cannot be read.
    """
    path = folder / MODEL_DESCRIPTION
    if not path.is_file():
        raise InputError(
            f"is no functional mock-up unit: it holds no {MODEL_DESCRIPTION}", file=file
        )
    root = read_xml(path.read_bytes(), f"{file} ({MODEL_DESCRIPTION})")
    version = root.get("fmiVersion", "")
    problem = version_problem(version)
    if problem:
        raise InputError(problem, file=file)
    if root.find("CoSimulation") is None:
        raise InputError(
            "offers no co-simulation (model exchange needs a solver, which no master here has); "
            "export it for co-simulation",
            file=file,
        )
    parsed, remarks = _parsed(path, file)
    twice = names_twice(root)
    remarks = left_out(root) + [text for text in remarks if not (twice and _NOT_UNIQUE in text)]
    ability = parsed.coSimulation
    identifier = ability.modelIdentifier or ""
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        raise InputError(
            f'its model identifier "{shortened(identifier)}" is no name of a library', file=file
        )
    major = int(version[0])
    units = _units(parsed)
    defined = {name: unit for name, unit in units.items() if unit is not None}
    relative, limits = _relative_names(root), _structural_limits(root)
    scalars = [
        _variable(entry, major, units, relative, limits, remarks)
        for entry in parsed.modelVariables
        if entry.type not in LEFT_OUT and entry.causality != "independent"
    ]
    variables, elements, owner = with_fields(scalars) if major == 2 else (
        {v.name: v for v in scalars}, {}, {}
    )  # fmt: skip
    return UnitDescription(
        parsed.modelName or identifier,
        version,
        major,
        identifier,
        parsed.guid or "",
        parsed.generationTool or "",
        variables,
        _dependencies(parsed.outputs, owner),
        _dependencies(parsed.initialUnknowns, owner),
        can_save=_true(ability.canGetAndSetFMUstate),
        can_serialise=_true(ability.canSerializeFMUstate),
        variable_steps=_true(ability.canHandleVariableCommunicationStepSize),
        internal_step=_number(getattr(ability, "fixedInternalStepSize", None)),
        only_once=_true(ability.canBeInstantiatedOnlyOncePerProcess),
        needs_tool=_true(ability.needsExecutionTool),
        remarks=remarks,
        elements=elements,
        log_categories=tuple(category.name for category in parsed.logCategories),
        units=_displayed(root, defined) | defined,
        ambiguous=frozenset(twice),
        terminals=_terminals(folder, file, remarks) if major == 3 else {},
    )


def _terminals(folder: Path, file: Path, remarks: list[str]) -> dict[str, Terminal]:
    """Return the terminals; damage is only a remark, because the unit runs without them."""
    try:
        return read_terminals(folder, file)
    except InputError as error:
        remarks.append(f"its terminals are left out: {error.message}")
        return {}


def _parsed(path: Path, file: Path) -> tuple[ModelDescription, list[str]]:
    """Parse with fmpy; a fault against the schema is a remark where it can be read all the same."""
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    try:
        return read_model_description(str(path)), []
    except ValidationError as error:
        remarks = [f"its {MODEL_DESCRIPTION} is not valid: {problem}" for problem in error.problems]
    except Exception as error:  # fmpy raises plain exceptions
        raise InputError(f"its {MODEL_DESCRIPTION} cannot be read: {error}", file=file) from None
    try:
        return read_model_description(str(path), validate=False), remarks[:3]
    except Exception:
        raise InputError(remarks[0], file=file) from None


def _true(value: bool | str | None) -> bool:
    return value is True or str(value).lower() in ("true", "1")


def _number(value: str | float | None) -> float | None:
    return None if value is None else float(value)


def _units(parsed: ModelDescription) -> dict[str, PhysicalUnit | None]:
    """Return the units that a description defines; None for one that is not known."""
    units: dict[str, PhysicalUnit | None] = {}
    for unit in parsed.unitDefinitions:
        base = unit.baseUnit
        try:
            if base is None:
                units[unit.name] = unit_from_name(unit.name)
            else:
                exponents = tuple(float(getattr(base, name)) for name in BASE)
                units[unit.name] = unit_from_base(
                    unit.name, exponents, float(base.factor), float(base.offset)
                )
        except UnitError:
            units[unit.name] = None
    return units


def _displayed(root: Element, defined: dict[str, PhysicalUnit]) -> dict[str, PhysicalUnit]:
    """Return the units in which values may be shown; a name that means two is left out."""
    meanings: dict[str, set[PhysicalUnit]] = {}
    for unit in root.findall("UnitDefinitions/Unit"):
        for shown in unit.findall("DisplayUnit"):
            name, of = shown.get("name", ""), defined.get(unit.get("name", ""))
            if of is None or shown.get("inverse") in ("true", "1"):
                continue
            with suppress(UnitError, ValueError):
                factor, offset = float(shown.get("factor", 1)), float(shown.get("offset", 0))
                meanings.setdefault(name, set()).add(display_unit(name, of, factor, offset))
    return {name: units.pop() for name, units in meanings.items() if len(units) == 1}


def _relative_names(root: Element) -> frozenset[str]:
    """Return the variables that measure differences, which fmpy does not read."""
    return frozenset(
        entry.get("name", "")
        for entry in root.find("ModelVariables") or ()
        if any(element.get("relativeQuantity") in ("true", "1") for element in (entry, *entry))
    )


def _variable(
    entry: ScalarVariable,
    major: int,
    units: dict[str, PhysicalUnit | None],
    relative: frozenset[str],
    limits: dict[str, tuple[float | None, float | None]],
    remarks: list[str],
) -> Variable:
    kind = entry.type
    if major == 2 and kind in ("Boolean", "Enumeration"):
        kind += "2"
    declared = entry.declaredType
    name = entry.unit or (declared.unit if declared is not None else None)
    unit = None
    if name is not None:
        if name not in units:
            try:
                units[name] = unit_from_name(name)
            except UnitError:
                units[name] = None
        unit = units[name]
        remark = f'its unit "{name}" is not known; values are taken as they are'
        if unit is None and remark not in remarks:
            remarks.append(remark)
    size = int(np.prod(entry.shape)) if entry.shape else 1
    start = entry.start
    texts: tuple[str, ...] = ()
    if start is not None:
        texts = (start,) if kind == TEXT or not entry.shape else tuple(str(start).split())
    return Variable(
        entry.name,
        kind,
        entry.causality,
        entry.variability,
        entry.initial,
        np.array([entry.valueReference], dtype=np.uint32),
        size,
        bool(entry.shape),
        texts,
        unit,
        entry.name in relative or bool(declared is not None and declared.relativeQuantity),
        entry.description or "",
        tuple(_dimension(dimension) for dimension in entry.dimensions),
        limits.get(entry.name, (None, None)),
    )


def _dimension(dimension: Dimension) -> int | str:
    """Return the size of a dimension, or the name of the variable that holds it."""
    return int(dimension.start) if dimension.start is not None else str(dimension.variable.name)


def _structural_limits(root: Element) -> dict[str, tuple[float | None, float | None]]:
    """Return least and largest values of structural parameters, which fmpy does not read."""
    return {
        entry.get("name", ""): (_limit(entry.get("min")), _limit(entry.get("max")))
        for entry in root.find("ModelVariables") or ()
        if entry.get("causality") == STRUCTURAL
    }


def _limit(text: str | None) -> float | None:
    """Return a limit as a number; a text that is no number limits nothing."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def _dependencies(unknowns: Sequence[Unknown], owner: dict[str, str]) -> dict[str, frozenset[str]]:
    """Return the inputs that outputs depend on, fields by their names.

    An output without a statement is left out.
    """
    inputs: dict[str, set[str] | None] = {}
    for unknown in unknowns:
        name = owner.get(unknown.variable.name, unknown.variable.name)
        if unknown.dependencies is None:
            inputs[name] = None
        elif inputs.get(name, set()) is not None:
            names = {owner.get(entry.name, entry.name) for entry in unknown.dependencies}
            inputs[name] = (inputs.get(name) or set()) | names
    return {name: frozenset(names) for name, names in inputs.items() if names is not None}


def _some(names: Sequence[str], most: int = MOST_NAMES) -> str:
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown
