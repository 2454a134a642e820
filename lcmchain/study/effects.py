"""Study of effects: how each one changes the result of a scene, and its part of the time."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.effects.switches import Switchable, switchable_effects
from lcmchain.errors import InputError
from lcmchain.study.comparison import QUANTITIES, Difference, differences
from lcmchain.study.outcome import Outcome
from lcmchain.study.results import plain_table, short
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.sources import Source, Variant


@dataclass(frozen=True, eq=False)
class EffectChange:
    """Difference of a run with one effect switched over from the scene as it is.

    Parameters
    ----------
    effect : which, whether the scene has it, and why.
    changes : of the result by the names of ``QUANTITIES``. seconds : solver time of the run.
    part : of the time of a step that the effect takes, measured on the same state; not a number
        where the effect changes the size of the step, which tells more.
    steps : of the run, over those of the scene as it is.
    """

    effect: Switchable
    changes: dict[str, Difference]
    seconds: float
    part: float
    steps: float
    failure: str


@dataclass(frozen=True, eq=False)
class EffectStudy:
    """The changes by all effects that can be switched; ``seconds`` is of the scene as it is."""

    title: str
    seconds: float
    changes: tuple[EffectChange, ...]

    @property
    def quantities(self) -> list:
        """The quantities that the scene has."""
        return [
            q for q in QUANTITIES
            if any(c.changes[q.name].typical == c.changes[q.name].typical for c in self.changes)
        ]  # fmt: skip


def study_effects(
    text: Source,
    folder: Path,
    *,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> EffectStudy:
    """Switch each effect of a scene over in turn.

    The part of a step's time that each takes is kept for later checks of scenes like this one.

    Raises
    ------
    InputError : the scene has no effect that can be switched, or fails as it is.
    SimulationInterrupted : Ctrl-C; the same call goes on from what is there.
    """
    scene = text.scene()
    effects = switchable_effects(scene)
    if not effects:
        raise InputError("the scene has no effect that could be switched", file=text.path)
    base = Variant("as it is", "effects")
    variants = [base, *(_variant(effect) for effect in effects)]
    outcomes = Study(text, folder, workers).outcomes(variants, progress)
    as_it_is = outcomes[base.name]
    if as_it_is.failure:
        raise InputError(f"the scene itself fails: {as_it_is.failure}", file=text.path)
    if progress is not None:
        progress(1.0, 1.0, "measuring the time of each effect")
    parts = text.effect_parts()
    return EffectStudy(
        scene.title,
        as_it_is.seconds,
        tuple(
            _change(
                effect, parts.get(effect.name, math.nan), outcomes[_variant(effect).name], as_it_is
            )
            for effect in effects
        ),
    )


def _variant(effect: Switchable) -> Variant:
    other = "off" if effect.state == "on" else "on"
    return Variant(f"{effect.name} {other}", "effects", (f"effects.{effect.name}={other}",))


def _change(effect: Switchable, part: float, outcome: Outcome, as_it_is: Outcome) -> EffectChange:
    steps = outcome.numbers.get("step_count", 0.0) / as_it_is.numbers["step_count"]
    changes = differences(outcome, as_it_is)
    return EffectChange(effect, changes, outcome.seconds, part, steps, outcome.failure)


def effects_table(study: EffectStudy) -> Table:
    """Return the changes as a table for the terminal."""
    table = plain_table(
        f"What effects change: {study.title}",
        "effect", "scene", "of a\nstep", "steps",
        *(f"{q.short}\n{q.unit}" for q in study.quantities),
        names=2,
        caption="each effect switched over alone: its part of a step's time, the steps of the run, "
        "and what it changes\n(root mean square over the sheet; force and work: of the number)",
    )  # fmt: skip
    for change in sorted(study.changes, key=lambda c: -np.nan_to_num(c.part)):
        if change.failure:
            cells: Sequence[str] = ["-", *("fails" for _ in study.quantities)]
        else:
            cells = [
                f"x {change.steps:.2f}",
                *(short(q.scale * change.changes[q.name].typical) for q in study.quantities),
            ]
        name = change.effect.name.replace("_", " ")
        table.add_row(
            name,
            change.effect.state,
            "-" if math.isnan(change.part) else f"{change.part:.0%}",
            *cells,
        )
    return table


def write_effects(path: Path, study: EffectStudy) -> None:
    """Write a row per effect, changes in SI or as parts."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = [q.name for q in QUANTITIES]
        writer.writerow(
            ["effect", "scene_has_it", "why", "part_of_step", "step_ratio", "seconds", *names,
             "failure"]
        )  # fmt: skip
        for c in study.changes:
            changes = [f"{c.changes[name].typical:.6g}" for name in names]
            writer.writerow(
                [c.effect.name, c.effect.state, c.effect.why, f"{c.part:.4g}", f"{c.steps:.6g}",
                 f"{c.seconds:.4g}", *changes, c.failure]
            )  # fmt: skip
