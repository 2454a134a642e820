"""``lcmchain run`` and ``check``: form the blank, or say what that would take."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.commands.options import (
    ModelRung,
    OutFolder,
    Overrides,
    Quiet,
    SceneFile,
    Strict,
    default_out,
    output_folder,
)
from lcmchain.commands.terminal import (
    console,
    progress_bar,
    require_none,
    say,
    warn,
    warn_in_groups,
)
from lcmchain.errors import InputError, MappingError, SimulationInterrupted, UnfinishedRun
from lcmchain.results import COMPLETE, all_warnings
from lcmchain.results.folder import write_summary

if TYPE_CHECKING:
    from lcmchain.report.numbers import Number
    from lcmchain.scene import Scene
    from lcmchain.study.choice import Choice
    from lcmchain.study.outcome import Outcome


def run(
    scene: SceneFile,
    out: OutFolder = None,
    threads: Annotated[
        int | None,
        typer.Option(
            "--threads",
            min=1,
            metavar="N",
            help="Number of threads; default all cores, one for a small mesh.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last checkpoint in DIR.")
    ] = False,
    until_stage: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="End with this stage; the same command with --resume goes on."
        ),
    ] = None,
    start_from: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="RESULTS",
            help="Go on from a run that ended with a stage, with other stages behind it.",
        ),
    ] = None,
    model: ModelRung = None,
    within: Annotated[
        str | None,
        typer.Option(
            metavar="ERRORS",
            help='Choose mesh and process time for these errors: "1 deg shear, 1 % thickness".',
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="TIME", help='Choose the mesh for this solver time, such as "20 s".'),
    ] = None,
    overrides: Overrides = None,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Form the blank, and map its fields to the meshes that the scene names."""
    if within is not None or budget is not None:
        for option, value in (("--until-stage", until_stage), ("--from", start_from)):
            if value is not None:
                raise InputError(
                    "belongs to the run of a scene; leave out --within and --budget", key=option
                )
        run_chosen(
            scene, out, within, budget, overrides or (),
            model=model, threads=threads, resume=resume, strict=strict, quiet=quiet,
        )  # fmt: skip
        return
    the_scene = _scene_on_rung(scene, overrides, model)
    with output_folder(out or default_out(scene)) as folder:
        summary = _summary_of_run(
            the_scene, folder, threads=threads, resume=resume, until_stage=until_stage,
            start_from=start_from, quiet=quiet,
        )  # fmt: skip
    require_none(print_result(summary, folder, quiet=quiet), strict=strict)


def _summary_of_run(
    scene: Scene,
    folder: Path,
    *,
    threads: int | None,
    resume: bool,
    until_stage: str | None,
    start_from: Path | None,
    quiet: bool,
) -> Mapping:
    """Run a scene in a folder; what a run has left that ends early is printed."""
    from lcmchain.pipeline import run as run_scene

    try:
        with progress_bar(quiet=quiet) as progress:
            return run_scene(
                scene, folder, threads=threads, resume=resume, until_stage=until_stage,
                start_from=start_from, progress=progress,
            ).summary  # fmt: skip
    except KeyboardInterrupt:
        # In the steps it is a request; here it came while fields are written, drawn or mapped.
        from lcmchain.solver.checkpoint import FILE_NAME

        if not (folder / FILE_NAME).exists():
            raise
        raise SimulationInterrupted(
            f"stopped by the user; the same command with --resume goes on from {folder}"
        ) from None
    except (MappingError, UnfinishedRun) as error:
        if error.result is not None:
            print_result(error.result.summary, folder, quiet=quiet)
        raise


def check(
    scene: SceneFile,
    out: OutFolder = None,
    model: ModelRung = None,
    overrides: Overrides = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Also list all entries and defaults, and every effect with its reason."
        ),
    ] = False,
    strict: Strict = False,
) -> None:
    """Show gaps, cost, memory and warnings, and with --full what is simulated and why."""
    the_scene = _scene_on_rung(scene, overrides, model)
    with output_folder(out or default_out(scene), inputs=[scene]) as folder:
        from lcmchain.check import check_scene
        from lcmchain.check.tables import active_in_words
        from lcmchain.pipeline import require_readable_targets

        require_readable_targets(the_scene)
        report = check_scene(the_scene, folder)
    terminal = console()
    for table in report.first_tables():
        terminal.print(table)
    for warning in report.warnings:
        warn(warning)
    if full:
        for table in report.further_tables():
            terminal.print(table)
    else:
        say(f"Simulated: {active_in_words(report.effects)}")
        say("--full lists every effect with its reason, all entries, and what was defaulted")
    say(f"Picture of the start: {report.picture}")
    require_none(report.warnings, strict=strict)


def _scene_on_rung(path: Path, overrides: list[str] | None, model: str | None) -> Scene:
    """Read a scene, on another rung of the model ladder where one is asked for."""
    from lcmchain.scene import on_rung, read_scene

    scene = read_scene(path, overrides or ())
    return scene if model is None else on_rung(scene, model)


# --- what a run says at its end: numbers of summary.json, warnings, where it lies -----------------


def print_result(summary: Mapping, folder: Path, *, quiet: bool = False) -> list[str]:
    """Print what a run has left, its warnings last; return them."""
    warnings = all_warnings(summary)
    if not quiet:
        _print_table(summary)
    warn_in_groups(warnings)
    if not quiet:
        say(f"Results in {folder}")
    return warnings


def _print_table(summary: Mapping) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(summary["title"]), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False,
        show_header=False,
    )  # fmt: skip
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for number in summary_rows(summary):
        table.add_row(Text(number.name), Text(number.in_words))
    console().print(table)


def summary_rows(summary: Mapping) -> Iterator[Number]:
    """Yield what matters first in a ``summary.json``, in words."""
    from lcmchain.report.chapters import filling_in_words
    from lcmchain.report.numbers import Number, key_numbers, ply_numbers

    if summary.get("state", COMPLETE) != COMPLETE:
        reached, total = 1e3 * summary["time_reached_s"], 1e3 * summary["process_time_s"]
        value = f"{reached:.4g} of {total:.4g} ms"
        yield Number("Reached", value, "the fields are of the last saved frame")
    yield from key_numbers(summary)
    yield from ply_numbers(summary)
    for name, report in summary["mapping"].items():
        yield Number(f"Mapping {name}", *_mapping_text(report))
    for name, report in summary.get("structure", {}).items():
        cells = f"{report['cell_count']:,} {'/'.join(report['elements'])} elements"
        yield Number(f"Structure {name}", cells, ", ".join(_structure_text(report)))
    for name, report in summary.get("infiltration", {}).items():
        cells = "failed" if "error" in report else f"{report['cell_count']:,} cells"
        yield Number(f"Infiltration {name}", cells, filling_in_words(report))


def _structure_text(report: Mapping) -> Iterator[str]:
    if not report["solved"]:
        yield "not solved"
    if report["displacement_max"] is not None:
        yield f"displaced by up to {1e3 * report['displacement_max']:.4g} mm"
    if report["eigenfrequencies"]:
        found = [f"{value:.4g}" for value in report["eigenfrequencies"][:3] if value is not None]
        yield f"eigenfrequencies {', '.join(found)} Hz"


def _mapping_text(report: Mapping) -> tuple[str, str]:
    if "error" in report:
        return "failed", ""
    return (
        f"{report['cell_count']:,} cells",
        f"{report['target_coverage']:.1%} of the target and {report['source_coverage']:.1%} of the "
        "sheet covered",
    )


# --- a run whose settings the program chooses -----------------------------------------------------


def run_chosen(
    path: Path,
    out: Path | None,
    within: str | None,
    budget: str | None,
    overrides: Sequence[str],
    *,
    model: str | None,
    threads: int | None,
    resume: bool,
    strict: bool,
    quiet: bool,
) -> None:
    """Run a scene with the settings that meet a requirement, and say what was chosen and why.

    Raises
    ------
    InputError : a requirement that cannot be read, ``--resume``, or wrong input.
    SimulationInterrupted : Ctrl-C; the pilots are kept.
    """
    from lcmchain.study.choice import read_requirement
    from lcmchain.study.sources import SceneText

    if resume:
        raise InputError(
            "a run whose settings are chosen starts anew (its pilots are kept); leave it out",
            key="--resume",
        )
    requirement = read_requirement(within, budget)
    text = SceneText.from_file(path, tuple(overrides), model)
    text.scene()
    with output_folder(out or default_out(path), inputs=[path]) as folder:
        from lcmchain.pipeline import run
        from lcmchain.study.chooser import Chooser
        from lcmchain.study.outcome import outcome_of
        from lcmchain.study.runs import INTERRUPTED

        result = None
        with progress_bar(quiet=quiet) as progress:

            def make(choice: Choice) -> Outcome:
                nonlocal result
                scene = chooser.scene_of(choice)
                try:
                    result = run(scene, folder, threads=threads, progress=progress)
                except SimulationInterrupted:  # its checkpoint is of no use: no --resume here
                    raise SimulationInterrupted(INTERRUPTED) from None
                return outcome_of(result.datasets, result.summary, scene)

            chooser = Chooser(
                text, folder / ".lcmchain" / "pilots", requirement, threads=threads,
                progress=progress, announce=(lambda _: None) if quiet else say,
            )  # fmt: skip
            choice = chooser.run(make)
        assert result is not None
        result.summary["choice"] = choice.as_dict()
        write_summary(folder, result.summary)
    warnings = print_result(result.summary, folder, quiet=quiet)
    if not quiet:
        say(f"Required: {choice.requirement}. Chosen: {choice.settings_in_words()}")
        say(choice.in_words())
    notes = [*choice.notes, *([] if choice.kept else [choice.missed()])]
    for note in notes:
        warn(note)
    require_none([*warnings, *notes], strict=strict)
