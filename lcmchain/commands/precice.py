"""``lcmchain precice``: a participant of a coupling through preCICE."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.folders import output_folder
from lcmchain.commands.options import Quiet, Results
from lcmchain.commands.terminal import progress_bar, say
from lcmchain.errors import InputError


def precice(
    case: Annotated[
        Path | None,
        typer.Argument(metavar="CASE.toml", help="What the participant simulates and exchanges."),
    ] = None,
    out: Results = None,
    example: Annotated[
        Path | None,
        typer.Option("--example", metavar="DIR", help="Write a coupling to start from, and end."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Take part in a coupling through preCICE (version 3), with forming or infiltration."""
    if example is not None:
        from lcmchain.coupling.precice_adapter.example import write_example

        with output_folder(example):
            written = write_example(example)
        say("Written: " + ", ".join(str(path) for path in written))
        say(f"Start both in {example}: lcmchain precice solid.toml & lcmchain precice fluid.toml")
        return
    if case is None:
        raise InputError("is missing: name the file of a participant, or use --example", key="CASE")
    from lcmchain.coupling.precice_adapter.case import read_case

    the_case = read_case(case)
    with output_folder(out or Path("results") / case.stem, inputs=[case]) as folder:
        from lcmchain.coupling.precice_adapter.run import run_participant

        with progress_bar(quiet=quiet) as progress:
            steps, files = run_participant(
                the_case, case.resolve().parent, folder,
                tell=lambda share, text: progress(min(share, 1.0), 1.0, text),
            )  # fmt: skip
    if not quiet:
        say(
            f"{the_case.participant}: {steps.windows} windows, {steps.repetitions} repetitions, "
            f"{steps.steps} steps"
        )
        say("Results: " + ", ".join(str(file) for file in files))
