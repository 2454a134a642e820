"""What accuracy costs in time: runs of a scene with many settings, against the finest of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.study.comparison import BY_NAME, QUANTITIES, Difference, differences
from lcmchain.study.convergence import NO_ORDER, Convergence, fitted, progress
from lcmchain.study.ladder import EDGE, chosen, ladder, scene_name
from lcmchain.study.levels import LEAST_PROGRESS
from lcmchain.study.outcome import Outcome
from lcmchain.study.process_pace import why_time_stays
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.source import Source
from lcmchain.study.variant import Variant

#: Quantities that the sentence of a study tells.
TOLD = ("shear_angle", "thickness", "punch_force", "clamp_force", "contour")


@dataclass(frozen=True, eq=False)
class Setting:
    """One run of a study with its errors against the reference, by the names of ``QUANTITIES``."""

    variant: Variant
    outcome: Outcome
    errors: Mapping[str, Difference]

    @property
    def seconds(self) -> float:
        return self.outcome.seconds

    def error(self, quantity: str) -> float:
        """Return the typical error, in SI or as a part."""
        return self.errors[quantity].typical


@dataclass(frozen=True, eq=False)
class AccuracyStudy:
    """What the settings cost, and what they are off by.

    Parameters
    ----------
    title : of the scene. settings : in the order of the study, without the reference.
    reference : the finest run. orders : by quantity, over the edge lengths of the three finest
        meshes, of which the reference is none where it differs in its process time as well.
    as_it_is : name of the setting that is the scene as it stands; process_time : of it [s].
    notes : what the study has left out, and why.
    """

    title: str
    settings: tuple[Setting, ...]
    reference: Setting
    orders: Mapping[str, Convergence]
    as_it_is: str = ""
    process_time: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def quantities(self) -> list[str]:
        """Names of the quantities that the reference has."""
        return [
            q.name
            for q in QUANTITIES
            if any(math.isfinite(setting.error(q.name)) for setting in self.settings)
        ]

    def efficient(self, quantity: str) -> list[Setting]:
        """Return the settings that no other one beats in both error and time, quickest first.

        Those on the mesh of the reference are left out: what they differ from it by says nothing
        of that mesh.
        """
        usable = [
            s for s in self.settings if math.isfinite(s.error(quantity)) and not self.on_finest(s)
        ]
        front: list[Setting] = []
        for setting in sorted(usable, key=lambda s: (s.seconds, s.error(quantity))):
            if not front or setting.error(quantity) < front[-1].error(quantity):
                front.append(setting)
        return front

    def on_finest(self, setting: Setting) -> bool:
        """Tell whether a setting has the mesh of the reference."""
        mine, finest = setting.outcome, self.reference.outcome
        return mine.faces.shape == finest.faces.shape and np.array_equal(
            mine.reference, finest.reference
        )

    def sentence(self) -> str:
        """Say what the scene as it is costs and gives, and what half of its error would cost."""
        scene = next((s for s in self.settings if s.variant.name == self.as_it_is), None)
        if scene is None or scene.outcome.failure:
            return ""
        told = [
            f"{BY_NAME[name].text(scene.error(name))} {BY_NAME[name].title}"
            for name in self.quantities
            if name in TOLD
        ]
        text = (
            f"{scene.variant.name}, {1e3 * self.process_time:.4g} ms: {', '.join(told)} for "
            f"{scene.seconds:.2g} s"
        )
        better = self.half_of("shear_angle", scene)
        if better is None:
            return f"{text}; no setting of the study halves the error of the shear angle"
        cost = better.seconds / scene.seconds
        return (
            f"{text}; half the error of the shear angle for {cost:.2g} times that time "
            f"({better.variant.name})"
        )

    def half_of(self, quantity: str, setting: Setting) -> Setting | None:
        """Return the quickest setting with half the error of another one; None without any."""
        return next(
            (
                s
                for s in self.efficient(quantity)
                if s.error(quantity) <= 0.5 * setting.error(quantity)
            ),
            None,
        )


def study_accuracy(
    text: Source,
    folder: Path,
    *,
    vary: Mapping[str, Sequence[str]] | None = None,
    finest: float = 0.5,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> AccuracyStudy:
    """Run a scene or a coupon with many settings, and compare each with the finest.

    Parameters
    ----------
    folder : where results are kept; those that lie there are not computed again.
    vary : values by scene entry, the finest last; by default a ladder made for the scene.
    finest : edge length of the reference by that of the scene, for the ladder.

    Raises
    ------
    InputError : an entry is wrong, or no setting can be run.
    SimulationInterrupted : Ctrl-C; the same call goes on from what is there.
    """
    variants = chosen(text, vary) if vary else ladder(text, finest)
    if len(variants) < 2:
        raise InputError("a study compares two settings at least", key="--vary")
    outcomes = Study(text, folder, workers).outcomes(variants, progress)
    *others, last = variants
    reference = outcomes[last.name]
    if reference.failure:
        raise InputError(
            f'the reference of the study, "{last.name}", failed: {reference.failure}; choose '
            "another one with --finest or --vary"
        )
    if all(outcomes[v.name].failure for v in others):
        first = others[0].name
        raise InputError(
            "nothing is left to compare: all other settings failed, the first "
            f'("{first}") since {outcomes[first].failure}; choose finer ones with --vary'
        )
    scene = text.scene()
    stays = "" if vary else why_time_stays(scene)
    return AccuracyStudy(
        title=scene.title,
        settings=tuple(
            Setting(v, outcomes[v.name], differences(outcomes[v.name], reference)) for v in others
        ),
        reference=Setting(last, reference, differences(reference, reference)),
        orders=_orders(variants if last.axis == EDGE else others, outcomes),
        as_it_is=scene_name(scene),
        process_time=scene.process.time,
        notes=(f"The process time is not varied, since {stays}",) if stays else (),
    )


def _orders(variants: Sequence[Variant], outcomes: Mapping[str, Outcome]) -> dict:
    """Return the orders over the three finest meshes that differ in nothing but edge length."""
    meshes = [
        v for v in variants
        if v.axis in (EDGE, "blank.edge_length") and v.value and not outcomes[v.name].failure
    ]  # fmt: skip
    meshes = sorted(meshes, key=lambda v: v.value or 0.0)[:3][::-1]
    if len(meshes) < 3:
        return {}
    runs = [outcomes[v.name] for v in meshes]
    between = {
        (i, j): differences(runs[i], runs[j]) for i, j in itertools.combinations(range(3), 2)
    }
    sizes = [v.value or math.nan for v in meshes]
    return {
        name: _order(sizes, {pair: found[name].typical for pair, found in between.items()})
        for name in BY_NAME
    }


def _order(sizes: Sequence[float], distances: Mapping[tuple[int, int], float]) -> Convergence:
    """Return the order over three meshes; none where finer ones change as much as coarse ones."""
    steps = distances[0, 1], distances[1, 2]
    if not all(step > 0.0 for step in steps) or progress(sizes, steps) < LEAST_PROGRESS:
        return NO_ORDER
    return fitted(sizes, distances)
