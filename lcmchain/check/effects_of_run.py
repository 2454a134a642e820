"""The effects of a run: those of its compiled model, and the stages that follow forming."""

from __future__ import annotations

from lcmchain.effects.audit import effects_of
from lcmchain.effects.effect import Effect
from lcmchain.effects.switches import settings_of
from lcmchain.model import Model
from lcmchain.scene import Infiltration, Scene, Structure


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
    found = [
        Effect(
            f"mapping to {target.name}", True, f"{target.kind} mesh {target.mesh}, {target.method}"
        )
        for target in scene.mapping
    ]
    if not found:
        found.append(Effect("mapping", False, "no [[mapping]] entry"))
    found += [
        Effect(f"structural analysis of {target.name}", True, _structure_text(target.structure))
        for target in scene.mapping
        if target.structure is not None
    ]
    for name, (case, _) in scene.infiltrations.items():
        found.append(Effect(f"infiltration of {name}", True, _infiltration_text(case)))
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    return [*found, Effect("permeability", scene.permeability is not None, law)]


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
