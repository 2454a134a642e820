"""The effects of a run: those of its compiled model, and the stages that follow forming."""

from __future__ import annotations

from lcmchain.effects.audit import effects_of
from lcmchain.effects.effect import Effect
from lcmchain.model import Model
from lcmchain.scene import Scene, Structure


def run_effects(scene: Scene, model: Model) -> list[Effect]:
    """Return the effects of a scene's model and its later stages, each with the reason."""
    return [*effects_of(model), *_stages(scene)]


def _stages(scene: Scene) -> list[Effect]:
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
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    return [*found, Effect("permeability", scene.permeability is not None, law)]


def _structure_text(structure: Structure) -> str:
    """Say what is analysed."""
    asked = [*(["static loads"] if structure.loads else [])]
    if structure.frequencies:
        asked.append(f"{structure.frequencies} eigenfrequencies")
    return " and ".join(asked) or "the deck alone"
