"""Memory of the material: what a law keeps of the way that led to its present state.

Adds: numbers per element that every step moves on.
Source: the file of the law.
Stability limit: that of the law's stiffness for small vibrations about its state.
Scene: ``material.law``.
Fields: one per number, named by the law; ``energy_inelastic`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import of_the_elements, switch_of_materials

SWITCH = switch_of_materials(
    "remembers",
    "without_memory",
    entry="material.law",
    without="what remains of a compaction that is taken back",
    why_not_on='the law remembers nothing; use law = "fabric-with-set"',
)

active = of_the_elements("memory")
