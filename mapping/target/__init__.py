"""Target meshes: read from a file, with their numbers, sets and parts, as cells in space."""

from __future__ import annotations

from lcmchain.mapping.target.mesh import (
    CellPolygons,
    TargetMesh,
    base_type,
    corner_count,
    read_target,
    section,
)

__all__ = [
    "CellPolygons",
    "TargetMesh",
    "base_type",
    "corner_count",
    "read_target",
    "section",
]
