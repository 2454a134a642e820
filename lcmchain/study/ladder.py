"""The settings of a study of accuracy: what a scene's accuracy and its cost depend on.

The scene as it stands is one of them. Around it one thing at a time is varied, so that a reader
sees what each buys; with the coarse mesh several, since the cheap settings lie there. The
reference is the finest: the shortest edges and the longest process. Where the process time is part
of the physics (:mod:`lcmchain.study.process_pace`) it stays as it is in all of them.

Not among them: integration points. The solid-shell integrates its Taylor expansion in closed form
and the shell its thickness, so there are none to choose (``lcmchain docs element``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lcmchain.errors import InputError
from lcmchain.mesh.blank import Blank
from lcmchain.model import build_model
from lcmchain.scene import RUNGS, Scene, rung_of
from lcmchain.study.process_pace import why_time_stays
from lcmchain.study.source import Source
from lcmchain.study.variant import Variant

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
