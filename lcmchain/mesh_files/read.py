"""Reading of any mesh file: the reader of its format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.readers.abaqus import read_abaqus
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio
from lcmchain.mesh_files.readers.exodus import read_exodus
from lcmchain.mesh_files.readers.gmsh import read_gmsh
from lcmchain.mesh_files.readers.med import read_med
from lcmchain.mesh_files.readers.nastran import read_nastran

#: Readers of their own, by the ending of the file; meshio reads all others.
READERS: dict[str, Callable[[Path], FileMesh]] = {
    ".inp": read_abaqus,
    ".bdf": read_nastran,
    ".nas": read_nastran,
    ".fem": read_nastran,
    ".msh": read_gmsh,
    ".med": read_med,
    ".e": read_exodus,
    ".ex2": read_exodus,
    ".exo": read_exodus,
    ".exii": read_exodus,
}


def read_mesh_file(path: Path) -> FileMesh:
    """Read nodes, cells, numbers, sets and parts of a mesh file, in the unit of the file.

    Parameters
    ----------
    path : a deck of Abaqus, CalculiX or Nastran, a file of Gmsh, MED or Exodus, or any other mesh
        file that meshio reads.

    Raises
    ------
    InputError : the file is absent, empty or unreadable; names the line where it has lines.
    """
    _require_file(path)
    return READERS.get(path.suffix.lower(), read_by_meshio)(path)


def _require_file(path: Path) -> None:
    if path.is_dir():
        raise InputError("this is a folder; name the mesh file in it", file=path)
    if not path.is_file():
        raise InputError("the target mesh does not exist", file=path)
    if path.stat().st_size == 0:
        raise InputError(
            "cannot read the target mesh: the file is empty; export it again", file=path
        )
