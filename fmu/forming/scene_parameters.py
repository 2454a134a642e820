"""Entries of a scene that a master may set before initialization: parameters of the unit.

The friction of the tools is always one. A scene marks further ones:

    [fmu]
    parameters = ["tools.holder.motion.mass", "process.mass_damping"]

A parameter is an entry with one number. Entries that decide the mesh cannot be parameters, since
fields have as many values as the unit was built with. Nor can the number of grippers, each of which
has outputs of its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel

from lcmchain.errors import InputError
from lcmchain.fmu.variables import UNITS, Kind, Variable, quoted
from lcmchain.quantities.entry_types import Number, Quantity
from lcmchain.scene import Scene, scene_from_text
from lcmchain.scene.reading.overrides import _steps

#: Tables that decide the mesh or the files.
OF_THE_BUILD = (
    "blank", "plies", "layup", "element", "output", "fmu", "mapping", "infiltration",
)  # fmt: skip

#: The number of grippers of an entry along a rim, which decides the outputs.
_NUMBER_OF_GRIPPERS = re.compile(r"grippers\b.*\bcount")

#: Always parameters, where the scene has tools.
FRICTION = "contact.friction"


class SceneParameter(NamedTuple):
    """A parameter of the unit and the entry of the scene behind it.

    key : dotted. unit : in which scenes read the entry, empty for a number.
    """

    variable: Variable
    key: str
    unit: str

    def override(self, value: float) -> str:
        """Return the text that sets the entry in a scene."""
        if self.unit:
            return f'{self.key}="{value!r} {self.unit}"'
        return f"{self.key}={int(value) if self.variable.kind is Kind.INTEGER else value!r}"


def scene_parameters(scene: Scene) -> tuple[SceneParameter, ...]:
    """Return the parameters of the unit of a scene.

    Raises
    ------
    InputError : the scene marks an entry that is no number, does not exist, or decides the mesh.
    """
    marked = [] if scene.fmu is None else list(scene.fmu.parameters)
    keys = [FRICTION] if scene.tools and FRICTION not in marked else []
    return tuple(_parameter(scene, key) for key in dict.fromkeys([*keys, *marked]))


def require_settable(scene: Scene, path: Path | str, given: Sequence[str]) -> None:
    """Try out that the scene takes its parameters from a master, each with its own value.

    path, given : where the scene was read, and its overrides.

    Raises
    ------
    InputError : an entry that can be read, but not be set alone.
    """
    for parameter in scene_parameters(scene):
        text = parameter.override(parameter.variable.start)  # type: ignore[arg-type]
        try:
            scene_from_text(scene.source.text, path, [*given, text])
        except InputError as error:
            raise InputError(
                f'"{parameter.key}" cannot be a parameter of the unit, because it cannot be set '
                f"alone: {error.message}; write a row of numbers as a list in the scene",
                key="fmu.parameters",
            ) from None


def overrides(parameters: Iterable[SceneParameter], values: dict[str, float]) -> list[str]:
    """Return the overrides for the parameters whose values differ from those of the scene."""
    return [
        parameter.override(values[parameter.variable.name])
        for parameter in parameters
        if values[parameter.variable.name] != parameter.variable.start
    ]


def _parameter(scene: Scene, key: str) -> SceneParameter:
    if re.split(r"[.\[]", key)[0] in OF_THE_BUILD:
        raise InputError(
            f'"{key}" cannot be a parameter of the unit: it decides the mesh or the files; set it '
            "when the unit is built (--set)",
            key="fmu.parameters",
        )
    if _NUMBER_OF_GRIPPERS.fullmatch(key):
        raise InputError(
            f'"{key}" cannot be a parameter of the unit: it decides how many outputs there are; '
            "set it when the unit is built (--set)",
            key="fmu.parameters",
        )
    value, entry = _entry(scene, key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(
            f'"{key}" cannot be a parameter of the unit: it is {value!r}, not one number that the '
            "scene gives",
            key="fmu.parameters",
        )
    unit = entry.dimension.unit if isinstance(entry, Quantity) else ""
    fmi_unit = unit.replace("^", "").replace("*", ".") or "1"
    is_whole = isinstance(entry, Number) and entry.whole
    variable = Variable(
        ".".join(quoted(str(step)) for step in _steps(key)),
        Kind.INTEGER if is_whole else Kind.REAL,
        "parameter",
        "fixed",
        f"entry {key} of the scene" + ("" if fmi_unit in UNITS else f" in {unit}"),
        fmi_unit if fmi_unit in UNITS and not is_whole else None,
        # pressures of a material are moduli
        "Modulus" if fmi_unit == "Pa" and key.startswith("material.") else None,
        start=int(value) if is_whole else float(value),
    )
    return SceneParameter(variable, key, unit)


def _entry(scene: Scene, key: str) -> tuple[object, Quantity | Number | None]:
    """Return the value of a scene's entry, and what its type says of it."""
    node: object = scene
    entry: Quantity | Number | None = None
    for step in _steps(key):
        if isinstance(node, tuple):
            node = _named(node, step, key)
            continue
        if not isinstance(node, BaseModel) or step not in type(node).model_fields:
            raise InputError(f'the scene has no entry "{key}"', key="fmu.parameters")
        field = type(node).model_fields[str(step)]
        entry = next(_of_types((*field.metadata, field.annotation)), None)
        node = getattr(node, str(step))
    return node, entry


def _named(nodes: tuple[object, ...], step: str | int, key: str) -> object:
    for index, node in enumerate(nodes):
        if step in (index, str(index), getattr(node, "name", None)):
            return node
    raise InputError(f'the scene has no entry "{key}"', key="fmu.parameters")


def _of_types(metadata: Iterable[object]) -> Iterator[Quantity | Number]:
    for item in metadata:
        if isinstance(item, (Quantity, Number)):
            yield item
        else:
            yield from _of_types(getattr(item, "__metadata__", ()))
            yield from _of_types(getattr(item, "__args__", ()) or ())
