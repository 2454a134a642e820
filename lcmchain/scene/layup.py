"""The short form of a stack: a code such as ``"[0/90, 45/-45]s"``, bottom first.

The code follows the usual one of laminates (ASTM D6507), written for fabrics:

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

from lcmchain.errors import shortened

#: Most plies of a stack, far above any use.
MOST_PLIES = 200

EXAMPLE = "[0/90, 45/-45]s"

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
