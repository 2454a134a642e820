"""The families of elements that a scene can choose, by its ``element.type``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from lcmchain.elements.family import Body
from lcmchain.elements.kinematic import KinematicElement
from lcmchain.elements.membrane_shell.body import MembraneShellBody
from lcmchain.elements.membrane_shell.table import MembraneShellElement
from lcmchain.elements.solid_shell.body import SolidShellBody
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import InputError

FAMILIES: dict[str, type[Body]] = {
    # both are frozen: mypy misses the right to set what a Body has
    family.type: family  # type: ignore[misc]
    for family in (SolidShellBody, MembraneShellBody)
}

#: The entry ``element``.
SheetElement = Annotated[
    Element | MembraneShellElement | KinematicElement, Field(discriminator="type")
]


def family_of(element: Any) -> type[Body]:
    """Return the family that a scene's ``element`` table (or the like) chooses by its ``type``.

    Raises
    ------
    InputError : the net of kinematic draping, which has no forces.
    """
    family = FAMILIES.get(element.type)
    if family is None:
        raise InputError(
            f'is "{element.type}", which lcmchain run and check lay without forces; this needs '
            'them: use element = "solid-shell"',
            key="element",
        )
    return family
