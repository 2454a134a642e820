"""Shear that depends on its rate: fabric that is wet with resin or a melt resists it, and relaxes.

Adds: to the shear stress that of a dashpot, and of Maxwell elements beside the fabric's own law.
Source: ``lcmchain/materials/features/viscous_shear.py``.
Stability limit: the dashpot acts with the rate of the last half step, and shortens the step by its
damping rate; Maxwell elements count as springs of their moduli.
Scene: ``material.viscous``.
Fields: ``viscous_shear_stress``, ``viscous_dissipation``, ``shear_strain_before``,
``relaxing_moment_1`` and so on; ``energy_viscous`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import (
    Effect,
    EffectModel,
    EffectScene,
    of_materials,
    switch_of_materials,
)
from lcmchain.materials.features.viscous_shear import viscous_of
from lcmchain.materials.law import Material

SWITCH = switch_of_materials(
    "resists_shear_rates",
    "without_viscosity",
    entry="material.viscous",
    without="what resists the rate of the shear, and its relaxation",
    why_not_on="the material states no viscosity; give material.viscous",
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect for all sheets."""
    nothing = "the shear does not depend on its rate"
    effect = of_materials("viscous shear", model, _in_words, nothing)
    if effect.active and (fields := temperatures_of(model)):
        effect = effect._replace(reason=f"{effect.reason}, {fields}")
    return [effect]


def _in_words(material: Material) -> str | None:
    viscous = viscous_of(material)
    return None if viscous is None else viscous.in_words()


def temperatures_of(model: EffectModel) -> str:
    """Say in words how the temperature differs over the sheets; empty where it does not."""
    fields = [getattr(body.material, "temperature", None) for body in model.bodies]
    return " and ".join(dict.fromkeys(field.in_words() for field in fields if field is not None))


def remarks(scene: EffectScene) -> list[str]:
    """Return what in a scene changes stresses that depend on a rate, a sentence each."""
    materials = [ply.material for ply in scene.stack]
    entries = []
    if any(material.resists_shear_rates for material in materials):
        entries.append(("shear", "material.viscous"))
    if any(material.relaxes for material in materials):
        entries.append(("compaction", "material.viscous.compaction"))
    if any(material.bending_resists_rates for material in materials):
        entries.append(("bending", "material.bending.viscous_1 and viscous_2"))
    remarks = [
        f"the viscous {what} takes process.time = {1e3 * scene.process.time:.4g} ms for the time "
        "of the real process; where it is a shorter one, give the viscosities and relaxation times "
        f"of {entry} multiplied by process.time over the real time: the stresses are the same"
        for what, entry in entries
    ]
    if not remarks:
        return []
    if scene.process.mass_scaling is not None:
        remarks.append(
            "process.mass_scaling leaves the viscous stresses as they are, if the process is slow "
            "enough for its inertia to play no part; vibrations of a heavier sheet are slower, and "
            "are resisted as such"
        )
    return remarks
