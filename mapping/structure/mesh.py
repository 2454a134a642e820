"""The mesh of the deck: the user's nodes and elements under their own numbers, and places on it."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.target import TargetMesh, base_type, corner_count
from lcmchain.quantities.readable import millimetres
from lcmchain.scene.structure import Place, Plane

#: Element of CalculiX for a cell of meshio's name, and the number of its nodes.
ELEMENTS = {
    "triangle": ("S3", 3),
    "triangle6": ("S6", 6),
    "quad": ("S4", 4),
    "quad8": ("S8R", 8),
    "tetra": ("C3D4", 4),
    "tetra10": ("C3D10", 10),
    "wedge": ("C3D6", 6),
    "wedge15": ("C3D15", 15),
    "hexahedron": ("C3D8I", 8),
    "hexahedron20": ("C3D20R", 20),
}

#: Cells with nodes in the middle of faces or of the cell, and what they are without these.
WITHOUT_CENTRES = {
    "triangle7": "triangle6",
    "quad9": "quad8",
    "wedge18": "wedge15",
    "hexahedron27": "hexahedron20",
}

#: How far elements without nodes in the middle of edges are off: deflection of a plate of 200 mm x
#: 200 mm x 1 mm under pressure, on 20 x 20 cells (manual, "Structural analysis").
TOO_STIFF = {
    "S3": "came out 85 % too small",
    "C3D6": "came out 85 % too small",
    "C3D4": "came out 97 % too small",
    "S4": "came out 1 % too small, on half as many cells along a side 13 %",
    "C3D8I": "came out 1 % too small, on half as many cells along a side 13 %",
}

RAISED = {
    "triangle": "triangle6", "quad": "quad8", "tetra": "tetra10",
    "wedge": "wedge15", "hexahedron": "hexahedron20",
}  # fmt: skip

#: Edges of a cell in the order of the nodes in their middle.
EDGES: dict[str, list[tuple[int, int]]] = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}

#: Sides of solids by their corners, in CalculiX's order of face numbers.
SIDES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "wedge": [(0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "hexahedron": [
        *[(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)],
        *[(1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    ],
}


@dataclass(frozen=True)
class DeckMesh:
    """Nodes and elements of a deck.

    Parameters
    ----------
    points : [m], (N,3). node_ids : (N,).
    blocks : meshio's type, element of CalculiX, and nodes (rows of ``points``) of each block, as
        many as the type has.
    cell_ids : numbers of all elements in the order of the blocks, (C,).
    cell_sets, node_sets : rows by the name of the set.
    """

    points: np.ndarray
    node_ids: np.ndarray
    blocks: tuple[tuple[str, str, np.ndarray], ...]
    cell_ids: np.ndarray
    cell_sets: Mapping[str, np.ndarray]
    node_sets: Mapping[str, np.ndarray]
    is_solid: bool

    @property
    def cell_count(self) -> int:
        return len(self.cell_ids)

    @property
    def elements(self) -> list[str]:
        """Kinds of elements, each once."""
        return list(dict.fromkeys(element for _, element, _ in self.blocks))

    @cached_property
    def used(self) -> np.ndarray:
        """Whether a node belongs to an element, (N,)."""
        used = np.zeros(len(self.points), dtype=bool)
        for _, _, cells in self.blocks:
            used[cells] = True
        return used

    @cached_property
    def is_corner(self) -> np.ndarray:
        """Whether a node is the corner of an element, (N,)."""
        corner = np.zeros(len(self.points), dtype=bool)
        for name, _, cells in self.blocks:
            corner[cells[:, : corner_count(name)]] = True
        return corner

    @cached_property
    def middles(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes in the middle of edges (M,), and the nodes at the ends of these (M, 2)."""
        middle, ends = [np.empty(0, dtype=np.int64)], [np.empty((0, 2), dtype=np.int64)]
        for name, _, cells in self.blocks:
            edges = EDGES[base_type(name)]
            for number, (a, b) in enumerate(edges, start=corner_count(name)):
                if number < cells.shape[1]:
                    middle.append(cells[:, number])
                    ends.append(cells[:, [a, b]])
        nodes, first = np.unique(np.concatenate(middle), return_index=True)
        return nodes, np.concatenate(ends)[first]

    @property
    def size(self) -> float:
        """Diagonal of the box around the used nodes [m]."""
        points = self.points[self.used]
        return float(np.linalg.norm(np.ptp(points, axis=0)))

    @cached_property
    def longest_edge(self) -> float:
        """Longest distance between two neighbouring corners of an element [m]."""
        longest = 0.0
        for name, _, cells in self.blocks:
            ends = self.points[cells[:, np.array(EDGES[base_type(name)])]]
            lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
            longest = max(longest, float(lengths.max()))
        return longest

    def counted(self) -> DeckMesh:
        """Return the same mesh with all nodes and elements numbered from 1 in their order."""
        return replace(
            self,
            node_ids=1 + np.arange(len(self.node_ids)),
            cell_ids=1 + np.arange(len(self.cell_ids)),
        )

    def with_middles(self, values: np.ndarray) -> np.ndarray:
        """Values of corner nodes, continued to nodes in the middle of edges as their mean."""
        nodes, ends = self.middles
        result = np.full(len(self.points), np.nan)
        result[: len(values)] = values
        result[nodes] = result[ends].mean(axis=1)
        return result


def deck_mesh(target: TargetMesh, *, quadratic: bool) -> DeckMesh:
    """Return the mesh of a deck.

    Parameters
    ----------
    quadratic : give every edge a node in its middle; their numbers follow the largest of the
        file, and they join the sets that both ends of their edge belong to.

    Raises
    ------
    InputError : cells that CalculiX has no element for, or ``quadratic`` with a mesh that has both
        linear and quadratic cells.
    """
    known = [(WITHOUT_CENTRES.get(name, name), cells) for name, cells in target.blocks]
    unknown = sorted({name for name, _ in known if name not in ELEMENTS})
    if unknown:
        raise InputError(
            f"CalculiX has no element for {', '.join(unknown)} cells; mesh the part with "
            "hexahedra, wedges or tetrahedra",
            file=target.file,
        )
    blocks = tuple(
        (name, ELEMENTS[name][0], cells[:, : ELEMENTS[name][1]]) for name, cells in known
    )
    mesh = DeckMesh(
        target.points, target.node_ids, blocks, target.cell_ids, target.cell_sets,
        target.node_sets, target.is_solid,
    )  # fmt: skip
    linear = [name in RAISED for name, _, _ in blocks]
    if not quadratic or not any(linear):
        return mesh
    if not all(linear):
        raise InputError(
            "the mesh has both linear and quadratic cells, which cannot be made quadratic; "
            'write elements = "as_mesh"',
            file=target.file,
        )
    return _raised(mesh)


def _raised(mesh: DeckMesh) -> DeckMesh:
    edges = [
        np.sort(cells[:, EDGES[name]], axis=2).reshape(-1, 2) for name, _, cells in mesh.blocks
    ]
    ends, number = np.unique(np.concatenate(edges), axis=0, return_inverse=True)
    first = len(mesh.points)
    numbers = np.split(first + number.reshape(-1), np.cumsum([len(e) for e in edges])[:-1])
    blocks = tuple(
        (
            RAISED[name],
            ELEMENTS[RAISED[name]][0],
            np.hstack([cells, own.reshape(len(cells), -1)]),
        )
        for (name, _, cells), own in zip(mesh.blocks, numbers)
    )
    sets = {}
    for name, nodes in mesh.node_sets.items():
        inside = np.zeros(first, dtype=bool)
        inside[nodes] = True
        sets[name] = np.concatenate([nodes, first + np.flatnonzero(inside[ends].all(axis=1))])
    following = mesh.node_ids.max() + 1 + np.arange(len(ends))
    return DeckMesh(
        np.concatenate([mesh.points, mesh.points[ends].mean(axis=1)]),
        np.concatenate([mesh.node_ids, following]),
        blocks,
        mesh.cell_ids,
        mesh.cell_sets,
        sets,
        mesh.is_solid,
    )


# --- nodes, cells and sides that supports and loads act on ----------------------------------------

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
