"""Transfer of forming fields onto the meshes of later stages."""

from __future__ import annotations

from lcmchain.mapping.options import MappingOptions
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import Sheet, read_sheet
from lcmchain.mapping.stage import map_file, map_forming
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.mapping.transfer import MappedFields, transfer
from lcmchain.mapping.weights import MappingWeights, Status, compute_weights

__all__ = [
    "MappedFields",
    "MappingOptions",
    "MappingReport",
    "MappingWeights",
    "Sheet",
    "Status",
    "TargetMesh",
    "compute_weights",
    "map_file",
    "map_forming",
    "read_sheet",
    "read_target",
    "transfer",
]
