"""What accuracy costs in time: runs of a scene with many settings, against the finest of them.

The scene as it stands is one of them. Around it one thing at a time is varied, so that a reader
sees the gain of each. On the coarse mesh several are varied, since the cheap settings lie there.
The reference is the finest setting: the shortest edges and the longest process. Where the process
time is part of the physics (:func:`lcmchain.study.step_settings.why_time_stays`) it stays as it is
in all.

Not among them: integration points. The solid-shell integrates its Taylor expansion in closed form
and the shell its thickness, so there are none to choose (``lcmchain docs element``).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh.blank import Blank
from lcmchain.model import build_model
from lcmchain.scene import RUNGS, Scene, rung_of
from lcmchain.study.comparison import BY_NAME, QUANTITIES, Difference, differences
from lcmchain.study.convergence import LEAST_PROGRESS, NO_ORDER, Convergence, fitted, progress
from lcmchain.study.outcome import Outcome
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.sources import Source, Variant
from lcmchain.study.step_settings import why_time_stays

# --- settings -------------------------------------------------------------------------------------


#: Names of what is varied.
EDGE, TIME, BOTH = "edge length", "process time", "edge length and process time"
CONTACT, STEP, DAMPING = "contact stiffness", "time step", "damping"
RUNG, MASS, FIBRES = "model", "added mass", "fibre modulus"

#: Edge lengths, by that of the scene; the last one is that of the reference.
EDGES = (3.0, 2.0, 1.5, 1.0, 0.75, 0.5)
#: Process times of the scene's mesh, and of one with edges twice as long, by that of the scene.
TIMES = (0.5, 2.0)
TIMES_COARSE = (0.25, 0.5, 2.0)
#: Inertia by the mass of the sheet, and fibre modulus by that of the fabric.
MASSES = (4.0, 16.0)
MASS_EDGES = (1.0, 0.75)
SOFTER_FIBRES = 0.25
#: Edge lengths of the cheaper rungs.
RUNG_EDGES = (1.0, 2.0)
#: Process time of the reference, by that of the scene.
LONGEST = 2.0


def ladder(text: Source, finest: float = EDGES[-1]) -> list[Variant]:
    """Return the settings for a scene, the reference last.

    Parameters
    ----------
    finest : edge length of the reference, by that of the scene.

    Raises
    ------
    InputError : ``finest`` is not below one.
    """
    if not 0.0 < finest < 1.0:
        raise InputError(f"must lie between 0 and 1, is {finest:g}", key="--finest")
    scene = text.scene()
    variants = [_with_edge(scene, factor) for factor in EDGES[:-1] if factor > finest]
    reference = _with_edge(scene, finest)
    if not why_time_stays(scene):
        variants += [reference, *_with_times(scene)]
        reference = _with_both(scene, finest, LONGEST)
    variants += _of_contact(text, scene)
    safety = scene.process.step_safety
    variants.append(
        Variant(f"time step x {0.5:g}", STEP, (f"process.step_safety={0.5 * safety:.6g}",), 0.5)
    )
    if scene.process.mass_damping > 0.0:
        half = f'process.mass_damping="{0.5 * scene.process.mass_damping:.6g} 1/s"'
        variants.append(Variant("damping / 2", DAMPING, (half,), 0.5))
    variants += _with_larger_steps(text, scene)
    return [*variants, *_on_rungs(text, scene), reference]


def chosen(text: Source, vary: Mapping[str, Sequence[str]]) -> list[Variant]:
    """Return settings that a user has chosen: every value of every entry, one at a time.

    The last value of each entry counts as its finest; together they make the reference.

    Parameters
    ----------
    vary : values, as texts, by the dotted keys of the scene.
    """
    variants = [
        Variant(f"{key} = {value}", key, (f"{key}={value}",), number_of(text, key, value))
        for key, values in vary.items()
        for value in values
    ]
    if len(vary) > 1:
        finest = tuple(f"{key}={values[-1]}" for key, values in vary.items())
        variants.append(Variant("all of the last", "reference", finest))
    return variants


def number_of(text: Source, key: str, value: str) -> float | None:
    """Return the value of a scene entry in SI; None where it is no number."""
    node: Any = text.scene((f"{key}={value}",))
    for part in key.split("."):
        node = getattr(node, part, None)
    return float(node) if isinstance(node, int | float) and not isinstance(node, bool) else None


def scene_name(scene: Scene) -> str:
    """Return the name of the setting that is the scene as it stands."""
    return _edge_text(scene.stack.shortest_edge)


def _blank(scene: Scene) -> Blank:
    return scene.shared_blank("lcmchain study accuracy")


def _with_edge(scene: Scene, factor: float) -> Variant:
    edge = factor * _blank(scene).edge_length
    overrides = () if factor == 1.0 else (_edge(edge),)
    return Variant(_edge_text(edge), EDGE, overrides, edge)


def _with_times(scene: Scene) -> list[Variant]:
    """Return the scene with other process times, and with edges twice as long as well."""
    return [
        *(_with_time(scene, factor) for factor in TIMES),
        *(_with_both(scene, 2.0, factor) for factor in TIMES_COARSE),
    ]


def _with_time(scene: Scene, factor: float) -> Variant:
    time = factor * scene.process.time
    name = f"{_edge_text(_blank(scene).edge_length)}, {_time_text(time)}"
    return Variant(name, TIME, (_time(scene, factor),), time)


def _with_both(scene: Scene, of_edge: float, of_time: float) -> Variant:
    edge, time = of_edge * _blank(scene).edge_length, of_time * scene.process.time
    name = f"{_edge_text(edge)}, {_time_text(time)}"
    return Variant(name, BOTH, (_edge(edge), _time(scene, of_time)), edge)


def _of_contact(text: Source, scene: Scene) -> list[Variant]:
    """Return the scene with softer and with stiffer contact, where it has tools."""
    if not scene.tools:
        return []
    penalty = build_model(scene).environment.penalty
    return [
        Variant(
            f"contact stiffness x {factor:g}", CONTACT,
            (f'contact.penalty="{factor * penalty:.9g} Pa/m"',), factor * penalty,
        )
        for factor in (0.5, 2.0)
    ]  # fmt: skip


def _with_larger_steps(text: Source, scene: Scene) -> list[Variant]:
    """Return the scene with mass added, on a finer mesh as well, and with softer fibres."""
    # a process without a time takes as many steps with more mass
    heavier = [] if scene.time_is_found else _with_mass(scene)
    softer = SOFTER_FIBRES * scene.process.fibre_modulus_factor
    name = f"fibre modulus x {SOFTER_FIBRES:g}"
    fibres = f"process.fibre_modulus_factor={softer:g}"
    variants = [*heavier, Variant(name, FIBRES, (fibres,), softer)]
    if heavier:
        both = f"mass x {MASSES[0]:g}, {name}"
        variants.append(Variant(both, FIBRES, (*heavier[0].overrides, fibres), softer))
    return [variant for variant in variants if _fits(text, variant)]


def _with_mass(scene: Scene) -> list[Variant]:
    """Return the scene with mass added, on a finer mesh as well.

    A rate of damping drags with the inertia: n times the mass gets it divided by the root of n
    (``lcmchain docs larger-steps``).
    """
    variants = []
    for of_edge in MASS_EDGES:
        edge = of_edge * _blank(scene).edge_length
        for factor in MASSES:
            damping = scene.process.mass_damping / math.sqrt(factor)
            overrides = [f"process.mass_scaling={{factor = {factor:g}}}"]
            if damping > 0.0:
                overrides.append(f'process.mass_damping="{damping:.6g} 1/s"')
            if of_edge != 1.0:
                overrides.append(_edge(edge))
            name = f"{_edge_text(edge)}, mass x {factor:g}"
            variants.append(Variant(name, MASS, tuple(overrides), factor))
    return variants


def _fits(text: Source, variant: Variant) -> bool:
    """Tell whether the scene allows a setting: no law without fibres has softer ones."""
    try:
        text.job(variant)
    except InputError:
        return False
    return True


def _on_rungs(text: Source, scene: Scene) -> list[Variant]:
    """Return the cheaper rungs of the model ladder, the quick ones on the coarse mesh as well."""
    rungs = list(RUNGS)
    variants = []
    for model in rungs[: rungs.index(rung_of(scene))]:
        for factor in RUNG_EDGES:
            edge = factor * _blank(scene).edge_length
            variants.append(
                Variant(f"{model}, {_edge_text(edge)}", RUNG, (_edge(edge),), edge, model)
            )
    # not every rung knows the law, or has something to drape on
    return [variant for variant in variants if _fits(text, variant)]


def _edge(length: float) -> str:
    return f'blank.edge_length="{1e3 * length:.9g} mm"'


def _time(scene: Scene, factor: float) -> str:
    if scene.time_is_found:
        return f"process.quasi_static={factor * scene.process.quasi_static:.9g}"
    return f'process.time="{1e3 * factor * scene.process.time:.9g} ms"'


def _edge_text(length: float) -> str:
    return f"{1e3 * length:.4g} mm"


def _time_text(time: float) -> str:
    return f"{1e3 * time:.4g} ms"


# --- the study ------------------------------------------------------------------------------------


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
    """Cost and errors of the settings.

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
