"""``lcmchain fmu doctor``: what a unit needs on this machine."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.terminal import console, say


def doctor(
    unit: Annotated[
        Path, typer.Argument(metavar="F.fmu", help="A unit, by lcmchain or another tool.")
    ],
    python: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Python that is to run it; default: this one."),
    ] = None,
    host: Annotated[
        str | None, typer.Option(metavar="PROGRAM", help="Program that is to import it.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Tell what a unit needs on this machine and what is missing (exit code 1); it is not run."""
    from lcmchain.fmu.doctor import Level, examine

    diagnosis = examine(unit, python=python, host=host)
    if as_json:
        sys.stdout.write(json.dumps(diagnosis.as_dict(), indent=2) + "\n")
    else:
        terminal = console()
        styles = {Level.OK: "green", Level.NOTE: "", Level.WARNING: "yellow", Level.MISSING: "red"}
        for finding in diagnosis.findings:
            line = f"{finding.level:<8}{finding.subject}: {finding.text}"
            if finding.remedy:
                line += f"\n{'':8}-> {finding.remedy}"
            terminal.print(
                line, style=styles[finding.level], markup=False, highlight=False, soft_wrap=True
            )
        missing = sum(finding.level is Level.MISSING for finding in diagnosis.findings)
        say(f"{unit}: {'can run here' if not missing else f'cannot run here, {missing} missing'}")
    if not diagnosis.runs:
        raise typer.Exit(1)
