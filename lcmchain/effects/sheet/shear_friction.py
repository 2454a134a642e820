"""Friction in shear: yarns rub where they turn on each other, and fabric comes back another way.

Adds: to the shear stress that of Dahl's friction.
Source: ``lcmchain/materials/features/shear_friction.py``.
Stability limit: it stiffens the shear by twice its own stiffness at rest, where the way turns.
Scene: ``material.membrane.friction``.
Fields: ``shear_friction_moment``, ``shear_friction_loss``, ``shear_strain_rubbed``;
``energy_inelastic`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_laws, switch_of_materials
from lcmchain.materials.features.shear_friction import shear_friction_of
from lcmchain.materials.law import Material

SWITCH = switch_of_materials(
    "shear_rubs",
    "without_shear_friction",
    entry="material.membrane.friction",
    without="what keeps fabric sheared when the load is gone",
    why_not_on="the material states no friction in shear; give material.membrane.friction",
)


def _in_words(material: Material) -> str | None:
    friction = shear_friction_of(material)
    return None if friction is None else friction.in_words()


active = of_the_laws("shear friction", _in_words, "sheared fabric does not rub")
