"""Target meshes: read from a file, with their numbers, sets and parts, as cells in space.

mesh file ─▶ read.py: the cells of the kind, what is wrong with them ─▶ mesh.py (TargetMesh)
                                                 its numbers, sets and parts ─▶ variables.py
"""

from __future__ import annotations

from lcmchain.mapping.target.mesh import CellPolygons, TargetMesh, section
from lcmchain.mapping.target.read import read_target
from lcmchain.mesh_files.shapes import base_type, corner_count

__all__ = [
    "CellPolygons",
    "TargetMesh",
    "base_type",
    "corner_count",
    "read_target",
    "section",
]
