"""Enhanced strain: lets the thickness follow bending where normal and other strains couple.

Adds: one strain E33 linear in ζ per element, eliminated by one update.
Source: Schäfer, Mitsch, Kärger, Eq. (17).
Stability limit: none, it softens.
Scene: where C^B couples 33 with other strains, or an element is curved;
``effects.enhanced_strain``.
Fields: none.
"""

from __future__ import annotations

from lcmchain.effects.effect import EffectScene, Refusal, Switch, of_elements, of_the_elements
from lcmchain.elements.families import SheetElement
from lcmchain.elements.solid_shell.table import Element

SWITCH = Switch(
    entry="element, material",
    without="the relief of the thickness in bending: sheets whose normal strain couples with "
    "others are too stiff in bending",
    called=lambda scene: _called(scene),
    off=of_elements(lambda element: _chosen(element, False)),
    on=of_elements(lambda element: _chosen(element, True)),
    unless="in triangles, which have none",
)


def _called(scene: EffectScene) -> bool | None:
    solid = [ply for ply in scene.stack if ply.element.has_thickness and ply.element.has_forces]
    if not solid:
        return False
    return True if any(ply.material.build().couples_thickness for ply in solid) else None


def _chosen(element: SheetElement, there: bool) -> SheetElement:
    if not element.has_thickness:
        raise Refusal('triangles have no thickness; use element = "solid-shell"')
    if not isinstance(element, Element):
        raise Refusal('a net of fibres has no strains of its own; use element = "solid-shell"')
    return element.with_enhanced_strain(there)


active = of_the_elements("enhanced strain")
