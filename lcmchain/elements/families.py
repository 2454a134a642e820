"""The families of elements that a scene can choose, by its ``element.type``.

Below them in the ladder of models stands the pin-jointed net of draping, which is laid without
forces.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from lcmchain.elements.family import Body
from lcmchain.elements.membrane_shell.body import MembraneShellBody
from lcmchain.elements.membrane_shell.table import MembraneShellElement
from lcmchain.elements.solid_shell.body import SolidShellBody
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import SceneModel


class KinematicElement(SceneModel):
    """Kinematic draping: a net of inextensible fibres, laid as ``[draping]`` says."""

    has_thickness: ClassVar[bool] = True
    has_forces: ClassVar[bool] = False
    remarks: ClassVar[tuple[str, ...]] = (
        'element = "kinematic" lays a net of inextensible fibres: it predicts no forces, no '
        "wrinkles, no slip and no draw-in by equilibrium, knows neither friction nor holder nor "
        "the stiffness of the fabric, and takes the thickness from constant volume",
    )

    type: Literal["kinematic"] = "kinematic"


FAMILIES: dict[str, type[Body]] = {
    family.type: family for family in (SolidShellBody, MembraneShellBody)
}

#: The entry ``element``.
SheetElement = Annotated[
    Element | MembraneShellElement | KinematicElement, Field(discriminator="type")
]


def family_of(element: SheetElement) -> type[Body]:
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
