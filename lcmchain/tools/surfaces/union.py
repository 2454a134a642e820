"""Union of the solids of a surface that overlap or touch, so that their outer surface remains.

Source: manifold3d (Apache-2.0), whose Boolean operations make closed surfaces of closed surfaces.
It is an optional dependency. trimesh calls the same library for this.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.tools.surfaces.orientation import agreeing, closed_parts, contains, signed_volume
from lcmchain.tools.surfaces.surface import WELD, edges, in_metres

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
