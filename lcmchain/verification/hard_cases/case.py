"""What a hard case is, what it returns, and the list of all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from lcmchain.errors import SimulationError


@dataclass(frozen=True)
class CaseResult:
    """One criterion of a hard case and how it came out.

    Parameters
    ----------
    name : of the case.
    criterion : what must hold, in words, without the limit.
    value, limit : measured and allowed, in ``unit``.
    unit : after the numbers, for example "%".
    at_least : whether the limit is a lower one.
    without : what fails without the measure that the solver takes, with its measured value; empty
        where no single measure stands behind the case.
    text : shown instead of the value (the words of a guard).
    """

    name: str
    criterion: str
    value: float
    limit: float
    unit: str = ""
    at_least: bool = False
    without: str = ""
    text: str = ""

    @property
    def holds(self) -> bool:
        if not math.isfinite(self.value):
            return False
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    @property
    def margin(self) -> float:
        """How many times better than the limit; below 1 it does not hold."""
        better, worse = (self.value, self.limit) if self.at_least else (self.limit, self.value)
        if not math.isfinite(self.value):
            return 0.0
        return better / worse if worse > 0.0 else math.inf


THEMES = (
    "Elements",
    "Time integration",
    "Coupons",
    "Compaction",
    "Contact and tools",
    "Forming",
    "Stacks",
    "Coupling",
)


#: What a case does: (name, full) -> results.
CaseFunction = Callable[[str, bool], Iterable[CaseResult]]


@dataclass(frozen=True)
class HardCase:
    """A case of the list: ``run(full)`` returns its results; ``reduced`` says what fast leaves out.

    ``theme`` is one of :data:`THEMES`, in whose order the table stands.
    """

    name: str
    theme: str
    function: CaseFunction
    reduced: str

    def run(self, full: bool = False) -> list[CaseResult]:
        return list(self.function(self.name, full))


CASES: dict[str, HardCase] = {}


def hard_case(
    name: str, theme: str, *, reduced: str = ""
) -> Callable[[CaseFunction], CaseFunction]:
    """Put the decorated function ``(name, full) -> results`` on the list."""

    def add(function):
        if name in CASES:
            raise ValueError(f"there are two hard cases named {name}")
        CASES[name] = HardCase(name, theme, function, reduced)
        return function

    return add


def stopped(run: Callable[[], object]) -> str:
    """Return the words in which a guard stops ``run``, or an empty text if it runs through."""
    try:
        run()
    except SimulationError as error:
        return str(error)
    return ""


def guarded(name: str, criterion: str, run: Callable[[], object], *words: str) -> CaseResult:
    """Return the result of a case that must end in a guard's error with all these ``words``."""
    message = stopped(run)
    found = sum(word in message for word in words)
    text = message.split(". Likely cause")[0] if message else "ran to its end"
    return CaseResult(name, criterion, found / len(words), 1.0, at_least=True, text=text)
