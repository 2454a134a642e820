"""Mesh files that meshio reads, with numbers and regions where their data have them.

Of unstructured grids of VTK (.vtu) it does not read arrays of type String, in which ParaView,
Exodus and others keep titles and names, as text, base64 or raw bytes appended to the file (VTK file
formats, "XML file formats"). They are left out here.
"""

from __future__ import annotations

import base64
import contextlib
import io
import re
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np

import lcmchain.mesh_files.shapes  # noqa: F401  (types that meshio misses)
from lcmchain.errors import InputError, shortened
from lcmchain.mesh_files.file_mesh import NO_CELLS, NO_IDS, FileMesh
from lcmchain.mesh_files.formats import FORMATS, known_formats

#: Names under which files keep the numbers of cells and nodes, in lower case: this program's,
#: ParaView's and VTK's, Ensight's.
CELL_NUMBERS = ("cell_id", "cell_ids", "element_id", "elementid", "element_ids", "globalelementid",
                "globalelementids", "globalcellids", "elem_id", "eid")  # fmt: skip
NODE_NUMBERS = ("node_id", "node_ids", "nodeid", "globalnodeid", "globalnodeids", "globalpointids",
                "point_id", "nid")  # fmt: skip

#: Names of arrays that divide the cells into parts, the most telling first.
PARTS = ("part", "part_id", "partid", "pid", "property_id", "propertyid", "objectid", "blockid",
         "materialids", "material_id", "material", "cellentityids", "region", "regionid",
         "gmsh:physical", "cell_tags", "medit:ref", "su2:tag", "gmsh:geometrical",
         "nastran:ref")  # fmt: skip

#: Beginnings of the names of arrays of 0 and 1 that mark the members of a set.
CELL_SET, NODE_SET, PART = "cell_set:", "node_set:", "part:"

# Where files of VTK count their cells.
CELL_COUNTS = {"vtu": rb'NumberOfCells="\s*(\d+)', "vtk": rb"(?m)^CELLS\s+(\d+)"}

# An array with more values than this counts something, it does not divide the mesh.
MOST_REGIONS = 1000


def read_by_meshio(
    path: Path, file_format: str | None = None, *, stand_in: Path | None = None
) -> FileMesh:
    """Read any file that meshio reads.

    Parameters
    ----------
    file_format : meshio's name of the format; None leaves it to the ending of the file.
    stand_in : file that is read in its place.

    Numbers are those of arrays that are known by their names; integer arrays of cells divide them
    into regions: the most telling one gives the parts, the others sets.

    Raises
    ------
    InputError : meshio does not read the file.
    """
    read = _read(path, file_format, stand_in or path)
    blocks = [(block.type, _table(block.data, path)) for block in read.cells]
    kept = [index for index, (_, nodes) in enumerate(blocks) if len(nodes)]
    blocks = [blocks[index] for index in kept]
    mesh = FileMesh(np.asarray(read.points), blocks)
    on_cells = {
        name: np.concatenate([np.asarray(data[index]) for index in kept])
        for name, data in read.cell_data.items()
        if kept and len(data) == len(read.cells)
    }
    take_arrays(mesh, on_cells, read.point_data)
    _take_named_sets(mesh, read, kept)
    return mesh


def take_arrays(
    mesh: FileMesh, on_cells: dict[str, np.ndarray], on_nodes: Mapping[str, np.ndarray]
) -> None:
    """Set numbers, marked sets and regions from the arrays of a file."""
    mesh.cell_ids = _numbers(on_cells, CELL_NUMBERS, mesh.cell_count, mesh.notes_of_sets, "cells")
    mesh.node_ids = _numbers(on_nodes, NODE_NUMBERS, len(mesh.points), mesh.notes_of_sets, "nodes")
    _take_marked_sets(mesh, on_cells, on_nodes)
    _take_regions(mesh, on_cells)


def _table(nodes, path: Path) -> np.ndarray:
    """Nodes of the cells of a block as a table of whole numbers."""
    table = np.asarray(nodes)
    if table.dtype.kind not in "iu" and table.size:
        raise InputError("cells have nodes that are no numbers; the mesh is broken", file=path)
    return table.astype(np.int64)


def _numbers(
    arrays: Mapping[str, np.ndarray], names: tuple[str, ...], count: int, notes: list[str], of: str
) -> np.ndarray:
    """Numbers of cells or nodes under one of the known names; none where they repeat."""
    by_name = {name.lower(): np.asarray(values) for name, values in arrays.items()}
    for name in names:
        if name not in by_name:
            continue
        given = by_name[name]
        if given.shape != (count,) or given.dtype.kind not in "iuf":
            continue
        numbers = given.astype(np.int64)
        if (numbers != given).any() or (numbers < 0).any():
            continue
        if len(np.unique(numbers)) < count:
            notes.append(f'"{name}" repeats numbers: the {of} are counted from 1 instead')
            continue
        return numbers
    return NO_IDS


def _take_marked_sets(
    mesh: FileMesh, on_cells: dict[str, np.ndarray], on_nodes: Mapping[str, np.ndarray]
) -> None:
    """Take the sets and parts that files of this program mark by 0 and 1."""
    for arrays, prefix, sets in (
        (on_cells, CELL_SET, mesh.cell_sets),
        (on_cells, PART, mesh.parts),
        (on_nodes, NODE_SET, mesh.node_sets),
    ):
        for name, values in arrays.items():
            if name.startswith(prefix) and np.ndim(values) == 1:
                sets[name[len(prefix) :]] = np.flatnonzero(np.asarray(values) == 1)


def _take_regions(mesh: FileMesh, on_cells: dict[str, np.ndarray]) -> None:
    """Divide the cells by integer arrays."""
    known = {name: place for place, name in enumerate(PARTS)}
    arrays = [
        name
        for name, values in on_cells.items()
        if values.ndim == 1
        and values.dtype.kind in "iu"
        and not name.startswith((CELL_SET, PART))
        and name.lower() not in CELL_NUMBERS
        and name != "mapping_status"
        and not (name == "part" and mesh.parts)
    ]
    for name in sorted(arrays, key=lambda name: known.get(name.lower(), len(known))):
        values = np.unique(on_cells[name])
        if len(values) > MOST_REGIONS:
            mesh.notes_of_sets.append(
                f'"{name}" has {len(values)} different values and divides nothing: left out'
            )
            continue
        divided = {f"{name} {value}": np.flatnonzero(on_cells[name] == value) for value in values}
        if not mesh.parts:
            mesh.parts = divided
        else:
            mesh.cell_sets |= divided


def _take_named_sets(mesh: FileMesh, read: meshio.Mesh, kept: list[int]) -> None:
    """Take the sets that meshio itself knows."""
    first = np.cumsum([0, *[len(nodes) for _, nodes in mesh.blocks]])
    for name, of_blocks in (read.cell_sets or {}).items():
        pieces = [
            np.asarray(of_blocks[index], dtype=np.int64) + first[place]
            for place, index in enumerate(kept)
            if index < len(of_blocks) and of_blocks[index] is not None
        ]
        if not name.startswith("gmsh:"):  # entities that bound an entity, no set of cells
            rows = np.unique(np.concatenate([NO_IDS, *pieces]))
            mesh.cell_sets[name] = rows[(rows >= 0) & (rows < mesh.cell_count)]
    for name, nodes in (read.point_sets or {}).items():
        rows = np.unique(np.asarray(nodes, dtype=np.int64))
        mesh.node_sets[name] = rows[(rows >= 0) & (rows < len(mesh.points))]


def _read(path: Path, file_format: str | None, file: Path) -> meshio.Mesh:
    said = io.StringIO()
    try:
        # meshio prints its reasons and ends the process; here they become one error.
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of numpy, about how meshio calls it
                return meshio.read(file, file_format)
    except (Exception, SystemExit) as error:
        # meshio fails on a file without cells for reasons of its own
        if _is_without_cells(path, file_format or path.suffix.lower()[1:]):
            raise InputError(NO_CELLS, file=path) from None
        reason = said.getvalue().strip() or str(error) or type(error).__name__
        reason = shortened(" ".join(reason.replace("Error: ", "").split()), 300)
        if file_format in FORMATS:
            title, known = FORMATS[file_format].title, ""
        else:
            title = "mesh"
            known = f". Read are: {known_formats(meshio.extension_to_filetypes)}"
        raise InputError(
            f"cannot be read as a {title} ({reason}); check that the file is complete{known}",
            file=path,
        ) from None


def _is_without_cells(path: Path, file_format: str) -> bool:
    """Tell whether a file of VTK counts no cells; False for files of other formats."""
    pattern = CELL_COUNTS.get(file_format)
    if pattern is None:
        return False
    counts = re.findall(pattern, path.read_bytes())
    return bool(counts) and all(int(count) == 0 for count in counts)


# --- VTU ------------------------------------------------------------------------------------------


_TEXT = re.compile(rb"<\w*Array[^>]*type\s*=\s*[\"\']String[\"\']")
_APPENDED = re.compile(rb"<AppendedData[^>]*>")


def read_vtu(path: Path) -> FileMesh:
    """Read a grid; arrays of text are left out and named in its notes.

    Raises
    ------
    InputError : the file is broken.
    """
    content = path.read_bytes()
    if _TEXT.search(content) is None:
        return read_by_meshio(path, "vtu")
    try:
        cleaned, names = _without_text(content)
    except (ElementTree.ParseError, ValueError, IndexError) as error:
        raise InputError(f"the VTU file is broken ({error}); export it again", file=path) from None
    with tempfile.TemporaryDirectory() as folder:
        stand_in = Path(folder) / "grid.vtu"
        stand_in.write_bytes(cleaned)
        mesh = read_by_meshio(path, "vtu", stand_in=stand_in)
    mesh.notes.append(f"arrays of text are left out: {', '.join(names)}")
    return mesh


def _without_text(content: bytes) -> tuple[bytes, list[str]]:
    """Return the file without its arrays of text, and the names of these."""
    appended = _APPENDED.search(content)
    raw = b""
    if appended is not None and re.search(rb"encoding\s*=\s*[\"\']raw", appended[0]):
        # no XML: the bytes begin behind an underscore, and each array with its length
        end = content.rindex(b"</AppendedData>")
        raw = content[content.index(b"_", appended.end()) + 1 : end]
        content = content[: appended.end()] + content[end:]
    root = ElementTree.fromstring(content)
    names = []
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag.endswith("Array") and child.get("type") == "String":
                names.append(child.get("Name") or "without a name")
                parent.remove(child)
    if raw:
        for array in root.iter("DataArray"):
            if array.get("format") == "appended":
                array.text = _inline(raw, int(array.attrib.pop("offset")), root)
                array.set("format", "binary")
        for part in root.findall("AppendedData"):
            root.remove(part)
    return ElementTree.tostring(root), names


def _inline(raw: bytes, offset: int, root: ElementTree.Element) -> str:
    """Text of an array that stands in a file, from its raw bytes among those appended."""
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    size = np.dtype(order + {"UInt64": "u8"}.get(root.get("header_type", "UInt32"), "u4"))
    if root.get("compressor") is None:
        end = offset + size.itemsize + int(np.frombuffer(raw, size, 1, offset)[0])
        return base64.b64encode(raw[offset:end]).decode()
    blocks = int(np.frombuffer(raw, size, 1, offset)[0])
    head = np.frombuffer(raw, size, 3 + blocks, offset)
    begin = offset + head.nbytes
    data = raw[begin : begin + int(head[3:].sum())]
    return (base64.b64encode(head.tobytes()) + base64.b64encode(data)).decode()
