"""Text of solver decks."""

from __future__ import annotations

import re
from pathlib import Path

from lcmchain.errors import InputError

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")


def real_number(text: str) -> float:
    """Return a real number as Fortran writes it; ``1.5-3`` and ``1.5D-3`` are 1.5e-3.

    Raises
    ------
    ValueError : it is none.
    """
    found = _REAL.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return float(found[1] + ("e" + found[2] if found[2] else ""))


def deck_lines(path: Path) -> list[str]:
    """Return the lines of a deck; comments may be in any one-byte encoding.

    Raises
    ------
    InputError : the file is absent, a folder, empty or no text.
    """
    if path.is_dir():
        raise InputError("this is a folder; name the deck in it", file=path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"the deck cannot be read ({error.strerror or error})", file=path
        ) from None
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(
            f"line {line}: holds a zero byte, so this is no text deck; export it as text",
            file=path,
        )
    if not content.strip():
        raise InputError("the file is empty; export the mesh again", file=path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
