"""Friction in bending: fibres that are bent rub on each other, and are bent back another way.

Adds: to the moment along either fibre direction that of Dahl's friction.
Source: ``lcmchain/materials/features/bending_losses.py``.
Stability limit: it stiffens the bending by twice its own stiffness at rest, where the way turns.
Scene: ``material.bending.friction_1``, ``material.bending.friction_2``.
Fields: ``bending_friction_moment_1``, ``bending_friction_moment_2``, ``bending_friction_loss``,
``curvature_before_1``, ``curvature_before_2``; ``energy_inelastic`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_laws, switch_of_materials
from lcmchain.materials.law import Material, bending_losses_of

SWITCH = switch_of_materials(
    "bending_rubs",
    "without_bending_friction",
    entry="material.bending.friction_1, material.bending.friction_2",
    without="what keeps fibres bent when the load is gone",
    why_not_on="the material states no friction; give material.bending.friction_1",
)


def _in_words(material: Material) -> str | None:
    losses = bending_losses_of(material)
    if losses is None or not losses.rubs:
        return None
    return "; ".join(
        f"along fibres {number} up to {direction.friction.limit:.4g} N within "
        f"{direction.friction.length:.4g} 1/m"
        for number, direction in enumerate(losses.directions, 1)
        if direction.friction is not None
    )


active = of_the_laws("bending friction", _in_words, "bent fibres do not rub")
