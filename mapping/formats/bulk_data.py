"""Fields of bulk data: numbers in eight columns, as exact as these columns allow.

Source: the small-field format of Nastran bulk data, which RTMsim, LCMsim and OptiStruct read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.mapping.formats.format import require_numbers

WIDTH = 8
LARGEST_NUMBER = 10**WIDTH - 1


def real(value: float) -> str:
    """Write a number into at most eight columns, with a decimal point and as many digits as fit.

    An exponent stands without ``E``, as ``1.2345-4``.
    """
    if value == 0.0:
        return "0.0"
    size, sign = abs(value), "-" if value < 0.0 else ""
    room = WIDTH - len(sign)
    if 1e-3 <= size < 1.0:
        text = f"{size:.{room - 1}f}"
        if text.startswith("0"):
            return sign + _short(text[1:])
    if 1e-3 <= size < 10.0 ** (room - 1):
        for decimals in range(room - 2, -1, -1):
            text = f"{size:.{decimals}f}" + ("." if decimals == 0 else "")
            if len(text) <= room:
                return sign + _short(text)
    for digits in range(room - 3, -1, -1):
        mantissa, exponent = f"{size:.{digits}e}".split("e")
        text = mantissa + ("." if digits == 0 else "") + f"{int(exponent):+d}"
        if len(text) <= room:
            return sign + text
    raise ValueError(f"{value} does not fit into {WIDTH} columns")


def number(text: str) -> float:
    """Read what :func:`real` wrote."""
    for sign in "+-":
        head, found, tail = text[1:].rpartition(sign)
        if found and head:
            return float(f"{text[0]}{head}e{sign}{tail}")
    return float(text)


def line(*fields: int | float | str) -> str:
    """One line of fields in eight columns each; a name stands left, numbers right."""
    texts = [
        f"{value:<{WIDTH}}" if isinstance(value, str) else
        f"{real(float(value)) if isinstance(value, float) else int(value):>{WIDTH}}"
        for value in fields
    ]  # fmt: skip
    return "".join(texts).rstrip()


def rounded(values: np.ndarray) -> np.ndarray:
    """Values as they come back from eight columns, of the same shape."""
    read = [number(real(float(value))) for value in np.ravel(values)]
    return np.array(read).reshape(np.shape(values))


def require_narrow(numbers: np.ndarray, what: str, file: Path | None) -> None:
    """Refuse numbers of cells or nodes that do not fit into eight columns.

    Raises
    ------
    InputError : a number is below 1 or above 99999999, or stands for two.
    """
    misfit = "does not fit into the eight columns of bulk data"
    require_numbers(numbers, what, file, LARGEST_NUMBER, misfit, "bulk data")


def _short(text: str) -> str:
    """Without zeros at the end, but with the decimal point."""
    shorter = text.rstrip("0")
    return shorter + "0" if shorter.endswith(".") and len(shorter) < WIDTH - 1 else shorter
