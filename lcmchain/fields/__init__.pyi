from .dataset import (
    LaidSheet,
    add_face_variables,
    build_datasets,
    laid_datasets,
    model_datasets,
)
from .derived import derive_fields, pressure_fields, tool_pressure
from .netcdf_file import read_forming, read_group, write_forming_netcdf
from .saved import FrameSeries, Histories
from .sheet import sheet_areas, sheet_faces, sheet_positions
from .summary import fibre_mass, field_summary
from .vtu import write_pvd, write_vtu

__all__ = [
    "FrameSeries",
    "Histories",
    "LaidSheet",
    "add_face_variables",
    "build_datasets",
    "laid_datasets",
    "model_datasets",
    "derive_fields",
    "fibre_mass",
    "field_summary",
    "pressure_fields",
    "read_forming",
    "read_group",
    "sheet_areas",
    "sheet_faces",
    "sheet_positions",
    "tool_pressure",
    "write_forming_netcdf",
    "write_pvd",
    "write_vtu",
]
