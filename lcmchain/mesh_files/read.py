"""Reading of any mesh file: its format is told by its content, the ending is the last hint."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.formats import format_of
from lcmchain.mesh_files.readers.abaqus import read_abaqus
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio
from lcmchain.mesh_files.readers.exodus import read_exodus
from lcmchain.mesh_files.readers.gmsh import read_gmsh
from lcmchain.mesh_files.readers.med import read_med
from lcmchain.mesh_files.readers.nastran import read_nastran
from lcmchain.mesh_files.readers.obj import read_obj
from lcmchain.mesh_files.readers.ply import read_ply
from lcmchain.mesh_files.readers.vtu import read_vtu

#: Readers by the name of the format; meshio reads all others.
READERS: dict[str, Callable[[Path], FileMesh]] = {
    "abaqus": read_abaqus,
    "nastran": read_nastran,
    "gmsh": read_gmsh,
    "med": read_med,
    "exodus": read_exodus,
    "obj": read_obj,
    "ply": read_ply,
    "vtu": read_vtu,
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
    name = format_of(path)
    return READERS.get(name, partial(read_by_meshio, file_format=name or None))(path)


def _require_file(path: Path) -> None:
    if path.is_dir():
        raise InputError("this is a folder; name the mesh file in it", file=path)
    if not path.is_file():
        raise InputError("the mesh file does not exist", file=path)
    if path.stat().st_size == 0:
        raise InputError("cannot read the mesh: the file is empty; export it again", file=path)
