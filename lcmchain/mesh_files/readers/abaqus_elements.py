"""Element types of Abaqus and CalculiX that are cells of a mesh to map onto.

Source: Abaqus Elements Guide, element index; CalculiX CrunchiX user's manual, "Element types". Both
number nodes as VTK does, mid-side nodes included.
"""

from __future__ import annotations

import re

_SHELL_SHAPES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
_SOLID_SHAPES = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    13: "pyramid13",
    15: "wedge15",
    20: "hexahedron20",
}
# Variants (reduced integration, hybrid, thermal, ...) follow the number of nodes as letters.
_SHELL = re.compile(r"(?:S|US|DS|M3D|CPS|CPE|CPEG|DC2D)(\d+)(?:R5|[A-Z]*5?)")
# Rigid, surface and axisymmetric elements, which are cells only where a deck has no shells: so
# meshio writes triangles and quadrilaterals.
_SECOND_CHOICE = re.compile(r"(?:R3D|SFM3D|CAX)(\d+)[A-Z]*")
_STRI = {"STRI3": "triangle", "STRI65": "triangle6"}
_CONTINUUM_SHELL = {"SC6": "wedge", "SC8": "hexahedron", "CSS8": "hexahedron"}
_SOLID = re.compile(r"(?:C3D|DC3D|DCC3D|Q3D|EC3D)(\d+)([A-Z]*)")

#: Faces of solids by their number from 1, corners from 0.
FACES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "pyramid": [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
    "wedge": [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    "hexahedron": [
        *[(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)],
        *[(1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    ],
}


def second_choice(element: str) -> str | None:
    """Return meshio's name of the shape of an element that is a cell only for want of shells."""
    found = _SECOND_CHOICE.fullmatch(element.upper())
    return _SHELL_SHAPES.get(int(found[1][:3])) if found is not None else None


def cell_type(element: str) -> str | None:
    """Return meshio's name of an element type's shape; None where it is no shell and no solid.

    Continuum shells (SC6R, SC8R) are wedges and hexahedra. Rigid, cohesive, gasket and surface
    elements, beams and those with a varying number of nodes are none.
    """
    element = element.upper()
    if element in _STRI:
        return _STRI[element]
    for begin, shape in _CONTINUUM_SHELL.items():
        if re.fullmatch(f"{begin}R?H?T?", element):
            return shape
    if (found := _SHELL.fullmatch(element)) is not None:
        return _SHELL_SHAPES.get(int(found[1][:3]))
    found = _SOLID.fullmatch(element)
    if found is None or "V" in found[2]:
        return None
    return _SOLID_SHAPES.get(int(found[1][:3]))
