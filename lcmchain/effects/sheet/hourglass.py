"""Hourglass control: stiffness of the deformations that one integration point does not see.

Adds: stresses of the strains linear in ξ and η.
Source: Schäfer, Mitsch, Kärger, Eqs. (16) and (18).
Stability limit: within the bound of the in-plane frequency.
Scene: ``element.hourglass``, ``fibre_hourglass``, ``in_plane_shear_hourglass``.
Fields: ``energy_hourglass`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import Switch, of_the_elements, refused

SWITCH = Switch(
    entry="element",
    without="what resists the deformations that one integration point does not see",
    called=lambda scene: any(ply.element.has_thickness for ply in scene.stack),
    off=refused(
        "an element with one integration point in the plane has motions that nothing else "
        "resists; element.hourglass chooses the kind"
    ),
    on=refused("triangles of constant strain have no such motions; leave it out"),
)

active = of_the_elements("hourglass control")
