"""Thickness as an unknown of the sheet, which the 2D approach does without.

Adds: displacements of both faces of the sheet, and with them the thickness of every element.
Source: Schäfer, Mitsch, Kärger, section 2 (solid-shell), against their section 3.3 (2D approach).
Stability limit: the thickness wave, h / c, where compaction has stiffened the sheet.
Scene: ``element`` (``"solid-shell"`` or ``"membrane-shell"``).
Fields: ``thickness``, ``fibre_volume_fraction``.
"""

from __future__ import annotations

from lcmchain.effects.effect import Switch, of_the_elements, refused

SWITCH = Switch(
    entry="element",
    without="the faces of the sheet, its thickness and all that follows from it",
    called=lambda scene: any(ply.element.has_thickness for ply in scene.stack),
    off=refused('thickness belongs to the elements; use element = "membrane-shell"'),
    on=refused('thickness belongs to the elements; use element = "solid-shell"'),
)

active = of_the_elements("thickness")
