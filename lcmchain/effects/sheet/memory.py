"""Memory of the material: what a law keeps of the way that led to its present state.

Adds: numbers per element that every step moves on.
Source: the file of the law.
Stability limit: that of the law's stiffness for small vibrations about its state.
Scene: ``material.law``.
Fields: one per number, named by the law; ``energy_inelastic`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import (
    Switch,
    of_the_elements,
    out_of_materials,
    refused,
    stated_by_materials,
)

SWITCH = Switch(
    entry="material.law",
    without="what remains of a compaction that is taken back",
    called=stated_by_materials("remembers"),
    off=out_of_materials("remembers", "without_memory"),
    on=refused('the law remembers nothing; use law = "fabric-with-set"'),
)

active = of_the_elements("memory")
