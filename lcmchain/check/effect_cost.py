"""The effects of a run, each with its reason, and what one costs.

The cost of an effect is the part of a step's time that is saved when the effect is taken out of a
scene. It is measured on the model of the scene itself. The scene is formed to a given time; then
the same steps are made with the effect and without it in turn, each in compiled code of its own.
Contact is left out by searching no node near a tool. The parts are kept per machine beside its
speed, in the user's cache folder, so that a check can tell them at no cost. They do not add up to
one, since effects share some of the work.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.check.expected_cost import keep_numbers, kept_numbers, speed_key
from lcmchain.compilation.threads import thread_count, use_threads
from lcmchain.effects.effect import Effect
from lcmchain.effects.switches import (
    Switchable,
    effects_of,
    settings_of,
    switchable_effects,
    switches,
    with_effect,
)
from lcmchain.model import Model
from lcmchain.scene import Infiltration, Scene, Structure
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation
from lcmchain.state import State

if TYPE_CHECKING:
    from rich.table import Table


def run_effects(scene: Scene, model: Model) -> list[Effect]:
    """Return the effects of a scene's model and its later stages, each with the reason."""
    settings = settings_of(scene)
    of_model = [
        effect._replace(reason=f'effects.{effect.key} = "{settings[effect.key]}"; {effect.reason}')
        if effect.key in settings
        else effect
        for effect in effects_of(model)
    ]
    return [*of_model, *later_stages(scene)]


def later_stages(scene: Scene) -> list[Effect]:
    """Return the stages of a scene that follow forming, as effects."""
    effects = [
        Effect(
            f"mapping to {target.name}", True, f"{target.kind} mesh {target.mesh}, {target.method}"
        )
        for target in scene.mapping
    ]
    if not effects:
        effects.append(Effect("mapping", False, "no [[mapping]] entry"))
    effects += [
        Effect(f"structural analysis of {target.name}", True, _structure_text(target.structure))
        for target in scene.mapping
        if target.structure is not None
    ]
    for name, (case, _) in scene.infiltrations.items():
        effects.append(Effect(f"infiltration of {name}", True, _infiltration_text(case)))
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    return [*effects, Effect("permeability", scene.permeability is not None, law)]


def _infiltration_text(case: Infiltration) -> str:
    """Say what flows from where to where, and what else is simulated."""
    parts = [
        *(f"gate {gate.name}: {gate.in_words}" for gate in case.gates),
        *(f"vent {vent.name}: {vent.in_words}" for vent in case.vents),
        *(f"region {region.name}: {region.in_words}" for region in case.regions),
        *(f"race track {t.name}: {1e3 * t.width:.3g} mm, {t.in_words}" for t in case.race_tracks),
        *(f"wetted {place.name}: {place.in_words}" for place in case.wetted),
        *([f"resin film: {case.film.in_words}"] if case.film is not None else []),
        *([f"flow medium: {case.flow_medium.in_words}"] if case.flow_medium is not None else []),
        *([case.closure.in_words] if case.closure is not None else []),
        *([case.with_forming.in_words] if case.with_forming is not None else []),
        *(["gravity"] if case.gravity is not None else []),
        *(["trapped air is compressed"] if case.trapped_air else []),
        f"at most {case.time:g} s",
    ]
    return "; ".join(parts)


def _structure_text(structure: Structure) -> str:
    """Say what is analysed."""
    asked = [*(["static loads"] if structure.loads else [])]
    if structure.frequencies:
        asked.append(f"{structure.frequencies} eigenfrequencies")
    return " and ".join(asked) or "the deck alone"


# --- what an effect costs -------------------------------------------------------------------------


FILE = "effects.json"
# Steps are timed in turn with and without an effect; other work only ever adds to a time, so that
# the least of so many counts.
REPETITIONS = 25
CHUNKS = 4
# Noise may make a part negative; what is kept are parts of a whole.
BOUNDS = (1e-9, 1.0 - 1e-9)
# These change the number of steps, not the cost of one.
OF_THE_STEP_SIZE = ("mass_scaling", "fibre_modulus")
CONTACT = "contact"


def measurable_effects(scene: Scene) -> list[Switchable]:
    """Return the effects of a scene whose part of a step can be measured."""
    effects = [one for one in switchable_effects(scene) if one.name not in OF_THE_STEP_SIZE]
    if scene.tools and CONTACT not in [one.name for one in effects]:
        effects.append(Switchable(CONTACT, "on", switches()[CONTACT].entry))
    return effects


class EffectCost(NamedTuple):
    """What a step costs with an effect and without it.

    effect : which, and whether the scene has it. with_it, without_it : seconds per element and
    step, the least of several.
    """

    effect: Switchable
    with_it: float
    without_it: float

    @property
    def part(self) -> float:
        """Part of the time of a step that the effect takes, as measured; noise may exceed it."""
        return 1.0 - self.without_it / self.with_it


def measure_effects(
    scene: Scene, effects: Sequence[Switchable] | None = None, *, at: float = 0.5
) -> list[EffectCost]:
    """Measure what effects of a scene cost, on one thread.

    Parameters
    ----------
    effects : those to measure, by default those of :func:`measurable_effects`.
    at : part of the process to which the scene is formed first, as it is: steps with and without
        an effect begin at the same shape.

    Raises
    ------
    Refusal : an effect that cannot be switched in this scene.
    """
    threads = thread_count()
    use_threads(1)
    try:
        return _measured(scene, measurable_effects(scene) if effects is None else effects, at)
    finally:
        use_threads(threads)


def _measured(scene: Scene, effects: Sequence[Switchable], at: float) -> list[EffectCost]:
    plain = Simulation.from_scene(scene)
    plain.advance_to(at * scene.process.time)
    start, step = plain.state.copy(), plain.prepare_steps()
    costs = []
    for effect in effects:
        if effect.name == CONTACT:
            other = Runner(Simulation(plain.model), start, searches=False)
        else:
            setting = "off" if effect.state == "on" else "on"
            changed = Simulation.from_scene(with_effect(scene, effect.name, setting))
            other = Runner(changed, _taken_over(changed.model, start))
        least = _least_times((Runner(plain, start), other), step)
        if effect.state == "off":
            least = least[::-1]
        costs.append(EffectCost(effect, *least))
    return costs


def _taken_over(model: Model, state: State) -> State:
    """Return a state of a model with all of another one's that fits it, else as at rest."""
    own = State.at_rest(model)
    for name, array in own.as_dict().items():
        other = getattr(state, name)
        if other.shape == array.shape:
            np.copyto(array, other)
    return own


class Runner(NamedTuple):
    """A simulation that makes steps from a state, with or without looking for contact."""

    simulation: Simulation
    state: State
    searches: bool = True

    def prepare(self) -> None:
        """Go back to the state, and find the nodes near tools."""
        self.simulation.restore(self.state)
        self.simulation.prepare_steps()

    def make_steps(self, step: float) -> None:
        """Make the steps that are timed, of ``step`` [s]."""
        for _ in range(CHUNKS):
            if self.searches:
                self.simulation.find_contact()
            else:
                self.simulation.state.near[:] = 0
            self.simulation.make_steps(STEPS_PER_CHUNK, step)


def _least_times(runners: tuple[Runner, Runner], step: float) -> tuple[float, float]:
    """Return the least time per element and step of two runners that take turns."""
    samples: tuple[list[float], list[float]] = ([], [])
    for turn in range(REPETITIONS + 1):
        for sample, runner in zip(samples, runners, strict=True):
            runner.prepare()
            begin = time.process_time()
            runner.make_steps(step)
            if turn > 0:  # the first one compiles
                sample.append(time.process_time() - begin)
    count = CHUNKS * STEPS_PER_CHUNK * runners[0].simulation.model.element_count
    return min(samples[0]) / count, min(samples[1]) / count


def record_effect_parts(model: Model, parts: Mapping[str, float]) -> None:
    """Keep measured parts of the time by effect, for later checks of such models here.

    They are kept for any number of threads, on which they hardly depend.
    """
    kept = kept_numbers(FILE)
    for name, part in parts.items():
        keep_numbers(FILE, kept, f"{speed_key(model, 1)}, {name}", float(np.clip(part, *BOUNDS)))


def effect_parts(model: Model) -> dict[str, float]:
    """Return the parts of the time by effect that were measured here for such models."""
    kept, start = kept_numbers(FILE), f"{speed_key(model, 1)}, "
    return {
        key.removeprefix(start): statistics.median(values)
        for key, values in kept.items()
        if key.startswith(start)
    }


def cost_table(costs: Sequence[EffectCost]) -> Table:
    """Return the costs as a table for a terminal."""
    from rich.table import Table

    table = Table(title="What effects cost, one thread, least of several", title_justify="left")
    table.add_column("effect")
    for column in ("with, ns", "without, ns", "part of a step"):
        table.add_column(column, justify="right")
    for cost in costs:
        values = f"{1e9 * cost.with_it:.2f}", f"{1e9 * cost.without_it:.2f}", f"{cost.part:.1%}"
        table.add_row(cost.effect.name.replace("_", " "), *values)
    return table
