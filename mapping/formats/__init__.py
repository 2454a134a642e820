"""Mapped fields in the files that programs of later stages read.

    mapped fields ─▶ MappedCells ─┬▶ vmap.py
                                  ├▶ drape.py, openradioss.py: draping by element
                                  └▶ preform.py ─▶ rtmsim.py, lcmsim.py: filling
    each format ─▶ its files, and an ExportReport: what it cannot hold, with the worst error

format.py has MappedCells and ExportReport, export.py knows the formats by name. A format is a file
with NAME and prepare, and a line there.
bulk_data.py writes the numbers in eight columns that several of them take.
"""

from __future__ import annotations

from lcmchain.mapping.formats.export import (
    FORMATS,
    export,
    export_files,
    export_path,
    prepare_export,
)
from lcmchain.mapping.formats.format import ExportReport, Loss

__all__ = [
    "FORMATS",
    "ExportReport",
    "Loss",
    "export",
    "export_files",
    "export_path",
    "prepare_export",
]
