"""Rules of single variables: causality, variability, start values, limits, types, names."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator

from lcmchain.fmu.doctor.rules.interface import (
    FLAGS,
    INITIAL,
    Entry,
    Interface,
    flag,
    number,
    repeated,
    rule,
    whole,
)

#: Numbers that whole types hold, by the name of the type.
_RANGES = {
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "Integer": (-(2**31), 2**31 - 1),
    "Enumeration": (-(2**63), 2**63 - 1),
}
_TRUTHS = ("true", "false", "0", "1")

# Structured names: FMI 2.0.5, 2.2.9; FMI 3.0.2, 2.4.7.5.1.
_QUOTED = r"""'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_WORD = rf"(?:[A-Za-z_][A-Za-z0-9_]*|{_QUOTED})"
_INDEXED = rf"{_WORD}(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_INDEXED}(?:\.{_INDEXED})*"
_STRUCTURED = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)")


@rule(
    "variability",
    "a variability that goes with causality and type: parameters fixed or tunable, inputs discrete "
    "or continuous, only reals continuous",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def variability(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        if entry.combination not in INITIAL or (
            entry.causality == "structuralParameter" and not interface.is_three
        ):
            yield f"{entry} is {entry.causality}, {entry.variability}"
        elif entry.variability == "continuous" and not entry.is_real:
            yield f"{entry} is continuous, but {entry.kind}"
        elif entry.kind == "Clock" and entry.variability != "discrete":
            yield f"the clock {entry} is {entry.variability}"


@rule(
    "initial",
    "an initial that goes with causality and variability, and none for the independent variable, "
    "nor for inputs in FMI 2.0",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, table of initial",
)
def initial(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        given = entry.attributes.get("initial")
        if given is None or entry.combination not in INITIAL:
            continue
        allowed = INITIAL[entry.combination]
        if entry.causality == "input" and not interface.is_three:
            allowed = ()
        if given not in allowed:
            yield f'{entry} is {entry.causality}, {entry.variability} with initial "{given}"'


@rule(
    "start",
    "a start value for inputs and where initial is exact or approx, and none where it is "
    "calculated or for the independent variable",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def start(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        if entry.kind == "Clock":
            continue
        wanted = entry.causality == "input" or entry.initial in ("exact", "approx")
        if wanted and entry.start is None:
            what = "an input" if entry.causality == "input" else f"initial {entry.initial}"
            yield f"{entry} has no start value, but is {what}"
        if not wanted and entry.start is not None and entry.combination in INITIAL:
            what = "the independent one" if not entry.initial else f"initial {entry.initial}"
            yield f"{entry} has a start value, but is {what}"


@rule(
    "start type",
    "start values of the variable's type, within its limits",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def start_type(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        for text in entry.start or ():
            problem = _problem(interface, entry, text)
            if problem:
                yield f'the start value "{text[:40]}" of {entry} {problem}'
                break


def _problem(interface: Interface, entry: Entry, text: str) -> str:
    """Return what is wrong with a start value; nothing if it fits."""
    if entry.kind == "Boolean":
        return "" if text in _TRUTHS else "is neither true nor false"
    value: float | None
    if entry.kind in _RANGES:
        if not re.fullmatch(r"[+-]?[0-9]+", text):
            return f"is no {entry.kind}"
        value = int(text)
        low, high = _RANGES[entry.kind]
        if not low <= value <= high:
            return f"is beyond the range of {entry.kind}"
    elif entry.is_real:
        value = number(text)
        if value is None:
            return "is no number"
    else:
        return ""
    least, most = (number(interface.effective(entry, name)) for name in ("min", "max"))
    if least is not None and most is not None and least > most:
        return ""  # told by "limits"
    if (least is not None and value < least) or (most is not None and value > most):
        return "is beyond min and max"
    return ""


@rule("limits", "min and max that are numbers of the type, min not above max",
      "FMI 2.0.5, 2.2.3; FMI 3.0.2, 2.4.4")  # fmt: skip
def limits(interface: Interface) -> Iterator[str]:
    for what, kind, (least, most) in interface.stated("min", "max"):
        low, high = _RANGES.get(kind, (-math.inf, math.inf))
        values = [number(text) for text in (least, most) if text is not None]
        if any(value is None or not low <= value <= high for value in values):
            yield f"{what} has limits that are no {kind} ({least} to {most})"
        elif len(values) == 2 and values[0] > values[1]:  # type: ignore[operator]
            yield f"{what} has min {least} above max {most}"


@rule(
    "independent variable",
    "one independent variable (in FMI 2.0 at most one), a real one",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def independent(interface: Interface) -> Iterator[str]:
    entries = [entry for entry in interface.variables if entry.causality == "independent"]
    if len(entries) > 1:
        yield f"{' and '.join(map(str, entries[:3]))} are independent"
    if not entries and interface.is_three:
        yield "no variable is independent"
    for entry in entries:
        if not entry.is_real:
            yield f"the independent {entry} is {entry.kind}"


@rule(
    "declared types",
    "declared types that are defined, of the variable's own kind; one for every enumeration",
    "FMI 2.0.5, 2.2.3; FMI 3.0.2, 2.4.4",
)
def declared_types(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        name = entry.attributes.get("declaredType")
        if name is None:
            if entry.kind == "Enumeration":
                yield f"the enumeration {entry} has no declared type"
        elif name not in interface.types:
            yield f'the type "{name}" of {entry} is not defined'
        elif interface.types[name][0] != entry.kind:
            yield f'{entry} is {entry.kind}, but its type "{name}" is {interface.types[name][0]}'


@rule(
    "units of measurement",
    "units and display units that are defined; a display unit only beside a unit, whose it is",
    "FMI 2.0.5, 2.2.2; FMI 3.0.2, 2.4.3",
)
def units(interface: Interface) -> Iterator[str]:
    told: set[str] = set()
    refused: set[tuple[str | None, str]] = set()
    for what, _, (unit, shown) in interface.stated("unit", "displayUnit"):
        if unit is not None and unit not in interface.units and unit not in told:
            told.add(unit)
            yield f'the unit "{unit}" of {what} is not defined'
        if shown is None or (unit, shown) in refused:
            continue
        element = None if unit is None else interface.units.get(unit)
        names = [e.get("name") for e in (() if element is None else element.iter("DisplayUnit"))]
        if shown not in names:
            refused.add((unit, shown))
            yield f'the display unit "{shown}" of {what} is none of its unit "{unit or ""}"'


@rule(
    "names",
    "names without line breaks; structured ones (variableNamingConvention) by their grammar, der() "
    "of reals",
    "FMI 2.0.5, 2.2.9; FMI 3.0.2, 2.4.7.5",
)
def names(interface: Interface) -> Iterator[str]:
    structured = interface.root.get("variableNamingConvention", "flat") == "structured"
    for entry in interface.variables:
        for name in (entry.name, *(alias.get("name", "") for alias in entry.aliases)):
            if not name or re.search(r"[\r\n\t]", name):
                yield f"{entry} has an empty name, or one with line breaks"
            elif structured and not _STRUCTURED.fullmatch(name):
                yield f"{name} is no structured name"
            elif structured and name.startswith("der(") and not entry.is_real:
                yield f"{name} is {entry.kind}"


@rule(
    "value references",
    "a value reference for every variable, in FMI 3.0 each its own",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def value_references(interface: Interface) -> Iterator[str]:
    same: defaultdict[int, list[Entry]] = defaultdict(list)
    for entry in interface.variables:
        if 0 <= entry.reference < 2**32:
            same[entry.reference].append(entry)
        else:
            yield f"{entry} has no value reference"
    for reference, group in same.items():
        if interface.is_three and len(group) > 1:
            yield f"{reference} is that of {' and '.join(map(str, group[:3]))}"


@rule(
    "aliases",
    "aliases (in FMI 2.0 variables of one type and value reference) of which one can be set and "
    "has a start value, all or none constant, of one unit; in FMI 3.0 with names of their own",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.5",
)
def aliases(interface: Interface) -> Iterator[str]:
    if interface.is_three:
        own = [entry.name for entry in interface.variables]
        others = [alias.get("name", "") for entry in interface.variables for alias in entry.aliases]
        for name in sorted(set(repeated([*dict.fromkeys(own), *others])), key=str):
            yield f'the name "{name}" of an alias is that of another variable'
        for entry in interface.variables:
            shown = any("displayUnit" in alias for alias in entry.aliases)
            if shown and interface.effective(entry, "unit") is None:
                yield f"an alias of {entry} has a display unit, {entry} no unit"
        return
    groups: defaultdict[tuple[str, int], list[Entry]] = defaultdict(list)
    for entry in interface.variables:
        if entry.reference >= 0:
            groups[entry.kind, entry.reference].append(entry)
    for group in groups.values():
        if len(group) > 1:
            who = " and ".join(map(str, group[:3]))
            yield from (f"{who} {what}" for what in _alias_problems(interface, group))


def _alias_problems(interface: Interface, group: list[Entry]) -> Iterator[str]:
    """Yield what is wrong with variables of FMI 2.0 that share a value reference."""
    varying = [entry for entry in group if entry.variability != "constant"]
    settable = [
        entry for entry in varying
        if entry.causality == "input" or entry.initial in ("exact", "approx")
    ]  # fmt: skip
    if varying and len(varying) < len(group):
        yield "share a value, but only some are constant"
    if len(settable) > 1:
        yield "share a value, but more than one can be set"
    elif len([entry for entry in varying if entry.start is not None]) > 1:
        yield "share a value, but more than one has a start value"
    if settable and any(entry.causality == "independent" for entry in group):
        yield "share a value, which is both settable and independent"
    if not varying and len({entry.start for entry in group}) > 1:
        yield "share a constant, but have different start values"
    if len({interface.effective(entry, "unit") for entry in group if entry.is_real}) > 1:
        yield "share a value, but have different units"


@rule(
    "setting more than once",
    "canHandleMultipleSetPerTimeInstant for inputs alone, in FMI 2.0 only of model exchange",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def multiple_sets(interface: Interface) -> Iterator[str]:
    exchanged = interface.root.find("ModelExchange") is not None
    for entry in interface.variables:
        given = entry.attributes.get("canHandleMultipleSetPerTimeInstant")
        if given is not None and entry.causality != "input":
            yield f"{entry} is {entry.causality}"
        elif given is not None and not (interface.is_three or exchanged):
            yield f"{entry} is of a unit for co-simulation alone"


@rule(
    "derivatives and restarts",
    "derivative of another, continuous real variable; reinit for continuous states of model "
    "exchange",
    "FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7.4",
)
def derivatives(interface: Interface) -> Iterator[str]:
    references = set()
    for entry in interface.variables:
        if "derivative" not in entry.attributes:
            continue
        of = interface.known(whole(entry.attributes["derivative"]))
        if of is None or of is entry:
            yield f"{entry} is the derivative of no other variable"
        elif not (entry.is_real and of.is_real) or of.variability != "continuous":
            yield f"{entry} is the derivative of {of}, which is not continuous"
        else:
            references.add(of.number)
    exchanged = interface.root.find("ModelExchange") is not None
    for entry in interface.variables:
        if "reinit" in entry.attributes and not (exchanged and entry.number in references):
            yield f"{entry} has reinit, but is no continuous state of model exchange"


@rule(
    "dimensions",
    "dimensions by a start, or by the reference of a constant or structural parameter (UInt64) of "
    "a positive start; structural parameters without dimensions; one start value, or one for every "
    "entry",
    "FMI 3.0.2, 2.4.7.3",
)
def dimensions(interface: Interface) -> Iterator[str]:
    for entry in interface.variables:
        if entry.dimensions and entry.causality == "structuralParameter":
            yield f"the structural parameter {entry} has dimensions"
            continue
        sizes = [size_of(interface, dimension) for dimension in entry.dimensions]
        problem = next((size for size in sizes if isinstance(size, str)), None)
        if problem is not None:
            yield f"{entry} has a dimension {problem}"
            continue
        count = math.prod(size for size in sizes if not isinstance(size, str))
        if interface.is_three and entry.start is not None and len(entry.start) not in (1, count):
            yield f"{entry} has {count} entries, but {len(entry.start)} start values"


def size_of(interface: Interface, dimension: dict[str, str]) -> int | str:
    """Return the size of a dimension, or what is wrong with it."""
    text = dimension.get("start")
    if (text is None) == ("valueReference" not in dimension):
        return "with neither or both of start and valueReference"
    if text is None:
        owner = interface.by_reference.get(whole(dimension["valueReference"]))
        if owner is None:
            return "by a value reference that no variable has"
        if owner.causality != "structuralParameter" and owner.variability != "constant":
            return f"by {owner}, which is neither constant nor a structural parameter"
        if owner.kind != "UInt64":
            return f"by {owner}, which is {owner.kind} and not UInt64"
        text = owner.start[0] if owner.start is not None and len(owner.start) == 1 else ""
    if not re.fullmatch(r"\+?0*[1-9][0-9]*", text):
        return f'of the size "{text}"'
    return int(text)


@rule(
    "clocks",
    "clocks with an interval that goes with intervalVariability, inside a unit with event mode; "
    "clocked variables that are discrete or tunable and name clocks; a priority for input clocks "
    "of scheduled execution, and none for output clocks",
    "FMI 3.0.2, 2.2.8 and 2.4.4",
)
def clocks(interface: Interface) -> Iterator[str]:
    entries = [entry for entry in interface.variables if entry.kind == "Clock"]
    scheduled = interface.root.find("ScheduledExecution") is not None
    for entry in entries:
        yield from (f"the clock {entry} {what}" for what in _clock_problems(interface, entry))
        has_priority = interface.effective(entry, "priority") is not None
        if scheduled and entry.causality == "input" and not has_priority:
            yield f"the input clock {entry} has no priority"
        if has_priority and entry.causality == "output":
            yield f"the output clock {entry} has a priority"
    together = interface.root.find("CoSimulation")
    if entries and together is not None and not flag(together, "hasEventMode"):
        yield "the unit has clocks, but not hasEventMode"
    for entry in interface.variables:
        texts = entry.attributes.get("clocks", "").split()
        named = [interface.by_reference.get(whole(text)) for text in texts]
        if any(clock is None or clock.kind != "Clock" for clock in named):
            yield f"{entry} names clocks that are none"
        if named and entry.variability not in ("discrete", "tunable"):
            yield f"the clocked {entry} is {entry.variability}"


def _clock_problems(interface: Interface, entry: Entry) -> Iterator[str]:
    """Yield what is wrong with the interval of a clock."""
    kind = interface.effective(entry, "intervalVariability")
    decimal = interface.effective(entry, "intervalDecimal")
    counter = interface.effective(entry, "intervalCounter")
    periodic = kind in ("constant", "fixed", "tunable")
    if kind not in ("constant", "fixed", "tunable", "changing", "countdown", "triggered"):
        yield "has no intervalVariability"
    if entry.causality not in ("input", "output", "local"):
        yield f"is {entry.causality}"
    if kind == "constant" and decimal is None and counter is None:
        yield "is constant, but without intervalDecimal"
    for name in ("intervalDecimal", "intervalCounter"):
        text = interface.effective(entry, name)
        value = number(text)
        if text is not None and not periodic:
            yield f"has {name}, but is {kind}"
        elif text is not None and (value is None or value <= 0.0):
            yield f"has {name} {text}"
    if counter is not None and interface.effective(entry, "supportsFraction") not in FLAGS:
        yield "has intervalCounter, but not supportsFraction"
    if counter is not None and interface.effective(entry, "resolution") is None:
        yield "has intervalCounter, but no resolution"
    for shift, base in (("shiftDecimal", decimal), ("shiftCounter", counter)):
        value = number(interface.effective(entry, shift))
        if value is not None and (base is None or value < 0.0):
            yield f"has {shift}, but no interval for it, or a negative one"


@rule(
    "previous values",
    "previous of clocked, discrete variables, each naming another discrete variable of its type, "
    "no input; intermediateUpdate of continuous ones",
    "FMI 3.0.2, 2.4.7.4",
)
def previous(interface: Interface) -> Iterator[str]:
    keys = []
    for entry in interface.variables:
        if entry.attributes.get("intermediateUpdate") in FLAGS and (
            entry.variability != "continuous"
        ):
            yield f"{entry} has intermediateUpdate, but is {entry.variability}"
        if "previous" not in entry.attributes:
            continue
        key = whole(entry.attributes["previous"])
        keys.append(key)
        of = interface.by_reference.get(key)
        if of is None or of is entry or of.kind != entry.kind or of.causality == "input":
            yield f"the previous value of {entry} is no other variable of its type"
        elif "discrete" != of.variability or entry.variability != "discrete":
            yield f"{entry} and its previous value {of} are not discrete"
        if "clocks" not in entry.attributes:
            yield f"{entry} has a previous value, but no clocks"
    for key in repeated(keys):
        yield f"{interface.by_reference.get(key)} is the previous value of more than one"
