"""Coordinates of the nodes of Abaqus decks: local systems, cylindrical and spherical coordinates.

Source: Abaqus Keywords Guide, *NODE (SYSTEM=R, C, S; angles in degrees), *SYSTEM; *NMAP says from
where the angles of spherical coordinates are counted: theta about z from the plane of x and z, phi
from the plane of x and y.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mesh_files.readers.abaqus_blocks import Block, words
from lcmchain.mesh_files.readers.abaqus_numbers import real

RECTANGULAR, CYLINDRICAL, SPHERICAL = "R", "C", "S"
_KINDS = {"": RECTANGULAR, "RECTANGULAR": RECTANGULAR, "CYLINDRICAL": CYLINDRICAL,
          "SPHERICAL": SPHERICAL}  # fmt: skip


class LocalSystem(NamedTuple):
    """Origin (3,) and unit vectors of the axes as rows (3, 3), in the system of the deck."""

    origin: np.ndarray
    axes: np.ndarray


def coordinate_kind(block: Block) -> str:
    """Return how a *NODE block gives its nodes: ``R``, ``C`` or ``S``.

    Raises
    ------
    InputError : SYSTEM is none of these.
    """
    given = block.parameters.get("SYSTEM", "").upper()
    kind = _KINDS.get(given, given)
    if kind not in (RECTANGULAR, CYLINDRICAL, SPHERICAL):
        raise block.error(
            f"has SYSTEM={given}; it may be R (x, y, z), C (r, theta, z) or S (r, theta, phi)"
        )
    return kind


def local_system(block: Block) -> LocalSystem | None:
    """Return the system that a *SYSTEM block defines; None where it goes back to that of the deck.

    Three numbers move the origin; three more are a point on the x axis, which stays in the plane of
    x and y of the deck unless a second line gives a point in the local plane of x and y.

    Raises
    ------
    InputError : the numbers make no system.
    """
    numbers = _numbers(block)
    if not numbers or not numbers[0]:
        return None
    counts = [3 * -(-len(line) // 3) for line in numbers]  # blank entries at the end are zero
    if counts not in ([3], [6], [6, 3]):
        raise block.error(
            "takes the origin and maybe a point on the x axis in its first line, and maybe a point "
            "in the plane of x and y in its second: 3 or 6 numbers, and 3"
        )
    numbers = [
        line + [0.0] * (count - len(line)) for line, count in zip(numbers, counts, strict=True)
    ]
    origin = np.array(numbers[0][:3])
    if counts == [3]:
        return LocalSystem(origin, np.eye(3))
    x = np.array(numbers[0][3:]) - origin
    if len(numbers) == 1:
        x[2] = 0.0
        z = np.array([0.0, 0.0, 1.0])
    else:
        z = np.cross(x, np.array(numbers[1]) - origin)
    lengths = float(np.linalg.norm(x)), float(np.linalg.norm(z))
    if not np.isfinite(lengths).all() or min(lengths) <= 1e-12 * max(1.0, *lengths):
        raise block.error("has no three different axes: its points coincide or lie on a line")
    x, z = x / lengths[0], z / lengths[1]
    return LocalSystem(origin, np.stack([x, np.cross(z, x), z]))


def _numbers(block: Block) -> list[list[float]]:
    """Numbers of each data line, without blank entries at its end."""
    found: list[list[float]] = []
    for row, text in enumerate(block.data):
        entries = words(text)
        while entries and not entries[-1]:
            entries.pop()
        try:
            found.append([real(entry) if entry else 0.0 for entry in entries])
        except ValueError:
            raise block.place_of(row).error("*SYSTEM takes numbers") from None
    return found


def places(given: np.ndarray, kind: str, system: LocalSystem | None) -> np.ndarray:
    """Return the places (N, 3) of coordinates (N, 3) of a kind, given in a local system."""
    if kind != RECTANGULAR:
        r, theta, third = given.T
        theta = np.radians(theta)
        height = third
        if kind == SPHERICAL:
            phi = np.radians(third)
            r, height = r * np.cos(phi), r * np.sin(phi)
        given = np.stack([r * np.cos(theta), r * np.sin(theta), height], axis=1)
    if system is None:
        return given
    with np.errstate(over="ignore", invalid="ignore"):  # places far off are told by the cells
        return given @ system.axes + system.origin
