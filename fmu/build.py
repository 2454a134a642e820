"""Build a functional mock-up unit (co-simulation, FMI 2.0 or 3.0) of a scene."""

from __future__ import annotations

import json
import platform
import re
import shutil
import tempfile
import warnings
import zipfile
from collections.abc import Mapping, Sequence
from importlib import metadata
from importlib.resources import files
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.check import require_no_initial_overlap
from lcmchain.coupling.cosimulation.description import TERMINALS_FILE
from lcmchain.errors import InputError
from lcmchain.fmu.description import (
    as_bytes,
    document,
    documentation,
    model_description,
    terminals_of,
)
from lcmchain.fmu.forming.interface import faces_of_plies, interface_of
from lcmchain.fmu.forming.scene_parameters import require_settable
from lcmchain.fmu.forming.variables import (
    FIELDS_OF_FMI2,
    FLUID_FIELDS_OF_FMI2,
    abilities_of,
    field_names,
    meshes_of,
)
from lcmchain.fmu.icons import icon_files
from lcmchain.fmu.instances import UNIT_FILE, define
from lcmchain.fmu.library.link import LinkError, guarded
from lcmchain.fmu.mesh_fields import layered_files
from lcmchain.fmu.part import INTERFACE_FILE, UnitDefinition
from lcmchain.mapping.interface import read_interface
from lcmchain.scene import Scene, read_scene
from lcmchain.scene.process import require_time_for_fluid
from lcmchain.tools.table import build_tool_table

# Exporters whose binaries turn the C calls of a master into Python calls.
EXPORTERS = {2: "pythonfmu", 3: "pythonfmu3"}
# Names of the entry files in a unit, which must not be those of real modules; another one for each
# version, since units of both in one process share the loaded modules.
ENTRY_MODULES = {2: "lcmchain_unit_fmi2", 3: "lcmchain_unit_fmi3"}
ENVIRONMENT_MODULE = "lcmchain_unit_environment"

#: Systems and processors for which the exporters carry a binary.
PLATFORMS = {("Linux", "x86_64"), ("Windows", "AMD64")}

HERE = Path(__file__).parent

# All files of a unit get this date, so that the same unit has the same bytes.
DATE = (1980, 1, 1, 0, 0, 0)


def build_fmu(
    scene_path: Path | str,
    out_path: Path | str,
    *,
    fmi: int = 2,
    part: str = "forming",
    overrides: Sequence[str] = (),
    needs_tool: bool = True,
    **options: Any,
) -> Path:
    """Build the unit of a scene and return its path.

    The unit holds the scene and the files that the scene names. It computes in the Python of the
    process that imports it, which must have lcmchain installed.

    Parameters
    ----------
    scene_path : scene file.
    out_path : the unit, ``*.fmu``; replaced only once the new one is complete.
    fmi : version of the standard. part : what the unit computes.
    overrides : ``key=value`` texts for the scene.
    needs_tool : whether the unit says that it needs an installed tool (``needsExecutionTool``).
    options : of the part; forming takes ``fields`` (names, None for those of the version) and
        ``pore_pressure`` (whether a fluid may act in the pores), and ``interface`` (patches of
        elements at which fields are exchanged, 0 for the elements).

    Raises
    ------
    InputError : the scene or a file that it names is missing or wrong, a tool overlaps the blank
        at the start, or the unit cannot be written.
    """
    out_path = Path(out_path)
    require_target(out_path, fmi)
    if part not in PARTS:
        raise InputError(f'no part "{part}"; there is {", ".join(PARTS)}', key="--part")
    scene = read_scene(scene_path, overrides)
    if part == "forming":
        require_settable(scene, scene_path, overrides)
    with tempfile.TemporaryDirectory(prefix="lcmchain-fmu-") as name:
        resources = Path(name)
        entries, faces = PARTS[part](scene, fmi, resources, **options)
        unit = {
            "part": part,
            "scene": "scene/scene.toml",
            "overrides": [*overrides, *stage_scene(scene, resources / "scene")],
            **entries,
        }
        write_unit(out_path, fmi, unit, resources, needs_tool=needs_tool, faces=faces)
    return out_path


def require_target(out_path: Path, fmi: int) -> None:
    """Refuse a file that is no unit, and a version of the standard that there is not.

    Raises
    ------
    InputError : either of them.
    """
    if out_path.suffix != ".fmu":
        raise InputError("the name of a functional mock-up unit ends in .fmu", file=out_path)
    if fmi not in EXPORTERS:
        raise InputError(f"there is no FMI {fmi} to build for; take 2 or 3", key="--fmi")


def write_unit(
    out_path: Path,
    fmi: int,
    unit: dict[str, Any],
    resources: Path,
    *,
    needs_tool: bool = True,
    faces: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write a unit, whole or not at all.

    Parameters
    ----------
    unit : what the part needs to define it (:func:`.instances.define`).
    resources : folder with the files that it names; those of every unit are added.
    needs_tool : whether the unit says that it needs an installed tool.
    faces : fields on a part of the interface alone, see :func:`.mesh_fields.layered_files`.

    Raises
    ------
    InputError : the installed exporter is not the one that the guard of its library is made for.
    """
    unit = {
        "model_name": model_identifier(out_path.stem), "lcmchain_version": __version__, **unit,
    }  # fmt: skip
    definition, _ = define(unit, resources)
    unit["guid"] = definition.guid
    _write_resources(resources, unit, fmi)
    root = model_description(definition, fmi, needs_tool=needs_tool)
    contents = {
        "modelDescription.xml": as_bytes(root),
        **_binaries(fmi, definition),
        **documentation(definition, EXPORTERS[fmi], metadata.version(EXPORTERS[fmi])),
    }
    ports = terminals_of(definition.variables) if fmi == 3 else []
    contents |= icon_files(definition.model_name, unit["part"], fmi, ports)
    if fmi == 3:
        contents[TERMINALS_FILE] = as_bytes(document(ports))
    interface = read_interface(resources / INTERFACE_FILE)
    contents |= layered_files(definition.variables, interface, faces)
    for path in sorted(resources.rglob("*")):
        if path.is_file():
            contents[f"resources/{path.relative_to(resources).as_posix()}"] = path.read_bytes()
    with replacing(out_path) as temporary:
        _write_archive(temporary, contents)
    if (platform.system(), platform.machine()) not in PLATFORMS:
        warnings.warn(
            f"{EXPORTERS[fmi]} has binaries for Linux and Windows on x86-64 only: the unit cannot "
            f"be imported on this machine ({platform.system()} {platform.machine()})",
            stacklevel=3,
        )


def model_identifier(name: str) -> str:
    """Turn a file name into an identifier of the C language, as FMI asks for."""
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    return identifier if re.match(r"[A-Za-z_]", identifier) else f"_{identifier}"


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


def _forming_entries(
    scene: Scene,
    fmi: int,
    resources: Path,
    *,
    fields: Sequence[str] | None = None,
    pore_pressure: bool = False,
    interface: int = 0,
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Check a scene for forming and write its interface.

    Return what its unit holds about it, and the faces of fields that lie on a part of them.
    """
    blanks = [ply.build_blank() for ply in scene.stack]
    tools = build_tool_table(
        scene.tools,
        scene.source.directory,
        scene.process.time,
        blank=np.concatenate([blank.node_positions for blank in blanks]),
    )
    require_no_initial_overlap(scene, tools, blanks)
    pore_pressure = pore_pressure or scene.wet_forming is not None
    require_time_for_fluid(time_is_found=scene.time_is_found, pore_pressure=pore_pressure)
    known = field_names(abilities_of(scene, pore_pressure=pore_pressure))
    if fields == ["all"]:
        fields = known
    for name in fields or ():
        if name not in known:
            raise InputError(f'no field "{name}"; there are {", ".join(known)}', key="--fields")
    if fields is None and fmi == 2:
        fields = [name for name in FIELDS_OF_FMI2 if name in known]
        fields += FLUID_FIELDS_OF_FMI2 if pore_pressure else ()
    title = f"interface of {scene.title}"
    meshes = meshes_of(scene)
    interface_of(meshes, interface).write(resources / INTERFACE_FILE, {"title": title})
    entries = {"fields": None if fields is None else list(fields), "pore_pressure": pore_pressure}
    return entries, faces_of_plies([ply.name for ply in scene.stack], meshes)


#: What checks a scene for a part: see :func:`_forming_entries`.
PARTS = {"forming": _forming_entries}


def _write_resources(resources: Path, unit: Mapping[str, Any], fmi: int) -> None:
    contents = {
        UNIT_FILE: (json.dumps(unit, indent=2) + "\n").encode(),
        "slavemodule.txt": ENTRY_MODULES[fmi].encode(),
        f"{ENTRY_MODULES[fmi]}.py": _entry_module(fmi),
        f"{ENVIRONMENT_MODULE}.py": (HERE / "entry_environment.py").read_bytes(),
    }
    for name, content in contents.items():
        (resources / name).write_bytes(content)


def _entry_module(fmi: int) -> bytes:
    return (HERE / f"entry_fmi{fmi}.py").read_bytes()


def _binaries(fmi: int, definition: UnitDefinition) -> dict[str, bytes]:
    """Return the exporter's binaries by their places in the unit, that of Linux with the guard."""
    folder = Path(str(files(EXPORTERS[fmi]))) / "resources" / "binaries"
    binaries = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix not in (".so", ".dll", ".dylib"):
            continue
        place = f"binaries/{path.parent.relative_to(folder).as_posix()}"
        try:
            content = guarded(path.read_bytes(), fmi, definition.variables, _entry_module(fmi))
        except LinkError as error:
            raise InputError(
                f"{error}: the installed {EXPORTERS[fmi]} {metadata.version(EXPORTERS[fmi])} is "
                "another than this lcmchain knows; install an earlier one",
                file=path,
            ) from None
        binaries[f"{place}/{definition.model_name}{path.suffix}"] = content
    return binaries


def _write_archive(path: Path, contents: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
