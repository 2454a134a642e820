"""``lcmchain run --within ... --budget ...``: a run whose settings the program chooses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lcmchain.commands.folders import default_out, output_folder
from lcmchain.commands.run_report import print_result
from lcmchain.commands.terminal import progress_bar, require_none, say, warn
from lcmchain.errors import InputError, SimulationInterrupted

if TYPE_CHECKING:
    from lcmchain.study.choice import Choice
    from lcmchain.study.outcome import Outcome


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
    """Run a scene with the settings that keep a wish, and say what was chosen and why.

    Raises
    ------
    InputError : a wish that cannot be read, ``--resume``, or wrong input.
    SimulationInterrupted : Ctrl-C; the pilots are kept.
    """
    from lcmchain.study.choice import read_wish
    from lcmchain.study.sources import SceneText

    if resume:
        raise InputError(
            "a run whose settings are chosen starts anew (its pilots are kept); leave it out",
            key="--resume",
        )
    wish = read_wish(within, budget)
    text = SceneText.from_file(path, tuple(overrides), model)
    text.scene()
    with output_folder(out or default_out(path), inputs=[path]) as folder:
        from lcmchain.pipeline import run
        from lcmchain.results.folder import write_summary
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
                text, folder / ".lcmchain" / "pilots", wish, threads=threads, progress=progress,
                announce=(lambda _: None) if quiet else say,
            )  # fmt: skip
            choice = chooser.run(make)
        assert result is not None
        result.summary["choice"] = choice.as_dict()
        write_summary(folder, result.summary)
    warnings = print_result(result.summary, folder, quiet=quiet)
    if not quiet:
        say(f"Wished: {choice.wish}. Chosen: {choice.settings_in_words()}")
        say(choice.in_words())
    notes = [*choice.notes, *([] if choice.kept else [choice.missed()])]
    for note in notes:
        warn(note)
    require_none([*warnings, *notes], strict=strict)
