"""Format of a mesh file, told by its content.

Programs name their files freely: bulk data of Nastran are called .dat, .blk or .bdf, a deck of
Abaqus .msh. The ending decides only where the content does not.
"""

from __future__ import annotations

import re
from pathlib import Path

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
}

#: Files of HDF5 that are neither MED nor Exodus are named by their ending.
_HDF5 = b"\x89HDF\r\n\x1a\n"
_CLASSIC_NETCDF = re.compile(rb"CDF[\x01\x02\x05]")

#: How a file begins, blanks and the mark of UTF-8 left out.
_BEGINNINGS = (
    ("gmsh", re.compile(rb"\$(?:MeshFormat|Comments|PhysicalNames|NOD)\b")),
    ("ply", re.compile(rb"ply\r?\n")),
    ("vtk", re.compile(rb"# vtk DataFile", re.IGNORECASE)),
    ("medit", re.compile(rb"MeshVersionFormatted\b")),
    ("vtu", re.compile(rb"(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*"
                       rb"<VTKFile[^>]*type=[\"\']UnstructuredGrid", re.DOTALL)),
)  # fmt: skip

# A deck of Abaqus begins with a keyword, after comments; one of LS-DYNA with *KEYWORD.
_ABAQUS = re.compile(
    rb"(?:[^\S\n]*(?:\*\*[^\n]*)?\n)*[^\S\n]*\*[^\S\n]*(?!KEYWORD\b)[A-Z]", re.IGNORECASE
)
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
    """
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
    if b"\0" not in head:
        content = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if _ABAQUS.match(content):
            return "abaqus"
        if _NASTRAN.search(content):
            return "nastran"
        if _OBJ_VERTEX.search(content) and _OBJ_FACE.search(content):
            return "obj"
    return BY_ENDING.get(ending, "")


def _of_hdf5(path: Path) -> str:
    """Tell MED and Exodus apart; "" for others and broken ones, whose reader names the damage."""
    import h5py
    import netCDF4

    try:
        with h5py.File(path, "r") as file:
            if "ENS_MAA" in file:
                return "med"
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
