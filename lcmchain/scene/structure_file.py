"""Read the file of a structural analysis: what ``[mapping.structure]`` holds, on its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lcmchain.scene.structure import Structure
from lcmchain.scene.table_file import read_table, table_from_text


def read_structure(path: str | Path, overrides: Sequence[str] = ()) -> Structure:
    """Read and validate the file of a structural analysis, see :func:`.table_file.read_table`."""
    return read_table(Structure, "structure", path, overrides)


def structure_from_text(
    text: str, path: Path | None = None, overrides: Sequence[str] = ()
) -> Structure:
    """Validate the text of the file of a structural analysis."""
    return table_from_text(Structure, "structure", text, path, overrides)
