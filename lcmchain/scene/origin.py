"""What the text of a scene in a result says: here the material that was formed."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.scene.explain import problems_of
from lcmchain.scene.overrides import apply_overrides
from lcmchain.scene.read import OVERRIDE, input_error, parse_toml
from lcmchain.scene.scene import Scene

#: The least that a scene needs beside its material.
_REST = {
    "process": {"time": "1 s"},
    "blank": {"size": ["1 m", "1 m"], "edge_length": "10 mm"},
}


def formed_material(text: str) -> Any:
    """Return the material table of a scene that a result holds, with its overrides.

    The other tables are not looked at: the meshes and tools that they name may be elsewhere by now.

    Raises
    ------
    InputError : it has no material, or one that this version does not know.
    """
    data = parse_toml(text, None)
    given = [line.removeprefix(OVERRIDE) for line in text.splitlines() if line.startswith(OVERRIDE)]
    apply_overrides(data, [item for item in given if item.startswith("material")])
    alone = _REST | {key: data[key] for key in ("material", "element") if key in data}
    try:
        return Scene.model_validate(alone, context=FROM_FILE).material
    except ValidationError as error:
        raise input_error(problems_of(error, alone), None) from None
