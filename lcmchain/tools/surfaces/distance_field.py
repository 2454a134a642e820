"""Distance field of a surface: signed distances on a regular grid, as a quadratic B-spline.

The signed distance is computed once, on a regular grid around the surface: exactly (closest point
of the closest triangle) in a narrow band, as a lower bound elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.surface import Surface, in_metres, warn
from lcmchain.tools.surfaces.triangle_distance import (
    CRACK,
    closest_places,
    feature_normals,
    narrow_band,
    triangle_tree,
)

#: Half-width of the band with exact distances, in grid spacings. The interpolated part is what is
#: left after the stencil's reach (one node in each direction): penetrations up to 3 spacings.
BAND = 5.0

#: Number of grid nodes that an automatic spacing aims at, and the most that is accepted.
AUTOMATIC_NODES = 3_000_000
MAXIMUM_NODES = 30_000_000

#: Largest in-plane distance beyond an open edge, in spacings, at which the back of a skin still
#: counts as solid. Wide enough to close the cracks between patches that do not share vertices.
OVERHANG = 1.0

#: Largest jump of a true signed distance between neighbouring nodes, in spacings. One is the limit
#: for a solid. Beyond an open edge a node at the back lies up to OVERHANG from it, and the next
#: one, at the front, a step farther: 1 + 2 OVERHANG where both lie on the surface continued, and a
#: little more, the quarter, where the edge bends. Opposite normals make jumps of up to 2 BAND.
LARGEST_JUMP = 1.25 + 2.0 * OVERHANG

#: Share of a spacing by which the field may miss the surface before a warning.
RESOLVED = 0.1


@dataclass(frozen=True)
class DistanceField:
    """Signed distance to a surface on a regular grid, in the frame of the surface.

    Parameters
    ----------
    spacing : distance [m] of the grid's nodes.
    origin : position [m] of node (0, 0, 0), shape [3].
    box : lower and upper corner [m] of the surface, shape [6].
    coefficients : quadratic B-spline coefficients [m] of the distance, float32, shape [nx, ny, nz].
    far_bound : 0 where the distance can be interpolated around a node; else +-(1 + k), saying that
        the distance is at least k spacings within half a spacing of the node, int8, same shape.
    """

    spacing: float
    origin: np.ndarray
    box: np.ndarray
    coefficients: np.ndarray
    far_bound: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        return self.coefficients.shape


def build_distance_field(surface: Surface, spacing: float | None, *, key: str) -> DistanceField:
    """Compute the distance field of a surface.

    Parameters
    ----------
    surface : oriented triangles.
    spacing : grid spacing [m]; None chooses one for about three million nodes. Features smaller
        than about two spacings are rounded.
    key : scene key of the tool's shape, named in errors.

    Raises
    ------
    InputError
        if the grid would be too large, or neighbouring parts of the surface have opposite normals.
    """
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    h = _spacing(high - low, spacing, key)
    margin = (BAND + 2.0) * h
    origin = low - margin
    shape = tuple(int(n) for n in np.ceil((high - low + 2.0 * margin) / h) + 1)

    unsigned = np.full(shape, np.inf)
    side = np.zeros(shape, np.int8)
    normals, is_open = feature_normals(surface)
    narrow_band(
        surface.points[surface.triangles],
        normals,
        is_open,
        origin,
        h,
        BAND * h,
        OVERHANG * h,
        unsigned,
        side,
        np.zeros(shape, np.float32),
    )
    in_band = np.isfinite(unsigned)
    unsigned[~in_band] = 0.0
    beyond_edge = in_band & (side == 0)
    valid = in_band & ~beyond_edge
    distance = side * unsigned
    _check_jumps(distance, valid, origin, h, surface)

    inside = _enclosed(in_band, valid & (side < 0))
    free = beyond_edge | ~(in_band | inside)
    interpolated = ndimage.binary_erosion(valid, np.ones((3, 3, 3)))
    # The back of a skin ends at the band: what lies behind it is free, and so is the fringe there.
    fringe = valid & ~interpolated & (side < 0)
    fringe &= ndimage.binary_dilation(free, np.ones((3, 3, 3)))

    # Any path from a node outside the band to the surface passes a node of the band.
    way = ndimage.distance_transform_edt(~in_band) + BAND - math.sqrt(3.0)
    bound = np.where(in_band, unsigned / h, way)
    bound[beyond_edge | fringe] = 0.0
    steps = 1.0 + np.floor(np.maximum(bound - 0.5 * math.sqrt(3.0), 0.0))
    negative = (inside | (valid & (side < 0))) & ~fringe
    far_bound = np.where(negative, -1.0, 1.0) * np.minimum(steps, 127.0)
    far_bound[interpolated] = 0.0

    field = DistanceField(
        spacing=h,
        origin=origin,
        box=np.concatenate((low, high)),
        coefficients=_spline_coefficients(distance, valid).astype(np.float32),
        far_bound=far_bound.astype(np.int8),
    )
    _check_resolution(field, surface)
    return field


def _enclosed(in_band, is_solid) -> np.ndarray:
    """Nodes outside the band that only solid separates from the rest: the inside of a solid."""
    label, count = ndimage.label(~in_band)
    free = np.zeros(count + 1, dtype=bool)
    for axis in range(3):
        first, last = label.take(0, axis), label.take(-1, axis)
        free[first], free[last] = True, True
        near, ahead = _shifted(label, axis)
        solid_near, solid_ahead = _shifted(is_solid, axis)
        band_near, band_ahead = _shifted(in_band, axis)
        free[near[band_ahead & ~solid_ahead]] = True
        free[ahead[band_near & ~solid_near]] = True
    free[0] = True  # label 0 is the band itself
    return ~free[label]


def _shifted(array, axis) -> tuple[np.ndarray, np.ndarray]:
    """Views of all nodes that have a next node along an axis, and of these next nodes."""
    ends = [slice(None)] * 3
    starts = [slice(None)] * 3
    ends[axis], starts[axis] = slice(None, -1), slice(1, None)
    return array[tuple(ends)], array[tuple(starts)]


def _check_jumps(distance, valid, origin, h, surface: Surface) -> None:
    """Reject a surface whose sides are confused: a signed distance changes by at most its step."""
    for axis in range(3):
        near, ahead = _shifted(distance, axis)
        both = np.logical_and(*_shifted(valid, axis))
        jump = both & (np.abs(ahead - near) > LARGEST_JUMP * h)
        if jump.any():
            node = np.array(np.unravel_index(int(np.argmax(jump)), jump.shape))
            ahead_of_node = node + np.eye(3, dtype=int)[axis]
            _refuse_overlap(surface, origin + h * np.array([node, ahead_of_node]), h)
            raise InputError(
                f"inside and outside are confused near {in_metres(origin + node * h)} (and at "
                f"{np.count_nonzero(jump)} places): neighbouring parts have opposite normals, or "
                "bodies overlap or touch, or a sheet is modelled by both its faces with the same "
                "normals; turn the normals or keep only the surface that touches the blank",
                file=surface.file,
            )


def _refuse_overlap(surface: Surface, points: np.ndarray, h: float) -> None:
    """Raise where two points (2, 3) on either side of a jump are closest to different solids."""
    part, closed = surface.parts()
    corners = [surface.points[surface.triangles[part == number]] for number in range(len(closed))]
    away = np.stack([closest_places(triangle_tree(solid), points).distance for solid in corners])
    # as close as the band takes for the same place
    near = np.flatnonzero((away <= away.min(axis=0) + CRACK * h).any(axis=1))
    if len(near) < 2 or not closed[near].all():
        return
    boxes = [
        f"{in_metres(solid.min(axis=(0, 1)))} to {in_metres(solid.max(axis=(0, 1)))}"
        for solid in (corners[number] for number in near[:2])
    ]
    remedy = (
        "write union = true in the tool's shape, which unites them here, or unite"
        if surface.orientation.united == 0
        else "their union left them apart: unite"
    )
    raise InputError(
        f"two solids of the file overlap or touch near {in_metres(points[0])}, or lie closer "
        f"together than the spacing {h * 1e3:.2g} mm tells apart: one from {boxes[0]}, one from "
        f"{boxes[1]}; inside and outside cannot be told there; {remedy} the solids in the CAD "
        "program (Boolean union) and export the surface of the whole, or give each solid a file "
        "and an entry [[tools]] of its own, with the same position and motion",
        file=surface.file,
    )


def _spline_coefficients(distance, valid) -> np.ndarray:
    """Quadratic B-spline coefficients f - f''/8, which reproduce quadratic functions exactly."""
    coefficients = distance.copy()
    for axis in range(3):
        inner = tuple(slice(1, -1) if other == axis else slice(None) for other in range(3))
        before = _shifted(_shifted(distance, axis)[0], axis)[0]
        after = _shifted(_shifted(distance, axis)[1], axis)[1]
        complete = valid[inner].copy()
        complete &= _shifted(_shifted(valid, axis)[0], axis)[0]
        complete &= _shifted(_shifted(valid, axis)[1], axis)[1]
        curvature = before - 2.0 * distance[inner] + after
        coefficients[inner] -= np.where(complete, 0.125 * curvature, 0.0)
    return coefficients


def _check_resolution(field: DistanceField, surface: Surface) -> None:
    """Warn where the interpolated field does not vanish on the surface."""
    step = max(1, len(surface.triangles) // 20_000)
    middles = surface.points[surface.triangles[::step]].mean(axis=1)
    place = ((middles - field.origin) / field.spacing).T
    near = field.far_bound[tuple(np.floor(place + 0.5).astype(int))] == 0
    if not near.any():
        return
    place = place[:, near]
    missed = np.abs(
        ndimage.map_coordinates(field.coefficients, place, np.float64, order=2, prefilter=False)
    )
    typical = float(np.quantile(missed, 0.95))
    if typical > RESOLVED * field.spacing:
        worst = field.origin + field.spacing * place[:, int(np.argmax(missed))]
        warn(
            surface.file,
            f"the distance field (spacing {field.spacing * 1e3:.3g} mm) misses the surface by more "
            f"than {typical * 1e3:.2g} mm on 5 % of its triangles, at most by "
            f"{missed.max() * 1e3:.2g} mm at {in_metres(worst)}; give the tool a smaller spacing",
        )


def _spacing(extent, spacing: float | None, key: str) -> float:
    def node_count(h):
        return float(np.prod(np.ceil(extent / h) + 2.0 * BAND + 5.0))

    if spacing is None:
        low, high = 1e-6 * extent.max(), extent.max()
        for _ in range(60):  # bisection of the logarithm
            middle = math.sqrt(low * high)
            low, high = (middle, high) if node_count(middle) > AUTOMATIC_NODES else (low, middle)
        return high
    if not 0.0 < spacing < math.inf:
        raise InputError(f"must be positive, is {spacing:g} m", key=f"{key}.spacing")
    if node_count(spacing) > MAXIMUM_NODES:
        smallest = spacing * (node_count(spacing) / MAXIMUM_NODES) ** (1.0 / 3.0)
        raise InputError(
            f"a distance field with spacing {spacing * 1e3:.3g} mm needs "
            f"{node_count(spacing) / 1e6:.0f} million nodes (at most {MAXIMUM_NODES // 1_000_000});"
            f" use about {smallest * 1.2e3:.2g} mm or check length_unit (the tool is "
            f"{extent.max() * 1e3:.3g} mm long)",
            key=f"{key}.spacing",
        )
    return float(spacing)
