"""The effects of a run: those of its compiled model, and the stages that follow forming."""

from __future__ import annotations

from lcmchain.effects.audit import effects_of
from lcmchain.effects.effect import Effect
from lcmchain.model import Model
from lcmchain.scene import Scene


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
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    return [*found, Effect("permeability", scene.permeability is not None, law)]
