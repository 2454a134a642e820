"""Places of a mesh that a scene names: the entries, and the nodes, cells and shares they mean.

``Where`` is the entry: a set, a point, a box, a polygon, a boundary. :class:`Places` finds its
nodes, cells and edges in the mesh that resin flows in, :func:`area_shares` the part of every face
of a flat sheet that lies in it.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Self

import numpy as np
import shapely
from pydantic import Field, model_validator
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely import Polygon, contains_xy
from shapely.validation import explain_validity

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Name,
    Number,
    PointInPlane,
    Position,
    PositiveLength,
    Range,
    Row,
    SceneModel,
    Switch,
    Text,
    wrong,
)

# --- scene entries --------------------------------------------------------------------------------


#: Entries that name a place, beside ``rim``.
WAYS = ("set", "point", "box", "polygon", "loop", "boundary")

Corners = Annotated[
    tuple[Position, Position],
    Row('["0 0 -1 mm", "20 20 1 mm"]', count=2, entries="points", units=False),
]
CornersInPlane = Row(
    '[["0 mm", "0 mm"], ["30 mm", "0 mm"], ["0 mm", "20 mm"]]',
    minimum_count=3,
    entries="corner points",
    units=False,
)


class Where(SceneModel):
    """A place of the mesh: a set, a point, a box, a polygon, the rim, or another boundary."""

    set: Annotated[Annotated[str, Text("GATE")] | None, AbsentMeans("")] = Field(
        default=None,
        description="Name of a node set, a cell set or a part of the mesh file.",
    )
    point: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None, description="The node nearest to a point, or all within radius of it."
    )
    radius: Annotated[PositiveLength | None, AbsentMeans("")] = Field(
        default=None, description="Distance from the point within which all nodes are taken."
    )
    box: Annotated[Corners | None, AbsentMeans("")] = Field(
        default=None, description="Nodes (of a region: cells) in a box, by two opposite corners."
    )
    polygon: Annotated[tuple[PointInPlane, ...] | None, CornersInPlane, AbsentMeans("")] = Field(
        default=None,
        description="Nodes (of a region: cells) whose x and y lie in a polygon, by its corners.",
    )
    rim: Switch = Field(
        default=False, description="Nodes on the outermost closed boundary of the mesh."
    )
    loop: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None,
        description="Nodes on the closed boundary that passes nearest to this point, as of a hole.",
    )

    boundary: Annotated[
        Annotated[int, Number(2, Range(1, 10_000), whole=True)] | None, AbsentMeans("")
    ] = Field(
        default=None,
        description="Nodes on a closed boundary by its number: 1 is the longest, 2 the next.",
    )

    @property
    def ways(self) -> list[str]:
        """Ways in which the place is given."""
        given = [way for way in WAYS if getattr(self, way) is not None]
        return [*given, *(["rim"] if self.rim else [])]

    @property
    def in_words(self) -> str:
        """What the place is, for the check of a scene."""
        if self.set is not None:
            return f'set "{self.set}"'
        if self.point is not None:
            around = "node nearest to" if self.radius is None else f"{_mm(self.radius)} mm around"
            return f"{around} {_place(self.point)}"
        if self.box is not None:
            return f"box from {_place(self.box[0])} to {_place(self.box[1])}"
        if self.polygon is not None:
            return f"polygon of {len(self.polygon)} corners"
        if self.loop is not None:
            return f"boundary next to {_place(self.loop)}"
        if self.boundary is not None:
            return f"boundary {self.boundary}"
        return "rim" if self.rim else "everywhere"

    @model_validator(mode="after")
    def _check_way(self) -> Self:
        self.require_ways()
        return self

    def require_ways(self) -> None:
        """Refuse what is no place, or more than one."""
        ways = self.ways
        if len(ways) != 1:
            found = " and ".join(ways) or "none"
            raise wrong(f"needs one of {', '.join(WAYS)} and rim = true, but has {found}")
        if self.radius is not None and self.point is None:
            raise wrong("belongs to point, which is not given", field="radius")


class NamedPlace(Where):
    """A place with a name, for messages and files."""

    name: Annotated[str, Name("gate")] = Field(description="Name, for messages and files.")


def _place(point: tuple[float, float, float]) -> str:
    return "(" + ", ".join(_mm(value) for value in point) + ") mm"


def _mm(value: float) -> str:
    return f"{1e3 * value + 0.0:.4g}"


# --- nodes, cells and edges -----------------------------------------------------------------------


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
                    f"no cell has its centroid within {_rough(where.radius)} mm of "
                    f"{place_text(np.array(where.point))}; the nearest is that of cell "
                    f"{self.cell_number(nearest)} at {place_text(self.centroids[nearest])}, "
                    f"{_rough(away[nearest])} mm away",
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
        points = self.points[self.used]
        return f"{place_text(points.min(axis=0))} to {place_text(points.max(axis=0))}"

    @cached_property
    def loops(self) -> list[np.ndarray]:
        """Edges (E, 2) of each connected boundary, the longest first."""
        edges, count = self.all_edges
        free = edges[count == 1]
        if len(free) == 0:
            return []
        graph = coo_array((np.ones(len(free)), free.T), shape=2 * (len(self.points),))
        loop = connected_components(graph, directed=False)[1][free[:, 0]]
        length = np.linalg.norm(self.points[free[:, 1]] - self.points[free[:, 0]], axis=1)
        total = np.bincount(loop, weights=length)
        order = [int(k) for k in np.argsort(-total, kind="stable") if total[k] > 0.0]
        return [free[loop == k] for k in order]

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
            f"{_rough(away[nearest])} mm away"
        )
        if away[nearest] > max(self.edge_length, radius or 0.0):
            reach = "one edge length" if radius is None else "the radius and one edge length"
            raise InputError(
                f"{place_text(point)} lies outside the mesh: the nearest is {told}, more than "
                f"{reach} ({_rough(max(self.edge_length, radius or 0.0))} mm); move it there, and "
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
                f"nearest lies at {place_text(places[nearest])}, {_rough(distance[nearest])} mm "
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
        nearest = [cKDTree(self.points[of_loop]).query(point) for of_loop in rows]
        number = int(np.argmin([away for away, _ in nearest]))
        away, at = nearest[number]
        if away > self.edge_length:
            raise InputError(
                f"no boundary passes within one edge length ({_rough(self.edge_length)} mm) of "
                f"{place_text(point)}; the nearest does so at "
                f"{place_text(self.points[rows[number][at]])}, {_rough(away)} mm away",
                key=f"{key}.loop",
            )
        return self.loops[number]


def place_text(point: np.ndarray) -> str:
    """Write a place in mm, for messages."""
    return "(" + ", ".join(f"{round(1e3 * value, 1) + 0.0:.1f}" for value in point) + ") mm"


def _rough(length: float) -> str:
    return f"{1e3 * length:.3g}"


# --- shares of faces ------------------------------------------------------------------------------


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


def _region(where: Where, key: str) -> Polygon:
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
