"""Mapped fields in the files that programs of later stages read."""

from __future__ import annotations

from lcmchain.mapping.formats.export import (
    FORMATS,
    export,
    export_files,
    export_path,
    prepare_export,
)
from lcmchain.mapping.formats.report import ExportReport, Loss

__all__ = [
    "FORMATS",
    "ExportReport",
    "Loss",
    "export",
    "export_files",
    "export_path",
    "prepare_export",
]
