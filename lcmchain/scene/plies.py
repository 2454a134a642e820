"""The entries of ``[[plies]]``, and their short form, the code of a lay-up.

The code follows the usual one of laminates (ASTM D6507), written for fabrics, bottom first:

- angles are in degrees, from x to the first family of fibres;
- a comma stands between plies, so does a slash between plies in parentheses;
- a slash joins the two families of *one* woven or stitched ply, ``0/90`` or ``(0/90)``;
  ``±45`` is short for ``45/-45``; one angle alone is that of the first family;
- ``_2`` behind a ply lays it twice, ``]2`` lays all plies of the brackets twice;
- ``s`` at the end is symmetric: the plies once more, in reverse order.

So ``[0/90]2s`` has four plies of a fabric, where it has eight of a tape in the usual code.
"""

from __future__ import annotations

import math
import re
from typing import Annotated

from pydantic import Field, field_validator

from lcmchain.elements.families import SheetElement
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import shortened
from lcmchain.mesh.blank import Blank
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    AtWork,
    Length,
    Name,
    PointInPlane,
    Switch,
    wrong,
)
from lcmchain.quantities.fields import FIELD_OF_VARIABLE

#: Groups, meshes and variables of result files that are not those of one ply.
RESERVED_NAMES = ("sheet", "solid", "history", "time", "body", "stack", *FIELD_OF_VARIABLE)
#: Most plies of a stack, far above any use.
MOST_PLIES = 200


class Ply(Blank):
    """One ply of a stack; the first lies lowest, each of the others on the one before it."""

    height: Annotated[Length | None, AbsentMeans("0 mm, or on the ply before")] = Field(  # type: ignore[assignment]
        default=None,
        description="z coordinate of the mid-surface; left out, the lowest ply lies at 0, every "
        "other one on the one before.",
    )
    center: PointInPlane = Field(  # type: ignore[assignment]
        default=("0 mm", "0 mm"), description="Shift of size or outline in the plane."
    )
    name: Annotated[Annotated[str, Name("top")] | None, AbsentMeans("ply_1, ply_2, ...")] = Field(
        default=None, description="Name in results and messages; by default counted from below."
    )
    material: Annotated[Annotated[str, Name("biaxial")] | None, AbsentMeans("[material]")] = Field(
        default=None, description="Name of an entry of [materials]; by default [material]."
    )
    element: Annotated[SheetElement | None, AbsentMeans("that of the scene")] = Field(
        default=None, description="Kind of element of this ply and its options."
    )

    film: Switch = Field(
        default=False,
        description="A film that helps to form the others and is taken off afterwards: a "
        "diaphragm, a release film. No thickness, fibre volume fraction, mapping or "
        "infiltration counts it.",
    )
    stages: AtWork = Field(
        default=None,
        description="Stages in which it is there, up to the last one: it is laid down when the "
        "first of them begins. Left out, it is there from the start.",
    )

    @field_validator("element", mode="before")
    @classmethod
    def _complete_element(cls, value: object) -> object:
        return complete_element(value)


def complete_element(value: object) -> object:
    """Take a name alone, and the solid-shell where options are given without a type."""
    if isinstance(value, str):
        return {"type": value}
    if isinstance(value, dict) and "type" not in value:
        return {"type": Element.model_fields["type"].default, **value}
    return value


def named_plies(plies: tuple[Ply, ...]) -> tuple[Ply, ...]:
    """Return the entries of ``[[plies]]`` with the names that are left out.

    Raises
    ------
    PydanticCustomError : two have the same name, or one has a name that result files use.
    """
    named: list[Ply] = []
    for index, ply in enumerate(plies):
        name = ply.name or f"ply_{index + 1}"
        same = [other for other, earlier in enumerate(named) if earlier.name == name]
        if same:
            raise wrong(
                f'is "{name}", but so is that of plies[{same[0]}]; give each its own',
                field=f"[{index}].name",
            )
        if name in RESERVED_NAMES:
            raise wrong(
                f'is "{name}", which result files use themselves; choose another',
                field=f"[{index}].name",
            )
        named.append(ply.model_copy(update={"name": name}))
    return tuple(named)


# --- lay-up codes ---------------------------------------------------------------------------------


EXAMPLE = "[0/90, 45/-45]s"

#: Signs of typeset codes, as they are pasted from a drawing: both minus signs, and degrees.
_PLAIN = str.maketrans({"\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "°": ""})
_CODE = re.compile(r"\s*\[(?P<plies>[^\[\]]*)\]\s*_?(?P<count>\d{1,4})?\s*_?(?P<mirror>[sS])?\s*")
_NUMBER = r"[-+]?\d{1,4}(?:\.\d{1,9})?"
_PLY = re.compile(rf"(?P<both>±|\+/?-(?=\d))?(?P<first>{_NUMBER})(?:\s*/\s*(?P<second>{_NUMBER}))?")
_REPEATED = re.compile(r"(?P<ply>.*?)\s*(?:_(?P<count>\d{1,4}))?")
_SLASH_BETWEEN_PLIES = re.compile(r"(\)(?:_\d+)?)\s*/\s*(?=\()")


class LayupError(ValueError):
    """What is wrong with a code, in words that follow "layup"."""


def angles_of(code: str) -> tuple[float, ...]:
    """Return the angle from x to the first family of fibres of every ply [rad], bottom first.

    >>> [round(math.degrees(angle)) for angle in angles_of("[0/90, 45/-45]s")]
    [0, 45, 45, 0]

    Raises
    ------
    LayupError : the code cannot be read, or has no plies.
    """
    code = code.translate(_PLAIN)
    whole = _CODE.fullmatch(code)
    if whole is None:
        raise LayupError(f'is "{shortened(code)}", which is no stack of plies; write "{EXAMPLE}"')
    if not whole["plies"].strip():
        raise LayupError(f'has no plies; write "{EXAMPLE}"')
    angles: list[float] = []
    for text in _SLASH_BETWEEN_PLIES.sub(r"\1,", whole["plies"]).split(","):
        angles += _plies_of(text.strip())
    angles *= _count(whole["count"], code)
    if whole["mirror"]:
        angles += reversed(angles)
    if len(angles) > MOST_PLIES:
        raise LayupError(f"has {len(angles):,} plies; at most {MOST_PLIES} are read")
    return tuple(angles)


def names_two_families(code: str) -> bool:
    """Tell whether a code writes any ply by two families, as in ``0/90`` or ``±45``."""
    return any(sign in _SLASH_BETWEEN_PLIES.sub(",", code) for sign in ("/", "±", "+-"))


def _plies_of(text: str) -> list[float]:
    """Return the angles [rad] of one ply of the code, as often as it is laid."""
    repeated = _REPEATED.fullmatch(text)
    ply = repeated["ply"] if repeated else text
    if ply.startswith("(") and ply.endswith(")"):
        ply = ply[1:-1].strip()
    match = _PLY.fullmatch(ply)
    if match is None:
        raise LayupError(
            f'has the ply "{shortened(text)}", which is neither an angle nor two families of '
            f"fibres such as 0/90; a comma stands between plies: {EXAMPLE}"
        )
    first = float(match["first"])
    second = -first if match["both"] else first + 90.0
    if match["second"] is not None:
        if match["both"]:
            raise LayupError(f'has the ply "{text}"; write ±45 or 45/-45')
        second = float(match["second"])
    if abs(math.remainder(second - first, 180.0)) != 90.0:
        raise LayupError(
            f'has the ply "{text}", but the two families of a fabric lie at 90 deg to each other '
            "before forming; a comma stands between plies"
        )
    return [math.radians(first)] * _count(repeated["count"] if repeated else None, text)


def _count(text: str | None, where: str) -> int:
    count = 1 if text is None else int(text)
    if count == 0:
        raise LayupError(f'lays "{shortened(where)}" no times; leave it out')
    return min(count, MOST_PLIES + 1)
