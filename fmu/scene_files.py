"""Copy a scene and the files that it names into a unit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path, PurePath

from lcmchain.errors import InputError
from lcmchain.scene import Scene


def stage_scene(scene: Scene, folder: Path) -> list[str]:
    """Copy the scene and the files that it names; return the overrides that name moved files.

    Raises
    ------
    InputError : a file cannot be read.
    """
    folder.mkdir()
    (folder / "scene.toml").write_text(scene.source.text, encoding="utf-8")
    overrides: list[str] = []
    for key, value in scene.source.files:
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
