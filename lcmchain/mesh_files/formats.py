"""Format of a mesh file, told by its content.

Programs name their files freely: bulk data of Nastran are called .dat, .blk or .bdf, a deck of
Abaqus .msh. The ending decides only where the content does not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import h5py
import netCDF4

from lcmchain.errors import InputError
from lcmchain.mesh_files.compressed import is_compressed, unpacked


class Format(NamedTuple):
    """A format of mesh files.

    Parameters
    ----------
    title : what it is called to users.
    endings : that programs give to it.
    """

    title: str
    endings: tuple[str, ...]


FORMATS = {
    "abaqus": Format("Abaqus or CalculiX deck", (".inp", ".msh")),
    "nastran": Format("Nastran or OptiStruct bulk data", (".bdf", ".nas", ".fem", ".blk")),
    "lsdyna": Format("LS-DYNA keyword file", (".k", ".key", ".dyn", ".dynain")),
    "universal": Format("Universal file", (".unv", ".uff")),
    "gmsh": Format("Gmsh mesh", (".msh", ".gmsh")),
    "med": Format("MED file", (".med", ".rmed", ".mmed")),
    "netgen": Format("NETGEN mesh", (".vol",)),
    "cgns": Format("CGNS file", (".cgns",)),
    "exodus": Format("Exodus file", (".e", ".ex2", ".exo", ".exii", ".g", ".gen")),
    "stl": Format("STL file", (".stl", ".stla", ".stlb")),
    "obj": Format("OBJ file", (".obj",)),
    "ply": Format("PLY file", (".ply",)),
    "vtu": Format("VTU file", (".vtu",)),
    "vtk": Format("VTK legacy file", (".vtk",)),
    "medit": Format("Medit mesh", (".mesh",)),
    "xdmf": Format("XDMF file", (".xdmf", ".xmf")),
    "off": Format("OFF file", (".off",)),
    "su2": Format("SU2 mesh", (".su2",)),
}  # fmt: skip
#: Formats by the ending, for files whose content does not tell. meshio looks at all other endings.
BY_ENDING = {
    ".inp": "abaqus",
    ".bdf": "nastran",
    ".nas": "nastran",
    ".fem": "nastran",
    ".msh": "gmsh",
    ".med": "med",
    ".e": "exodus",
    ".ex2": "exodus",
    ".exo": "exodus",
    ".exii": "exodus",
    ".obj": "obj",
    ".ply": "ply",
    ".vtu": "vtu",
    ".unv": "universal",
    ".k": "lsdyna",
    ".key": "lsdyna",
    ".vol": "netgen",
}

#: Files of HDF5 that are none of MED, CGNS and Exodus are named by their ending.
_HDF5 = b"\x89HDF\r\n\x1a\n"
_CLASSIC_NETCDF = re.compile(rb"CDF[\x01\x02\x05]")

#: How a file begins, blanks and the mark of UTF-8 left out.
_BEGINNINGS = (
    ("gmsh", re.compile(rb"\$(?:MeshFormat|Comments|PhysicalNames)\b")),
    ("ply", re.compile(rb"ply\r?\n")),
    ("vtk", re.compile(rb"# vtk DataFile", re.IGNORECASE)),
    ("medit", re.compile(rb"MeshVersionFormatted\b")),
    ("universal", re.compile(rb"-1[ \t]*\r?\n[ \t]*\d+b?[ \t\r\n]")),
    ("netgen", re.compile(rb"(?:#[^\n]*\n\s*)*mesh3d\b")),
    ("off", re.compile(rb"OFF[ \t]*\r?\n")),
    ("su2", re.compile(rb"(?:%[^\n]*\n\s*)*NDIME[ \t]*=")),
    ("xdmf", re.compile(rb"(?:<\?xml[^>]*>\s*)?(?:<!DOCTYPE[^>\[]*(?:\[[^\]]*\])?\s*>\s*)?"
                        rb"(?:<!--.*?-->\s*)*<Xdmf\b", re.DOTALL)),
    ("vtu", re.compile(rb"(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*"
                       rb"<VTKFile[^>]*type=[\"\']UnstructuredGrid", re.DOTALL)),
)  # fmt: skip

#: What is no mesh that can be read, by how it begins: its name, and what to do.
_MESH_IT = "it holds surfaces, no mesh; mesh it, or export it as STL"
_FOREIGN = (
    ("STEP model", re.compile(rb"ISO-10303-21;"), _MESH_IT),
    ("IGES model", re.compile(rb"[^\n]*S(?: {6}|0{6})1\s*\n"), _MESH_IT),
    ("Parasolid model", re.compile(rb"\*\*ABCDEFGHIJKLMNOPQRSTUVWXYZ|PS\0"), _MESH_IT),
    ("ACIS model", re.compile(rb"\d+ \d+ \d+ \d+\s*\n\d+ [^\n]*ACIS|ACIS BinaryFile"), _MESH_IT),
    ("JT model", re.compile(rb"Version \d+\.\d+ JT"), "export its facets as STL"),
    ("Radioss starter deck", re.compile(rb"(?:#[^\n]*\n)*#RADIOSS STARTER|/BEGIN\b"),
     "export the mesh as Nastran or LS-DYNA"),
    ("Ansys deck", re.compile(rb"(?:![^\n]*\n|/COM[^\n]*\n|\s*\n)*/(?:PREP7|BATCH|TITLE)\b",
                              re.IGNORECASE), "export the mesh as Nastran, Abaqus or Universal"),
    ("Gmsh mesh of version 1", re.compile(rb"\$NOD\b"),
     "save it as version 4.1; of NETGEN, export the Gmsh2 format"),
    ("VRML model", re.compile(rb"#VRML"), "export its facets as STL"),
    ("CGNS file in the old ADF form", re.compile(rb"[^\n]{0,8}ADF Database"),
     "convert it with adf2hdf"),
    ("zip archive", re.compile(rb"PK\x03\x04"), "unpack it; of 3MF, export STL"),
)  # fmt: skip

# Keywords that decks of LS-DYNA alone have. Their comments begin with $, and a file that another
# includes has no *KEYWORD.
_LSDYNA = re.compile(
    rb"^\*(?:KEYWORD\b|ELEMENT_(?:SHELL|SOLID|TSHELL)|SET_(?:NODE|SHELL|SOLID|PART)_)",
    re.IGNORECASE | re.MULTILINE,
)
# A deck of Abaqus begins with a keyword, after comments.
_ABAQUS = re.compile(rb"(?:[^\S\n]*(?:\*\*[^\n]*)?\n)*[^\S\n]*\*[^\S\n]*[A-Z]", re.IGNORECASE)
# Lines that only bulk data or what stands before them have.
_NASTRAN = re.compile(
    rb"^(?:[ \t]*BEGIN[ \t]+BULK|[ \t]*CEND[ \t]*(?:\$.*)?\r?$|"
    rb"(?:GRID|CQUAD[48R]|CTRIA[36R]|CTETRA|CHEXA|CPENTA)\*?[ \t,])",
    re.IGNORECASE | re.MULTILINE,
)
_OBJ_VERTEX = re.compile(rb"^[ \t]*v(?:[ \t]+[-+.\deE]+){3}", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f(?:[ \t]+-?\d+(?:/-?\d*){0,2}){3}", re.MULTILINE)
_STL = re.compile(rb"\s*solid\b.*?^\s*facet\s+normal\b.*?^\s*vertex\b",
                  re.IGNORECASE | re.MULTILINE | re.DOTALL)  # fmt: skip
#: Bytes in which the beginnings are looked for; a deck may have long comments before its mesh.
_HEAD = 4096


def format_of(path: Path) -> str:
    """Return the name of the format of a file, "" where meshio shall tell it by the ending.

    Parameters
    ----------
    path : of a file that exists.

    Raises
    ------
    InputError : the file is of a known kind that is no mesh.
    """
    if is_compressed(path):
        with unpacked(path) as inner:
            return format_of(inner)
    ending = path.suffix.lower()
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if head.startswith(_HDF5) or _CLASSIC_NETCDF.match(head):
        return _of_hdf5(path) or BY_ENDING.get(ending, "")
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    for name, pattern in _BEGINNINGS:
        if pattern.match(text):
            return name
    if _is_binary_stl(path, head) or _STL.match(text):
        return "stl"
    for title, pattern, remedy in _FOREIGN:
        if pattern.match(text):
            raise InputError(f"this is a {title}, which is not read: {remedy}", file=path)
    if b"\0" not in head:
        content = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if _LSDYNA.search(content):
            return "lsdyna"
        if _ABAQUS.match(content):
            return "abaqus"
        if _NASTRAN.search(content):
            return "nastran"
        if _OBJ_VERTEX.search(content) and _OBJ_FACE.search(content):
            return "obj"
    return BY_ENDING.get(ending, "")


def known_formats(endings: Iterable[str]) -> str:
    """Return what is read, in words.

    Parameters
    ----------
    endings : that decide for files whose content is not known.
    """
    return (
        f"{', '.join(known.title for known in FORMATS.values())}; by their ending also "
        f"{', '.join(sorted(endings))}"
    )


def ending_that_disagrees(path: Path, name: str) -> str | None:
    """Return a sentence about a file whose ending belongs to another format than its content.

    Parameters
    ----------
    name : of the format that the content has.
    """
    ending = path.suffix.lower()
    usual = [of.title for of in FORMATS.values() if ending in of.endings]
    if name not in FORMATS or not usual or ending in FORMATS[name].endings:
        return None
    return (
        f"the ending {path.suffix} stands for {' or '.join(usual)}, but the file is read by its "
        f"content: {FORMATS[name].title}"
    )


def _of_hdf5(path: Path) -> str:
    """Tell MED, CGNS and Exodus apart; "" for others and broken ones."""
    try:
        with h5py.File(path, "r") as file:
            if "ENS_MAA" in file:
                return "med"
            if "CGNSLibraryVersion" in file:
                return "cgns"
    except Exception:  # h5py raises what the damage makes of the file
        pass  # or a classic netCDF file
    try:
        with netCDF4.Dataset(path) as file:
            return "exodus" if "num_nodes" in file.dimensions else ""
    except Exception:
        return ""


def _is_binary_stl(path: Path, head: bytes) -> bool:
    """Whether the number of triangles in a binary STL file fits its length."""
    count = int.from_bytes(head[80:84], "little")
    return len(head) >= 84 and path.stat().st_size == 84 + 50 * count
