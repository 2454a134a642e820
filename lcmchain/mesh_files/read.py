"""Reading of any mesh file: its format is told by its content, the ending is the last hint."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from meshio import extension_to_filetypes

from lcmchain.errors import InputError
from lcmchain.mesh_files.compressed import is_compressed, unpacked
from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.formats import ending_that_disagrees, format_of, known_formats
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio, read_vtu
from lcmchain.mesh_files.readers.cgns import read_cgns
from lcmchain.mesh_files.readers.decks.abaqus import read_abaqus
from lcmchain.mesh_files.readers.decks.lsdyna import read_lsdyna
from lcmchain.mesh_files.readers.decks.nastran import read_nastran
from lcmchain.mesh_files.readers.decks.universal import read_universal
from lcmchain.mesh_files.readers.exodus import read_exodus
from lcmchain.mesh_files.readers.facets import read_obj, read_ply
from lcmchain.mesh_files.readers.gmsh import read_gmsh
from lcmchain.mesh_files.readers.med import read_med
from lcmchain.mesh_files.readers.netgen import read_netgen

#: Readers by the name of the format; meshio reads all others.
READERS: dict[str, Callable[[Path], FileMesh]] = {
    "abaqus": read_abaqus,
    "nastran": read_nastran,
    "gmsh": read_gmsh,
    "med": read_med,
    "exodus": read_exodus,
    "cgns": read_cgns,
    "obj": read_obj,
    "ply": read_ply,
    "lsdyna": read_lsdyna,
    "universal": read_universal,
    "netgen": read_netgen,
    "vtu": read_vtu,
}

#: Endings by which meshio tells the format of a file whose content is not known here.
ENDINGS_OF_MESHIO = frozenset(extension_to_filetypes)


def read_mesh_file(path: Path) -> FileMesh:
    """Read nodes, cells, numbers, sets and parts of a mesh file, in the unit of the file.

    Parameters
    ----------
    path : a deck of Abaqus, CalculiX, Nastran or LS-DYNA, a Universal file, a file of Gmsh, MED,
        NETGEN, CGNS or Exodus, or any other mesh file that meshio reads; also compressed by gzip,
        bzip2 or xz.

    Raises
    ------
    InputError : the file is absent, empty, of no known format or unreadable; names the line where
        it has lines.
    """
    _require_file(path)
    if is_compressed(path):
        with unpacked(path) as file:
            return read_mesh_file(file)
    name = format_of(path)
    if not name and path.suffix.lower() not in ENDINGS_OF_MESHIO:
        raise InputError(
            "the content is no mesh of a format that is known, and the ending does not tell; "
            f"export the mesh as one of these: {known_formats(ENDINGS_OF_MESHIO)}",
            file=path,
        )
    mesh = READERS.get(name, partial(read_by_meshio, file_format=name or None))(path)
    if (told := ending_that_disagrees(path, name)) is not None:
        mesh.notes.insert(0, told)
    return mesh


def _require_file(path: Path) -> None:
    if path.is_dir():
        raise InputError("this is a folder; name the mesh file in it", file=path)
    if not path.is_file():
        raise InputError("the mesh file does not exist", file=path)
    if path.stat().st_size == 0:
        raise InputError("cannot read the mesh: the file is empty; export it again", file=path)
