"""Couplings: units of FMI simulated together (``cosim``), and through preCICE (``precice``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.commands.options import (
    Overrides,
    Quiet,
    Results,
    Strict,
    default_out,
    name_of_input,
    output_folder,
    results_option,
)
from lcmchain.commands.terminal import console, progress_bar, require_none, say, warn
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from lcmchain.coupling.cosimulation.system_file import System

SSP_SUFFIX, SSD_SUFFIX = ".ssp", ".ssd"


def cosim(
    system: Annotated[
        Path,
        typer.Argument(
            metavar="SYSTEM",
            help="File of the system (TOML), SSP archive, .ssd, or a folder with one.",
        ),
    ],
    out: Annotated[
        Path | None,
        results_option("SYSTEM"),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the checkpoint in DIR.")
    ] = False,
    export: Annotated[
        Path | None,
        typer.Option(
            "--export", metavar="F.ssp", help="Write the system as an SSP archive, do not simulate."
        ),
    ] = None,
    ssp_version: Annotated[
        str,
        typer.Option("--ssp-version", metavar="1.0|2.0", help="Of the archive of --export."),
    ] = "1.0",
    overrides: Overrides = None,
    strict: Strict = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Say nothing but warnings and errors.")
    ] = False,
) -> None:
    """Simulate functional mock-up units together, by any coupling scheme."""
    from lcmchain.coupling.cosimulation.stopping import sigterm_as_ctrl_c

    default = default_out(system.resolve() if system.is_dir() else system)
    system = _file_of(system)
    with sigterm_as_ctrl_c(), _read(system, overrides or ()) as the_system:
        if export is not None:
            _export(the_system, system, export, ssp_version)
            return
        from lcmchain.coupling.cosimulation.recorder import cost_table
        from lcmchain.coupling.cosimulation.run import run_system

        with output_folder(out or default, inputs=[system]) as folder:
            with progress_bar(quiet=quiet) as progress:
                summary = run_system(
                    the_system, folder, resume=resume, progress=progress, inputs=(system,)
                )
    if not quiet:
        console().print(cost_table(summary))
        say(f"Results: {folder / 'cosimulation.nc'}")
    for warning in summary["warnings"]:
        warn(warning)
    require_none(summary["warnings"], strict=strict)


@contextmanager
def _read(path: Path, overrides: Sequence[str]) -> Iterator[System]:
    """Read a file, told by its content; an SSP archive stays unpacked within the block."""
    if not path.is_file():
        raise InputError("there is no such file", file=path)
    kind = _kind(path)
    if kind not in (SSP_SUFFIX, SSD_SUFFIX):
        from lcmchain.coupling.cosimulation.system_file import read_system

        yield read_system(path, overrides)
        return
    from lcmchain.coupling.cosimulation.ssp.reading import read_ssd, read_ssp
    from lcmchain.coupling.cosimulation.temporary_folder import temporary_folder

    with temporary_folder("lcmchain-ssp-") as folder:
        read = read_ssd if kind == SSD_SUFFIX else read_ssp
        yield read(path, folder, overrides)


def _file_of(path: Path) -> Path:
    """Return the file of the system that a folder holds; a file as it is.

    Raises
    ------
    InputError : a folder without a system, or with several.
    """
    if not path.is_dir():
        return path
    from lcmchain.coupling.cosimulation.ssp.structure import STRUCTURE_FILE

    found = [path / STRUCTURE_FILE] if (path / STRUCTURE_FILE).is_file() else []
    found = found or sorted(path.glob(f"*{SSD_SUFFIX}"))
    if len(found) == 1:
        return found[0]
    told = f"holds {len(found)} systems ({', '.join(file.name for file in found[:3])})"
    raise InputError(
        f"is a folder that {told if found else f'holds no {STRUCTURE_FILE}'}; name the file of the "
        "system in it",
        file=path,
    )


def _kind(path: Path) -> str:
    """Return the ending that the content of a file calls for, its own where that says nothing."""
    with path.open("rb") as file:
        head = file.read(100)
    if head.startswith(b"PK\x03\x04"):
        return SSP_SUFFIX
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"<?xml", b"<ssd:")):
        return SSD_SUFFIX
    return path.suffix.lower()


def _export(the_system: System, source: Path, target: Path, version: str) -> None:
    from lcmchain.coupling.cosimulation.ssp.writing import VERSIONS, write_ssp

    if version not in VERSIONS:
        raise InputError(
            f'there is no SSP "{version}" to write; take {" or ".join(VERSIONS)}',
            key="--ssp-version",
        )
    if target.suffix.lower() != SSP_SUFFIX:
        raise InputError("the name of a system archive ends in .ssp", file=target)
    with output_folder(target.parent, inputs=[source]):
        write_ssp(the_system, target, version)
    say(f"Wrote {target}")


# --- a participant of a coupling through preCICE --------------------------------------------------


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
    from lcmchain.scene.reading.read import directory_of

    the_case = read_case(case)
    with output_folder(out or Path("results") / name_of_input(case), inputs=[case]) as folder:
        from lcmchain.coupling.precice_adapter.run import run_participant

        with progress_bar(quiet=quiet) as progress:
            steps, files = run_participant(
                the_case, directory_of(case), folder,
                tell=lambda share, text: progress(min(share, 1.0), 1.0, text),
            )  # fmt: skip
    if not quiet:
        say(
            f"{the_case.participant}: {steps.windows} windows, {steps.repetitions} repetitions, "
            f"{steps.steps} steps"
        )
        say("Results: " + ", ".join(str(file) for file in files))
