"""What the text of a scene in a result says: the material that was formed, its permeability."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.scene.explain import problems_of
from lcmchain.scene.overrides import apply_overrides
from lcmchain.scene.read import OVERRIDE, input_error, parse_toml
from lcmchain.scene.scene import Scene

#: The least that a scene needs beside its material.
_REST: dict[str, dict[str, Any]] = {
    "process": {"time": "1 s"},
    "blank": {"size": ["1 m", "1 m"], "edge_length": "10 mm"},
}


def formed_material(text: str) -> Any:
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
    return _scene_of(text, "material", "element").material


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
    alone: dict[str, Any] = {"process": _REST["process"]}
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


def _with_overrides(text: str, *tables: str) -> dict[str, Any]:
    """The tables of a scene with the overrides of those that are named."""
    data = parse_toml(text, None)
    given = [line.removeprefix(OVERRIDE) for line in text.splitlines() if line.startswith(OVERRIDE)]
    apply_overrides(data, [item for item in given if item.startswith(tables)])
    return data


def _checked(tables: dict[str, Any]) -> Scene:
    try:
        return Scene.model_validate(tables, context=FROM_FILE)
    except ValidationError as error:
        raise input_error(problems_of(error, tables), None) from None
