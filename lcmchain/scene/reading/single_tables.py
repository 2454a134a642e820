"""Tables of a scene without the rest: from a file of their own, or from the scene in a result."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from lcmchain.errors import InputError
from lcmchain.materials.table import MaterialTable
from lcmchain.quantities.entry_types import FROM_FILE, SceneModel
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.reading.explain import MOST_PROBLEMS, problems_of
from lcmchain.scene.reading.overrides import TomlTable, apply_overrides
from lcmchain.scene.reading.read import (
    OVERRIDE,
    input_error,
    parse_toml,
    read_text,
    require_within_limits,
)
from lcmchain.scene.scene import Scene
from lcmchain.scene.structure import Structure

Table = TypeVar("Table", bound=SceneModel)


def read_table(
    model: type[Table], stage: str, path: str | Path, overrides: Sequence[str] = ()
) -> Table:
    """Read and validate a file (TOML) with what ``[mapping.STAGE]`` holds in a scene.

    Parameters
    ----------
    overrides : ``key=value`` texts, as for a scene.

    Raises
    ------
    InputError : the file cannot be read, is not TOML, or any entry is wrong; all wrong entries are
        named in one message.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the file of the case in it", file=path)
    return _table_from_text(model, stage, read_text(path), path, overrides)


def _table_from_text(
    model: type[Table],
    stage: str,
    text: str,
    path: Path | None = None,
    overrides: Sequence[str] = (),
) -> Table:
    """Validate the text of such a file.

    Raises
    ------
    InputError : as in :func:`read_table`.
    """
    data: TomlTable = parse_toml(text, path)
    if overrides:
        apply_overrides(data, overrides)
    require_within_limits(data, path)
    try:
        return model.model_validate(copy.deepcopy(data), context=FROM_FILE)
    except ValidationError as error:
        # where the table stands in a scene
        problems = problems_of(error, {"mapping": [{stage: data}]}, ("mapping", 0, stage))
        unexplained = max(error.error_count() - MOST_PROBLEMS, 0)
        raise input_error(problems, path, unexplained=unexplained) from None


# --- infiltration and structural analysis ---------------------------------------------------------


def read_infiltration(path: str | Path, overrides: Sequence[str] = ()) -> Infiltration:
    """Read and validate the file of an infiltration, see :func:`read_table`."""
    return read_table(Infiltration, "infiltration", path, overrides)


def infiltration_from_text(
    text: str, path: Path | None = None, overrides: Sequence[str] = ()
) -> Infiltration:
    """Validate the text of the file of an infiltration."""
    return _table_from_text(Infiltration, "infiltration", text, path, overrides)


def is_scene_file(path: str | Path) -> bool:
    """Whether a file is a scene and not the case of an infiltration: it has a blank or plies.

    A file that cannot be read is none; reading it as a case tells what is wrong.
    """
    try:
        words = read_text(Path(path))
    except InputError:
        return False
    of_scene = ("[blank", "blank", "[[plies", "plies", "layup")
    return any(line.strip().startswith(of_scene) for line in words.splitlines())


def read_structure(path: str | Path, overrides: Sequence[str] = ()) -> Structure:
    """Read and validate the file of a structural analysis, see :func:`read_table`."""
    return read_table(Structure, "structure", path, overrides)


def structure_from_text(
    text: str, path: Path | None = None, overrides: Sequence[str] = ()
) -> Structure:
    """Validate the text of the file of a structural analysis."""
    return _table_from_text(Structure, "structure", text, path, overrides)


# --- tables of the scene that a result holds ------------------------------------------------------


#: The least that a scene needs beside its material.
_REST: dict[str, TomlTable] = {
    "process": {"time": "1 s"},
    "blank": {"size": ["1 m", "1 m"], "edge_length": "10 mm"},
}


def formed_material(text: str) -> MaterialTable:
    """Return the material table of a scene that a result holds, with its overrides.

    The other tables are not looked at: the meshes and tools that they name may be elsewhere by now.

    Raises
    ------
    InputError : it has no material, or one that this version does not know, or several plies.
    """
    data = parse_toml(text, None)
    if "plies" in data or "layup" in data:
        raise InputError(
            "was formed from a stack of plies, and this takes a part of one sheet; form one "
            "([blank] and [material])",
            key="plies" if "plies" in data else "layup",
        )
    material = _scene_of(text, "material", "element").material
    assert material is not None  # plies alone do without
    return material


def formed_plies(text: str) -> dict[str, Any]:
    """Return the material table of every ply of a stack by its name, bottom first.

    Outlines, edges and heights are not looked at.

    Raises
    ------
    InputError : the scene has no plies, or a material that this version does not know.
    """
    data = _with_overrides(text, "material", "plies", "layup")
    if "plies" not in data and "layup" not in data:
        raise InputError("the scene in it has no plies; form the stack again", key="plies")
    alone: TomlTable = {"process": _REST["process"]}
    alone |= {key: data[key] for key in ("material", "materials", "layup") if key in data}
    if "plies" in data:
        named = [{k: ply[k] for k in ("name", "material") if k in ply} for ply in data["plies"]]
        alone["plies"] = [ply | _REST["blank"] for ply in named]
    else:
        alone["blank"] = _REST["blank"]
    return {ply.name: ply.material for ply in _checked(alone).stack}


def formed_permeability(text: str) -> Any:
    """Return the permeability law of a scene that a result holds; None where there is none.

    A law that this version does not know is none either: the values in the result stay valid.
    """
    if not text:
        return None
    try:
        return _scene_of(text, "material", "element", "permeability").permeability
    except InputError:
        return None


def _scene_of(text: str, *tables: str) -> Scene:
    """The scene with these of its tables, and the least that it needs beside them."""
    data = _with_overrides(text, *tables)
    alone = _REST | {key: data[key] for key in tables if key in data}
    named = data.get("materials")
    if "material" not in alone and isinstance(named, dict) and named:
        alone["material"] = next(iter(named.values()))  # permeability needs any that has fibres
    return _checked(alone)


def _with_overrides(text: str, *tables: str) -> TomlTable:
    """The tables of a scene with the overrides of those that are named."""
    data = parse_toml(text, None)
    given = [line.removeprefix(OVERRIDE) for line in text.splitlines() if line.startswith(OVERRIDE)]
    apply_overrides(data, [item for item in given if item.startswith(tables)])
    return data


def _checked(tables: TomlTable) -> Scene:
    try:
        return Scene.model_validate(tables, context=FROM_FILE)
    except ValidationError as error:
        raise input_error(problems_of(error, tables), None) from None
