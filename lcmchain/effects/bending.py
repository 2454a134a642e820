"""Bending: the stiffness C^B of the strains linear and quadratic over the thickness.

Adds: moments, with a stiffness that is independent of the membrane.
Source: Schäfer, Mitsch, Kärger, Eqs. (19) and (25).
Stability limit: none of its own for the solid-shell; bending waves for the triangles of the 2D
approach.
Scene: ``material.bending``, ``material.bending_factor``, ``element.cross_terms``,
``element.bending_thickness``.
Fields: ``bending_pressure``; it shows as ``displacement``.
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_elements

active = of_the_elements("bending")
