"""``lcmchain study``: what accuracy costs, what effects change, what results depend on."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.commands.options import (
    Overrides,
    Quiet,
    default_out,
    output_folder,
    results_option,
    takes_options,
)
from lcmchain.commands.terminal import progress_bar, say, show_whole, warn
from lcmchain.errors import InputError, UnfinishedRun

if TYPE_CHECKING:
    from lcmchain.study.runs import Workers

OutFolder = Annotated[
    Path | None,
    results_option("<scene>_<study>"),
]

study_app = typer.Typer(
    no_args_is_help=True,
    help="What accuracy costs in time, what effects change, what results depend on.",
)

Studied = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        help="Scene file (TOML), or a coupon: bias-extension, picture-frame, off-axis.",
    ),
]
Vary = Annotated[
    list[str] | None,
    typer.Option(
        "--vary",
        metavar="KEY=A|B|C",
        help="Values of a scene entry, the finest last; may be repeated. Default: a ladder.",
    ),
]


@dataclass(frozen=True)
class RunOptions:
    """Options of all studies: who makes their runs."""

    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, metavar="N", help="Runs side by side; default one per core."
        ),
    ] = None
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, metavar="N", help="Threads of each run.")
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Make the runs on this dask cluster."),
    ] = None

    def as_workers(self) -> Workers:
        """Return who makes the runs: one process per core by default, where dask is installed."""
        from lcmchain.study.runs import Workers

        count = self.workers
        if self.scheduler is not None and count is not None:
            raise InputError("a cluster has its own workers; leave it out", key="--workers")
        if count is None:
            count = 1
            if self.scheduler is None and find_spec("distributed") is not None:
                count = max(1, (os.cpu_count() or 1) // (self.threads or 1))
        return Workers(count, self.threads, self.scheduler)


@study_app.command("accuracy")
@takes_options
def study_accuracy(
    scene: Studied,
    out: OutFolder = None,
    vary: Vary = None,
    finest: Annotated[
        float,
        typer.Option("--finest", metavar="F", help="Edges of the reference, by the scene's."),
    ] = 0.5,
    *,
    run_by: RunOptions,
    overrides: Overrides = None,
    quiet: Quiet = False,
) -> None:
    """Run a scene with many settings, and show error against time."""
    from lcmchain.study import read_source

    text = read_source(scene, tuple(overrides or ()))
    chosen = values_of(vary or ())
    with output_folder(out or study_folder(scene, "accuracy"), inputs=[scene]) as folder:
        from lcmchain.study import study_accuracy as run_study
        from lcmchain.study.accuracy_files import (
            failures,
            order_table,
            terminal_table,
            write_accuracy,
        )

        with progress_bar(quiet=quiet) as progress:
            study = run_study(
                text, folder, vary=chosen, finest=finest,
                workers=run_by.as_workers(), progress=progress,
            )  # fmt: skip
        write_accuracy(folder, study)
    if not quiet:
        show_whole(terminal_table(study))
        if study.orders:
            show_whole(order_table(study))
        if study.sentence():
            say(study.sentence())
        for note in study.notes:
            say(note)
        say(f"Chart, tables and report in {folder}")
    for failure in failures(study):
        warn(failure)


@study_app.command("effects")
@takes_options
def study_effects(
    scene: Studied,
    out: OutFolder = None,
    *,
    run_by: RunOptions,
    overrides: Overrides = None,
    quiet: Quiet = False,
) -> None:
    """Switch each effect of a scene over, and show what that changes of result and time."""
    from lcmchain.study import read_source

    text = read_source(scene, tuple(overrides or ()))
    with output_folder(out or study_folder(scene, "effects"), inputs=[scene]) as folder:
        from lcmchain.study.effects import effects_table, write_effects
        from lcmchain.study.effects import study_effects as run_study

        with progress_bar(quiet=quiet) as progress:
            study = run_study(text, folder, workers=run_by.as_workers(), progress=progress)
        write_effects(folder / "effects.csv", study)
    if not quiet:
        show_whole(effects_table(study))
        say(f"Table in {folder}")
    for change in study.changes:
        if change.failure:
            warn(f"{change.effect.name} switched over: no result, {change.failure}")


@study_app.command("sweep")
@takes_options
def study_sweep(
    scene: Studied,
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary", metavar="KEY=VALUES", help="Values A|B|C or a range A..B; may be repeated."
        ),
    ],
    sample_count: Annotated[
        int | None,
        typer.Option("--samples", min=2, metavar="N", help="Points of the ranges, spread evenly."),
    ] = None,
    out: OutFolder = None,
    *,
    run_by: RunOptions,
    overrides: Overrides = None,
    quiet: Quiet = False,
) -> None:
    """Run a scene over values of any of its entries."""
    from lcmchain.study import read_source
    from lcmchain.study.sweep import read_entry

    text = read_source(scene, tuple(overrides or ()))
    title = text.scene().title
    entries = [read_entry(entry) for entry in vary]
    with output_folder(out or study_folder(scene, "sweep"), inputs=[scene]) as folder:
        from lcmchain.study.sweep import run_sweep, sweep_table, write_sweep

        with progress_bar(quiet=quiet) as progress:
            runs = run_sweep(
                text, folder, entries, count=sample_count,
                workers=run_by.as_workers(), progress=progress,
            )  # fmt: skip
        write_sweep(folder, title, runs)
    if not quiet:
        show_whole(sweep_table(title, runs))
        say(f"Tables in {folder}")
    failed = [run for run in runs if run.failure]
    for run in failed:
        warn(f"{run.variant.name}: no result, {run.failure}")
    if failed:  # what was asked for is not all there; in the other studies a failure is a finding
        raise UnfinishedRun(
            f"{len(failed)} of {len(runs)} runs gave no result, for the reasons above; what the "
            f"others gave is in {folder}"
        )


@study_app.command("sensitivity")
@takes_options
def study_sensitivity(
    scene: Studied,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY",
            help="Scene entry with a number; may be repeated. Default: material and friction.",
        ),
    ] = None,
    part: Annotated[
        float, typer.Option("--part", metavar="P", help="Part by which each is changed.")
    ] = 0.1,
    out: OutFolder = None,
    *,
    run_by: RunOptions,
    overrides: Overrides = None,
    quiet: Quiet = False,
) -> None:
    """Find which inputs the results of a scene depend on."""
    from lcmchain.study import read_source

    text = read_source(scene, tuple(overrides or ()))
    with output_folder(out or study_folder(scene, "sensitivity"), inputs=[scene]) as folder:
        from lcmchain.study.sensitivity import (
            run_sensitivity,
            sensitivity_table,
            write_sensitivity,
        )

        with progress_bar(quiet=quiet) as progress:
            found = run_sensitivity(
                text, folder, vary or (), part=part,
                workers=run_by.as_workers(), progress=progress,
            )  # fmt: skip
        write_sensitivity(folder / "sensitivity.csv", found)
    if not quiet:
        show_whole(sensitivity_table(found))
        say(f"Table in {folder}")
    for failure in found.failures:
        warn(failure)


def study_folder(scene: Path, kind: str) -> Path:
    """Name the folder of a study: that of the scene's results, and what is studied."""
    return default_out(scene).with_name(f"{default_out(scene).name}_{kind}")


def values_of(vary: Sequence[str]) -> dict[str, list[str]]:
    """Return the values by key of texts ``KEY=A|B|C``.

    Raises
    ------
    InputError : a text is not of that form, or names a key twice.
    """
    from lcmchain.study.sweep import read_entry

    found: dict[str, list[str]] = {}
    for entry in map(read_entry, vary):
        if entry.is_range:
            raise InputError(
                f'"{entry.key}" has a range; list its values, as in '
                '--vary "blank.edge_length=10 mm|5 mm"',
                key="--vary",
            )
        if entry.key in found:
            raise InputError(f'"{entry.key}" is given twice', key="--vary")
        found[entry.key] = list(entry.values)
    return found
