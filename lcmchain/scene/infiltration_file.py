"""Read the file of an infiltration: what ``[mapping.infiltration]`` holds, on its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.table_file import read_table, table_from_text


def read_infiltration(path: str | Path, overrides: Sequence[str] = ()) -> Infiltration:
    """Read and validate the file of an infiltration, see :func:`.table_file.read_table`."""
    return read_table(Infiltration, "infiltration", path, overrides)


def infiltration_from_text(
    text: str, path: Path | None = None, overrides: Sequence[str] = ()
) -> Infiltration:
    """Validate the text of the file of an infiltration."""
    return table_from_text(Infiltration, "infiltration", text, path, overrides)


def is_scene_file(path: str | Path) -> bool:
    """Whether a file is a scene and not the case of an infiltration: it has a blank or plies.

    A file that cannot be read is none; reading it as a case tells what is wrong.
    """
    try:
        words = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    of_scene = ("[blank", "blank", "[[plies", "plies", "layup")
    return any(line.strip().startswith(of_scene) for line in words.splitlines())
