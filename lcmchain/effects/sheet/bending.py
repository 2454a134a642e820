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

from lcmchain.effects.effect import Refusal, Switch, of_elements, of_the_elements
from lcmchain.elements.families import SheetElement
from lcmchain.elements.membrane_shell.table import MembraneShellElement

SWITCH = Switch(
    entry="material.bending, element.bending",
    without="the moments that hold a sheet against wrinkles",
    called=lambda scene: any(_bends(element) for element in scene.stack.elements.values()),
    off=of_elements(lambda element: _membrane(element)),
    on=of_elements(lambda element: _shell(element)),
    unless="of solid-shells",
)


def _bends(element: SheetElement) -> bool:
    return element.has_forces and getattr(element, "bending", True)


def _membrane(element: SheetElement) -> SheetElement:
    if not isinstance(element, MembraneShellElement):
        raise Refusal(
            "without C^B solid-shells have motions that nothing resists; use small values of "
            'material.bending, or element = "membrane-shell", which can be a membrane alone'
        )
    return element.without_bending()


def _shell(element: SheetElement) -> SheetElement:
    if not element.has_forces:
        raise Refusal('a net of fibres has no moments; use element = "membrane-shell"')
    return element if element.has_thickness else element.model_copy(update={"bending": True})


active = of_the_elements("bending")
