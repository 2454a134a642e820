"""Shapes of rigid tools, one file each.

A shape is the scene table of its file, with the methods of :class:`ToolShape`. It is registered by
its place in ``Shape``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.tools.shapes.base import ToolShape
from lcmchain.tools.shapes.cone import Cone
from lcmchain.tools.shapes.cylinder import Cylinder
from lcmchain.tools.shapes.extruded_profile import ExtrudedProfile
from lcmchain.tools.shapes.plate import Plate
from lcmchain.tools.shapes.plate_with_hole import PlateWithHole
from lcmchain.tools.shapes.revolved_profile import RevolvedProfile
from lcmchain.tools.shapes.sphere_capped_punch import SphereCappedPunch
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
