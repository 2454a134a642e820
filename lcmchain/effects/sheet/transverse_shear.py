"""Transverse shear: directors that do not stay normal to the sheet.

Adds: stresses S23 and S13 of assumed natural strains.
Source: Schäfer, Mitsch, Kärger, Eqs. (7) to (9).
Stability limit: shear waves over the thickness; far below the others in a textile.
Scene: ``material.membrane.C23``, ``C13`` and those of ``material.bending``.
Fields: none; it shows as ``displacement`` of the two faces.
"""

from __future__ import annotations

from lcmchain.effects.effect import Switch, of_the_elements, refused

SWITCH = Switch(
    entry="element",
    without="what keeps the directors upright",
    called=lambda scene: any(ply.element.has_thickness for ply in scene.stack),
    off=refused("without it nothing keeps the directors of the solid-shell upright; leave it out"),
    on=refused('the normal of a triangle stays normal; use element = "solid-shell"'),
)

active = of_the_elements("transverse shear")
