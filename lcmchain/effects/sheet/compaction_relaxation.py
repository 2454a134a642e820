"""Relaxing compaction: the pressure on a held gap falls, a gap under a held pressure closes on.

Adds: to the compaction stress those of Maxwell elements, each a share of the compaction law.
Source: ``lcmchain/materials/features/relaxation.py``.
Stability limit: that of the compaction, whose tangent is larger by all shares together.
Scene: ``material.viscous.compaction``.
Fields: ``compaction_strain_before``, ``compaction_stress_before``, ``relaxing_work``,
``relaxing_compaction_1`` and so on; ``energy_viscous`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_laws, switch_of_materials
from lcmchain.materials.features.relaxation import relaxation_of
from lcmchain.materials.law import Material

SWITCH = switch_of_materials(
    "relaxes",
    "without_relaxation",
    entry="material.viscous.compaction",
    without="how the pressure on the fabric relaxes",
    why_not_on="the material states no relaxing compaction; give material.viscous.compaction",
)


def _in_words(material: Material) -> str | None:
    relaxation = relaxation_of(material)
    return None if relaxation is None else relaxation.in_words()


active = of_the_laws("compaction relaxation", _in_words, "the compaction does not depend on time")
