"""Reading of the surfaces of tools from mesh files, with what is wrong with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.quantities.units import QuantityError, length_factor
from lcmchain.tools.surfaces.solids import oriented, united
from lcmchain.tools.surfaces.surface import WELD, Surface, edge_middle, edges, in_metres, warn

_TRIANGULATION = {"triangle": [(0, 1, 2)], "quad": [(0, 1, 2), (0, 2, 3)]}


def read_surface(
    file: Path, length_unit: str, blank: np.ndarray | None = None, *, union: bool = False
) -> Surface:
    """Read the surface of a tool from an STL file, a deck, or any other mesh file.

    Vertices at the same place are welded, degenerate and repeated triangles dropped, and normals
    turned into free space (:func:`lcmchain.tools.surfaces.solids.oriented`), each with a warning.

    Parameters
    ----------
    file : path of the mesh.
    length_unit : unit of its coordinates, for example "mm".
    blank : points [m] of the blank at the start in the frame of the mesh, shape [point_count, 3],
        on whose side open surfaces are free; None leaves them as they are.
    union : unite the solids of the file (:func:`lcmchain.tools.surfaces.solids.united`).

    Raises
    ------
    InputError
        if the file is absent, broken, empty, without surface cells, cannot be oriented or united.
    """
    try:
        scale = length_factor(length_unit)
    except QuantityError as error:
        raise InputError(f"length_unit of the tool's mesh: {error}", file=file) from None
    points, triangles = read_triangles(Path(file), length_unit)
    points = points * scale
    points, triangles = weld(points, triangles, file)
    if blank is not None:
        _warn_of_size(points, blank, file, length_unit)
    triangles, orientation = oriented(points, triangles, file, blank)
    if union:
        points, triangles, count = united(points, triangles, file)
        orientation = replace(orientation, united=count)
    edge_of_side, _, edge_use = edges(triangles)
    surface = Surface(points, triangles, edge_of_side, edge_use, Path(file), orientation)
    if (edge_use > 2).any():
        worst = edge_middle(surface, int(np.argmax(edge_use > 2)))
        warn(
            file,
            f"{np.count_nonzero(edge_use > 2)} edges belong to more than two triangles, the first "
            f"at {in_metres(worst)}; inside and outside may be confused near them",
        )
    return surface


def read_triangles(file: Path, length_unit: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Read points in the unit of the file, shape [N, 3], and triangles, shape [T, 3].

    The file is read as targets of a mapping are; what the reader leaves out is a warning. Surface
    cells of any order are taken by their corners, quadrilaterals as two triangles.

    Parameters
    ----------
    length_unit : that the file is going to be read with; a warning tells of a file that states
        another one. None leaves it out.

    Raises
    ------
    InputError : the file is absent, broken, or holds no surface.
    """
    if not file.is_file():
        raise InputError("there is no such file; the path is relative to the scene file", file=file)
    if file.stat().st_size == 0:
        raise InputError("the file is empty; export the tool's surface again", file=file)
    # Imported here: scenes without tools from files do without all readers.
    from lcmchain.mesh_files import read_mesh_file
    from lcmchain.mesh_files.length_unit import stated_unit_hint
    from lcmchain.mesh_files.shapes import base_type

    mesh = read_mesh_file(file)
    pieces: list[np.ndarray] = []
    aside = dict(mesh.left_aside)
    for name, cells in mesh.blocks:
        shape = base_type(name)
        if shape == "polygon":
            shape_rows = [(0, i, i + 1) for i in range(1, cells.shape[1] - 1)]
        else:
            shape_rows = _TRIANGULATION.get(shape, [])
        pieces.extend(cells[:, row] for row in shape_rows)
        if not shape_rows:
            aside[name] = aside.get(name, 0) + len(cells)
    if sum(map(len, pieces)) == 0:
        kinds = ", ".join(sorted(aside)) or "no cells at all"
        raise InputError(
            f"holds no triangles or quadrilaterals ({kinds}); export the tool's surface",
            file=file,
        )
    for note in mesh.notes:
        warn(file, note)
    if length_unit is not None and (hint := stated_unit_hint(mesh.unit, length_unit)) is not None:
        warn(file, hint)
    if aside:
        listed = ", ".join(f"{count} {name}" for name, count in sorted(aside.items()))
        warn(file, f"only triangles and quadrilaterals make a tool, left out are: {listed}")
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("is a plane mesh; a tool needs points with x, y and z", file=file)
    triangles = np.concatenate(pieces).astype(np.int64)
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise InputError("has triangles with vertices that do not exist; it is broken", file=file)
    if not np.isfinite(points[np.unique(triangles)]).all():
        raise InputError("has vertices that are not finite numbers; it is broken", file=file)
    return points, triangles


def _warn_of_size(points: np.ndarray, blank: np.ndarray, file: Path, length_unit: str) -> None:
    """Tell of a tool that is as much larger or smaller than the blank as with a wrong unit."""
    from lcmchain.mesh_files.length_unit import TOOL, length_unit_hint

    size, blank_size = (float(np.ptp(corners, axis=0).max()) for corners in (points, blank))
    hint = length_unit_hint(size, blank_size, length_unit, TOOL)
    if hint is not None:
        warn(file, hint)


def weld(points: np.ndarray, triangles: np.ndarray, file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices at the same place; drop triangles without area and repeated ones.

    trimesh and libigl join by rounding the coordinates, which leaves pairs on either side of a
    rounding limit apart.
    """
    used, triangles = np.unique(triangles, return_inverse=True)
    points = points[used]
    points, index = np.unique(points, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles.reshape(-1, 3)]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if size == 0.0:
        raise InputError("all vertices lie at one point; export the surface again", file=file)
    tolerance = WELD * size
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        points, triangles = points[first], label[triangles].astype(np.int64)

    a, b, c = (points[triangles[:, i]] for i in range(3))
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    has_area = doubled_area > tolerance * longest
    if not has_area.any():
        raise InputError("no triangle has an area; export the tool's surface again", file=file)
    turned = np.argmin(triangles, axis=1)[:, None]
    canonical = np.take_along_axis(triangles, (turned + np.arange(3)) % 3, axis=1)
    first = np.zeros(len(triangles), dtype=bool)
    first[np.unique(canonical, axis=0, return_index=True)[1]] = True
    kept = has_area & first
    if not kept.all():
        warn(
            file,
            f"{np.count_nonzero(~has_area)} triangles without area and "
            f"{np.count_nonzero(has_area & ~first)} repeated triangles were left out",
        )
    return points, np.ascontiguousarray(triangles[kept])
