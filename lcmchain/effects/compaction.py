"""Compaction: a normal stiffness that grows as the sheet gets thinner.

Adds: a stress S33 of the normal strain that stiffens under pressure.
Source: Schäfer, Mitsch, Kärger, Eq. (23); the normal thickness as its measure: manual, "Theory".
Stability limit: the thickness wave follows the law's tangent; the step is renewed as the sheet
thins.
Scene: ``material.compaction``, ``element.compaction_strain``.
Fields: ``thickness``, ``compaction_pressure``.
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_elements

active = of_the_elements("compaction")
