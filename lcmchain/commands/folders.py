"""Folders of results: their names, and that they can be written to before any work."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lcmchain.atomic import protecting
from lcmchain.errors import InputError


def default_out(scene: Path) -> Path:
    """Name the folder of the results: ``results/`` and the name of the scene (or of its folder)."""
    name = scene.resolve().parent.name if scene.stem == "scene" else scene.stem
    return Path("results") / (name or "scene")


@contextmanager
def output_folder(folder: Path, *, inputs: Iterable[Path | None] = ()) -> Iterator[Path]:
    """Make the folder of the results and prove that it can be written to, before any work.

    When the work then finds wrong input, folders made here that are still empty are removed.

    Parameters
    ----------
    inputs : files that the work reads and must not write over.

    Raises
    ------
    InputError : the folder cannot be made or written to, or the work would write over an input.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _remove_empty(made)
        reason = "it is a file" if folder.is_file() else error.strerror or str(error)
        raise InputError(
            f"results cannot be written here ({reason}); name another folder with --out",
            file=folder,
        ) from None
    try:
        with protecting(file for file in inputs if file is not None):
            yield folder
    except BaseException:
        _remove_empty(made)
        raise


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:  # innermost first
        try:
            folder.rmdir()
        except OSError:
            return
