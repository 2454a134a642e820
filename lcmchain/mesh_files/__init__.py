"""Mesh files of other programs: one reader per format, whoever reads (tool, target, gate, set).

    path ─▶ formats (by content) ─▶ read ─▶ readers/… ─▶ FileMesh ─▶ tool, target, gate, set

- ``file_mesh.py``: what a reader takes from a file, before any of it is scaled or checked.
- ``compressed.py``: files that are packed by gzip, bzip2 or xz.
- ``shapes.py``: types of cells, their corners, edges and faces.
- ``length_unit.py``: whether a mesh is as much too large or small as with a wrong unit of length.
"""

from __future__ import annotations

from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.read import read_mesh_file

__all__ = ["FileMesh", "read_mesh_file"]
