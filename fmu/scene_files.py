"""Copy a scene and the files that it names into a unit."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path, PurePath

from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.permeability import Permeability


def stage_scene(scene: Scene, folder: Path) -> list[str]:
    """Copy the scene and the files that it names; return the overrides that name moved files.

    Raises
    ------
    InputError : a file cannot be read.
    """
    folder.mkdir()
    (folder / "scene.toml").write_text(scene.source.text, encoding="utf-8")
    overrides: list[str] = []
    for key, value in _named_files(scene):
        place = PurePath(value)
        if place.is_absolute() or ".." in place.parts or place == PurePath("scene.toml"):
            # Files from elsewhere get a folder of their own, where no two share a name.
            place = PurePath("files", f"{len(overrides)}_{place.name}")
            overrides.append(f"{key}={json.dumps(place.as_posix())}")
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(scene.source.directory / value, target)
        except OSError as error:
            raise InputError(f'"{value}" cannot be read: {error.strerror}', key=key) from None
    return overrides


def _named_files(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield key and value of every entry of a scene that names a file."""
    for index, tool in enumerate(scene.tools):
        for entry in tool.shape.file_entries:
            yield f"tools[{index}].shape.{entry}", getattr(tool.shape, entry)
    for index, target in enumerate(scene.mapping):
        yield f"mapping[{index}].mesh", target.mesh
    laws = [("", scene.permeability), ("infiltration.", _law(scene.infiltration))]
    laws += [
        (f"mapping[{index}].infiltration.", _law(target.infiltration))
        for index, target in enumerate(scene.mapping)
    ]
    for table, law in laws:
        file = getattr(law, "file", None)
        if file is not None:
            yield f"{table}permeability.file", file


def _law(case: Infiltration | None) -> Permeability | None:
    return None if case is None else case.permeability
