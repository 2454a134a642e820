"""Run the hard cases, and the one table of their results."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from rich.table import Table

from lcmchain.errors import InputError
from lcmchain.verification.hard_cases.case import CASES, THEMES, CaseResult, HardCase

COLUMNS = ("case", "criterion", "result", "margin", "without the measure")


@dataclass
class Report:
    """Results of cases in the order of the list; ``full``: nothing was reduced."""

    full: bool
    results: list[tuple[HardCase, list[CaseResult]]] = field(default_factory=list)
    wall_s: float = 0.0

    @property
    def failed(self) -> list[CaseResult]:
        return [result for _, results in self.results for result in results if not result.holds]

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Return the table's rows, see :data:`COLUMNS`."""
        rows = []
        for case, results in self.results:
            for i, result in enumerate(results):
                name = result.name.replace("_", " ") if i == 0 else ""
                if i == 0 and case.reduced and not self.full:
                    name += f" (reduced: {case.reduced})"
                criterion = f"{result.criterion} {limit_text(result)}".strip()
                rows.append(
                    (name, criterion, value_text(result), margin_text(result), result.without)
                )
        return rows

    def table(self) -> Table:
        """Return the table for the terminal."""
        table = Table(title=self._title(), title_justify="left")
        for column in COLUMNS:
            table.add_column(column, justify="right" if column == "margin" else "left")
        for row in self.rows():
            table.add_row(*row)
        return table

    def markdown(self) -> str:
        """Return the table as a page of Markdown."""
        option = " --full" if self.full else ""
        lines = [
            "# Hard case table",
            "",
            f"Written by `lcmchain verify hard-cases{option} --out FILE.md`.",
            "",
            f"{self._title()}.",
            "",
            f"| {' | '.join(COLUMNS)} |",
            "|---|---|---|---:|---|",
        ]
        for row in self.rows():
            lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |")
        return "\n".join(lines) + "\n"

    def _title(self) -> str:
        count = sum(len(results) for _, results in self.results)
        held = count - len(self.failed)
        kind = "full" if self.full else "fast"
        return (
            f"Hard cases ({kind} version, {self.wall_s:.0f} s): {held} of {count} criteria hold "
            f"(number of cases: {len(self.results)})"
        )


def run_cases(
    names: Sequence[str] = (),
    *,
    full: bool = False,
    progress: Callable[[float, float, str], None] | None = None,
) -> Report:
    """Run the cases ``names`` (all without) and return their report.

    Raises
    ------
    InputError : a name that is not on the list.
    """
    for name in names:
        if name not in CASES:
            raise InputError(f'there is no hard case "{name}"; there are {", ".join(CASES)}')
    chosen = [case for case in CASES.values() if not names or case.name in names]
    chosen.sort(key=lambda case: THEMES.index(case.theme))
    report, start = Report(full), time.perf_counter()
    for number, case in enumerate(chosen):
        if progress is not None:
            progress(number, len(chosen), case.name.replace("_", " "))
        report.results.append((case, case.run(full)))
    report.wall_s = time.perf_counter() - start
    return report


def limit_text(result: CaseResult) -> str:
    """Return the limit with its sign and unit; empty where a guard's words are the criterion."""
    if result.text:
        return ""
    sign = "≥" if result.at_least else "≤"
    return f"{sign} {result.limit:g} {result.unit}".strip()


def value_text(result: CaseResult) -> str:
    """Return the measured value with its unit, or a guard's words."""
    if result.text:
        return result.text
    mark = "" if result.holds else " FAILS"
    return f"{result.value:.3g} {result.unit}".strip() + mark


def margin_text(result: CaseResult) -> str:
    """Return how many times better than the limit a value is."""
    if result.text:
        return "holds" if result.holds else "FAILS"
    if math.isinf(result.margin) or result.margin > 1e4:
        return "> 10,000 x"
    return f"{result.margin:.3g} x"
