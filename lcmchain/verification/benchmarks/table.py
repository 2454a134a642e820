"""All benchmarks as one table."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from rich.table import Table

from lcmchain.scene.schema import Element
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


def run_benchmarks(
    full: bool = False, *, progress: Callable[[float, float, str], None] | None = None
) -> list[BenchmarkResult]:
    """Run all benchmarks; ``full`` adds finer meshes and the large deformation of shells.

    ``progress`` is called with completed, total, and the name of what is running.
    """
    cases = linear_benchmarks(64 if full else 32) + large_deformation_benchmarks(full)
    results: list[BenchmarkResult] = []
    for done, case in enumerate(cases):
        if progress is not None:
            function = case.func if isinstance(case, partial) else case
            progress(done, len(cases), function.__name__.replace("_", " "))
        result = case()
        results += result.at_loads() if isinstance(result, CurveResult) else [result]
    return results


def benchmark_table(results: list[BenchmarkResult]) -> Table:
    """Return the table that ``lcmchain verify benchmarks`` prints."""
    table = Table(title="Benchmarks of the solid-shell element", title_justify="left")
    table.add_column("problem")
    table.add_column("mesh")
    for column in ("value", "reference", "value / reference", "expected per mesh"):
        table.add_column(column, justify="right")
    table.add_column("reference from")
    for r in results:
        normalised = f"{r.normalised:.4f}" if math.isfinite(r.normalised) else "-"
        expected = "-" if r.expected is None else f"{r.expected:.3f}"
        value, reference = f"{r.value:.5g}", f"{r.reference:.5g}"
        table.add_row(r.name, r.mesh, value, reference, normalised, expected, r.origin)
    return table
