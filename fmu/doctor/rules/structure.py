"""Rules of the model structure and of terminals: complete lists, variables that exist."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from lcmchain.fmu.doctor.rules.interface import INITIAL, Entry, Interface, Unknown, repeated, rule

LISTS = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")
_KINDS = ("dependent", "constant", "fixed", "tunable", "discrete")
_INITIAL_KINDS = ("dependent", "constant")


@rule(
    "outputs",
    "every output in the Outputs of the model structure, each once and nothing else",
    "FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8",
)
def outputs(interface: Interface) -> Iterator[str]:
    wanted = [entry for entry in interface.variables if entry.causality == "output"]
    yield from _differences(interface, interface.unknowns("Output"), wanted, "is no output")


@rule(
    "derivatives of states",
    "derivatives in the model structure that have derivative and are continuous, each once",
    "FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8",
)
def state_derivatives(interface: Interface) -> Iterator[str]:
    listed = interface.unknowns("ContinuousStateDerivative")
    wanted = [
        entry for unknown in listed if (entry := interface.known(unknown.of)) is not None
        and "derivative" in entry.attributes and entry.variability == "continuous"
    ]  # fmt: skip
    what = "is no continuous derivative of a state"
    yield from _differences(interface, listed, list(dict.fromkeys(wanted)), what)


@rule(
    "initial unknowns",
    "as InitialUnknowns all outputs, states and derivatives with initial approx or calculated and "
    "all calculated parameters, each once; in FMI 2.0 in ascending order, in FMI 3.0 clocked "
    "variables as the unit likes, event indicators never",
    "FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8",
)
def initial_unknowns(interface: Interface) -> Iterator[str]:
    listed = interface.unknowns("InitialUnknown")
    derivatives = {unknown.of for unknown in interface.unknowns("ContinuousStateDerivative")}
    dynamic = derivatives | set(interface.states)
    clocked = {e for e in interface.variables if "clocks" in e.attributes or e.kind == "Clock"}
    wanted = [
        entry for entry in interface.variables
        if entry not in clocked and (
            entry.causality == "calculatedParameter"
            or (entry.initial in ("approx", "calculated")
                and (entry.causality == "output" or interface.key(entry) in dynamic))
        )
    ]  # fmt: skip
    optional = {interface.key(entry) for entry in clocked} if interface.is_three else set()
    # those of an impossible variability are told by that rule
    optional |= {interface.key(e) for e in interface.variables if e.combination not in INITIAL}
    certain = [unknown for unknown in listed if unknown.of not in optional]
    yield from _differences(interface, certain, wanted, "is known at the start, or not exposed")
    for key in repeated(unknown.of for unknown in listed if unknown.of in optional):
        yield f"{interface.known(key)} stands there more than once"
    order = [unknown.of for unknown in listed]
    if not interface.is_three and order != sorted(order):
        yield "they are not in ascending order"
    indicators = {unknown.of for unknown in interface.unknowns("EventIndicator")}
    for unknown in listed:
        if unknown.of in indicators and unknown.of not in dynamic:
            yield f"{interface.known(unknown.of)} is an event indicator"


@rule(
    "dependencies",
    "dependencies on variables that there are, each once, with as many kinds; initial ones on "
    "inputs, on what is exact and on the independent variable, of the kinds dependent or constant",
    "FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8",
)
def dependencies(interface: Interface) -> Iterator[str]:
    for name in LISTS:
        for unknown in interface.unknowns(name):
            who = interface.known(unknown.of) or f"the entry {unknown.of}"
            for what in _dependency_problems(interface, unknown, name):
                yield f"{name} {who} {what}"


def _dependency_problems(interface: Interface, unknown: Unknown, name: str) -> Iterator[str]:
    """Yield what is wrong with the dependencies of an unknown."""
    dependencies = unknown.dependencies or ()
    known = [interface.known(key) for key in dependencies]
    if None in known:
        absent = next(key for key, entry in zip(dependencies, known, strict=True) if entry is None)
        yield f"depends on {absent}, which no variable is"
    for key in repeated(dependencies):
        yield f"depends on {interface.known(key)} twice"
    if unknown.kinds is not None:
        allowed = _INITIAL_KINDS if name == "InitialUnknown" else _KINDS
        if unknown.dependencies is None or len(unknown.kinds) != len(dependencies):
            yield f"has {len(unknown.kinds)} kinds of {len(dependencies)} dependencies"
        elif not set(unknown.kinds) <= set(allowed):
            yield f"has a kind of dependency other than {', '.join(allowed)}"
    for entry in known:
        if entry is None:
            continue
        if name == "InitialUnknown" and not _is_known_initially(entry):
            yield f"depends on {entry}, which is not known then"
        elif name != "InitialUnknown" and entry.causality == "calculatedParameter":
            yield f"depends on {entry}, a calculated parameter, which is none of the knowns"


def _is_known_initially(entry: Entry) -> bool:
    return entry.causality in ("input", "independent") or entry.initial == "exact"


@rule(
    "clocked states",
    "every variable with a previous value in the ClockedStates, each once, and event indicators "
    "that are continuous",
    "FMI 3.0.2, 2.4.8",
)
def clocked_states(interface: Interface) -> Iterator[str]:
    wanted = [entry for entry in interface.variables if "previous" in entry.attributes]
    listed = interface.unknowns("ClockedState") if interface.is_three else []
    if interface.is_three:
        yield from _differences(interface, listed, wanted, "has no previous value")
        for unknown in interface.unknowns("EventIndicator"):
            named = interface.known(unknown.of)
            if named is None or not named.is_real or named.variability != "continuous":
                yield f"the event indicator {named or unknown.of} is no continuous variable"


def _differences(
    interface: Interface, listed: list[Unknown], wanted: list[Entry], wrong: str
) -> Iterator[str]:
    """Yield what a list lacks, has twice, or has though it should not."""
    places = [unknown.of for unknown in listed]
    there, right = set(places), {interface.key(entry) for entry in wanted}
    for entry in wanted:
        if interface.key(entry) not in there:
            yield f"{entry} is missing"
    for key in dict.fromkeys(places):
        if key not in right:
            named = interface.known(key)
            yield f"{named} {wrong}" if named is not None else f"no variable is {key}"
    for key in repeated(places):
        yield f"{interface.known(key)} stands there more than once"


# --- terminals (FMI 3.0), which are described in a file of their own ------------------------------


#: Rules of matching that the standard defines; those of others have a name with dots.
MATCHING = ("plug", "bus", "sequence", "none")
FLOWS = ("inflow", "outflow")
#: Causalities of what a terminal exchanges.
EXCHANGED = ("input", "output", "parameter", "calculatedParameter")


@rule(
    "terminals",
    "terminals with names of their own and a rule of matching; members that are inputs, outputs or "
    "parameters, with names of their own where they are matched by name; one flow beside stream "
    "members",
    "FMI 3.0.2, 2.4.9",
)
def terminals(interface: Interface) -> Iterator[str]:
    root = interface.terminals
    if root is None:
        return
    if root.tag != "fmiTerminalsAndIcons":
        yield f"the file describes <{root.tag[:40]}>"
        return
    if not root.get("fmiVersion", "").startswith("3."):
        yield f'the file is of FMI "{root.get("fmiVersion", "")[:20]}"'
    yield from _level(interface, root.findall("Terminals/Terminal"), "")


def _level(interface: Interface, listed: list[Element], outer: str) -> Iterator[str]:
    for name in repeated(element.get("name", "") for element in listed):
        yield f'"{outer}{name}" stands twice'
    for element in listed:
        name = outer + element.get("name", "")
        matching = element.get("matchingRule", "")
        if matching not in MATCHING and "." not in matching:
            yield f'{name} has the rule "{matching[:40]}"'
        yield from _members(interface, element, name, matching)
        yield from _level(interface, element.findall("Terminal"), f"{name}.")


def _members(interface: Interface, element: Element, name: str, matching: str) -> Iterator[str]:
    members = element.findall("TerminalMemberVariable")
    streams = element.findall("TerminalStreamMemberVariable")
    if matching in ("plug", "bus"):
        names = [member.get("memberName", "") for member in members]
        names += [s.get(f"{way}StreamMemberName", "") for s in streams for way in ("in", "out")]
        if not all(names):
            yield f"{name} has a member without a name, which {matching} matches by"
        for twice in repeated(filter(None, names)):
            yield f'the member "{twice}" of {name} stands twice'
    flows = sum(member.get("variableKind") in FLOWS for member in members)
    if streams and flows > 1:
        yield f"{name} has {flows} flows beside stream members"
    used: list[tuple[str, tuple[str, ...]]] = [
        (member.get("variableName", ""), EXCHANGED) for member in members
    ]
    for stream in streams:
        used.append((stream.get("inStreamVariableName", ""), ("input", "parameter")))
        used.append((stream.get("outStreamVariableName", ""), ("output", "calculatedParameter")))
    for variable, allowed in used:
        entry = interface.by_name.get(variable)
        if entry is None:
            yield f'{name} has the variable "{variable[:60]}", which there is not'
        elif entry.causality not in allowed:
            yield f"{name} has {variable}, which is {entry.causality}"
