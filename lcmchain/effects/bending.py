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

from typing import Any

from lcmchain.effects.effect import Refusal, Switch, of_the_elements

SWITCH = Switch(
    entry="material.bending, element.bending",
    without="the moments that hold a sheet against wrinkles",
    called=lambda scene: scene.element.has_forces and getattr(scene.element, "bending", True),
    off=lambda scene: {"element": _membrane(scene)},
    on=lambda scene: {"element": _shell(scene)},
    unless="of solid-shells",
)


def _membrane(scene: Any) -> Any:
    if scene.element.has_thickness:
        raise Refusal(
            "without C^B solid-shells have motions that nothing resists; use small values of "
            'material.bending, or element = "membrane-shell", which can be a membrane alone'
        )
    return scene.element.without_bending()


def _shell(scene: Any) -> Any:
    if not scene.element.has_forces:
        raise Refusal('a net of fibres has no moments; use element = "membrane-shell"')
    return scene.element.model_copy(update={"bending": True})


active = of_the_elements("bending")
