"""Bending that depends on its rate: a dashpot, and Maxwell elements beside the fabric's own law.

Adds: to the moment along either fibre direction those of a dashpot and of Maxwell elements.
Source: ``lcmchain/materials/features/bending_losses.py``.
Stability limit: the dashpot acts with the rate of the last half step, and shortens the step by its
damping rate; Maxwell elements count as springs of their moduli.
Scene: ``material.bending.viscous_1``, ``material.bending.viscous_2``.
Fields: ``viscous_bending_moment_1``, ``viscous_bending_moment_2``, ``viscous_bending_loss``,
``relaxing_bending_moment_1_1`` and so on; ``energy_viscous`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_laws, switch_of_materials
from lcmchain.materials.law import Material, bending_losses_of

SWITCH = switch_of_materials(
    "bending_resists_rates",
    "without_viscous_bending",
    entry="material.bending.viscous_1, material.bending.viscous_2",
    without="what resists the rate of the bending, and its relaxation",
    why_not_on="the material states no viscosity of bending; give material.bending.viscous_1",
)


def _in_words(material: Material) -> str | None:
    losses = bending_losses_of(material)
    if losses is None or not losses.resists_rates:
        return None
    told = []
    for number, direction in enumerate(losses.directions, 1):
        parts = [f"dashpot {direction.viscosity:.4g} N s m"] if direction.viscosity > 0.0 else []
        parts += [
            f"relaxing {term.modulus:.4g} N m in {term.time:.4g} s" for term in direction.terms
        ]
        if parts:
            told.append(f"along fibres {number} {', '.join(parts)}")
    return "; ".join(told)


active = of_the_laws("viscous bending", _in_words, "the bending does not depend on its rate")
