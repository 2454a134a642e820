"""The families of elements that a scene can choose, by its ``element.type``."""

from __future__ import annotations

from lcmchain.elements.family import Body
from lcmchain.elements.membrane_shell.body import MembraneShellBody
from lcmchain.elements.solid_shell.body import SolidShellBody

FAMILIES: dict[str, type[Body]] = {
    family.type: family for family in (SolidShellBody, MembraneShellBody)
}


def family_of(element) -> type[Body]:
    """Return the family that a scene's ``element`` table (or the like) chooses by its ``type``."""
    return FAMILIES[element.type]
