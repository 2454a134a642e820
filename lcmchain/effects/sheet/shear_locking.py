"""Locking of a fabric in shear, beyond the angle from which on its yarns touch.

Adds: a shear stress that grows with the cube of what the shear exceeds the locking angle by.
Source: ``lcmchain/materials/features/shear.py``.
Stability limit: the shear wave, where the locked tangent comes near that of the fibres.
Scene: ``material.membrane.locking_angle``, ``locking_stiffness``.
Fields: none; it shows as ``shear_angle``.
"""

from __future__ import annotations

from lcmchain.effects.effect import Effect, EffectModel, switch_of_materials

SWITCH = switch_of_materials(
    "locks",
    "without_locking",
    entry="material.membrane.locking_angle",
    without="what stops the shear at the locking angle",
    why_not_on=(
        "the material states no locking; give material.membrane.locking_angle and locking_stiffness"
    ),
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect for all sheets."""
    locks = any(body.material.locks for body in model.bodies)
    reason = "the law stiffens beyond its locking angle" if locks else "the law states no locking"
    return [Effect("shear locking", locks, reason)]
