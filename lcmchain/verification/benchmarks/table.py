"""All benchmarks, and the tables of their results."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from rich.table import Table

from lcmchain.scene import Element
from lcmchain.verification.benchmarks import (
    beams,
    large_cantilever,
    large_shells,
    patch,
    plates,
    shells,
)
from lcmchain.verification.benchmarks.meshes import AS_PUBLISHED, NO_SHEAR_ROW
from lcmchain.verification.benchmarks.result import BenchmarkResult, CurveResult

Benchmark = Callable[[], BenchmarkResult | CurveResult]


def linear_benchmarks(finest: int = 32) -> list[Benchmark]:
    """Return the benchmarks of the linear theory, up to ``finest`` elements along an edge."""
    counts = [count for count in (4, 8, 16, 32, 64) if count <= finest]
    cases: list[Benchmark] = []
    for element in (AS_PUBLISHED, NO_SHEAR_ROW):
        cases += [partial(patch.patch_test, kind, element) for kind in ("membrane", "bending")]
    for load in beams.STRAIGHT:
        for shape in ("rectangle", "trapezoid", "parallelogram"):
            cases.append(partial(beams.straight_cantilever, load, shape))
            if load == "in-plane":
                cases.append(partial(beams.straight_cantilever, load, shape, element=NO_SHEAR_ROW))
    for n1, n2 in ((12, 1), (24, 2), (48, 4), (96, 8)):
        for element in (AS_PUBLISHED, NO_SHEAR_ROW):
            cases.append(
                partial(beams.straight_cantilever, "in-plane", "rectangle", n1, n2, element)
            )
    cases.append(partial(beams.straight_cantilever, "out-of-plane", "rectangle", 24, 2))
    cases.append(partial(beams.straight_cantilever, "extension", "rectangle", 48, 4))
    for thickness, load in beams.TWISTED:
        cases += [partial(beams.twisted_beam, thickness, load, n1) for n1 in (12, 24, 48)]
    for problem in (shells.scordelis_lo, shells.pinched_cylinder, shells.hemisphere):
        cases += [partial(problem, count) for count in counts]
        cases += [partial(problem, count, Element()) for count in (8, 32)]
    for load in plates.COEFFICIENTS:
        for slenderness in (100, 1000, 10_000):
            cases += [partial(plates.clamped_plate, load, slenderness, count) for count in counts]
    cases.append(beams.cantilever_frequency)
    return cases


def large_deformation_benchmarks(full: bool) -> list[Benchmark]:
    """Return the benchmarks with large rotations; with ``full`` those of shells too."""
    cases: list[Benchmark] = [large_cantilever.end_shear]
    cases += [partial(large_cantilever.roll_up, count) for count in (16, 24, 48)]
    if full:
        cases += [partial(large_shells.hemisphere, count) for count in (16, 32)]
        cases.append(partial(large_shells.pinched_cylinder, 48))
    return cases


@dataclass
class Report:
    """Results of the benchmarks in the order of the list."""

    full: bool
    results: list[BenchmarkResult] = field(default_factory=list)
    curves: list[CurveResult] = field(default_factory=list)
    wall_s: float = 0.0

    def linear_rows(self) -> list[tuple[str, str, str]]:
        """Return problem, reference with its origin, and value over reference by mesh."""
        problems: dict[tuple, list[BenchmarkResult]] = {}
        for result in self.results:
            problems.setdefault((result.name, result.reference, result.origin), []).append(result)
        return [
            (name, f"{reference:.5g} ({origin})", ", ".join(map(_by_mesh, results)))
            for (name, reference, origin), results in problems.items()
        ]

    def large_rows(self) -> list[tuple[str, str, str, str, str]]:
        """Return problem, mesh, origin of the reference, and deviations at the end and at most."""
        return [
            (
                curve.name,
                curve.mesh,
                curve.origin,
                ", ".join(
                    f"{label} {deviation:+.2%}"
                    for label, deviation in zip(curve.labels, curve.deviation[-1])
                ),
                f"{abs(curve.deviation).max():.2%}",
            )
            for curve in self.curves
        ]

    def tables(self) -> list[Table]:
        """Return the tables for the terminal."""
        tables = []
        for title, meaning, columns, rows in self._sections():
            table = Table(*columns, title=f"{title}. {meaning}", title_justify="left")
            for row in rows:
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
            lines += [f"| {' | '.join(row)} |" for row in rows] + [""]
        return "\n".join(lines)

    def _sections(self):
        kind = "full" if self.full else "fast"
        yield (
            f"Linear benchmarks, {kind} version",
            "Value over reference by mesh; in brackets that of an independent implementation "
            f"({self.wall_s:.0f} s for all benchmarks)",
            ("problem", "reference", "value / reference"),
            self.linear_rows(),
        )
        yield (
            "Large deformation",
            "Deviation at the last load, and the largest on the way, over the largest reference",
            ("problem", "mesh", "reference", "at the last load", "largest"),
            self.large_rows(),
        )


def _by_mesh(result: BenchmarkResult) -> str:
    expected = "" if result.expected is None else f" ({result.expected:.3f})"
    return f"{result.mesh}: {result.normalised:.3f}{expected}"


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
