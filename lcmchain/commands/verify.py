"""``lcmchain verify``: cases by which element, solver and coupling are judged, as tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.terminal import console, progress_bar, say
from lcmchain.errors import SimulationError

verify_app = typer.Typer(no_args_is_help=True, help="Judge element, solver and coupling by cases.")

MarkdownFile = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE.md", help="Write the table as Markdown too."),
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


def _write_markdown(out: Path | None, text: str) -> None:
    if out is None:
        return
    from lcmchain.atomic import replacing

    with replacing(out) as path:
        path.write_text(text, encoding="utf-8")
    say(f"Table in {out}")
