"""A rule of the standard, and a model description as rules read it.

FMI 2.0 and 3.0 are read alike, and defaults are filled in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar
from xml.etree.ElementTree import Element

Key = TypeVar("Key", str, int)

REALS = ("Real", "Float64", "Float32")
FLAGS = ("true", "1")

#: Values of ``initial`` that causality and variability allow, the default first; none where the
#: attribute does not apply. Pairs that are not here are not allowed (FMI 2.0.5, 2.2.7; FMI 3.0.2,
#: 2.4.7.4). Inputs have none in FMI 2.0.
INITIAL: dict[tuple[str, str], tuple[str, ...]] = {
    **dict.fromkeys(
        ((c, v) for c in ("structuralParameter", "parameter") for v in ("fixed", "tunable")),
        ("exact",),
    ),
    **dict.fromkeys(
        ((c, v) for c in ("calculatedParameter", "local") for v in ("fixed", "tunable")),
        ("calculated", "approx"),
    ),
    **dict.fromkeys((("input", v) for v in ("discrete", "continuous")), ("exact",)),
    **dict.fromkeys((("output", "constant"), ("local", "constant")), ("exact",)),
    **dict.fromkeys(
        ((c, v) for c in ("output", "local") for v in ("discrete", "continuous")),
        ("calculated", "exact", "approx"),
    ),
    ("independent", "continuous"): (),
}


@dataclass(frozen=True, eq=False)
class Entry:
    """A variable.

    Parameters
    ----------
    number : its place among the variables, from 1, by which FMI 2.0 refers to it.
    reference : its value reference, by which FMI 3.0 does; -1 where it has none.
    kind : its type, as its element is called.
    attributes : all that stand at it; of FMI 2.0 also those of the element of its type.
    start : the start values as they are written, None where there are none.
    dimensions : attributes of its dimensions (FMI 3.0).
    """

    number: int
    reference: int
    name: str
    kind: str
    causality: str
    variability: str
    attributes: dict[str, str]
    start: tuple[str, ...] | None
    dimensions: tuple[dict[str, str], ...]
    aliases: tuple[dict[str, str], ...]

    @property
    def is_real(self) -> bool:
        return self.kind in REALS

    @property
    def combination(self) -> tuple[str, str]:
        return self.causality, self.variability

    @property
    def initial(self) -> str:
        """``initial`` as written or by default; empty where it does not apply."""
        allowed = INITIAL.get(self.combination, ())
        return self.attributes.get("initial", allowed[0]) if allowed else ""

    def __str__(self) -> str:
        return self.name or f"(variable {self.number} without a name)"


@dataclass(frozen=True, eq=False)
class Unknown:
    """An entry of the model structure; ``of`` and ``dependencies`` are as the version refers."""

    of: int
    dependencies: tuple[int, ...] | None
    kinds: tuple[str, ...] | None


class Interface:
    """A model description, read without trust: what is missing or no number is left to the rules.

    Parameters
    ----------
    root : ``fmiModelDescription`` of FMI 2.0 or 3.0.
    terminals : ``fmiTerminalsAndIcons`` of FMI 3.0, where the unit has it.
    folder : where the unit is unpacked; None where its files are not looked at.
    """

    def __init__(
        self, root: Element, terminals: Element | None = None, folder: Path | None = None
    ) -> None:
        self.root, self.terminals, self.folder = root, terminals, folder
        self.is_three = root.get("fmiVersion", "").startswith("3")
        self.variables = tuple(
            self._entry(number, element)
            for number, element in enumerate(root.find("ModelVariables") or (), 1)
        )
        # the first of those that share one, which FMI 3.0 does not allow
        self.by_reference = {entry.reference: entry for entry in reversed(self.variables)}
        self.by_name = {entry.name: entry for entry in self.variables}
        self.units = {e.get("name", ""): e for e in root.findall("UnitDefinitions/Unit")}
        self.types = {e.get("name", ""): self._type(e) for e in root.find("TypeDefinitions") or ()}
        self.kinds = tuple(
            element
            for name in ("CoSimulation", "ModelExchange", "ScheduledExecution")
            if (element := root.find(name)) is not None
        )

    def known(self, key: int) -> Entry | None:
        """Return the variable that the model structure calls by this number."""
        if self.is_three:
            return self.by_reference.get(key)
        return self.variables[key - 1] if 0 < key <= len(self.variables) else None

    def key(self, entry: Entry) -> int:
        """Return the number by which the model structure calls a variable."""
        return entry.reference if self.is_three else entry.number

    def effective(self, entry: Entry, attribute: str) -> str | None:
        """Return an attribute of a variable, or that of its declared type."""
        own = entry.attributes.get(attribute)
        if own is not None:
            return own
        _, inherited, _ = self.types.get(entry.attributes.get("declaredType", ""), ("", {}, ()))
        return inherited.get(attribute)

    def stated(self, *names: str) -> Iterator[tuple[str, str, tuple[str | None, ...]]]:
        """Yield who states one of some attributes, its kind, and all of them as they hold there.

        Types come first; a variable that states none of them has those of its type.
        """
        for name, (kind, attributes, _) in self.types.items():
            yield f"the type {name}", kind, tuple(map(attributes.get, names))
        for entry in self.variables:
            if not entry.attributes.keys().isdisjoint(names):
                yield str(entry), entry.kind, tuple(self.effective(entry, n) for n in names)

    def unknowns(self, kind: str) -> list[Unknown]:
        """Return the entries of a list of the model structure, by its name in FMI 3.0."""
        path = f"ModelStructure/{kind}"
        if not self.is_three:
            name = {"ContinuousStateDerivative": "Derivative"}.get(kind, kind)
            path = f"ModelStructure/{name}s/Unknown"
        entries = []
        for element in self.root.findall(path):
            dependencies, kinds = element.get("dependencies"), element.get("dependenciesKind")
            entries.append(
                Unknown(
                    whole(element.get("valueReference" if self.is_three else "index")),
                    None if dependencies is None else tuple(map(whole, dependencies.split())),
                    None if kinds is None else tuple(kinds.split()),
                )
            )
        return entries

    @property
    def states(self) -> dict[int, Entry]:
        """Continuous states by their numbers: those whose derivatives the structure lists."""
        by_number = {}
        for unknown in self.unknowns("ContinuousStateDerivative"):
            entry = self.known(unknown.of)
            if entry is not None and "derivative" in entry.attributes:
                state = self.known(whole(entry.attributes["derivative"]))
                if state is not None:
                    by_number[self.key(state)] = state
        return by_number

    def _type(self, element: Element) -> tuple[str, dict[str, str], tuple[Element, ...]]:
        """Return kind, attributes and items of a declared type."""
        if self.is_three:
            return element.tag.removesuffix("Type"), dict(element.attrib), tuple(element)
        typed = next((e for e in element if e.tag != "Annotations"), element)
        return typed.tag, dict(typed.attrib), tuple(typed)

    def _entry(self, number: int, element: Element) -> Entry:
        typed, kind = element, element.tag
        if not self.is_three:
            typed = next((e for e in element if e.tag != "Annotations"), element)
            kind = typed.tag
        attributes = {**element.attrib, **typed.attrib}
        start: tuple[str, ...] | None = None
        if "start" in attributes:
            is_list = self.is_three and kind not in ("String", "Binary")
            start = tuple(attributes["start"].split()) if is_list else (attributes["start"],)
        elif typed.find("Start") is not None:
            start = tuple(e.get("value", "") for e in typed.findall("Start"))
        causality = attributes.get("causality", "local")
        return Entry(
            number,
            whole(attributes.get("valueReference")),
            attributes.get("name", ""),
            kind,
            causality,
            attributes.get("variability", self._variability(kind, causality)),
            attributes,
            start,
            tuple(dict(e.attrib) for e in element.findall("Dimension")),
            tuple(dict(e.attrib) for e in element.findall("Alias")),
        )

    def _variability(self, kind: str, causality: str) -> str:
        """Return the default; FMI 2.0 has one for all."""
        if not self.is_three:
            return "continuous"
        if causality in ("parameter", "structuralParameter", "calculatedParameter"):
            return "fixed"
        return "continuous" if kind in REALS else "discrete"


def flag(element: Element, name: str) -> bool:
    """Return whether an attribute of an element says true."""
    return element.get(name) in FLAGS


def number(text: str | None) -> float | None:
    """Return a number, None where it is none."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def repeated(values: Iterable[Key]) -> Iterator[Key]:
    """Yield what stands more than once, each once."""
    for value, count in Counter(values).items():
        if count > 1:
            yield value


def whole(text: str | None) -> int:
    """Return a number by which variables are referred to, -1 where it is none."""
    try:
        return int(text or "")
    except ValueError:
        return -1


# --- rules ----------------------------------------------------------------------------------------


#: What is wrong by a rule, a sentence each.
Check = Callable[[Interface], Iterator[str]]


@dataclass(frozen=True)
class Rule:
    """A rule: ``asks`` is what the standard wants, ``source`` where it says so."""

    name: str
    asks: str
    source: str
    check: Check


class Broken(NamedTuple):
    """A rule that a description breaks, and how, a sentence each."""

    rule: Rule
    how: tuple[str, ...]


#: All rules by name, in the order in which they are told.
RULES: dict[str, Rule] = {}


def rule(name: str, asks: str, source: str) -> Callable[[Check], Check]:
    """Register a check as the rule of this name."""

    def register(check: Check) -> Check:
        RULES[name] = Rule(name, asks, source, check)
        return check

    return register


def broken_rules(
    root: Element, terminals: Element | None = None, folder: Path | None = None
) -> list[Broken]:
    """Return the rules that a model description of FMI 2.0 or 3.0 breaks; empty if it keeps all.

    terminals : what describes the terminals of the unit, if it has them.
    folder : where the unit is unpacked; without it no pictures are looked at.
    """
    interface = Interface(root, terminals, folder)
    found = (Broken(one, tuple(one.check(interface))) for one in RULES.values())
    return [broken for broken in found if broken.how]
