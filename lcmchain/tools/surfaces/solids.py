"""Solids of a tool's surface: which side of it is solid, and the union of several.

Triangles that share an edge are made to agree. A closed part is solid inside; parts within parts
are cavities and solids in turn. An open part is solid on the side on which the blank does not lie
at the start. trimesh and libigl make triangles agree without telling a surface that has one side
only, and know no blank.

Solids that overlap or touch are united on request, so that their outer surface remains. Source of
the union: manifold3d (Apache-2.0), whose Boolean operations make closed surfaces of closed
surfaces. It is an optional dependency. trimesh calls the same library for this.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.surface import WELD, Orientation, edges, in_metres, warn
from lcmchain.tools.surfaces.triangle_distance import closest_places, triangle_tree

#: Points of the blank that are asked on which side of an open part they lie.
WITNESSES = 500
#: Least share of the witnesses of an open part that must agree on its side.
AGREEMENT = 0.75
#: Least sine of the angle between the way to a witness and the surface: below, it lies beside it.
LEAST_SINE = 0.1
#: Share of the largest distance of a witness below which one may touch, and tells nothing.
TOUCHING = 0.02
#: Volume of a closed part, over the cube of its size, below which it has no inside.
FLAT = 1e-9
#: Triangles of a closed part that must lie within another for the part to do so.
PROBES = 20
#: Parts that wind around a point by more than half a turn contain it.
INSIDE = 0.5


def agreeing(
    points: np.ndarray, triangles: np.ndarray, file: Path
) -> tuple[np.ndarray, np.ndarray, int]:
    """Turn triangles so that all that share an edge agree, keeping the side of the larger area.

    Returns
    -------
    triangles, the number of the connected part of each, and how many were turned.

    Raises
    ------
    InputError : the surface has one side only; names the place.
    """
    edge, forward, use = edges(triangles)
    order = np.argsort(edge.ravel(), kind="stable")
    order = order[use[edge.ravel()[order]] == 2].reshape(-1, 2)
    first, second = order[:, 0] // 3, order[:, 1] // 3
    clash = forward.ravel()[order[:, 0]] == forward.ravel()[order[:, 1]]

    # Each triangle stands for two nodes, as given (t) and turned (t + count): neighbours that agree
    # join equal nodes, those that clash unequal ones.
    count = len(triangles)
    other = second + np.where(clash, count, 0)
    rows = np.concatenate((first, first + count))
    columns = np.concatenate((other, (other + count) % (2 * count)))
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    _, label = connected_components(graph, directed=False)
    as_given, turned = label[:count], label[count:]
    if (as_given == turned).any():
        worst = points[triangles[int(np.argmax(as_given == turned))]].mean(axis=0)
        raise InputError(
            f"the surface has only one side (like a Moebius strip) near {in_metres(worst)}, so "
            "that inside and outside cannot be told; repair the mesh",
            file=file,
        )
    part = np.unique(np.minimum(as_given, turned), return_inverse=True)[1].reshape(-1)
    if not clash.any():
        return triangles, part, 0
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area_as_given = np.bincount(as_given, weights=area, minlength=label.max() + 1)
    flip = area_as_given[as_given] < area_as_given[turned]
    # Where both sides weigh the same, the first triangle decides.
    tie = area_as_given[as_given] == area_as_given[turned]
    flip |= tie & (as_given > turned)
    return _turned(triangles, flip), part, int(np.count_nonzero(flip))


def oriented(
    points: np.ndarray, triangles: np.ndarray, file: Path, blank: np.ndarray | None = None
) -> tuple[np.ndarray, Orientation]:
    """Turn triangles so that normals point into free space, with a warning that tells what was.

    Parameters
    ----------
    points, triangles : welded surface; blank : points of the blank at the start in the frame of
        the surface, shape [point_count, 3]; None leaves open parts as they are.

    Raises
    ------
    InputError : see :func:`agreeing`.
    """
    triangles, part, against = agreeing(points, triangles, file)
    closed = closed_parts(triangles, part)
    if blank is not None:
        blank = blank[:: max(1, len(blank) // WITNESSES)]
    inverted, reasons = _inverted_closed(points, triangles, part, closed, blank)
    if not closed.all():
        inverted_open, reason = _inverted_open(points, triangles, part, closed, blank, file)
        inverted |= inverted_open
        reasons.append(reason)
    flip = inverted[part]
    result = Orientation(
        closed=int(np.count_nonzero(closed)),
        open=int(np.count_nonzero(~closed)),
        reasons=tuple(reasons),
        against_neighbours=against,
        with_part=int(np.count_nonzero(flip)),
    )
    _warn_of(result, len(triangles), file)
    return (_turned(triangles, flip) if flip.any() else triangles), result


def _warn_of(orientation: Orientation, count: int, file: Path) -> None:
    if orientation.against_neighbours:
        warn(
            file,
            f"{orientation.against_neighbours} of {count} triangles were turned against their "
            "neighbours and have been turned back",
        )
    if orientation.with_part:
        warn(
            file,
            f"{orientation.with_part} of {count} triangles had normals that point into the solid "
            f"and have been turned; now they point {' and '.join(orientation.reasons)}",
        )


def _turned(triangles: np.ndarray, flip: np.ndarray) -> np.ndarray:
    result = triangles.copy()
    result[flip] = result[flip][:, ::-1]
    return result


def closed_parts(triangles: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Whether every edge of a part has two of its triangles, shape [part_count]."""
    edge = edges(triangles)[0]
    owned = np.stack([np.repeat(part, 3), edge.ravel()], axis=1)
    pairs, use = np.unique(owned, axis=0, return_counts=True)
    closed = np.ones(part.max() + 1, dtype=bool)
    closed[pairs[use != 2, 0]] = False
    return closed


def _inverted_closed(
    points: np.ndarray,
    triangles: np.ndarray,
    part: np.ndarray,
    closed: np.ndarray,
    blank: np.ndarray | None,
) -> tuple[np.ndarray, list[str]]:
    """Which closed parts have normals that point into the solid, and what decided."""
    inverted = np.zeros(len(closed), dtype=bool)
    reasons: dict[str, None] = {}
    order = np.argsort(part, kind="stable")
    of_part = np.split(order, np.cumsum(np.bincount(part))[:-1])
    corners_of = {int(p): points[triangles[of_part[p]]] for p in np.flatnonzero(closed)}
    for p, corners in corners_of.items():
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        volume = signed_volume(corners - low)
        if abs(volume) <= FLAT * float(np.linalg.norm(high - low)) ** 3:
            reasons["as in the file (closed without an inside)"] = None
            continue
        # A part that sticks out is no cavity: it overlaps.
        probes = corners[:: max(1, len(corners) // PROBES)].mean(axis=1)
        around = [
            q
            for q in corners_of
            if q != p and all(contains(corners_of[q], probe) for probe in probes)
        ]
        if not around and volume < 0.0 and blank is not None and _contains_all(corners, blank):
            # as in the file: a mould all around the blank
            reasons["to the blank, which lies inside"] = None
            continue
        cavity = len(around) % 2 == 1
        inverted[p] = (volume > 0.0) == cavity
        reasons["into cavities" if cavity else "outwards"] = None
    return inverted, list(reasons)


def signed_volume(corners: np.ndarray) -> float:
    """Volume of a closed surface by the corners (T, 3, 3) of its triangles, negative inside out."""
    a, b, c = corners.transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


def contains(corners: np.ndarray, point: np.ndarray) -> bool:
    """Whether a closed surface, by the corners (T, 3, 3) of its triangles, contains a point.

    Its winding number tells.

    Source: van Oosterom, Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng.
    30 (1983); Jacobson et al., "Robust inside-outside segmentation", ACM Trans. Graph. 32 (2013).
    """
    if (point < corners.min(axis=(0, 1))).any() or (point > corners.max(axis=(0, 1))).any():
        return False
    a, b, c = (corners - point).transpose(1, 0, 2)
    length_a, length_b, length_c = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    dot = np.einsum
    below = (
        length_a * length_b * length_c
        + dot("ij,ij->i", a, b) * length_c
        + dot("ij,ij->i", b, c) * length_a
        + dot("ij,ij->i", c, a) * length_b
    )
    turns = float(np.arctan2(triple, below).sum()) / (2.0 * np.pi)
    return abs(turns) > INSIDE


def _contains_all(corners: np.ndarray, blank: np.ndarray) -> bool:
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    if (blank < low).any() or (blank > high).any():
        return False
    return all(contains(corners, point) for point in blank[:: max(1, len(blank) // 20)])


def _inverted_open(
    points: np.ndarray,
    triangles: np.ndarray,
    part: np.ndarray,
    closed: np.ndarray,
    blank: np.ndarray | None,
    file: Path,
) -> tuple[np.ndarray, str]:
    """Which open parts have the blank behind them, and what decided.

    A point of the blank tells the side of the part that is closest to it, unless it lies beside its
    rim. Parts that no point tells, as the far wall of a shell, follow the others where those agree.
    """
    inverted = np.zeros(len(closed), dtype=bool)
    if blank is None:
        return inverted, "as in the file (open)"
    corners = points[triangles]
    found = closest_places(triangle_tree(corners), blank)
    a, b, c = corners[found.triangle].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    edge_of_side, _, use = edges(triangles)
    on_rim = np.zeros(len(points), dtype=bool)
    rim = use[edge_of_side] != 2
    on_rim[triangles[rim]] = on_rim[np.roll(triangles, -1, axis=1)[rim]] = True
    height = np.einsum("pi,pi->p", blank - found.foot, normal)
    told = np.abs(height) > LEAST_SINE * found.distance
    # corners are features 1 to 3, edges 4 to 6
    corner, side = (found.feature - 1) % 3, (found.feature - 4) % 3
    told &= ~((found.feature >= 4) & rim[found.triangle, side])
    at_corner = (found.feature >= 1) & (found.feature <= 3)
    told &= ~(at_corner & on_rim[triangles[found.triangle, corner]])
    told &= found.distance > TOUCHING * found.distance.max()

    of = part[found.triangle[told]]
    before = np.bincount(of[height[told] > 0.0], minlength=len(closed))
    behind = np.bincount(of[height[told] < 0.0], minlength=len(closed))
    votes = before + behind
    heard = ~closed & (votes > 0)
    sure = heard & (np.maximum(before, behind) >= AGREEMENT * votes)
    inverted = sure & (behind > before)
    if not sure.any():
        if heard.any():
            warn(
                file,
                "the blank lies on both sides of the open surface at the start, so that its normals"
                " were left as in the file; move the tool, or check length_unit",
            )
        return np.zeros_like(inverted), "as in the file (open)"
    if inverted[sure].all():
        inverted |= ~closed & ~heard
    return inverted, "to the side of the blank"


# --- union ----------------------------------------------------------------------------------------


#: Twice the area of a triangle, over the square of its longest side, below which it has none.
NEEDLE = 1e-12


def united(
    points: np.ndarray, triangles: np.ndarray, file: Path
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the surface of the union of all solids, and how many these were.

    Parameters
    ----------
    points, triangles : welded surface whose normals point into free space, those of a cavity into
        it. A cavity belongs to the smallest solid around it.

    Raises
    ------
    InputError : manifold3d is not installed, a part is open, or a mould that the blank lies in.
    """
    try:
        from manifold3d import Error, Manifold, Mesh64, OpType
    except ImportError:
        raise InputError(
            'union = true needs manifold3d: pip install "lcmchain[union]"; or unite the solids in '
            "the CAD program and export the surface of the whole",
            file=file,
        ) from None
    triangles, part, _ = agreeing(points, triangles, file)
    closed = closed_parts(triangles, part)
    if not closed.all():
        corner = points[triangles[int(np.argmax(~closed[part]))]].mean(axis=0)
        raise InputError(
            f"only closed solids can be united, and {np.count_nonzero(~closed)} of "
            f"{len(closed)} parts are open, the first near {in_metres(corner)}; close them, or "
            "leave out union",
            file=file,
        )
    solids = _solids(points, triangles, part, file)
    if len(solids) == 1:
        return points, triangles, 1
    manifolds = []
    for solid in solids:
        used, rows = np.unique(solid, return_inverse=True)
        mesh = Mesh64(points[used], rows.reshape(-1, 3).astype(np.uint64))
        manifolds.append(Manifold(mesh))
        if manifolds[-1].status() != Error.NoError:
            raise InputError(
                f"a solid near {in_metres(points[used].mean(axis=0))} cannot be united with "
                f"others ({manifolds[-1].status().name}); repair the mesh",
                file=file,
            )
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    whole = Manifold.batch_boolean(manifolds, OpType.Add).simplify(WELD * size).to_mesh64()
    points = np.ascontiguousarray(whole.vert_properties[:, :3])
    triangles = whole.tri_verts.astype(np.int64)
    _require_areas(points, triangles, file)
    return points, triangles, len(solids)


def _solids(
    points: np.ndarray, triangles: np.ndarray, part: np.ndarray, file: Path
) -> list[np.ndarray]:
    """Triangles of each solid, with those of its cavities."""
    order = np.argsort(part, kind="stable")
    of_part = [triangles[rows] for rows in np.split(order, np.cumsum(np.bincount(part))[:-1])]
    volumes = np.array([signed_volume(points[rows]) for rows in of_part])
    solids = {k: [of_part[k]] for k in np.flatnonzero(volumes > 0.0).tolist()}
    for cavity in np.flatnonzero(volumes <= 0.0).tolist():
        middle = points[of_part[cavity][0]].mean(axis=0)
        around = [k for k in solids if contains(points[of_part[k]], middle)]
        if not around:
            raise InputError(
                f"the part around {in_metres(middle)} is hollow: a mould in which the blank lies, "
                "or without an inside; solids can be united, it cannot. Leave out union, or give "
                "it a file of its own",
                file=file,
            )
        solids[min(around, key=lambda k: volumes[k])].append(of_part[cavity])
    return [np.concatenate(pieces) for pieces in solids.values()]


def _require_areas(points: np.ndarray, triangles: np.ndarray, file: Path) -> None:
    """Refuse a union that is not closed, or has triangles without a normal."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    wrong = np.linalg.norm(np.cross(b - a, c - a), axis=1) <= NEEDLE * longest**2
    if wrong.any() or (edges(triangles)[2] % 2 != 0).any():
        place = points[triangles[int(np.argmax(wrong))]].mean(axis=0)
        raise InputError(
            f"the solids meet so closely near {in_metres(place)} that their union has triangles "
            "without an area; unite them in the CAD program",
            file=file,
        )
