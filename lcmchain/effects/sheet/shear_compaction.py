"""Shear-compaction coupling: a sheet that thickens as it is sheared, or presses on what holds it.

Adds: the shear to the strain of which the compaction stress is a function, and to the shear stress
what the pressure holds against the shear.
Source: ``lcmchain/materials/features/shear_compaction.py``.
Stability limit: the thickness wave of the sheared, compacted sheet; the step follows its tangent.
Scene: ``material.compaction.shear_coupling`` or ``material.compaction.table``.
Fields: ``thickness``, ``compaction_pressure``, ``fibre_volume_fraction``.
"""

from __future__ import annotations

from lcmchain.effects.effect import Switch, of_the_elements, out_of_materials, refused

SWITCH = Switch(
    entry="material.compaction.shear_coupling, material.compaction.table",
    without="how shear thickens the sheet",
    called=lambda scene: any(
        ply.element.has_thickness and ply.material.couples_shear for ply in scene.stack
    ),
    off=out_of_materials("couples_shear", "without_shear_coupling"),
    on=refused(
        "the material states no coupling, or the elements have no thickness; give "
        'material.compaction.shear_coupling > 0 or table, and element = "solid-shell"'
    ),
)

active = of_the_elements("shear-compaction coupling")
