"""From the words of a scene to nodes, cells and edges of the mesh that resin flows in."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely import Polygon, contains_xy
from shapely.validation import explain_validity

from lcmchain.errors import InputError
from lcmchain.mesh.where import Where


@dataclass(frozen=True)
class Places:
    """Nodes, cells and edges of a surface mesh, found by the words of a scene.

    Parameters
    ----------
    points : nodes [m], shape (N, 3). cells : their rows, shape (C, 4), -1 behind a triangle.
    node_sets, cell_sets : rows by name.
    node_ids, cell_ids : numbers in the user's file, for messages; empty where it has none.
    """

    points: np.ndarray
    cells: np.ndarray
    node_sets: Mapping[str, np.ndarray]
    cell_sets: Mapping[str, np.ndarray]
    node_ids: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    cell_ids: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def nodes(self, where: Where, key: str) -> np.ndarray:
        """Rows of the nodes of a place, ascending.

        Parameters
        ----------
        key : of the place in the scene, for messages.

        Raises
        ------
        InputError : a set that does not exist or has no node here, a point that lies off the mesh,
            no node in the box, or a mesh without a boundary.
        """
        if where.set is not None:
            nodes = self._of_set(where.set, key)
        elif where.point is not None:
            nodes = self._around(np.array(where.point), where.radius, key)
        elif where.box is not None:
            nodes = self.used[self._in_box(where, self.points[self.used], "node", key)]
        elif where.polygon is not None:
            nodes = self.used[self._in_polygon(where, self.points[self.used], "node", key)]
        else:
            nodes = self.edges(where, key).ravel()
        return np.unique(nodes)

    def cells_of(self, where: Where, key: str) -> np.ndarray:
        """Rows of the cells of a place: of a set, or with their centroid in a box or radius.

        Of a set of nodes, the cells that have all their nodes in it.

        Raises
        ------
        InputError : as of :meth:`nodes`.
        """
        if where.set is not None and where.set in self.cell_sets:
            return self._some(np.unique(self.cell_sets[where.set]), where.set, "cell", key)
        if where.box is not None:
            return self._in_box(where, self.centroids, "centroid of a cell", key)
        if where.polygon is not None:
            return self._in_polygon(where, self.centroids, "centroid of a cell", key)
        if where.point is not None and where.radius is not None:
            away = np.linalg.norm(self.centroids - np.array(where.point), axis=1)
            found = np.flatnonzero(away <= where.radius)
            if len(found) == 0:
                nearest = int(np.argmin(away))
                raise InputError(
                    f"no cell has its centroid within {_mm(where.radius)} mm of "
                    f"{place_text(np.array(where.point))}; the nearest is that of cell "
                    f"{self.cell_number(nearest)} at {place_text(self.centroids[nearest])}, "
                    f"{_mm(away[nearest])} mm away",
                    key=key,
                )
            return found
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.nodes(where, key)] = True
        whole = (inside[self.cells] | (self.cells < 0)).all(axis=1)
        return self._some(np.flatnonzero(whole), str(where.set), "whole cell", key)

    def edges(self, where: Where, key: str) -> np.ndarray:
        """Nodes of the mesh's edges along a place, shape (E, 2), each edge once.

        Of sets, boxes and polygons, the edges that have both ends in them.

        Raises
        ------
        InputError : as of :meth:`nodes`, or no edge there.
        """
        if where.rim or where.loop is not None or where.boundary is not None:
            loops = self.loops
            if not loops:
                raise InputError("the mesh is closed: it has no boundary", key=key)
            if where.rim:
                return self.outermost()
            if where.boundary is not None:
                return self._numbered_loop(where.boundary, key)
            return self._nearest_loop(np.array(where.loop), key)
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.nodes(where, key)] = True
        found = self.all_edges[0][inside[self.all_edges[0]].all(axis=1)]
        if len(found) == 0:
            raise InputError("no edge of the mesh has both its ends there", key=key)
        return found

    # --- the mesh ---------------------------------------------------------------------------------

    @cached_property
    def used(self) -> np.ndarray:
        """Rows of the nodes that belong to a cell."""
        return np.unique(self.cells[self.cells >= 0])

    @cached_property
    def centroids(self) -> np.ndarray:
        """Means of the corners of each cell [m], shape (C, 3)."""
        there = self.cells >= 0
        summed = np.where(there[:, :, None], self.points[self.cells], 0.0).sum(axis=1)
        return summed / there.sum(axis=1)[:, None]

    @cached_property
    def all_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Every edge once, shape (E, 2), and of how many cells it is."""
        following = np.roll(self.cells, -1, axis=1)
        following = np.where(following < 0, self.cells[:, :1], following)
        pairs = np.stack([self.cells, following], axis=2).reshape(-1, 2)
        pairs = np.sort(pairs[self.cells.ravel() >= 0], axis=1)
        edges, count = np.unique(pairs, axis=0, return_counts=True)
        return edges, count

    @cached_property
    def edge_length(self) -> float:
        """Median length of an edge [m]."""
        ends = self.points[self.all_edges[0]]
        return float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))

    @property
    def extent(self) -> str:
        """From the least to the largest coordinates of the part, for messages."""
        own = self.points[self.used]
        return f"{place_text(own.min(axis=0))} to {place_text(own.max(axis=0))}"

    @cached_property
    def loops(self) -> list[np.ndarray]:
        """Edges (E, 2) of each connected boundary, the longest first."""
        edges, count = self.all_edges
        free = edges[count == 1]
        if len(free) == 0:
            return []
        graph = coo_array((np.ones(len(free)), free.T), shape=2 * (len(self.points),))
        part = connected_components(graph, directed=False)[1][free[:, 0]]
        length = np.linalg.norm(self.points[free[:, 1]] - self.points[free[:, 0]], axis=1)
        total = np.bincount(part, weights=length)
        order = [int(p) for p in np.argsort(-total, kind="stable") if total[p] > 0.0]
        return [free[part == p] for p in order]

    def outermost(self) -> np.ndarray:
        """Edges (E, 2) of the boundary around the others: a hole may be longer than it."""
        loops = self.loops
        size = [np.linalg.norm(np.ptp(self.points[loop].reshape(-1, 3), axis=0)) for loop in loops]
        return loops[int(np.argmax(np.array(size) > max(size) * (1.0 - 1e-9)))]

    def node_number(self, row: int) -> int:
        """Number of a node in the user's file; its row where the file has none."""
        return int(self.node_ids[row]) if len(self.node_ids) else int(row)

    def cell_number(self, row: int) -> int:
        """Number of a cell in the user's file; its row where the file has none."""
        return int(self.cell_ids[row]) if len(self.cell_ids) else int(row)

    # --- the ways ---------------------------------------------------------------------------------

    def _of_set(self, name: str, key: str) -> np.ndarray:
        if name in self.node_sets:
            nodes = np.asarray(self.node_sets[name])
        elif name in self.cell_sets:
            nodes = self.cells[self.cell_sets[name]].ravel()
        else:
            known = [*self.node_sets, *self.cell_sets]
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            if close:
                hint = f'; did you mean "{close[0]}"?'
            elif known:
                hint = f"; there is {', '.join(known[:10])}" + (", ..." if len(known) > 10 else "")
            else:
                hint = "; it has no sets: name a point, a box, a loop or the rim"
            raise InputError(f'the mesh has no set "{name}"{hint}', key=f"{key}.set")
        return self._some(np.intersect1d(nodes, self.used), name, "node of a cell", key)

    def _some(self, rows: np.ndarray, name: str, what: str, key: str) -> np.ndarray:
        if len(rows) == 0:
            raise InputError(f'the set "{name}" has no {what} of this mesh', key=f"{key}.set")
        return rows

    def _around(self, point: np.ndarray, radius: float | None, key: str) -> np.ndarray:
        away = np.linalg.norm(self.points[self.used] - point, axis=1)
        nearest = int(np.argmin(away))
        row = int(self.used[nearest])
        told = (
            f"node {self.node_number(row)} at {place_text(self.points[row])}, "
            f"{_mm(away[nearest])} mm away"
        )
        if away[nearest] > max(self.edge_length, radius or 0.0):
            reach = "one edge length" if radius is None else "the radius and one edge length"
            raise InputError(
                f"{place_text(point)} lies outside the mesh: the nearest is {told}, more than "
                f"{reach} ({_mm(max(self.edge_length, radius or 0.0))} mm); move it there, and "
                "check the unit",
                key=f"{key}.point",
            )
        found = np.flatnonzero(away <= (radius or 0.0))
        return self.used[found] if len(found) else np.array([row])

    def _in_box(self, where: Where, places: np.ndarray, what: str, key: str) -> np.ndarray:
        corners = np.array(where.box)
        low, high = corners.min(axis=0), corners.max(axis=0)
        slack = 1e-9 * float(np.ptp(self.points[self.used], axis=0).max())
        inside = ((places >= low - slack) & (places <= high + slack)).all(axis=1)
        if not inside.any():
            distance = np.linalg.norm(places - np.clip(places, low, high), axis=1)
            nearest = int(np.argmin(distance))
            raise InputError(
                f"no {what} lies in the box from {place_text(low)} to {place_text(high)}; the "
                f"nearest lies at {place_text(places[nearest])}, {_mm(distance[nearest])} mm "
                f"outside (the part spans {self.extent}); move it there, and check the unit",
                key=f"{key}.box",
            )
        return np.flatnonzero(inside)

    def _in_polygon(self, where: Where, places: np.ndarray, what: str, key: str) -> np.ndarray:
        polygon = Polygon(where.polygon)
        if not polygon.is_valid:
            raise InputError(
                f"crosses itself ({explain_validity(polygon)}, in m); give its corners in order",
                key=f"{key}.polygon",
            )
        # with nodes on its sides, whatever their last digits
        slack = 1e-9 * float(np.ptp(self.points[self.used], axis=0).max())
        inside = contains_xy(polygon.buffer(slack), places[:, 0], places[:, 1])
        if not inside.any():
            raise InputError(
                f"no {what} lies in the polygon (the part spans {self.extent}); move it there, "
                "and check the unit",
                key=f"{key}.polygon",
            )
        return np.flatnonzero(inside)

    def _numbered_loop(self, number: int, key: str) -> np.ndarray:
        if number > len(self.loops):
            there = "; ".join(
                f"{k} at {place_text(self.points[loop[0, 0]])}"
                for k, loop in enumerate(self.loops[:10], start=1)
            )
            raise InputError(
                f"is {number}, but the mesh has {len(self.loops)} closed boundaries: {there}",
                key=f"{key}.boundary",
            )
        return self.loops[number - 1]

    def _nearest_loop(self, point: np.ndarray, key: str) -> np.ndarray:
        rows = [np.unique(loop) for loop in self.loops]
        found = [cKDTree(self.points[own]).query(point) for own in rows]
        number = int(np.argmin([away for away, _ in found]))
        away, at = found[number]
        if away > self.edge_length:
            raise InputError(
                f"no boundary passes within one edge length ({_mm(self.edge_length)} mm) of "
                f"{place_text(point)}; the nearest does so at "
                f"{place_text(self.points[rows[number][at]])}, {_mm(away)} mm away",
                key=f"{key}.loop",
            )
        return self.loops[number]


def place_text(point: np.ndarray) -> str:
    """Write a place in mm, for messages."""
    return "(" + ", ".join(f"{1e3 * value + 0.0:.1f}" for value in point) + ") mm"


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g}"
