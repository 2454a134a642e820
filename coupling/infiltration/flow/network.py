"""Control volumes of the nodes and the conductances between them, by linear finite elements.

The flow from node i to node j through a cell is T_ij (u_i - u_j), with T_ij = -∫ ∇N_i · h K/µ ∇N_j
dA: the finite-element matrix as a network. The flow that leaves i reaches j, so that resin is
conserved on any mesh. T_ij may be negative (obtuse triangles, long quadrilaterals, strong
anisotropy). Race tracks, and links through the thickness to a flow medium, are edges as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.flow.flow_medium import FULL_COLUMN, Links
from lcmchain.coupling.infiltration.flow.pairs import Pairs, Sheet, conducting_pairs
from lcmchain.coupling.infiltration.flow.preform import FlowMesh
from lcmchain.errors import InputError
from lcmchain.jit import routine

_GAUSS = 1.0 / np.sqrt(3.0)


@dataclass(frozen=True)
class RaceTrack:
    """Edges along which resin runs ahead in a channel, as at the rim of a cut preform.

    Parameters
    ----------
    name : for messages.
    edges : node rows of the sides of cells, shape (K, 2).
    conductance : permeability times cross-section of the channel [m4], one number or (K,): a gap
        of width w and height h has about w h³ / 12 or w³ h / 12 with the smaller side cubed.
    section : cross-section [m2] that the resin fills in addition, one number or (K,).
    """

    name: str
    edges: np.ndarray
    conductance: float | np.ndarray
    section: float | np.ndarray = 0.0

    def __post_init__(self) -> None:
        edges = np.asarray(self.edges, dtype=np.int64).reshape(-1, 2)
        object.__setattr__(self, "edges", edges)
        if not len(edges):
            raise InputError(f'the race track "{self.name}" has no edges')
        if not np.all(np.asarray(self.conductance) > 0.0) or np.any(np.asarray(self.section) < 0):
            raise InputError(
                f'the race track "{self.name}" needs a positive conductance and a section >= 0'
            )


class Conductances(NamedTuple):
    """Flow per pressure between nodes, and its moments for the front.

    Parameters
    ----------
    flow : T of each edge (E,) [m³/(Pa s)]. Negative values occur.
    moment : T times the vector from the other end to this end, in the plane of the node of this
        end, for both ends (E, 2, 2) [m⁴/(Pa s)].
    spread : h K/µ integrated over each control volume, components 11, 22, 12 in the plane of its
        node (N, 3) [m⁵/(Pa s)].
    scale : h/µ of the cells times the factor on their permeability (C,) [m/(Pa s)].
    """

    flow: np.ndarray
    moment: np.ndarray
    spread: np.ndarray
    scale: np.ndarray


class Network:
    """Edges between nodes that share a cell, with their conductances per unit of h K/µ.

    Parameters
    ----------
    mesh : the sheet.
    permeability : tensors in space [m2], shape (C, 3, 3).
    tracks : channels along edges.
    gates : rows of nodes at which resin enters or leaves.
    links : between the control volumes of a flow medium and of the preform.
    """

    def __init__(
        self,
        mesh: FlowMesh,
        permeability: np.ndarray,
        tracks: Sequence[RaceTrack] = (),
        gates: np.ndarray | None = None,
        links: Links | None = None,
    ) -> None:
        self.links = links
        self.node_count = mesh.node_count
        self.cells, self._points = mesh.cells, mesh.points
        flat = _flat_corners(mesh.corners, mesh.normals)
        axes = np.stack(_plane_axes(mesh.corners, mesh.normals), axis=1)
        tensor = np.einsum("cmi,cij,cnj->cmn", axes, permeability, axes)
        quadrilateral = mesh.is_quadrilateral
        gradients, weights = _gradients(flat, quadrilateral)
        #: ∫ N_a dA of each corner [m2], (C, 4): the area of the cell that belongs to its node.
        self.corner_areas = _corner_areas(weights, quadrilateral)
        matrix = -np.einsum("cg,cgai,cij,cgbj->cab", weights, gradients, tensor, gradients)
        self._mean_gradient = np.einsum("cg,cga...->ca...", weights, gradients)
        self._mean_gradient /= weights.sum(axis=1)[:, None, None]
        self._axes, self._tensor = axes, tensor
        #: Arrangement of the cells around the nodes.
        self.unfolding = _unfold(mesh.cells, flat, mesh.node_count)
        area = weights.sum(axis=1)
        mean = -np.einsum(
            "c,cai,cij,cbj->cab", area, self._mean_gradient, tensor, self._mean_gradient
        )
        turns = self.unfolding.turns
        sheet = Sheet(mesh.cells, flat, turns, tensor, matrix, mean)
        gates = np.empty(0, dtype=np.int64) if gates is None else gates
        kept = [_sides_between(mesh.cells, gates), *(track.edges for track in tracks)]
        self._take_corners(turns)
        self._take_pairs(conducting_pairs(sheet, np.concatenate(kept), gates))
        self._add_tracks(mesh, tracks)
        self._add_links(links)

    def _take_pairs(self, pairs: Pairs) -> None:
        number = pairs.ends[:, 0] * self.node_count + pairs.ends[:, 1]
        unique, edge = np.unique(number, return_inverse=True)
        #: Node rows of each edge, the smaller first, (E, 2).
        self.edges = np.stack([unique // self.node_count, unique % self.node_count], axis=1)
        #: Number of edges in the sheet; they come before those through the thickness.
        self.in_plane_count = len(unique)
        self._pair_cell, self._pair_edge = pairs.cell, edge.reshape(-1)
        self._pair_flow, self._pair_between = pairs.flow, pairs.between
        self._pair_moment = pairs.flow[:, None, None] * pairs.between
        reach = np.bincount(self._pair_edge, pairs.flow * pairs.span)
        #: Σ T d·(AK)⁻¹d over the cells at each edge, with the area A of each end's node, (E, 2).
        self.reach = reach[:, None] / self.node_areas()[self.edges]

    def _take_corners(self, turns: np.ndarray) -> None:
        cell, corner = np.nonzero(self.cells >= 0)
        turned = np.einsum(
            "kim,kmn,kjn->kij", turns[cell, corner], self._tensor[cell], turns[cell, corner]
        )
        self._corner = (cell, corner, self.cells[cell, corner])
        weighted = turned * self.corner_areas[cell, corner][:, None, None]
        self._corner_spread = weighted[:, (0, 1, 0), (0, 1, 1)]

    def _add_tracks(self, mesh: FlowMesh, tracks: Sequence[RaceTrack]) -> None:
        """Add channels along edges: conductance per 1/µ, and volume at the nodes [m³]."""
        edge_count = len(self.edges)
        self._track_flow = np.zeros(edge_count)
        self.track_volume = np.zeros(self.node_count)
        numbers = self.edges[:, 0] * self.node_count + self.edges[:, 1]
        for track in tracks:
            ends = np.sort(track.edges, axis=1)
            named = ends[:, 0] * self.node_count + ends[:, 1]
            edge = np.minimum(np.searchsorted(numbers, named), edge_count - 1)
            lost = np.flatnonzero(numbers[edge] != named)
            if len(lost):
                raise InputError(
                    f'the race track "{track.name}" names {len(lost)} edges that no cell has '
                    f"(first: nodes {ends[lost[0], 0]} and {ends[lost[0], 1]})"
                )
            length = np.linalg.norm(mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]], axis=1)
            np.add.at(
                self._track_flow, edge, np.broadcast_to(track.conductance, len(edge)) / length
            )
            # a channel passes the front on at once, whatever the sheet beside it
            self.reach[edge] = np.inf
            half = 0.5 * np.broadcast_to(track.section, len(edge)) * length
            for end in (0, 1):
                np.add.at(self.track_volume, ends[:, end], half)
        # a channel has the direction of the side of its cell, in the planes of its nodes
        direction = np.zeros((edge_count, 2, 2))
        direction[self._pair_edge] = self._pair_between
        self._direction = direction
        self._track_moment = self._track_flow[:, None, None] * direction
        spread = (
            0.5
            * self._track_flow[:, None, None]
            * np.stack(
                [
                    direction[..., 0] ** 2,
                    direction[..., 1] ** 2,
                    direction[..., 0] * direction[..., 1],
                ],
                axis=2,
            )
        )
        self._track_spread = np.zeros((self.node_count, 3))
        for end in (0, 1):
            np.add.at(self._track_spread, self.edges[:, end], spread[:, end])

    def _add_links(self, links: Links | None) -> None:
        """Add edges between a flow medium and the preform, after those in the sheets."""
        if links is None:
            return
        count = len(links.above)
        self.edges = np.concatenate([self.edges, np.sort(np.stack(links, axis=1), axis=1)])
        self.reach = np.concatenate([self.reach, np.zeros((count, 2))])
        self._track_flow = np.concatenate([self._track_flow, np.zeros(count)])
        for name in ("_direction", "_track_moment"):
            in_plane = getattr(self, name)
            setattr(self, name, np.concatenate([in_plane, np.zeros((count, 2, 2))]))

    def corner_sum(self, values: np.ndarray) -> np.ndarray:
        """Return sums over the corners at each node (N,) of values per corner (C, 4)."""
        cell, corner, node = self._corner
        return np.bincount(node, values[cell, corner], minlength=self.node_count)

    def edge_vectors(self, edges: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return vectors (K, 2) [m] to the ends of edges, in the planes of their nodes."""
        return self._direction[edges, ends]

    def around(
        self, nodes: np.ndarray, others: np.ndarray, conductances: Conductances
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the surroundings of several nodes in the mean plane around them.

        Returns
        -------
        Vectors (K, 2) [m] from the middle of the nodes to ``others``; h K/µ integrated over the
        control volumes of the nodes, components 11, 22, 12 [m⁵/(Pa s)]; and their area [m²].
        """
        cell, corner, node = self._corner
        own = np.isin(node, nodes)
        cell, area = cell[own], self.corner_areas[cell[own], corner[own]]
        axes = self._axes[cell]
        normal = np.cross(axes[:, 0], axes[:, 1])
        _, vectors = np.linalg.eigh(np.einsum("k,ki,kj->ij", area, normal, normal))
        weight = area * conductances.scale[cell]
        plane = vectors[:, :2].T
        within = np.einsum("pi,kmi->kpm", plane, axes)
        tensor = np.einsum("k,kpm,kmn,kqn->pq", weight, within, self._tensor[cell], within)
        away = self._points[others] - self._points[nodes].mean(axis=0)
        length = np.linalg.norm(away, axis=1)
        flat = away @ plane.T
        flat *= (length / np.maximum(np.linalg.norm(flat, axis=1), 1e-300))[:, None]
        return flat, tensor[(0, 1, 0), (0, 1, 1)], float(area.sum())

    def edge_mean(self, values: np.ndarray) -> np.ndarray:
        """Return means over the cells at each edge (E,) of values per cell (C,)."""
        size = len(self.edges)
        total = np.bincount(self._pair_edge, values[self._pair_cell], minlength=size)
        return total / np.maximum(np.bincount(self._pair_edge, minlength=size), 1)

    def cell_mean(self, values: np.ndarray) -> np.ndarray:
        """Return means over the corners of each cell (C,) of values per node (N,), without nan."""
        cell, _, node = self._corner
        known = ~np.isnan(values[node])
        count = np.bincount(cell[known], minlength=len(self.cells))
        total = np.bincount(cell[known], values[node][known], minlength=len(self.cells))
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def node_mean(self, values: np.ndarray) -> np.ndarray:
        """Return means over the cells of each node (N,) of values per cell (C,), by area."""
        return self.corner_sum(self.corner_areas * values[:, None]) / self.node_areas()

    def node_areas(self) -> np.ndarray:
        """Return the area of the sheet at each node (N,) [m²]."""
        return self.corner_sum(self.corner_areas)

    def conductances(
        self,
        scale: np.ndarray,
        track_scale: np.ndarray | float,
        through: np.ndarray | None = None,
    ) -> Conductances:
        """Return the conductances.

        Parameters
        ----------
        scale : h/µ times the factor on the permeability (C,) [m/(Pa s)].
        track_scale : 1/µ of the resin in the channels, one number or (E,) [1/(Pa s)].
        through : K₃ / (µ h) of the cells (C,) [m/(Pa s)], where there are links.
        """
        size = len(self.edges)
        pair = scale[self._pair_cell]
        flow: np.ndarray = np.bincount(self._pair_edge, pair * self._pair_flow, minlength=size)
        moment = np.empty((size, 2, 2))
        for end in (0, 1):
            for axis in (0, 1):
                moment[:, end, axis] = np.bincount(
                    self._pair_edge, pair * self._pair_moment[:, end, axis], minlength=size
                )
        cell, _, node = self._corner
        spread: np.ndarray = np.stack(
            [
                np.bincount(node, scale[cell] * part, minlength=self.node_count)
                for part in self._corner_spread.T
            ],
            axis=1,
        )
        if self._track_flow.any():
            factor = np.broadcast_to(np.asarray(track_scale, dtype=float), size)
            flow = flow + factor * self._track_flow
            moment = moment + factor[:, None, None] * self._track_moment
            in_plane = float(factor[: self.in_plane_count].mean())
            spread = spread + in_plane * self._track_spread
        if self.links is not None and through is not None:
            area = self.node_areas()[self.links.above]
            below = self.node_mean(through)[self.links.below]
            flow[self.in_plane_count :] = FULL_COLUMN * area * below
        return Conductances(flow, moment, spread, scale)

    def velocity(self, potential: np.ndarray, factor: np.ndarray) -> np.ndarray:
        """Return Darcy's velocity of the cells, -K/µ ∇u (C, 3) [m/s]; nan where a node has no u.

        factor : 1/µ times the factor on the permeability (C,) [1/(Pa s)].
        """
        values = np.where(self.cells >= 0, potential[self.cells], 0.0)
        slope = np.einsum("ca,cai->ci", values, self._mean_gradient)
        flow = -factor[:, None] * np.einsum("cij,cj->ci", self._tensor, slope)
        return np.einsum("ci,cij->cj", flow, self._axes)


def _sides_between(cells: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Sides of cells with both ends among the nodes, (K, 2)."""
    following = np.roll(cells, -1, axis=1)
    following[cells[:, 3] < 0, 2] = cells[cells[:, 3] < 0, 0]
    sides = np.stack([cells, following], axis=2).reshape(-1, 2)
    return sides[np.isin(sides, nodes).all(axis=1)]


def _gradients(flat: np.ndarray, quadrilateral: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients (C, 4, 4, 2) of the shape functions at the integration points, weights (C, 4)."""
    count = len(flat)
    gradients = np.zeros((count, 4, 4, 2))
    weights = np.zeros((count, 4))
    for number, (x, y) in enumerate(_points()):
        local = 0.25 * np.array(
            [[-(1 - y), -(1 - x)], [1 - y, -(1 + x)], [1 + y, 1 + x], [-(1 + y), 1 - x]]
        )
        local = np.broadcast_to(local, (count, 4, 2)).copy()
        # A triangle has one constant gradient, at the first point with all the weight.
        local[~quadrilateral] = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
        jacobian = np.einsum("cai,cam->cim", flat, local)
        size = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
        inverse = np.empty_like(jacobian)
        inverse[:, 0, 0], inverse[:, 1, 1] = jacobian[:, 1, 1], jacobian[:, 0, 0]
        inverse[:, 0, 1], inverse[:, 1, 0] = -jacobian[:, 0, 1], -jacobian[:, 1, 0]
        inverse /= size[:, None, None]
        gradients[:, number] = np.einsum("cam,cmi->cai", local, inverse)
        share = 0.5 if number == 0 else 0.0
        weights[:, number] = np.where(quadrilateral, size, share * size)
    return gradients, weights


def _corner_areas(weights: np.ndarray, quadrilateral: np.ndarray) -> np.ndarray:
    areas = np.zeros_like(weights)
    shape = np.array([
        [0.25 * (1 - x) * (1 - y), 0.25 * (1 + x) * (1 - y),
         0.25 * (1 + x) * (1 + y), 0.25 * (1 - x) * (1 + y)]
        for x, y in _points()
    ])  # fmt: skip
    areas[quadrilateral] = weights[quadrilateral] @ shape
    areas[~quadrilateral, :3] = weights[~quadrilateral, :1] / 3.0
    return areas


def _points() -> tuple[tuple[float, float], ...]:
    return ((-_GAUSS, -_GAUSS), (_GAUSS, -_GAUSS), (_GAUSS, _GAUSS), (-_GAUSS, _GAUSS))


# --- the cells around each node, laid flat --------------------------------------------------------
# Only lengths and angles within the sheet enter: a sheet that is rolled up along its mesh lines has
# the same unfolding as the flat one. Around a node whose angles do not sum to a full turn (the top
# of a dome) the cells are spread evenly over it.


def _flat_corners(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Corners of cells in their own planes [m], shape (C, 4, 2); the first axis along a side.

    corners (C, 4, 3), normals (C, 3). A warped quadrilateral is projected onto its mean plane.
    """
    first, second = _plane_axes(corners, normals)
    away = corners - corners[:, :1]
    return np.stack(
        [np.einsum("cai,ci->ca", away, first), np.einsum("cai,ci->ca", away, second)], axis=2
    )


def _plane_axes(corners: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors in the planes of cells, each (C, 3), the first along the first side."""
    side = corners[:, 1] - corners[:, 0]
    side = side - np.einsum("ci,ci->c", side, normals)[:, None] * normals
    first = side / np.linalg.norm(side, axis=1)[:, None]
    return first, np.cross(normals, first)


class Unfolding(NamedTuple):
    """How the cells around nodes lie in the nodes' planes.

    turns (C, 4, 2, 2) : matrices that take vectors of a cell's plane into that of a corner's node.
        They turn, and mirror where a cell runs the other way round than the first at the node.
    angle (N,) : sum of the cells' angles at each node; 2 pi where the cells close around it.
    inward (N, 2) : direction from the rim into the sheet at nodes of the rim, 0 elsewhere.
    """

    turns: np.ndarray
    angle: np.ndarray
    inward: np.ndarray


def _unfold(cells: np.ndarray, flat: np.ndarray, node_count: int) -> Unfolding:
    """Lay the cells (C, 4), with corners (C, 4, 2) in their own planes, around their nodes."""
    count = np.where(cells[:, 3] >= 0, 4, 3)
    cell, corner = np.nonzero(cells >= 0)
    order = np.argsort(cells[cell, corner], kind="stable")
    cell, corner = cell[order], corner[order]
    start = np.searchsorted(cells[cell, corner], np.arange(node_count + 1))
    following, before = (corner + 1) % count[cell], (corner - 1) % count[cell]
    here = flat[cell, corner]
    ahead, behind = flat[cell, following] - here, flat[cell, before] - here
    first = np.arctan2(ahead[:, 1], ahead[:, 0])
    crossed = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    angle = np.arctan2(crossed, np.einsum("ki,ki->k", ahead, behind)) % (2.0 * np.pi)
    at, mirrored, total, closed = _walk(start, cells[cell, following], cells[cell, before], angle)
    # A mirrored corner begins, in its node's plane, with its second side.
    turn = np.where(mirrored, at + first + angle, at - first)
    cosine, sine = np.cos(turn), np.sin(turn)
    sign = np.where(mirrored, -1.0, 1.0)
    turns = np.zeros((len(cells), 4, 2, 2))
    turns[cell, corner] = np.stack([cosine, -sign * sine, sine, sign * cosine], axis=1).reshape(
        -1, 2, 2
    )
    inward = np.stack([np.cos(0.5 * total), np.sin(0.5 * total)], axis=1)
    inward[closed] = 0.0
    return Unfolding(turns, np.where(closed, 2.0 * np.pi, total), inward)


@routine
def _walk(start, following, before, angle):
    """Angle at which each corner begins around its node, and whether it is mirrored.

    Also the sum of the angles at each node, and whether its cells close around it.
    """
    sums = np.zeros(len(start) - 1)
    closes = np.zeros(len(start) - 1, dtype=np.bool_)
    at = np.zeros(len(angle))
    mirrored = np.zeros(len(angle), dtype=np.bool_)
    visited = np.zeros(len(angle), dtype=np.bool_)
    for node in range(len(start) - 1):
        low, high = start[node], start[node + 1]
        closed = True
        total = 0.0
        left = high - low
        while left > 0:
            # Begin at a side that belongs to one corner only, else anywhere.
            begin, edge = -1, -1
            for k in range(low, high):
                if visited[k]:
                    continue
                if begin < 0:
                    begin, edge = k, following[k]
                for side in (following[k], before[k]):
                    shared = 0
                    for m in range(low, high):
                        if following[m] == side or before[m] == side:
                            shared += 1
                    if shared == 1:
                        if closed:
                            begin, edge = k, side
                        closed = False
            k = begin
            while k >= 0:
                visited[k] = True
                left -= 1
                at[k] = total
                mirrored[k] = before[k] == edge
                total += angle[k]
                edge = following[k] if mirrored[k] else before[k]
                k = -1
                for m in range(low, high):
                    if not visited[m] and (following[m] == edge or before[m] == edge):
                        k = m
                        break
        if closed and total > 0.0:
            for k in range(low, high):
                middle = (at[k] + 0.5 * angle[k]) * (2.0 * np.pi / total)
                at[k] = middle - 0.5 * angle[k]
        sums[node], closes[node] = total, closed
    return at, mirrored, sums, closes
