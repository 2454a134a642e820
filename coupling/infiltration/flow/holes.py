"""Gates that are round holes: what lies between the hole and the nodes that stand for it.

Nodes that have the gate's pressure act as a hole of some size of their own, the effective radius,
that depends on the mesh. It is where the logarithmic field around the hole has the pressure of the
nodes: the field of the mesh is right at the neighbours j of the nodes i, and brings the same flow,

    Σ T_ij ln(ρ_j / r_e) = θ κ

with the distances ρ_j from the middle of the nodes, measured so that the sheet is isotropic, and
the angle θ of the sheet around them. Between the nodes and the true hole, smaller or larger, acts
what is left of the logarithm. After D. W. Peaceman, SPE Journal 18 (1978) 183 and 23 (1983) 531
for anisotropic grids; here for any mesh in space, and for more than one node.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.flow.front import find_front
from lcmchain.coupling.infiltration.flow.network import Conductances, Network
from lcmchain.coupling.infiltration.flow.state import FillingState

#: So many times at most conducts an edge of which a part lies in a hole. A node almost at its rim
#: would get the pressure of the hole, and stand for a larger one: a dome from a hole of two edges'
#: radius fills 0.6 % earlier than a resolved one with this, 2 % earlier without a limit, 2 % later
#: with 3.
MOST_WIDER = 5.0


def hole_conductance(
    network: Network, conductances: Conductances, nodes: np.ndarray, radius: float
) -> float:
    """Conductance between a hole of a radius [m] and the nodes that lie in it [m3/(Pa s)].

    Negative where the hole is larger than the nodes' effective radius; infinite where both are
    the same, and for several nodes of which some are on the rim.
    """
    around = _Around.of(network, conductances, nodes, radius)
    if around is None:
        return np.inf
    total = around.flow.sum()
    effective = (np.sum(around.flow * around.size) - around.spread) / total
    if effective == around.hole:
        return np.inf
    return float(around.spread / (effective - around.hole))


class _Around(NamedTuple):
    """The logarithmic field around a hole, at the nodes beside those that lie in it.

    at (K,) : numbers of the edges to them; flow (K,) : their conductances. size (K,) : logarithm of
    the field there, of which ``hole`` is that at the hole. spread : θ κ.
    """

    at: np.ndarray
    flow: np.ndarray
    size: np.ndarray
    hole: float
    spread: float

    @classmethod
    def of(
        cls, network: Network, conductances: Conductances, nodes: np.ndarray, radius: float
    ) -> _Around | None:
        """Return the field around a hole; None for several nodes of which some are on the rim."""
        at, beyond = _leaving_edges(network, nodes)
        angle = 2.0 * np.pi
        if len(nodes) == 1:
            angle = float(network.unfolding.angle[nodes[0]])
            first = network.edges[at, 0]
            away = network.edge_vectors(at, np.where(first == nodes[0], 0, 1))
            spread = conductances.spread[nodes[0]]
            area = network.node_areas()[nodes[0]]
        else:
            if network.unfolding.inward[nodes].any():
                return None
            away, spread, area = network.around(nodes, beyond, conductances)
        mean, size, hole = _logarithms(away, spread / area, radius)
        return cls(at, conductances.flow[at], size, hole, angle * mean)


def _logarithms(
    away: np.ndarray, spread: np.ndarray, radius: float
) -> tuple[float, np.ndarray, float]:
    """Mean of h K/µ; logarithms of the field around a round hole at places (K, 2), and at it.

    Measured so that the sheet is isotropic the hole is an ellipse, of semi-axes a and b. Outside
    the field is ln |z + sqrt(z² - a² + b²)| / 2, with z from the longer axis on, and that of a
    round hole of the radius (a + b) / 2 far away.
    """
    xx, yy, xy = spread
    values, axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    stretch = (values[1] / values[0]) ** 0.25
    # Where the sheet conducts least it becomes longer.
    along, across = away @ axes[:, 0] * stretch, away @ axes[:, 1] / stretch
    z = along + 1j * across
    root = np.sqrt(z * z - radius**2 * (stretch**2 - stretch**-2))
    size = 0.5 * np.maximum(np.abs(z + root), np.abs(z - root))
    hole = 0.5 * radius * (stretch + 1.0 / stretch)
    return float(np.sqrt(values[0] * values[1])), np.log(size), float(np.log(hole))


def neighbours(network: Network, nodes: np.ndarray) -> np.ndarray:
    """Rows of the nodes that edges join to the given ones, ascending."""
    return np.unique(_leaving_edges(network, nodes)[1])


def widening(
    network: Network,
    conductances: Conductances,
    nodes: np.ndarray,
    radius: float,
    contact: float,
    state: FillingState,
) -> np.ndarray:
    """Return factors (E,) of the edges by which a wide hole, at its own pressure, acts as itself.

    The edges between its nodes and the others lead to the hole's rim: in its logarithmic field each
    brings as much as from nodes at the higher pressure that the negative ``contact`` gives them.
    None lifts a node above the hole, as all factors are positive. While the front is beside the
    nodes, all edges are shortened alike by what the contact takes away from them together.
    """
    factor = np.ones(len(network.edges))
    at, beyond = _leaving_edges(network, nodes)
    around = _Around.of(network, conductances, nodes, radius)
    wider: np.ndarray | float
    if around is not None and state.full[beyond].all():
        outside = np.maximum(around.size - around.hole, 1e-300)
        wider = np.minimum(1.0 - around.spread / contact / outside, MOST_WIDER)
    else:
        leaving = _leaving(network, conductances, nodes, state.full, state.fill)
        wider = 1.0 / max(1.0 + leaving / contact, 1.0 / MOST_WIDER)
    factor[at] = np.where(conductances.flow[at] > 0.0, wider, 1.0)
    return factor


def while_filling(
    network: Network,
    conductances: Conductances,
    nodes: np.ndarray,
    contact: float,
    full: np.ndarray,
    fill: np.ndarray,
) -> float:
    """Return the conductance between hole and nodes while the front is next to them.

    A hole that is larger than what its nodes stand for takes resistance away from the field around
    them. As long as that has little, at most half of it is taken.
    """
    _, beyond = _leaving_edges(network, nodes)
    if contact >= 0.0 or not np.isfinite(contact) or full[beyond].all():
        return contact
    return -max(-contact, 2.0 * _leaving(network, conductances, nodes, full, fill))


def _leaving_edges(network: Network, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the edges that join the nodes to others, and the rows of these."""
    inside = np.zeros(network.node_count, dtype=bool)
    inside[nodes] = True
    first, second = network.edges[: network.in_plane_count].T
    out = np.flatnonzero(inside[first] != inside[second])
    return out, np.where(inside[first[out]], second[out], first[out])


def _leaving(
    network: Network,
    conductances: Conductances,
    nodes: np.ndarray,
    full: np.ndarray,
    fill: np.ndarray,
) -> float:
    """Conductance from the nodes to full ones and to the front beside them [m3/(Pa s)]."""
    out, beyond = _leaving_edges(network, nodes)
    front = find_front(network, conductances, full, fill)
    inside = np.zeros(network.node_count, dtype=bool)
    inside[nodes] = True
    fed = inside[front.source]
    leaving = np.sum(front.flow[fed] / front.distance[front.member[fed]])
    leaving += conductances.flow[out][full[beyond]].sum()
    return float(leaving)


def mean_conductance(network: Network, conductances: Conductances, nodes: np.ndarray) -> float:
    """Geometric mean of the principal values of h K/µ at nodes, averaged [m3/(Pa s)]."""
    larger, smaller = _principal_spread(conductances.spread[nodes])
    return float(np.sqrt(np.maximum(larger * smaller, 0.0)).sum() / _area(network, nodes))


def _principal_spread(spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Larger and smaller principal value of spreads (K, 3)."""
    middle, half = 0.5 * (spread[:, 0] + spread[:, 1]), 0.5 * (spread[:, 0] - spread[:, 1])
    radius = np.hypot(half, spread[:, 2])
    return middle + radius, middle - radius


def radial_time(
    network: Network,
    conductances: Conductances,
    nodes: np.ndarray,
    radius: float,
    pores: np.ndarray,
    drive: float,
) -> float:
    """Time [s] in which a hole fills the volumes of its nodes, dry at first; drive : [Pa]."""
    area = _area(network, nodes)
    angle = float(network.unfolding.angle[nodes[0]]) if len(nodes) == 1 else 2.0 * np.pi
    reach = np.sqrt(2.0 * area / angle)
    if reach <= radius:
        return 0.0
    mean = mean_conductance(network, conductances, nodes)
    bracket = reach**2 * np.log(reach / radius) - 0.5 * (reach**2 - radius**2)
    return float(pores[nodes].sum() / area / (2.0 * mean * drive) * bracket)


def _area(network: Network, nodes: np.ndarray) -> float:
    return float(network.node_areas()[nodes].sum())
