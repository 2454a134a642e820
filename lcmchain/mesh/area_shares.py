"""Which part of every face of a flat sheet lies in a place that a scene names."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.validation import explain_validity

from lcmchain.errors import InputError
from lcmchain.mesh.where import Where

#: Corners of the polygon that stands for a disc, of the same area.
DISC_CORNERS = 512


def area_shares(where: Where, corners: np.ndarray, key: str) -> np.ndarray:
    """Return the part of the area of every face that lies in a place (F,), 0 to 1.

    Parameters
    ----------
    where : a box, a polygon, or a point with a radius.
    corners : of the flat faces [m], shape (F, 4, 3); a triangle repeats its last one.
    key : of the place in the scene, for messages.

    Raises
    ------
    InputError : the place has no area, crosses itself, or holds no part of a face.
    """
    region = _region(where, key)
    inside = np.ones(len(corners), dtype=bool)
    if where.box is not None:
        low, high = np.sort([where.box[0][2], where.box[1][2]])
        slack = 1e-9 * float(np.ptp(corners[..., :2], axis=(0, 1)).max())
        inside = (corners[..., 2] >= low - slack).all(axis=1)
        inside &= (corners[..., 2] <= high + slack).all(axis=1)
    faces = shapely.polygons(corners[..., :2])
    shares = np.where(inside, shapely.area(shapely.intersection(faces, region)), 0.0)
    shares /= shapely.area(faces)
    shares[shares > 1.0 - 1e-9] = 1.0  # whole ones, whatever their last digits
    shares[shares < 1e-9] = 0.0
    if not shares.any():
        low, high = 1e3 * corners.min(axis=(0, 1)), 1e3 * corners.max(axis=(0, 1))
        height = f" and its height is {low[2]:.4g} mm" if where.box is not None else ""
        raise InputError(
            f"holds no part of the sheet ({where.in_words}; the sheet spans x {low[0]:.4g} to "
            f"{high[0]:.4g} mm and y {low[1]:.4g} to {high[1]:.4g} mm{height}); move it there, and "
            "check the unit",
            key=key,
        )
    return shares


def _region(where: Where, key: str) -> Any:
    """Return the place as a polygon of the plane."""
    if where.box is not None:
        (x0, y0, _), (x1, y1, _) = where.box
        region = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    elif where.polygon is not None:
        region = shapely.Polygon(where.polygon)
    else:
        assert where.point is not None and where.radius is not None
        angle = 2.0 * np.pi / DISC_CORNERS
        around = angle * np.arange(DISC_CORNERS)
        radius = where.radius * np.sqrt(angle / np.sin(angle))
        circle = radius * np.column_stack([np.cos(around), np.sin(around)])
        region = shapely.Polygon(np.array(where.point[:2]) + circle)
    if where.box is not None and not region.area > 0.0:
        raise InputError(f"has no area ({where.in_words}); a pressure needs one", key=key)
    if not region.is_valid:
        raise InputError(
            f"crosses itself ({explain_validity(region)}, in m); give its corners in order",
            key=f"{key}.polygon",
        )
    shapely.prepare(region)
    return region
