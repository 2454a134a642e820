"""Linear equations of a sheet: their unknowns, and small displacements and natural frequencies.

The unknowns are means and scaled half differences of pairs of a bottom and a top node. The tangent
is built in them, so that the large stiffness through the thickness never cancels against itself: a
sheet of slenderness 10⁴ has the condition number of a shear-flexible plate instead of one that
exhausts double precision.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from lcmchain.elements.solid_shell.tangent import PAIR_MODES, linearise, node_stiffness
from lcmchain.model import Model
from lcmchain.statics.problem import STATIC_SOLVER, StaticProblem, require_supports


class PairSystem:
    """Equations in means m and scaled half differences q of pairs of a bottom and a top node.

    Bottom and top node are displaced by m ∓ s q with one s = thickness / edge length, so that q,
    edge length times a rotation, is as large as m. Components that are held on both faces are no
    unknowns; where one face is held, the other moves with m = ± s q; where the middle is held, q
    remains.
    """

    def __init__(
        self, model: Model, held: np.ndarray, held_middle: np.ndarray | None = None
    ) -> None:
        self.model = model
        body = model.only_body(STATIC_SOLVER)
        self.elements = body.mesh.elements
        n = self.pair_count = body.mesh.pair_count
        geometry = body.geometry
        area = geometry.volume / (2.0 * geometry.height)
        self.scale = s = float(np.mean(geometry.height) / np.mean(np.sqrt(area)))
        basis = PAIR_MODES.copy()
        basis[:, 4:] *= s
        self.basis = basis

        corners = self.elements
        full = (3 * corners[:, :, None] + np.arange(3)).reshape(-1, 24)
        rows = np.repeat(full, 24, axis=1).ravel()
        columns = np.tile(full, (1, 24)).ravel()
        size = 6 * n
        entries, self._slot = np.unique(columns * size + rows, return_inverse=True)
        column, self._row = np.divmod(entries, size)
        self._start = np.searchsorted(column, np.arange(size + 1))
        self._size = size

        # columns of the unknowns in (m, q); components run fastest
        held = np.asarray(held, dtype=bool).T.reshape(2, 3 * n)
        middle = np.zeros(3 * n, dtype=bool)
        if held_middle is not None:
            middle = np.asarray(held_middle, dtype=bool).T.ravel()
        mean = np.flatnonzero(~held[0] & ~held[1] & ~middle)
        difference = np.flatnonzero(~held[0] & ~held[1])
        single = np.flatnonzero((held[0] ^ held[1]) & ~middle)
        sign = np.where(held[0, single], 1.0, -1.0)
        unknowns = len(mean) + len(difference) + len(single)
        index = np.arange(unknowns)
        rows = np.concatenate([mean, difference + 3 * n, single + 3 * n, single])
        columns = np.concatenate([index, index[unknowns - len(single) :]])
        values = np.concatenate([np.ones(unknowns), s * sign])
        self.Z = csc_matrix((values, (rows, columns)), shape=(size, unknowns))

    def assemble(
        self,
        mode_stiffness: np.ndarray,
        load_stiffness: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> csc_matrix:
        """Return the tangent (6 pairs, 6 pairs) in (m, q)."""
        K = node_stiffness(mode_stiffness, self.basis)
        data = np.bincount(self._slot, weights=K.ravel(), minlength=len(self._row))
        matrix = csc_matrix((data, self._row, self._start), shape=(self._size, self._size))
        if load_stiffness is not None:
            pairs, blocks = load_stiffness
            index = 3 * (self.pair_count + pairs)[:, None] + np.arange(3)
            rows = np.repeat(index, 3, axis=1).ravel()
            columns = np.tile(index, (1, 3)).ravel()
            # forces ±g(d) with d = d0 + 2 s q act on q with 2 s g
            values = 4.0 * self.scale**2 * blocks.ravel()
            matrix = matrix + csc_matrix((values, (rows, columns)), shape=matrix.shape)
        return matrix

    def reduced(self, K: csc_matrix) -> csc_matrix:
        """Return the tangent of the unknowns."""
        return (self.Z.T @ K @ self.Z).tocsc()

    def factorise(self, K: csc_matrix) -> SuperLU:
        """Return the LU factors of the unknowns' tangent; RuntimeError if it is singular."""
        # the pattern is symmetric and the diagonal large: pivots may stay on it
        return splu(
            self.reduced(K),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=1e-3,
            options={"SymmetricMode": True},
        )

    def reduced_product(self, K: csc_matrix, displacement: np.ndarray) -> np.ndarray:
        """Return the unknowns' part of K times a nodal displacement (3, node_count)."""
        if not displacement.any():
            return np.zeros(self.Z.shape[1])
        return self.Z.T @ (K @ self._from_nodes(displacement))

    def reduced_mass(self, mass: np.ndarray) -> csc_matrix:
        """Return the mass matrix of the unknowns of lumped nodal masses (node_count,)."""
        n, s = self.pair_count, self.scale
        bottom, top = np.repeat(mass[:n], 3), np.repeat(mass[n:], 3)
        diagonal = np.concatenate([bottom + top, s**2 * (bottom + top)])
        cross = s * (top - bottom)
        M = diags_array([diagonal, cross, cross], offsets=[0, 3 * n, -3 * n])
        return (self.Z.T @ M @ self.Z).tocsc()

    def reduce(self, forces: np.ndarray) -> np.ndarray:
        """Return the generalised forces of nodal ones (3, node_count)."""
        n = self.pair_count
        bottom, top = forces[:, :n].T, forces[:, n:].T
        both = np.concatenate([bottom + top, self.scale * (top - bottom)])
        return self.Z.T @ both.ravel()

    def expand(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the nodal displacement (3, node_count) of the unknowns."""
        m, q = (self.Z @ unknowns).reshape(2, -1, 3)
        return np.concatenate([m - self.scale * q, m + self.scale * q]).T

    def modes(self, displacement: np.ndarray) -> np.ndarray:
        """Return the change (E, 21) of the mode vectors with a nodal displacement."""
        both = self._from_nodes(displacement).reshape(-1, 3)
        modes = np.einsum("kn,end->ekd", self.basis, both[self.elements])
        return modes.reshape(-1, 21)

    def _from_nodes(self, displacement):
        n = self.pair_count
        bottom, top = displacement[:, :n].T, displacement[:, n:].T
        both = np.concatenate([0.5 * (top + bottom), 0.5 * (top - bottom) / self.scale])
        return both.ravel()


def linear_solution(problem: StaticProblem) -> np.ndarray:
    """Return the displacement (3, node_count) [m] of the linear theory at load factor 1."""
    system = PairSystem(problem.model, problem.held, problem.held_middle)
    start = np.zeros((3, problem.model.node_count))
    K = system.assemble(linearise(problem.model, start).stiffness)
    right = system.reduce(problem.external_forces(start))
    right = right - system.reduced_product(K, problem.prescribed)
    return system.expand(system.factorise(K).solve(right)) + problem.prescribed


def linear_frequencies(model: Model, held: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest natural frequencies (count,) [Hz] and modes (count, 3, node_count).

    Masses are lumped at the nodes; ``held`` (3, node_count) are the supports.

    Raises
    ------
    InputError : supports that let the sheet move rigidly.
    """
    require_supports(model, held)
    system = PairSystem(model, held)
    K = system.assemble(linearise(model, np.zeros((3, model.node_count))).stiffness)
    factors = system.factorise(K)
    M = system.reduced_mass(model.nodes.mass)
    solver = LinearOperator(M.shape, matvec=factors.solve)
    K = system.reduced(K)
    start = np.ones(M.shape[0])  # not the random one: repeated runs give the same digits
    squares, shapes = eigsh(K, count, M=M, sigma=0.0, OPinv=solver, v0=start)
    order = np.argsort(squares)
    modes = np.array([system.expand(shape) for shape in shapes.T[order]])
    return np.sqrt(squares[order]) / (2.0 * np.pi), modes
