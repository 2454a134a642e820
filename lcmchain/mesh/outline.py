"""Outline of a blank: vertices, area, and what an outline must not do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import shapely

from lcmchain.errors import InputError

MAXIMUM_ELEMENT_COUNT = 2_000_000
MOST_LATTICE_CELLS = 4 * MAXIMUM_ELEMENT_COUNT


def polygon_area(outline: np.ndarray) -> float:
    """Area enclosed by a polygon [m2], positive when its vertices run anticlockwise.

    Parameters
    ----------
    outline : vertices [m], shape (vertex_count, 2), not repeated at the end.
    """
    local = outline - outline[0]
    return 0.5 * math.fsum(cross(local, np.roll(local, -1, axis=0)))


class _File(Protocol):
    @property
    def file(self) -> str: ...


class BlankShape(Protocol):
    """Shape of a blank as a scene gives it, see :class:`lcmchain.mesh.blank.Blank`."""

    @property
    def size(self) -> tuple[float, float] | None:
        """Width along x and height along y of a rectangle [m]."""

    @property
    def rim(self) -> Sequence[tuple[float, float]] | None:
        """Corners of any other outline [m]."""

    @property
    def drawing(self) -> _File | None:
        """Drawing that gives the rim; without a rim it was not there to be read."""

    @property
    def cuts(self) -> Mapping[str, Sequence]:
        """Corners of each of the holes, darts and slits [m]."""


def outline_of(blank: BlankShape) -> tuple[np.ndarray, str]:
    """Vertices of the blank, anticlockwise, and the scene key that gave them."""
    corners, drawing = blank.rim, blank.drawing
    if corners is None and drawing is not None:
        raise InputError(
            f'there is no drawing "{drawing.file}"; file names are relative to the scene file',
            key="blank.drawing.file",
        )
    if corners is None:
        assert blank.size is not None
        width, height = (float(length) for length in blank.size)
        if not (math.isfinite(width) and math.isfinite(height) and min(width, height) > 0.0):
            raise InputError(f"must be positive, got {width:g} m x {height:g} m", key="blank.size")
        x, y = 0.5 * width, 0.5 * height
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), "blank.size"
    key = "blank.outline" if drawing is None else "blank.drawing"
    outline = np.array(corners, dtype=float).reshape(-1, 2)
    if not np.isfinite(outline).all():
        raise InputError("has a coordinate that is not a finite number", key=key)
    if len(outline) > 1 and np.array_equal(outline[0], outline[-1]):
        outline = outline[:-1]  # written as a closed polygon
    if len(outline) < 3:
        raise InputError(f"needs at least three different points, got {len(outline)}", key=key)
    check_simple(outline, key)
    if polygon_area(outline) < 0.0:
        outline = outline[::-1]
    return np.ascontiguousarray(outline), key


def check_simple(outline: np.ndarray, key: str) -> None:
    """Raise InputError where a polygon repeats a point, touches or crosses itself."""
    vertex_count = len(outline)
    start, end = outline, np.roll(outline, -1, axis=0)
    along = end - start
    size = np.ptp(outline, axis=0).max()
    lengths = np.hypot(*along.T)
    if (lengths <= 1e-12 * size).any():
        repeated = int(np.argmin(lengths))
        raise InputError(
            f"point {repeated + 2 if repeated + 1 < vertex_count else 1} repeats the point before "
            f"it, {in_mm(start[repeated])}; remove one of them",
            key=key,
        )
    # Neighbouring edges share a point; they may only not fold back onto each other.
    ahead = np.roll(along, -1, axis=0)
    straight = np.abs(cross(along, ahead)) <= 1e-12 * lengths * np.roll(lengths, -1)
    folded = straight & ((along * ahead).sum(axis=1) < 0.0)
    fold = int(np.argmax(folded)) if folded.any() else vertex_count
    edges = shapely.linestrings(np.stack([start, end], axis=1))
    touching = shapely.STRtree(edges).query(edges, predicate="dwithin", distance=1e-12 * size).T
    apart = np.diff(touching)[:, 0]
    meeting = touching[(apart > 1) & (apart < vertex_count - 1)]
    first, other = min(meeting.tolist(), default=(vertex_count, vertex_count))
    if fold < vertex_count and fold <= first:
        raise InputError(f"folds back onto itself at {in_mm(end[fold])}", key=key)
    if first < vertex_count:
        raise InputError(
            f"intersects itself: the edge from point {first + 1} {in_mm(start[first])} meets "
            f"the edge from point {other + 1} {in_mm(start[other])}; give the points in the "
            "order in which one walks around the blank",
            key=key,
        )


def check_element_count(outline: np.ndarray, area: float, edge_length: float) -> None:
    """Raise InputError where elements of an edge length [m] are too large or too many."""
    key = "blank.edge_length"
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, np.newaxis]
    width = min(np.ptp(outline @ normal) for normal in normals)
    if edge_length > width:
        raise InputError(
            f"{1e3 * edge_length:g} mm is larger than the blank, which is {1e3 * width:g} mm wide; "
            f"choose {1e3 * width / 10.0:.2g} mm or less",
            key=key,
        )
    if whole_number(width / edge_length) < 2:
        raise InputError(
            f"{1e3 * edge_length:g} mm leaves fewer than two elements across the blank, which is "
            f"{1e3 * width:g} mm wide; choose {1e3 * width / 3.0:.2g} mm or less, better a tenth "
            "of the width",
            key=key,
        )
    estimate = area / edge_length**2
    if estimate > MAXIMUM_ELEMENT_COUNT:
        smallest = math.sqrt(area / MAXIMUM_ELEMENT_COUNT)
        raise InputError(
            f"{1e3 * edge_length:g} mm would make about {estimate:.2g} elements, more than the "
            f"{MAXIMUM_ELEMENT_COUNT} that are allowed; choose {1e3 * smallest:.2g} mm or more",
            key=key,
        )


def check_lattice_size(outline: np.ndarray, edge_length: float) -> None:
    """Raise InputError where the lattice under an outline, in fibre axes, has too many cells.

    A sliver across the fibres holds few elements, but the lattice reaches over all of its box.
    """
    width, height = np.ptp(outline, axis=0)
    count = width * height / edge_length**2
    if count > MOST_LATTICE_CELLS:
        smallest = math.sqrt(width * height / MOST_LATTICE_CELLS)
        raise InputError(
            f"{edge_length:g} m is too short for a blank that reaches over {width:.3g} m x "
            f"{height:.3g} m along its fibres: the lattice under it would have about {count:.2g} "
            f"cells; choose {1e3 * smallest:.2g} mm or more, or turn the fibres along the blank",
            key="blank.edge_length",
        )


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of vectors in the plane, shape (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def whole_number(value: float) -> int:
    """Nearest whole number, the upper one of two."""
    return math.floor(value + 0.5)


def in_mm(point: np.ndarray) -> str:
    """Point of the plane [m] as text in mm, for messages."""
    return f"({1e3 * point[0]:.4g}, {1e3 * point[1]:.4g}) mm"
