"""Printed results of CalculiX (``.dat``): eigenfrequencies, stresses and strains."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError

_NUMBER = r"[-+]?\d+\.\d+(?:E[-+]?\d+)?"
_MODE = re.compile(rf"\s+\d+((?:\s+{_NUMBER}){{4}})\s*")


@dataclass(frozen=True)
class PrintedResults:
    """What a ``.dat`` file holds, in the units of the deck.

    Parameters
    ----------
    frequencies : [Hz], (M,); an eigenvalue below zero, which has none, is not a number.
    element : of every integration point, (P,), in the order of the file.
    stress, strain : there, rows 11, 22, 33, 12, 13, 23 in the axes of the element, (P, 6); shear
        strains are tensor components, half the engineering ones.
    """

    frequencies: np.ndarray
    element: np.ndarray
    stress: np.ndarray
    strain: np.ndarray


def read_printed(path: Path | str) -> PrintedResults:
    """Read the printed results of the steps that :mod:`lcmchain.mapping.structure.deck` writes.

    Raises
    ------
    InputError : the file is absent or broken.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    frequencies: list[float] = []
    points: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for number, line in enumerate(lines):
        if "E I G E N V A L U E   O U T P U T" in line:
            frequencies = _frequencies(lines, number + 1)
        elif line.startswith((" stresses (elem", " strains (elem")):
            points[line.split()[0]] = _points(lines, number + 1, path)
    nothing = np.empty(0, dtype=np.int64), np.empty((0, 6))
    element, stress = points.get("stresses", nothing)
    same, strain = points.get("strains", nothing)
    if not np.array_equal(element, same):
        raise InputError("stresses and strains are of different elements", file=path)
    return PrintedResults(np.array(frequencies), element, stress, strain)


def _frequencies(lines: list[str], first: int) -> list[float]:
    found: list[float] = []
    for line in lines[first:]:
        match = _MODE.fullmatch(line)
        if match is None:
            if found:
                break
            continue
        eigenvalue, _, cycles, _ = (float(text) for text in match[1].split())
        found.append(cycles if eigenvalue >= 0.0 else np.nan)
    return found


def _points(lines: list[str], first: int, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Elements (P,) and components (P, 6) of the table whose head stands before ``first``."""
    elements, rows = [], []
    try:
        for line in lines[first + 1 :]:
            if not line.strip():
                break
            words = line.split()
            elements.append(int(words[0]))
            # Signs may leave no blank between two numbers, which have 14 characters each.
            rows.append([float(line[14 * k + 14 : 14 * k + 28]) for k in range(6)])
    except (ValueError, IndexError):
        raise InputError("the table of stresses is broken; was the run cut off?", file=path) from (
            None
        )
    return np.array(elements, dtype=np.int64), np.array(rows).reshape(-1, 6)
