"""Fields of a forming result: what they are, how they follow from positions, and their files."""

from lcmchain.fields.dataset import (
    LaidSheet,
    add_face_variables,
    build_datasets,
    laid_datasets,
    model_datasets,
)
from lcmchain.fields.derived import derive_fields
from lcmchain.fields.frames import FrameSeries
from lcmchain.fields.histories import Histories
from lcmchain.fields.netcdf import read_forming, read_group, write_forming_netcdf
from lcmchain.fields.pressure import pressure_fields, tool_pressure
from lcmchain.fields.sheet import sheet_areas, sheet_faces, sheet_positions
from lcmchain.fields.summary import fibre_mass, field_summary
from lcmchain.fields.table import FIELDS, Field
from lcmchain.fields.vtu import write_pvd, write_vtu

__all__ = [
    "FIELDS",
    "Field",
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
