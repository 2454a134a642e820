"""Position of the front inside the control volumes, by their fill factors.

The front is in the control volumes that are not full and have a full neighbour. Such a volume k
takes resin from its full neighbours i only, as if the pressure went on linearly past its node to
the front and had the value of the vent there:

    q_k = Σ_i T_ik (u_i - u_k) = T_k (ū_k - u_v) / s_k,   T_k = Σ_i T_ik,  ū_k = Σ_i T_ik u_i / T_k

with s_k the distance from the full neighbours to the front over that to node k. It grows with the
fill factor F_k: s_k = 1/2 + r_k F_k, where r_k is the width of the control volume along the flow
over the distance between the nodes. For neighbours of any number and direction and a full tensor

    r_k = A_k T_k / (G_k · (h K/µ)⁻¹ G_k),   G_k = Σ_i T_ik (x_k - x_i)

which is exact for straight fronts along and across the lines of a lattice: flow in one dimension
is exact in space. Plain control-volume methods set s_k = 1: the front then jumps from node to node.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.infiltration.flow.network import Conductances, Network

# Least T_k over the sum of |T_ik|. Where conductances nearly cancel, in a one-sided neighbourhood,
# a volume waits for more full neighbours, if there will be any.
LEAST_SHARE = 0.02
# Least sum of T_ik d·(A_k K)⁻¹d over the full neighbours, with d = x_k - x_i; below, a volume waits
# as well. The sum is 1 for one neighbour on a line of a lattice, and 1/6 across the acute corner of
# a cell with diagonal fibres that are four times as permeable along: there resin would leak ahead
# of the front. Each cell counts with its own K, as the permeability beyond the volume may be any.
LEAST_REACH = 0.25
# Least ratio r_k.
LEAST_WIDTH = 0.5
# Tolerance of the half circle by which the cells around a node on a straight rim turn.
CORNER = np.radians(35.0)
# The front comes from within if r would be larger than this for flow along the rim.
STEEP = 2.0


class Front(NamedTuple):
    """Control volumes with the front, and the edges that feed them.

    Parameters
    ----------
    nodes : rows, ascending (K,).
    member : position in ``nodes`` of the fed end of each feeding edge (P,).
    source : row of its full end (P,).
    edge : number of the edge (P,).
    flow : conductance T_ik of the edge (P,).
    total : T_k (K,).
    ratio : r_k (K,).
    distance : s_k (K,).
    """

    nodes: np.ndarray
    member: np.ndarray
    source: np.ndarray
    edge: np.ndarray
    flow: np.ndarray
    total: np.ndarray
    ratio: np.ndarray
    distance: np.ndarray

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return means of nodal values (N,) over full neighbours, weighted with T_ik (K,)."""
        weighted = self.flow * values[self.source]
        return np.bincount(self.member, weighted, minlength=len(self.nodes)) / self.total

    def conducting(self, factor: np.ndarray) -> Front:
        """Return the same front with the conductances of the edges multiplied by factors (E,)."""
        flow = self.flow * factor[self.edge]
        total = np.bincount(self.member, flow, minlength=len(self.nodes))
        return self._replace(flow=flow, total=total)

    def passed(self) -> np.ndarray:
        """Return the fill factor at which the front passes the node (K,)."""
        return np.minimum(0.5 / self.ratio, 1.0)


def find_front(
    network: Network, conductances: Conductances, full: np.ndarray, fill: np.ndarray
) -> Front:
    """Return the front for full nodes (N,) and fill factors (N,)."""
    # flow through the thickness is no part of the front in the plane
    edges = network.edges[: network.in_plane_count]
    first, second = edges.T
    at = full[first]
    edge = np.flatnonzero(at != full[second])
    at = at[edge]
    fed = np.where(at, second[edge], first[edge])
    source = np.where(at, first[edge], second[edge])
    flow = conductances.flow[edge]
    moment = conductances.moment[edge, at.astype(np.int64)]
    count = network.node_count
    total = np.bincount(fed, flow, minlength=count)
    strength = np.bincount(fed, np.abs(flow), minlength=count)
    size = np.abs(conductances.flow[: len(edges)])
    all_around = np.bincount(first, size, minlength=count)
    all_around += np.bincount(second, size, minlength=count)
    reach = network.reach[edge, at.astype(np.int64)]
    reached = np.bincount(fed, reach, minlength=count) > LEAST_REACH
    takes = (total > LEAST_SHARE * strength) & reached
    waits = (strength > 0.0) & ~takes
    if waits.any():
        takes |= waits & (total > 0.0) & _in_pocket_without(takes, full, edges)
    nodes = np.flatnonzero(takes)
    kept = takes[fed]
    member = np.searchsorted(nodes, fed[kept])
    moment = np.stack(
        [np.bincount(fed, moment[:, axis], minlength=count)[nodes] for axis in (0, 1)], axis=1
    )
    section = _section_along_flow(network, nodes, total[nodes], moment, conductances.spread[nodes])
    limit = LEAST_WIDTH + 1.5 * (1.0 - strength[nodes] / all_around[nodes])
    ratio = total[nodes] / np.where(section > 1e-3 * total[nodes], section, 1e-3 * total[nodes])
    ratio = np.clip(ratio, LEAST_WIDTH, limit)
    distance = 0.5 + ratio * np.clip(fill[nodes], 0.0, 1.0)
    return Front(nodes, member, source[kept], edge[kept], flow[kept], total[nodes], ratio, distance)


def _in_pocket_without(takes: np.ndarray, full: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Whether a volume (N,) that waits for more full neighbours would wait for ever.

    No volume of its pocket of volumes that are not full takes resin, as in an acute corner.
    """
    first, second = edges[~full[edges].any(axis=1)].T
    links = coo_array((np.ones(len(first)), (first, second)), shape=(len(full), len(full)))
    count, pocket = connected_components(links, directed=False)
    alive = np.zeros(count, dtype=bool)
    alive[pocket[takes]] = True
    return ~alive[pocket]


def _squared_section(moment: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """G · S⁻¹ G of moments (K, 2) and spreads (K, 3): κ L² / A of a straight front [1/(Pa s)]."""
    xx, yy, xy = spread.T
    gx, gy = moment.T
    area = xx * yy - xy * xy  # vanishes where nothing conducts, as in resin that has gelled
    section = yy * gx * gx - 2.0 * xy * gx * gy + xx * gy * gy
    return np.divide(section, area, out=np.zeros_like(area), where=area > 0.0)


def _section_along_flow(
    network: Network,
    nodes: np.ndarray,
    total: np.ndarray,
    moment: np.ndarray,
    spread: np.ndarray,
) -> np.ndarray:
    """(n · G)² / (n · S n) with the direction n of the flow: S⁻¹ G inside the sheet.

    No resin crosses the rim: there the flow runs along it, or straight towards it if the front
    comes from within. In a corner nothing is behind the node.
    """
    section = _squared_section(moment, spread)
    inward = network.unfolding.inward[nodes]
    angle = network.unfolding.angle[nodes]
    along = np.stack([-inward[:, 1], inward[:, 0]], axis=1)
    ahead, towards = _section(moment, spread, along), _section(moment, spread, inward)
    wall = np.abs(angle - np.pi) < CORNER
    section = np.where(wall, np.where(total < STEEP * ahead, ahead, towards), section)
    return np.where(angle <= np.pi - CORNER, np.inf, section)


def _section(moment: np.ndarray, spread: np.ndarray, way: np.ndarray) -> np.ndarray:
    xx, yy, xy = spread.T
    conducted = xx * way[:, 0] ** 2 + 2.0 * xy * way[:, 0] * way[:, 1] + yy * way[:, 1] ** 2
    return _dot(moment, way) ** 2 / np.where(conducted > 0.0, conducted, np.inf)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ki,ki->k", a, b)
