"""Mesh files of other programs: one reader per format, whoever reads (tool, target, gate, set)."""

from __future__ import annotations

from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.read import read_mesh_file

__all__ = ["FileMesh", "read_mesh_file"]
