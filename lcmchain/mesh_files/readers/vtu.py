"""Unstructured grids of VTK (.vtu), without the arrays of text that meshio does not read.

Source: VTK file formats, "XML file formats": ParaView, Exodus and others keep titles and names as
arrays of type String, as text, base64 or raw bytes appended to the file.
"""

from __future__ import annotations

import base64
import re
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.readers.by_meshio import read_by_meshio

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
