"""An independent reference for the filling of a sheet: no front, no time steps, one obstacle.

For a constant viscosity, a mould at rest, gates at one constant pressure above that of the air,
and air that leaves everywhere at that pressure, the time integral w of the pressure solves, at
every time for itself, an obstacle problem (C. M. Elliott, V. Janovsky, Proceedings of the Royal
Society of Edinburgh A 88 (1981) 93; the transformation is Baiocchi's):

    w >= 0,   porosity h - div(h K / mu grad w) >= 0,   one of both zero,   w = p t on gates.

The sheet is wet where w is positive, and the fill factor elsewhere is what the flow has brought.
All is filled when the solution without the obstacle is nowhere negative. That solution is p t - u
with -div(h K / mu grad u) = porosity h and u = 0 on the gates, so that the fill time is max u / p:
one linear solution.

Discretised by linear elements of Crouzeix and Raviart (Revue francaise d'automatique 7 R3 (1973)
33), whose unknowns stand in the middles of the sides: the filling of the package has them in the
nodes, follows a front and takes time steps. It shares no code with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve


@dataclass
class HeleShaw:
    """Filling of triangles in space at a constant gate pressure.

    Parameters
    ----------
    points : [m], (N, 3); triangles : node rows, (T, 3).
    thickness : [m]; porosity; both (T,) or one number.
    permeability : tensors in space [m2], (T, 3, 3), or one.
    viscosity : [Pa s]; pressure : of the gates above that of the air [Pa].
    gate_nodes : a side belongs to the gate if both of its nodes do.
    """

    points: np.ndarray
    triangles: np.ndarray
    thickness: np.ndarray | float
    porosity: np.ndarray | float
    permeability: np.ndarray
    viscosity: float
    pressure: float
    gate_nodes: np.ndarray
    sides: np.ndarray = field(init=False)  # node rows of every side, (E, 2)
    volume: np.ndarray = field(init=False)  # pore volume of every side [m3], (E,)
    stiffness: csr_matrix = field(init=False)  # [m3/(Pa s)], (E, E)
    gate: np.ndarray = field(init=False)  # whether a side is of the gate, (E,)

    def __post_init__(self) -> None:
        x = self.points[self.triangles]
        count = len(x)
        # side k lies opposite to corner k
        pairs = np.sort(self.triangles[:, [[1, 2], [2, 0], [0, 1]]], axis=2)
        self.sides, side = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
        side = side.reshape(count, 3)
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        twice = np.linalg.norm(normal, axis=1)
        opposite = x[:, [2, 0, 1]] - x[:, [1, 2, 0]]
        # gradient of the barycentric coordinate of corner k, in the plane of the triangle
        gradient = np.cross(normal[:, None], opposite) / (twice**2)[:, None, None]
        tensor = np.broadcast_to(self.permeability, (count, 3, 3)) / self.viscosity
        area = 0.5 * twice * np.broadcast_to(self.thickness, (count,))
        self._local = np.einsum("t,tki,tij,tlj->tkl", area, gradient, tensor, gradient)
        self._pores = area * np.broadcast_to(self.porosity, (count,)) / 3.0
        # the functions of the sides are 1 - 2 times the barycentric coordinates
        self.stiffness, self.volume = self._assembled(side, len(self.sides), 4.0)
        self.gate = np.isin(self.sides, self.gate_nodes).all(axis=1)

    def _assembled(
        self, rows: np.ndarray, count: int, factor: float
    ) -> tuple[csr_matrix, np.ndarray]:
        """Return stiffness and pore volumes over unknowns (T, 3) of the triangles."""
        row, column = np.repeat(rows, 3, axis=1).ravel(), np.tile(rows, 3).ravel()
        entries = (factor * self._local.ravel(), (row, column))
        stiffness = coo_matrix(entries, shape=(count, count)).tocsr()
        return stiffness, np.bincount(rows.ravel(), np.repeat(self._pores, 3), minlength=count)

    @property
    def nodal_fill_time(self) -> float:
        """The fill time [s] with linear elements that have their unknowns in the corners.

        They resist the flow too little where it is singular and those of the sides too much, so
        that the truth lies between both.
        """
        stiffness, volume = self._assembled(self.triangles, len(self.points), 1.0)
        free = np.setdiff1d(np.unique(self.triangles), self.gate_nodes)
        found = spsolve(stiffness[free][:, free].tocsc(), volume[free])
        return float(found.max() / self.pressure)

    @property
    def torsion(self) -> np.ndarray:
        """The solution u [Pa s] of the filled sheet, zero on the gate, (E,)."""
        free = np.flatnonzero(~self.gate)
        found = np.zeros(len(self.sides))
        found[free] = spsolve(self.stiffness[free][:, free].tocsc(), self.volume[free])
        return found

    @property
    def fill_time(self) -> float:
        """Time [s] at which the last pore is filled."""
        return float(self.torsion.max() / self.pressure)

    def fill(self, time: float, guess: np.ndarray | None = None) -> np.ndarray:
        """Fill factor of every side's volume at a time [s], (E,).

        Primal-dual active sets (M. Hintermüller, K. Ito, K. Kunisch, SIAM Journal on Optimization
        13 (2002) 865), from those where the solution without the obstacle is positive, or from a
        guess of the wet sides.
        """
        wet = self.pressure * time > self.torsion if guess is None else guess.copy()
        wet |= self.gate
        fixed = self.pressure * time * self.gate
        for _ in range(200):
            free = np.flatnonzero(wet & ~self.gate)
            solved = fixed.copy()
            if free.size:
                load = -self.volume[free] - self.stiffness[free] @ fixed
                solved[free] = spsolve(self.stiffness[free][:, free].tocsc(), load)
            brought = -(self.stiffness @ solved)
            now = np.where(wet, solved > 0.0, brought > self.volume) | self.gate
            if np.array_equal(now, wet):
                break
            wet = now
        else:
            raise RuntimeError("the active sets of the reference do not settle")
        return np.where(wet, 1.0, np.clip(brought / self.volume, 0.0, 1.0))

    def wet_volume(self, time: float) -> float:
        """Resin in the sheet at a time [s] [m3]."""
        return float(self.fill(time) @ self.volume)


def triangles_of(
    points: np.ndarray, cells: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut quadrilaterals into four triangles about their centres.

    ``cells`` (C, 4), triangles with -1 in the fourth place. Returns the points with the centres
    behind them, the triangles (T, 3) and the cell of each (T,).
    """
    quads = np.flatnonzero(cells[:, 3] >= 0)
    others = np.flatnonzero(cells[:, 3] < 0)
    centre = len(points) + np.arange(len(quads))
    cut = [np.column_stack([cells[quads, k], cells[quads, (k + 1) % 4], centre]) for k in range(4)]
    triangles = np.concatenate([cells[others, :3], *cut])
    owner = np.concatenate([others, np.tile(quads, 4)])
    return np.concatenate([points, points[cells[quads]].mean(axis=1)]), triangles, owner


def refined(
    points: np.ndarray, triangles: np.ndarray, gate_nodes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut every triangle into four; those of triangle t are t, T + t, 2 T + t and 3 T + t.

    Returns points, triangles, and the gate's nodes with the middles between two of them.
    """
    pairs = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]], axis=2)
    sides, side = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(points) + side.reshape(len(triangles), 3)
    a, b, c = triangles.T
    ma, mb, mc = middle.T
    parts = [(a, mc, mb), (mc, b, ma), (mb, ma, c), (ma, mb, mc)]
    between = len(points) + np.flatnonzero(np.isin(sides, gate_nodes).all(axis=1))
    return (
        np.concatenate([points, points[sides].mean(axis=1)]),
        np.concatenate([np.column_stack(part) for part in parts]),
        np.concatenate([gate_nodes, between]),
    )
