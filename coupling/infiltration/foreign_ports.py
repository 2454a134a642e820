"""Ports of LCMsim and RTMsim: points on the mesh with the cells within a radius.

LCMsim keeps the ports that were picked with the mouse in ``_pset.csv`` beside the mesh: the radius
in the first line, then the coordinates of a point per line, in metres. Cells with their centroid
within the radius are part 6, whatever part they were in before. RTMsim has the radius in its input
file, and takes a larger one where no centroid is within it.

Sources: LCMsim_v3, ``parse_mesh.jl``; RTMsim 1.0.4, ``pre.jl`` (Obertscheider, Fauster and others).
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.target import TargetMesh
from lcmchain.mesh.places import place_text

#: The file beside a mesh of LCMsim, and the number of the part of its ports.
PORTS_FILE, PORTS_PART = "_pset.csv", 6
#: Factor by which RTMsim widens the radius of a port until it holds a cell, and most repetitions.
_WIDER, _MOST_STEPS = Decimal("1.1"), 200

Coordinates = tuple[Decimal, Decimal, Decimal]


@dataclass(frozen=True)
class Ports:
    """Ports as the file writes them [m]."""

    file: Path
    radius: Decimal
    points: tuple[Coordinates, ...]


@dataclass(frozen=True)
class Port:
    """A port on a mesh [m].

    Parameters
    ----------
    radius : within which centroids of cells lie.
    holds_nodes : whether nodes lie within it as well; a gate is else at the nearest one.
    """

    point: Coordinates
    radius: Decimal
    holds_nodes: bool

    @property
    def gate_lines(self) -> list[str]:
        """Entries of its gate in the file of an infiltration."""
        return self.cell_lines if self.holds_nodes else self.cell_lines[:1]

    @property
    def cell_lines(self) -> list[str]:
        """Entries of a place with its cells."""
        place = " ".join(map(str, self.point))
        return [f'point = "{place} m"', f'radius = "{self.radius} m"']

    @property
    def in_words(self) -> str:
        """Position and radius for the terminal."""
        place = place_text(np.array(self.point, dtype=float))
        return f"{1e3 * float(self.radius):g} mm around {place}"


def read_ports(path: Path) -> Ports:
    """Read the ports of a case.

    Raises
    ------
    InputError : no text, no radius above 0, no point, or a line without three numbers; names it.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    except UnicodeDecodeError:
        raise InputError("is no CSV text", file=path) from None
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    if len(lines) < 2:
        raise InputError("has no ports: a radius [m] in the first line, then x,y,z [m]", file=path)
    (first, radius_text), *rows = lines
    radius = decimal_of(radius_text, f"line {first}, the radius", path)
    if radius <= 0:
        raise InputError(f"line {first}: the radius of ports is above 0", file=path)
    points = []
    for number, row in rows:
        parts = row.split(",")
        if len(parts) != 3:
            raise InputError(
                f"line {number}: a port is three numbers with commas between, x,y,z [m]", file=path
            )
        x, y, z = (decimal_of(part.strip(), f"line {number}", path) for part in parts)
        points.append((x, y, z))
    return Ports(path, radius, tuple(points))


def on_mesh(ports: Ports, target: TargetMesh, *, widens: bool) -> list[Port]:
    """Find ports on a mesh.

    Parameters
    ----------
    widens : take a larger radius where it holds no centroid of a cell, as RTMsim does.

    Raises
    ------
    InputError : a port without a cell; names it and the nearest cell.
    """
    found = []
    for place in ports.points:
        point = np.array(place, dtype=float)
        nearest = float(np.linalg.norm(target.centroids - point, axis=1).min())
        radius, steps = ports.radius, 0
        while widens and float(radius) < nearest and steps < _MOST_STEPS:
            radius, steps = radius * _WIDER, steps + 1
        if float(radius) < nearest:
            raise InputError(
                f"no cell has its centroid within {1e3 * float(radius):g} mm of the port at "
                f"{place_text(point)}; the nearest is {1e3 * nearest:.4g} mm away: move it there, "
                "or give a larger radius in the first line",
                file=ports.file,
            )
        nodes = np.linalg.norm(target.points - point, axis=1)
        found.append(Port(place, radius, bool((nodes <= float(radius)).any())))
    return found


def decimal_of(text: str, where: str, path: Path) -> Decimal:
    """Return a number as it is written.

    Raises
    ------
    InputError : it is none, or not finite; names ``where``.
    """
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise InputError(f'{where}: "{text}" is not a number', file=path) from None
    if not value.is_finite():
        raise InputError(f'{where}: "{text}" is not a finite number', file=path)
    return value
