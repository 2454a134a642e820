"""``lcmchain verify``, cases by which the program is judged, and ``bench``, its speed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcmchain.atomic import replacing
from lcmchain.commands.terminal import console, progress_bar, say, show_whole
from lcmchain.errors import SimulationError

verify_app = typer.Typer(no_args_is_help=True, help="Judge element, solver and coupling by cases.")

MarkdownFile = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FILE.md", help="Write the table as Markdown too."),
]


@verify_app.command("benchmarks")
def verify_benchmarks(
    full: Annotated[
        bool, typer.Option("--full", help="Finer meshes and large deformation of shells too.")
    ] = False,
    out: MarkdownFile = None,
) -> None:
    """Solve the shell benchmarks and print them beside their references."""
    from lcmchain.verification.benchmarks.table import run_benchmarks

    with progress_bar() as progress:
        report = run_benchmarks(full, progress=progress)
    for table in report.tables():
        console().print(table)
    _write_markdown(out, report.markdown())


@verify_app.command("hard-cases")
def verify_hard_cases(
    full: Annotated[
        bool, typer.Option("--full", help="Nothing reduced: finer meshes, a million steps.")
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Run this case; may be repeated.")
    ] = None,
    out: MarkdownFile = None,
) -> None:
    """Run the hard cases and print criterion, result and margin of each."""
    import lcmchain.coupling.iteration.hard_cases  # noqa: F401  puts its cases on the list
    from lcmchain.verification.hard_cases import run_cases

    with progress_bar() as progress:
        report = run_cases(only or (), full=full, progress=progress)
    console().print(report.table())
    _write_markdown(out, report.markdown())
    if report.failed:
        names = ", ".join(sorted({result.name for result in report.failed}))
        raise SimulationError(f"criteria do not hold in: {names}")


@verify_app.command("coupling")
def verify_coupling(out: MarkdownFile = None) -> None:
    """Compare the coupling schemes over stiffness and permeability: iterations, divergence."""
    from rich.markdown import Markdown

    from lcmchain.coupling.iteration.study import study_schemes

    with progress_bar() as progress:
        study = study_schemes(progress=progress)
    console().print(Markdown(study.markdown()))
    _write_markdown(out, study.markdown())


def bench(
    mapping: Annotated[
        bool, typer.Option("--mapping", help="Of the mapping, beside medcoupling if it is there.")
    ] = False,
    filling: Annotated[
        bool, typer.Option("--filling", help="Of the infiltration, over the size of the mesh.")
    ] = False,
    unit: Annotated[
        bool, typer.Option("--unit", help="Of co-simulation units, beside the solver alone.")
    ] = False,
    sizes: Annotated[
        bool, typer.Option("--sizes", help="Of free plates, over the number of elements.")
    ] = False,
    parts: Annotated[bool, typer.Option("--parts", help="Of each part of a step alone.")] = False,
    effects: Annotated[
        bool, typer.Option("--effects", help="Of a step with each effect and without it.")
    ] = False,
    stacks: Annotated[
        bool, typer.Option("--stacks", help="Of stacks of plies, and of what an interface costs.")
    ] = False,
    laws: Annotated[
        bool, typer.Option("--laws", help="Of the element kernel, by what a fabric's law knows.")
    ] = False,
    peers: Annotated[
        bool, typer.Option("--peers", help="Beside CalculiX and Kratos, where they are installed.")
    ] = False,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the solver's figures here."),
    ] = None,
) -> None:
    """Measure the speed of the solver, the mapping, the infiltration or units on this machine."""
    if unit:
        from lcmchain.fmu.benchmark import run_unit_bench

        table = run_unit_bench()
    elif filling:
        from lcmchain.coupling.infiltration.benchmark import run_filling_bench

        table = run_filling_bench()
    elif mapping:
        from lcmchain.mapping.benchmark import run_mapping_bench

        table = run_mapping_bench()
    elif parts:
        from lcmchain.bench import run_part_bench

        table = run_part_bench(json_file)
    elif effects:
        from lcmchain.bench import run_effect_bench

        table = run_effect_bench(json_file)
    elif stacks:
        from lcmchain.bench import run_stack_bench

        table = run_stack_bench(json_file)
    elif laws:
        from lcmchain.bench import run_law_bench

        table = run_law_bench(json_file)
    elif peers:
        from lcmchain.bench.peers import run_peer_bench

        table = run_peer_bench(json_file)
    elif sizes:
        from lcmchain.bench import run_size_bench

        table = run_size_bench(json_file)
    else:
        from lcmchain.bench import run_bench

        table = run_bench(json_file)
    show_whole(table)


def _write_markdown(out: Path | None, text: str) -> None:
    if out is None:
        return
    with replacing(out) as path:
        path.write_text(text, encoding="utf-8")
    say(f"Table in {out}")
