"""Lowered fibre modulus: fibres that stretch a little more, for a larger time step.

Adds: nothing; the moduli C11 and C22 of the membrane are those of the fabric times a factor. The
fibre wave sets the step of a fabric, and its fibres hardly stretch: a tenth of the modulus makes
the step three times as long, and lets the fibres strain by about ten times as much, still far below
the angles and stretches of forming. The bending stiffness keeps its fibres. The automatic contact
stiffness follows the modulus.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2 (step of a wave); the bound
by a stated strain: own.
Stability limit: none of its own; it lowers that of the fibres.
Scene: ``process.fibre_modulus_factor``, ``process.fibre_strain_allowed``.
Fields: ``fibre_strain_1``, ``fibre_strain_2`` tell what it does.
"""

from __future__ import annotations

from lcmchain.effects.effect import Effect, EffectModel, Switch, of_table, refused

SWITCH = Switch(
    entry="process.fibre_modulus_factor",
    without="the larger time step; the fibres have their own modulus",
    called=lambda scene: scene.process.fibre_modulus_factor != 1.0,
    off=of_table("process", fibre_modulus_factor=1.0),
    on=refused("the factor is 1; give process.fibre_modulus_factor"),
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect for all sheets."""
    factors = {getattr(body.material, "fibre_modulus_factor", 1.0) for body in model.bodies}
    if factors == {1.0}:
        return [Effect("lowered fibre modulus", False, "fibres have the modulus of the fabric")]
    text = " and ".join(f"{factor:g}" for factor in sorted(factors))
    return [Effect("lowered fibre modulus", True, f"C11 and C22 of the membrane times {text}")]
