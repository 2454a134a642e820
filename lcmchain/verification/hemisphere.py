"""Measures of a formed hemisphere: two results compared, and one with its mirror image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lcmchain.fields.sheet import (
    face_centres,
    reference_positions,
    sheet_faces,
    sheet_positions,
)

if TYPE_CHECKING:
    import xarray as xr


# four elements beyond the end of the die fillet at 87 mm
FLANGE_RADIUS = 0.105
AREA = 0.02  # edge of the areas over which shear angles are averaged [m]
# Areas of a blank of 300 mm as the paper's A, B, C: where the shear is largest (on the rim of the
# dome), in the sheared flange, and half-way up the dome; column and row of 15 x 15 squares.
LOCAL_AREAS = {"A rim, largest shear": (3, 3), "B flange": (1, 4), "C dome": (5, 5)}


def root_mean_square(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def outline_nodes(sheet: xr.Dataset) -> np.ndarray:
    """Return the nodes on the outline of a blank that is a centred rectangle."""
    reference = reference_positions(sheet)[:, :2]
    return np.flatnonzero((np.abs(reference) > np.abs(reference).max(axis=0) - 1e-6).any(axis=1))


def draw_in(sheet: xr.Dataset) -> float:
    """Return how far the middles of the blank's sides have moved inwards, on average [m]."""
    reference, formed = reference_positions(sheet), sheet_positions(sheet)
    half = reference[:, :2].max()
    depths = []
    for axis in (0, 1):
        on_side = np.abs(reference[:, axis]) > half - 1e-9
        middle = on_side & (np.abs(reference[:, 1 - axis]) < 1e-9)
        depths.append(half - np.abs(formed[middle, axis]))
    return float(np.mean(depths))


def contour(sheet: xr.Dataset) -> np.ndarray:
    """Return the formed outline of a centred rectangle, in order and from above, (n, 2) [m]."""
    nodes = outline_nodes(sheet)
    reference = reference_positions(sheet)[nodes]
    around = np.argsort(np.arctan2(reference[:, 1], reference[:, 0]))
    return sheet_positions(sheet)[nodes[around], :2]


def contour_distances(sheet: xr.Dataset, other: xr.Dataset) -> np.ndarray:
    """Return the distances [m] of the nodes of either contour from the other contour."""
    one, two = contour(sheet), contour(other)
    return np.concatenate([_distances_to_polygon(one, two), _distances_to_polygon(two, one)])


def _distances_to_polygon(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    along = np.roll(corners, -1, axis=0) - corners
    relative = points[:, None] - corners
    share = np.einsum("psi,si->ps", relative, along) / np.einsum("si,si->s", along, along)
    nearest = np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(relative - nearest, axis=2).min(axis=1)


def mirror_difference(sheet: xr.Dataset, axis: int) -> dict[str, float]:
    """Return how far a result is from its mirror image along ``axis`` (0: x, 1: y).

    ``contour`` [m] largest in-plane distance of outline nodes; ``thickness`` [m], where the result
    has one, and ``shear_angle`` [rad] root mean square over the sheet.
    """
    sign = np.ones(3)
    sign[axis] = -1.0
    reference, formed = reference_positions(sheet), sheet_positions(sheet)
    twin = cKDTree(reference).query(reference * sign)[1]
    outline = (formed - formed[twin] * sign)[outline_nodes(sheet), :2]
    centres = face_centres(sheet, formed=False)
    face_twin = cKDTree(centres).query(centres * sign)[1]
    shear = sheet["shear_angle"].values[-1]
    difference = {
        "contour": float(np.linalg.norm(outline, axis=1).max()),
        "shear_angle": root_mean_square(shear + shear[face_twin]),
    }
    if "thickness" in sheet:
        thickness = sheet["thickness"].values[-1]
        difference["thickness"] = root_mean_square(thickness - thickness[face_twin])
    return difference


def flange_and_pole(sheet: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the faces in the flat flange and at the pole of the hemisphere.

    The flat flange: level within 2 degrees, farther than ``FLANGE_RADIUS`` from the axis, and not
    in the outermost ring of elements. Nearer to the die, and along the drawn-in edges, a light
    holder rests on the sheet that its bending over the fillet has lifted, and presses it.
    """
    centres = face_centres(sheet, formed=True)
    radius = np.linalg.norm(centres[:, :2], axis=1)
    corners = sheet_positions(sheet)[sheet_faces(sheet)]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    level = np.abs(normal[:, 2]) > np.cos(np.radians(2.0)) * np.linalg.norm(normal, axis=1)
    outline = np.isin(sheet_faces(sheet), outline_nodes(sheet)).any(axis=1)
    return level & (radius > FLANGE_RADIUS) & ~outline, radius < 0.01


def area_mean_shear(sheet: xr.Dataset, size: float = AREA) -> dict[tuple[int, int], float]:
    """Return shear angles [rad] averaged over squares of ``size`` [m] of the reference."""
    centres = face_centres(sheet, formed=False)[:, :2]
    cells = np.floor((centres - centres.min()) / size + 1e-9).astype(int)
    shear = sheet["shear_angle"].values[-1]
    return {
        tuple(cell): float(shear[(cells == cell).all(axis=1)].mean())
        for cell in np.unique(cells, axis=0)
    }


def symmetric_mean(areas: dict[tuple[int, int], float], place: tuple[int, int]) -> float:
    """Return the mean size of an area's value and of its images in the symmetries of a square."""
    last = max(max(area) for area in areas)
    turned = {place, place[::-1]}
    turned |= {(last - i, j) for i, j in turned}
    turned |= {(i, last - j) for i, j in turned}
    return float(np.mean([abs(areas[image]) for image in turned]))
