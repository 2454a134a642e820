from .fields import MappedFields
from .report import MappingReport
from .sheet import Sheet, read_sheet
from .stage import MappingOptions, map_file, map_forming
from .target import TargetMesh, read_target
from .transfer import compute_weights, transfer
from .weights import MappingWeights, Status

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
