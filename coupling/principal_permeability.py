"""Principal permeabilities with their axes, and the check of a law's range."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError


class PrincipalPermeabilities(NamedTuple):
    """Principal permeabilities [m2], each (C,), and their directions, each (C, 3).

    Parameters
    ----------
    k1, k2 : the larger and the smaller one in the plane of the sheet.
    k3 : through the thickness.
    direction_1, direction_2, direction_3 : unit vectors whose sign has no meaning. They form a
        right-handed frame; the third one is the axis about which fibre 1 turns to fibre 2.
    """

    k1: np.ndarray
    k2: np.ndarray
    k3: np.ndarray
    direction_1: np.ndarray
    direction_2: np.ndarray
    direction_3: np.ndarray


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (C, 3) of length one; not a number for vectors of length zero."""
    length = np.linalg.norm(vectors, axis=1)
    return vectors / np.where(length > 0.0, length, np.nan)[:, None]


def within(
    fraction: np.ndarray,
    outside: np.ndarray,
    limits: tuple[float, float],
    *,
    name: str,
    out_of_range: str,
    advice: str = "",
) -> np.ndarray:
    """Return fibre volume fractions, not a number where they are outside of a law's range.

    Parameters
    ----------
    outside : whether a value is outside, of the shape of ``fraction``.
    limits : of the range.
    name : of the law, for messages.
    out_of_range : ``"raise"`` or ``"nan"``.
    advice : on values above the range.

    Raises
    ------
    InputError : a value is outside and ``out_of_range`` is ``"raise"``; names the first cells and
        the worst value.
    """
    if out_of_range == "raise" and np.any(outside):
        low, high = limits
        cells = np.flatnonzero(outside)
        flat = fraction.reshape(-1)
        worst = cells[np.argmax(np.abs(flat[cells] - 0.5 * (low + high)))]
        few = ", ".join(str(cell) for cell in cells[:5]) + (", ..." if len(cells) > 5 else "")
        beyond = advice if flat[worst] >= high else ""
        raise InputError(
            f"{name} holds for fibre volume fractions between {_short(low)} and {high:.3f}, but "
            f"{len(cells)} cells lie outside (cell {few}; the worst is {worst} with "
            f"{flat[worst]:.3f}){beyond}",
            key="permeability",
        )
    return np.where(outside, np.nan, fraction)


def _short(low: float) -> str:
    return f"{low:.3f}" if low else "0"
