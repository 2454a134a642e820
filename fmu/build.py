"""Build a functional mock-up unit (FMI 2.0, co-simulation) that forms a scene."""

from __future__ import annotations

import json
import platform
import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath

from pythonfmu import FmuBuilder

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.check import require_no_initial_overlap
from lcmchain.errors import InputError
from lcmchain.fmu.forming_slave import UNIT_FILE, sheet_mesh, unit_guid, variables_of
from lcmchain.mesh.blank import build_blank
from lcmchain.scene import Scene, read_scene
from lcmchain.tools.table import build_tool_table

# The file that pythonfmu loads, and its name in the unit, which must not be that of a real module.
ENTRY_FILE = "unit_entry.py"
ENTRY_MODULE = "lcmchain_forming_unit"

#: Systems and processors for which pythonfmu carries a binary.
PLATFORMS = {("Linux", "x86_64"), ("Windows", "AMD64")}


def build_fmu(scene_path: Path | str, out_path: Path | str) -> Path:
    """Build the unit of a scene and return its path.

    The unit holds the scene and the files that the scene names. It computes in the Python of the
    process that imports it, which must have lcmchain installed.

    Parameters
    ----------
    scene_path : scene file.
    out_path : the unit, ``*.fmu``; replaced only once the new one is complete.

    Raises
    ------
    InputError : the scene or a file that it names is missing or wrong, a tool overlaps the blank
        at the start, or the unit cannot be written.
    """
    out_path = Path(out_path)
    if out_path.suffix != ".fmu":
        raise InputError("the name of a functional mock-up unit ends in .fmu", file=out_path)
    scene = read_scene(scene_path)
    blank = build_blank(scene.blank, scene.material.thickness)
    tools = build_tool_table(
        scene.tools, scene.source.directory, scene.process.time, blank=blank.node_positions
    )
    require_no_initial_overlap(scene, blank, tools)
    with tempfile.TemporaryDirectory(prefix="lcmchain-fmu-") as name:
        folder = Path(name)
        overrides = _stage_scene(scene, folder / "scene")
        staged = read_scene(folder / "scene" / "scene.toml", overrides)
        unit = {
            "model_name": model_identifier(out_path.stem),
            "scene": "scene/scene.toml",
            "overrides": overrides,
            "lcmchain_version": __version__,
            "guid": unit_guid(staged, variables_of(staged, sheet_mesh(staged))),
        }
        (folder / UNIT_FILE).write_text(json.dumps(unit, indent=2) + "\n", encoding="utf-8")
        script = folder / "script" / f"{ENTRY_MODULE}.py"
        script.parent.mkdir()
        shutil.copyfile(Path(__file__).with_name(ENTRY_FILE), script)
        with replacing(out_path) as temporary, _unchanged_imports():
            FmuBuilder.build_FMU(
                script,
                dest=temporary,
                project_files=[folder / "scene", folder / UNIT_FILE],
                canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
            )
    if (platform.system(), platform.machine()) not in PLATFORMS:
        warnings.warn(
            "pythonfmu has binaries for Linux and Windows on x86-64 only: the unit cannot be "
            f"imported on this machine ({platform.system()} {platform.machine()})",
            stacklevel=2,
        )
    return out_path


def model_identifier(name: str) -> str:
    """Turn a file name into an identifier of the C language, as FMI asks for."""
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    return identifier if re.match(r"[A-Za-z_]", identifier) else f"_{identifier}"


def _stage_scene(scene: Scene, folder: Path) -> list[str]:
    """Copy the scene and the files that it names; return the overrides that name moved files."""
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


@contextmanager
def _unchanged_imports() -> Iterator[None]:
    """Undo what pythonfmu's builder leaves in ``sys.path`` and ``sys.modules``."""
    path = list(sys.path)
    sys.modules.pop(ENTRY_MODULE, None)
    try:
        yield
    finally:
        sys.path[:] = path
        sys.modules.pop(ENTRY_MODULE, None)
