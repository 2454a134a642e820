"""Closest point of a triangle: the one function of all searches and distance fields."""

from __future__ import annotations

from lcmchain.jit import strict_equation


@strict_equation
def closest_point_of_triangle(corners, x, y, z):
    """Closest point of a triangle and what it lies on: 0 inside, 1-3 corner, 4-6 edge k to k + 1.

    Source: Ericson, Real-Time Collision Detection (2005), section 5.1.5.

    Parameters
    ----------
    corners : of the triangle [m], shape (3, 3).
    x, y, z : point [m].

    Returns
    -------
    closest point (x, y, z) [m], and the number of the face, corner or edge that it lies on.
    """
    abx = corners[1, 0] - corners[0, 0]
    aby = corners[1, 1] - corners[0, 1]
    abz = corners[1, 2] - corners[0, 2]
    acx = corners[2, 0] - corners[0, 0]
    acy = corners[2, 1] - corners[0, 1]
    acz = corners[2, 2] - corners[0, 2]
    px, py, pz = x - corners[0, 0], y - corners[0, 1], z - corners[0, 2]
    d1 = abx * px + aby * py + abz * pz
    d2 = acx * px + acy * py + acz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return corners[0, 0], corners[0, 1], corners[0, 2], 1
    px, py, pz = x - corners[1, 0], y - corners[1, 1], z - corners[1, 2]
    d3 = abx * px + aby * py + abz * pz
    d4 = acx * px + acy * py + acz * pz
    if d3 >= 0.0 and d4 <= d3:
        return corners[1, 0], corners[1, 1], corners[1, 2], 2
    px, py, pz = x - corners[2, 0], y - corners[2, 1], z - corners[2, 2]
    d5 = abx * px + aby * py + abz * pz
    d6 = acx * px + acy * py + acz * pz
    if d6 >= 0.0 and d5 <= d6:
        return corners[2, 0], corners[2, 1], corners[2, 2], 3
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w, feature = d1 / (d1 - d3), 0.0, 4
    else:
        vb = d5 * d2 - d1 * d6
        if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            v, w, feature = 0.0, d2 / (d2 - d6), 6
        else:
            va = d3 * d6 - d5 * d4
            if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                v, feature = 1.0 - w, 5
            else:
                v, w, feature = vb / (va + vb + vc), vc / (va + vb + vc), 0
    return (
        corners[0, 0] + v * abx + w * acx,
        corners[0, 1] + v * aby + w * acy,
        corners[0, 2] + v * abz + w * acz,
        feature,
    )
