"""Compaction: a normal stiffness that grows as the sheet gets thinner.

Adds: a stress S33 of the normal strain that stiffens under pressure.
Source: Schäfer, Mitsch, Kärger, Eq. (23); the normal thickness as its measure: manual, "Theory".
Stability limit: the thickness wave follows the law's tangent; the step is renewed as the sheet
thins.
Scene: ``material.compaction``, ``element.compaction_strain``.
Fields: ``thickness``, ``compaction_pressure``.
"""

from __future__ import annotations

from lcmchain.effects.effect import Switch, of_the_elements, out_of_materials, refused

SWITCH = Switch(
    entry="material.compaction.c1",
    without="the growth of the stiffness over the thickness: thickness and compaction pressure "
    "under tools",
    called=lambda scene: any(
        ply.element.has_thickness and ply.material.compacts for ply in scene.stack
    ),
    off=out_of_materials("compacts", "without_compaction"),
    on=refused(
        "the material states no growth of its stiffness over the thickness, or the elements have "
        'no thickness; give material.compaction.c1 > 0 and element = "solid-shell"'
    ),
)

active = of_the_elements("compaction")
