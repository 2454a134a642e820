"""Gates that are round holes: the conductance between the hole and the nodes that represent it.

Nodes with the pressure of the gate act as a hole of an effective radius r_e that depends on the
mesh. At this radius the logarithmic field around the hole has the pressure of the nodes. With the
field of the mesh right at the neighbours j of the nodes i, and the same flow,

    Σ T_ij ln(ρ_j / r_e) = θ κ

with the distances ρ_j from the middle of the nodes, in coordinates in which the sheet is isotropic,
and the angle θ of the sheet around them. The rest of the logarithm, between r_e and the radius of
the true hole, smaller or larger, is the conductance. After D. W. Peaceman, SPE Journal 18 (1978)
183 and 23 (1983) 531 for anisotropic grids; here for any mesh in space, and for several nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.flow.front import find_front
from lcmchain.coupling.infiltration.flow.network import Conductances, Network
from lcmchain.coupling.infiltration.flow.state import FillingState

#: Largest factor on the conductance of an edge that is partly in a hole. Without a limit a node
#: almost at the rim would get the pressure of the hole, and represent a larger one: a dome from a
#: hole with a radius of two edges fills 0.6 % earlier than a resolved one with this limit, 2 %
#: earlier without a limit, and 2 % later with 3.
MOST_WIDER = 5.0


def hole_conductance(
    network: Network, conductances: Conductances, nodes: np.ndarray, radius: float
) -> float:
    """Return the conductance between a hole of a radius [m] and the nodes in it [m³/(Pa s)].

    It is negative where the hole is larger than the effective radius of the nodes, and infinite
    where both are equal, or where some of several nodes are on the rim.
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
    """The logarithmic field around a hole, at the neighbours of the nodes in it.

    Parameters
    ----------
    at : numbers of the edges to the neighbours (K,).
    flow : their conductances (K,).
    size : logarithm of the field there (K,).
    hole : logarithm of the field at the hole.
    spread : θ κ.
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
        """Return the field around a hole; None where some of several nodes are on the rim."""
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
    """Return the mean of h K/µ, and logarithms of the field at positions (K, 2) and at the hole.

    In coordinates in which the sheet is isotropic the round hole is an ellipse of semi-axes a and
    b. Outside of it the field is ln |z + sqrt(z² - a² + b²)| / 2, with z measured from the longer
    axis; far away it is that of a round hole of the radius (a + b) / 2.
    """
    xx, yy, xy = spread
    values, axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    stretch = (values[1] / values[0]) ** 0.25
    # in these coordinates the sheet is longer in the direction of the lower conductance
    along, across = away @ axes[:, 0] * stretch, away @ axes[:, 1] / stretch
    z = along + 1j * across
    root = np.sqrt(z * z - radius**2 * (stretch**2 - stretch**-2))
    size = 0.5 * np.maximum(np.abs(z + root), np.abs(z - root))
    hole = 0.5 * radius * (stretch + 1.0 / stretch)
    return float(np.sqrt(values[0] * values[1])), np.log(size), float(np.log(hole))


def neighbours(network: Network, nodes: np.ndarray) -> np.ndarray:
    """Return the rows of the neighbours of nodes, ascending."""
    return np.unique(_leaving_edges(network, nodes)[1])


def widening(
    network: Network,
    conductances: Conductances,
    nodes: np.ndarray,
    radius: float,
    contact: float,
    state: FillingState,
) -> np.ndarray:
    """Return factors (E,) on the edges that represent a wide hole whose nodes have its pressure.

    The edges from its nodes end at the rim of the hole: in the logarithmic field each carries the
    flow that it would have from nodes at the higher pressure by the negative ``contact``. No node
    gets a pressure above that of the hole, as all factors are positive. While the front is beside
    the nodes, all edges have the same factor, by the contact of all together.
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

    A hole larger than the effective radius of its nodes reduces the resistance of the field around
    them, while the front is near by at most a half.
    """
    _, beyond = _leaving_edges(network, nodes)
    if contact >= 0.0 or not np.isfinite(contact) or full[beyond].all():
        return contact
    return -max(-contact, 2.0 * _leaving(network, conductances, nodes, full, fill))


def _leaving_edges(network: Network, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the edges from nodes to others, and the rows of these."""
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
    """Return the conductance from nodes to full neighbours and to the front [m³/(Pa s)]."""
    out, beyond = _leaving_edges(network, nodes)
    front = find_front(network, conductances, full, fill)
    inside = np.zeros(network.node_count, dtype=bool)
    inside[nodes] = True
    fed = inside[front.source]
    leaving = np.sum(front.flow[fed] / front.distance[front.member[fed]])
    leaving += conductances.flow[out][full[beyond]].sum()
    return float(leaving)


def mean_conductance(network: Network, conductances: Conductances, nodes: np.ndarray) -> float:
    """Return the geometric mean of the principal values of h K/µ, averaged [m³/(Pa s)]."""
    larger, smaller = _principal_spread(conductances.spread[nodes])
    return float(np.sqrt(np.maximum(larger * smaller, 0.0)).sum() / _area(network, nodes))


def _principal_spread(spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the larger and the smaller principal value of spreads (K, 3)."""
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
    """Return the time [s] in which a hole fills the dry volumes of its nodes.

    drive : pressure of the hole above that of the air [Pa].
    """
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
