"""Nodes, cells and sides that supports and loads act on."""

from __future__ import annotations

import difflib

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.structure.mesh import EDGES, SIDES, DeckMesh
from lcmchain.mapping.target import base_type, corner_count
from lcmchain.quantities.places import millimetres
from lcmchain.scene.structure import Place, Plane

#: How far from a plane a node may lie, as a share of the mesh's size.
ON_PLANE = 1e-3
#: A point one edge away counts as near, whatever the last digits are.
ROUNDING = 1e-9


def nodes_at(place: Place, mesh: DeckMesh, key: str) -> np.ndarray:
    """Rows of the nodes of a place, ascending.

    Parameters
    ----------
    key : of the place in the analysis, for messages.

    Raises
    ------
    InputError : a set that does not exist, a point off the mesh, or no node there.
    """
    if place.set is not None:
        nodes = _nodes_of_set(place.set, mesh, key)
        missing = "the set has no node of an element"
    elif place.plane is not None:
        nodes, missing = _on_plane(place.plane, mesh)
    elif place.point is not None:
        nodes, missing = _nearest_corner(np.array(place.point), mesh, f"{key}.point"), ""
    else:
        nodes, missing = _on_edge(mesh), "the mesh has no outer edge"
        if mesh.is_solid:
            raise InputError("solids have no outer edge; name a set or a plane", key=f"{key}.edge")
    nodes = np.unique(nodes)
    nodes = nodes[mesh.used[nodes]]
    if len(nodes) == 0:
        raise InputError(missing, key=key)
    return nodes


def cells_at(place: Place, mesh: DeckMesh, key: str) -> np.ndarray:
    """Rows of the cells of shells at a place: those of a cell set, or with all corners there.

    Raises
    ------
    InputError : a set that does not exist, or no cell there.
    """
    if not place.ways:
        return np.arange(mesh.cell_count)
    if place.set is not None and place.set in mesh.cell_sets:
        return np.asarray(mesh.cell_sets[place.set])
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[nodes_at(place, mesh, key)] = True
    cells = np.concatenate(
        [inside[cells[:, : corner_count(name)]].all(axis=1) for name, _, cells in mesh.blocks]
    )
    return _require_some(np.flatnonzero(cells), "cell", key)


def sides_at(place: Place, mesh: DeckMesh, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows of solid cells (S,) and numbers from 1 of their outer sides (S,) at a place.

    A side belongs to a place when all its corners do.

    Raises
    ------
    InputError : no place given, a set that does not exist, or no side there.
    """
    if not place.ways:
        raise InputError(
            "a pressure on solids needs its place: name a set of nodes or a plane", key=key
        )
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[nodes_at(place, mesh, key)] = True
    owners, numbers, corners = [], [], []
    first = 0
    for name, _, cells in mesh.blocks:
        for side_number, side in enumerate(SIDES[base_type(name)], start=1):
            closed = [*side, side[-1]][:4]
            owners.append(first + np.arange(len(cells)))
            numbers.append(np.full(len(cells), side_number))
            corners.append(np.sort(cells[:, closed], axis=1))
        first += len(cells)
    owner, number, nodes = (np.concatenate(parts) for parts in (owners, numbers, corners))
    _, which, count = np.unique(nodes, axis=0, return_inverse=True, return_counts=True)
    taken = (count[which.reshape(-1)] == 1) & inside[nodes].all(axis=1)
    rows = _require_some(np.flatnonzero(taken), "outer side of a cell", key)
    rows = rows[np.lexsort((number[rows], owner[rows]))]
    return owner[rows], number[rows]


def _require_some(rows: np.ndarray, what: str, key: str) -> np.ndarray:
    if len(rows) == 0:
        raise InputError(f"no {what} has all its corners there", key=key)
    return rows


def _nodes_of_set(name: str, mesh: DeckMesh, key: str) -> np.ndarray:
    if name in mesh.node_sets:
        return np.asarray(mesh.node_sets[name])
    if name in mesh.cell_sets:
        wanted = np.zeros(mesh.cell_count, dtype=bool)
        wanted[mesh.cell_sets[name]] = True
        ends = np.cumsum([len(cells) for _, _, cells in mesh.blocks])[:-1]
        parts = zip(mesh.blocks, np.split(wanted, ends))
        return np.concatenate([cells[mask].ravel() for (_, _, cells), mask in parts])
    known = [*mesh.node_sets, *mesh.cell_sets]
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    there = f"; there is {', '.join(known[:10])}" if known and not close else ""
    none = "; the file has no sets: name a plane, a point or the edge" if not known else ""
    raise InputError(f'the mesh has no set "{name}"{hint}{there}{none}', key=f"{key}.set")


def _nearest_corner(point: np.ndarray, mesh: DeckMesh, key: str) -> np.ndarray:
    """Row (1,) of the corner nearest to a point [m] that lies within a cell's edge of the mesh."""
    corners = np.flatnonzero(mesh.is_corner)
    away = np.linalg.norm(mesh.points[corners] - point, axis=1)
    nearest = int(np.argmin(away))
    row = corners[nearest]
    reach = mesh.longest_edge
    if not away[nearest] <= reach * (1.0 + ROUNDING):
        raise InputError(
            f"{millimetres(point)} lies off the mesh: the nearest node is {mesh.node_ids[row]} at "
            f"{millimetres(mesh.points[row])}, {1e3 * away[nearest]:.4g} mm away, farther than the "
            f"longest edge of a cell ({1e3 * reach:.4g} mm); move the point there, and check its "
            "unit and that of the mesh",
            key=key,
        )
    return np.array([row])


def _on_plane(plane: Plane, mesh: DeckMesh) -> tuple[np.ndarray, str]:
    height = mesh.points @ np.array(plane.normal) - plane.position
    tolerance = ON_PLANE * mesh.size if plane.tolerance is None else plane.tolerance
    used = np.flatnonzero(mesh.used)
    row = used[np.argmin(np.abs(height[used]))]
    missing = (
        f"no node lies within {1e3 * tolerance:.3g} mm of the plane; the nearest is "
        f"{1e3 * abs(height[row]):.3g} mm away, node {mesh.node_ids[row]} at "
        f"{millimetres(mesh.points[row])}"
    )
    return np.flatnonzero(np.abs(height) <= tolerance), missing


def _on_edge(mesh: DeckMesh) -> np.ndarray:
    """Nodes on edges that belong to one cell only, those in the middle of the edges among them."""
    edges, middles = [], []
    for name, _, cells in mesh.blocks:
        for number, (a, b) in enumerate(EDGES[base_type(name)], start=corner_count(name)):
            edges.append(np.sort(cells[:, [a, b]], axis=1))
            middles.append(cells[:, number] if number < cells.shape[1] else cells[:, a])
    ends, middle = np.concatenate(edges), np.concatenate(middles)
    _, which, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    outer = count[which.reshape(-1)] == 1
    return np.concatenate([ends[outer].ravel(), middle[outer]])
