"""Shapes of rigid tools: planes, bodies that a profile bounds, and surface meshes.

A shape is a scene table with the methods of :class:`ToolShape`. It is registered by its place in
``Shape``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.tools.shapes.analytic import (
    Cone,
    Cylinder,
    ExtrudedProfile,
    Plate,
    PlateWithHole,
    RevolvedProfile,
    SphereCappedPunch,
)
from lcmchain.tools.shapes.base import ToolShape
from lcmchain.tools.shapes.surface_mesh import SurfaceMesh

Shape = Annotated[
    SphereCappedPunch
    | Plate
    | PlateWithHole
    | Cylinder
    | Cone
    | RevolvedProfile
    | ExtrudedProfile
    | SurfaceMesh,
    Field(discriminator="type"),
]

__all__ = [
    "Cone",
    "Cylinder",
    "ExtrudedProfile",
    "Plate",
    "PlateWithHole",
    "RevolvedProfile",
    "Shape",
    "SphereCappedPunch",
    "SurfaceMesh",
    "ToolShape",
]
