"""All benchmarks, and the tables of their results."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from rich.table import Table

from lcmchain.scene import Element
from lcmchain.verification.benchmarks import large_deformation, linear, patch, semi_cylinder
from lcmchain.verification.benchmarks.meshes import NO_SHEAR_ROW, OPTIONS
from lcmchain.verification.benchmarks.result import BenchmarkResult, CurveResult

Benchmark = Callable[[], BenchmarkResult | CurveResult]


def linear_benchmarks(finest: int = 32) -> list[Benchmark]:
    """Return the benchmarks of the linear theory, up to ``finest`` elements along an edge.

    Each with the default options and as published; those that bend in their plane also without the
    shear row that locks them.
    """
    counts = [count for count in (4, 8, 16, 32, 64) if count <= finest]
    cases: list[Benchmark] = []
    for element in OPTIONS.values():
        locks = element == NO_SHEAR_ROW  # what only this choice is about
        cases += [
            partial(patch.patch_test, kind, element=element) for kind in ("membrane", "bending")
        ]
        for load in ("in-plane",) if locks else linear.STRAIGHT:
            for shape in ("rectangle", "trapezoid", "parallelogram"):
                cases.append(partial(linear.straight_cantilever, load, shape, element=element))
        for n1, n2 in ((12, 1), (24, 2), (48, 4), (96, 8)):
            cases.append(
                partial(linear.straight_cantilever, "in-plane", "rectangle", n1, n2, element)
            )
        if not locks:
            cases += _bending_benchmarks(counts, element)
    return cases


def _bending_benchmarks(counts: list[int], element: Element) -> list[Benchmark]:
    cases: list[Benchmark] = [
        partial(linear.straight_cantilever, "out-of-plane", "rectangle", 24, 2, element),
        partial(linear.straight_cantilever, "extension", "rectangle", 48, 4, element),
    ]
    for thickness, load in linear.TWISTED:
        cases += [partial(linear.twisted_beam, thickness, load, n1, element) for n1 in (12, 24, 48)]
    for problem in (linear.scordelis_lo, linear.pinched_cylinder, linear.hemisphere):
        cases += [partial(problem, count, element) for count in counts]
    for load in linear.COEFFICIENTS:
        for slenderness in (100, 1000, 10_000):
            cases += [
                partial(linear.clamped_plate, load, slenderness, count, element) for count in counts
            ]
    cases.append(partial(linear.cantilever_frequency, element=element))
    return cases


def large_deformation_benchmarks(full: bool) -> list[Benchmark]:
    """Return the benchmarks with large rotations; with ``full`` those of shells too.

    Each with the default options and as published.
    """
    cases: list[Benchmark] = []
    for element in OPTIONS.values():
        if element == NO_SHEAR_ROW:
            continue
        cases.append(partial(large_deformation.end_shear, element=element))
        cases += [
            partial(large_deformation.roll_up, count, element=element) for count in (16, 24, 48)
        ]
        if full:
            cases += [partial(large_deformation.hemisphere, count, element) for count in (16, 32)]
            cases.append(partial(large_deformation.pinched_cylinder, 48, element))
            cases += [
                partial(semi_cylinder.semi_cylinder, layup, 40, element)
                for layup in semi_cylinder.LAYUPS
            ]
    return cases


@dataclass
class Report:
    """Results of the benchmarks in the order of the list."""

    full: bool
    results: list[BenchmarkResult] = field(default_factory=list)
    curves: list[CurveResult] = field(default_factory=list)
    wall_s: float = 0.0

    def linear_rows(self) -> list[tuple[str, ...]]:
        """Return problem, reference with its origin, mesh, and value over reference by options."""
        rows: dict[tuple, dict[str, str]] = {}
        problems = list(dict.fromkeys(result.name for result in self.results))
        for result in sorted(self.results, key=lambda result: problems.index(result.name)):
            reference = f"{result.reference:.5g} ({result.origin})"
            cells = rows.setdefault((result.name, reference, result.mesh), {})
            cells[result.options] = _normalised(result)
        return _filled(rows, _options(self.results))

    def large_rows(self) -> list[tuple[str, ...]]:
        """Return problem, origin of the reference, mesh, and deviations by options."""
        rows: dict[tuple, dict[str, str]] = {}
        for curve in self.curves:
            cells = rows.setdefault((curve.name, curve.origin, curve.mesh), {})
            cells[curve.options] = _deviations(curve)
        return _filled(rows, _options(self.curves))

    def tables(self) -> list[Table]:
        """Return the tables for the terminal."""
        tables = []
        for title, meaning, columns, rows in self._sections():
            table = Table(*columns, title=f"{title}. {meaning}", title_justify="left")
            for row in _without_repeats(rows):
                table.add_row(*row)
            tables.append(table)
        return tables

    def markdown(self) -> str:
        """Return the tables as a page of Markdown."""
        option = " --full" if self.full else ""
        lines = [
            "# Benchmark table",
            "",
            f"Written by `lcmchain verify benchmarks{option} --out FILE.md`.",
            "",
        ]
        for title, meaning, columns, rows in self._sections():
            lines += [f"## {title}", "", f"{meaning}.", ""]
            lines += [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
            lines += [f"| {' | '.join(row)} |" for row in _without_repeats(rows)] + [""]
        return "\n".join(lines)

    def _sections(self):
        kind = "full" if self.full else "fast"
        columns = ("problem", "reference", "mesh")
        yield (
            f"Linear benchmarks, {kind} version",
            "Value over reference by options of the element, the default being that of a scene "
            "without any entry for it; in brackets the value of an independent implementation "
            f"({self.wall_s:.0f} s for all benchmarks)",
            (*columns, *_options(self.results)),
            self.linear_rows(),
        )
        yield (
            "Large deformation",
            "Deviation at the last load over the largest reference; in brackets the largest on the "
            "way",
            (*columns, *_options(self.curves)),
            self.large_rows(),
        )


def _options(results: Sequence[BenchmarkResult | CurveResult]) -> list[str]:
    """Return the sets of options that occur, in the order of the list."""
    return [name for name in OPTIONS if any(result.options == name for result in results)]


def _filled(rows: dict[tuple, dict[str, str]], options: list[str]) -> list[tuple[str, ...]]:
    """Return rows with a cell for every set of options, empty where it was not run."""
    return [(*head, *(cells.get(name, "") for name in options)) for head, cells in rows.items()]


def _without_repeats(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return rows whose problem and reference are empty where they are those of the row above."""
    above = [("", ""), *(row[:2] for row in rows)]
    return [
        ("", "", *row[2:]) if row[:2] == last else row
        for row, last in zip(rows, above[:-1], strict=True)
    ]


def _normalised(result: BenchmarkResult) -> str:
    expected = "" if result.expected is None else f" ({result.expected:.3f})"
    return f"{result.normalised:.3f}{expected}"


def _deviations(curve: CurveResult) -> str:
    """Return the deviations at the last load that was reached, and the largest one."""
    if not curve.reached:
        return "no equilibrium"
    reached = curve.deviation[: curve.reached]
    last = ", ".join(
        f"{label} {deviation:+.2%}"
        for label, deviation in zip(curve.labels, reached[-1], strict=True)
    )
    text = f"{last} ({abs(reached).max():.2%})"
    if curve.reached < len(curve.load_factor):
        text += f"; no equilibrium beyond {curve.load_factor[curve.reached - 1]:g} of the load"
    return text


def run_benchmarks(
    full: bool = False, *, progress: Callable[[float, float, str], None] | None = None
) -> Report:
    """Run all benchmarks; ``full`` adds finer meshes and the large deformation of shells.

    ``progress`` is called with completed, total, and the name of what is running.
    """
    cases = linear_benchmarks(64 if full else 32) + large_deformation_benchmarks(full)
    report, start = Report(full), time.perf_counter()
    for done, case in enumerate(cases):
        if progress is not None:
            function = case.func if isinstance(case, partial) else case
            progress(done, len(cases), function.__name__.replace("_", " "))
        result = case()
        if isinstance(result, CurveResult):
            report.curves.append(result)
        else:
            report.results.append(result)
    report.wall_s = time.perf_counter() - start
    return report
