"""Hourglass control: stiffness of the deformations that one integration point does not see.

Adds: stresses of the strains linear in ξ and η.
Source: Schäfer, Mitsch, Kärger, Eqs. (16) and (18).
Stability limit: within the bound of the in-plane frequency.
Scene: ``element.hourglass``, ``fibre_hourglass``, ``in_plane_shear_hourglass``.
Fields: ``energy_hourglass`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_elements

active = of_the_elements("hourglass control")
