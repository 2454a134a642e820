"""Enhanced strain: lets the thickness follow bending where normal and other strains couple.

Adds: one strain E33 linear in ζ per element, eliminated by one update.
Source: Schäfer, Mitsch, Kärger, Eq. (17).
Stability limit: none, it softens.
Scene: where C^B couples 33 with other strains, or an element is curved;
``effects.enhanced_strain``.
Fields: none.
"""

from __future__ import annotations

from typing import Any

from lcmchain.effects.effect import Refusal, Switch, of_the_elements

SWITCH = Switch(
    entry="element, material",
    without="the relief of the thickness in bending: sheets whose normal strain couples with "
    "others are too stiff in bending",
    called=lambda scene: _called(scene),
    off=lambda scene: {"element": _chosen(scene, False)},
    on=lambda scene: {"element": _chosen(scene, True)},
    unless="in triangles, which have none",
)


def _called(scene: Any) -> bool | None:
    if not scene.element.has_thickness:
        return False
    return True if scene.material.build().couples_thickness else None


def _chosen(scene: Any, there: bool) -> Any:
    if not scene.element.has_thickness:
        raise Refusal('triangles have no thickness; use element = "solid-shell"')
    return scene.element.with_enhanced_strain(there)


active = of_the_elements("enhanced strain")
