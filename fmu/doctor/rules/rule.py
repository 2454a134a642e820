"""A rule of the standard, and the list of all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

from lcmchain.fmu.doctor.rules.interface import Interface

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
