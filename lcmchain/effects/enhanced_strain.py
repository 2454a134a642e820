"""Enhanced strain: lets the thickness follow bending where normal and other strains couple.

Adds: one strain E33 linear in ζ per element, eliminated by one update.
Source: Schäfer, Mitsch, Kärger, Eq. (17).
Stability limit: none, it softens.
Scene: none: it is in where C^B couples 33 with other strains, or an element is curved.
Fields: none.
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_elements

active = of_the_elements("enhanced strain")
