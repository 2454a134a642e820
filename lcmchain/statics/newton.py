"""Newton's method for the equilibrium of a sheet at a given load factor.

Forces are those of the compiled element kernel, the tangent is its exact derivative
(``elements/solid_shell/tangent.py``). The geometric stiffness takes the stress resultants
extrapolated linearly over the last correction instead of those of the corrected displacement
("mixed integration points": Magisano, Leonetti, Garcea, Int. J. Numer. Meth. Engng 109 (2017)
1237). Newton's method of the displacements takes rotations of a stiff sheet for huge membrane
stresses; this one does not, and converges over load steps that are many times larger. The
equilibrium found is the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.errors import SimulationError
from lcmchain.statics.acceleration import SecantAcceleration
from lcmchain.statics.convergence import Balance, balance, in_equilibrium
from lcmchain.statics.pair_system import PairSystem
from lcmchain.statics.problem import StaticProblem

MAXIMUM_ITERATIONS = 20
INVERSE_ITERATIONS = 30
# Share of the lowest stiffness of the start below which an equilibrium is near a limit point, where
# it is zero.
NEARLY_SINGULAR = 0.1
LIMIT_POINT = (
    "a limit or bifurcation point; follow the path by its arc length, prescribe displacements "
    "instead of forces, or support the sheet; where single elements give way, refine the mesh"
)
STEPS_TOO_LARGE = (
    "steps too large for the sheet; start with a smaller step, or follow the path by its arc length"
)
LARGEST_MOVE = 10.0  # correction of a displacement over the size of the sheet


class StepResult(NamedTuple):
    """Outcome of one step; ``change`` (unknowns) and ``length`` serve the arc-length method."""

    converged: bool
    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float
    cause: str = ""
    change: np.ndarray | None = None
    length: float = 0.0


class Newton:
    """Newton's method with extrapolated stress resultants, at a given load factor."""

    def __init__(self, problem: StaticProblem, force_tolerance: float) -> None:
        self.problem = problem
        self.force_tolerance = force_tolerance
        self.size = float(np.ptp(problem.body.mesh.node_positions, axis=0).max())
        self.system = PairSystem(problem.model, problem.held, problem.held_middle)

    def correct(self, displacement: np.ndarray, factor: float, next_factor: float) -> StepResult:
        """Find equilibrium at ``next_factor`` from the equilibrium ``displacement``."""
        system = self.system
        support_motion = (next_factor - factor) * self.problem.prescribed
        resultants, first_energy = None, None
        acceleration = SecantAcceleration()
        now = self.balance(displacement, next_factor)
        for iteration in range(1, MAXIMUM_ITERATIONS + 1):
            state = linearise(self.problem.model, displacement, resultants)
            K = system.assemble(state.stiffness, self._load_stiffness(displacement, next_factor))
            right = system.reduce(now.residual)
            if iteration == 1:
                right = right - system.reduced_product(K, support_motion)
            else:
                support_motion = np.zeros_like(displacement)
            try:
                correction = system.factorise(K).solve(right)
            except RuntimeError:
                return self._failed(displacement, next_factor, iteration, "singular tangent")
            move = system.expand(acceleration.move(correction)) + support_motion
            if not self._plausible(move):
                return self._failed(displacement, next_factor, iteration, "divergence")
            displacement = displacement + move
            energy = abs(correction @ right)
            first_energy = energy if first_energy is None else first_energy
            now = self.balance(displacement, next_factor)
            if in_equilibrium(now, correction, energy, first_energy, self.force_tolerance):
                return StepResult(True, next_factor, displacement, iteration, now.relative)
            resultants = self._extrapolated(state, move)
        return self._failed(displacement, next_factor, iteration, unsettled(move))

    def balance(self, displacement: np.ndarray, factor: float) -> Balance:
        """Return the balance of forces of a displacement at a load factor."""
        return balance(self.problem, self.system, displacement, factor, self.size)

    def failure(
        self, result: StepResult, displacement: np.ndarray, factor: float
    ) -> SimulationError:
        """Return the error of a step from an equilibrium that could not be made to converge."""
        model = self.problem.model
        residual = self.balance(result.displacement, result.load_factor).residual
        supported = self.problem.held
        if self.problem.held_middle is not None:
            supported = supported | np.tile(self.problem.held_middle, 2)
        size = np.linalg.norm(np.where(supported, 0.0, residual), axis=0)
        node = int(np.argmax(size))
        x, y, z = model.node_positions[node]
        start = self.lowest_stiffness(np.zeros_like(displacement), 0.0)
        left = self.lowest_stiffness(displacement, factor) / start if start else 0.0
        cause = LIMIT_POINT if left < NEARLY_SINGULAR else STEPS_TOO_LARGE
        return SimulationError(
            f"no equilibrium was found beyond the load factor {factor:.6g} ({result.cause} after "
            f"{result.iterations} iterations, relative residual {result.residual:.3g}). "
            f"The largest out-of-balance force is {size[node]:.3g} N at node {node}, initially at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m. The lowest stiffness before is {left:.2g} of that at "
            f"the start. Likely cause: {cause}"
        )

    def lowest_stiffness(self, displacement: np.ndarray, factor: float) -> float:
        """Return the lowest eigenvalue of the tangent at an equilibrium, 0 where it is singular.

        By inverse iteration, without its sign; in the scaled unknowns of the system [N/m].
        """
        state = linearise(self.problem.model, displacement)
        K = self.system.assemble(state.stiffness, self._load_stiffness(displacement, factor))
        try:
            factors = self.system.factorise(K)
        except RuntimeError:
            return 0.0
        mode = np.ones(self.system.Z.shape[1])
        for _ in range(INVERSE_ITERATIONS):
            mode = factors.solve(mode / np.linalg.norm(mode))
        return 1.0 / float(np.linalg.norm(mode))

    def _plausible(self, move):
        """Whether a correction is finite and no larger than a few times the sheet."""
        return bool(np.all(abs(move) < LARGEST_MOVE * self.size))  # false for not-a-numbers

    def _extrapolated(self, state, move):
        """Return the resultants (E, 42) predicted linearly over the displacement ``move``."""
        modes = self.system.modes(move)
        return state.resultants + np.einsum("eij,ej->ei", state.resultant_gradient, modes)

    def _load_stiffness(self, displacement, factor):
        """Return blocks (pairs, (n, 3, 3)) of -∂f/∂d of the couples on the director unknowns."""
        if not self.problem.couples:
            return None
        directors = self.problem.directors(displacement)
        blocks = [
            -factor * couple.force_and_gradient(directors[couple.pairs])[1]
            for couple in self.problem.couples
        ]
        pairs = np.concatenate([couple.pairs for couple in self.problem.couples])
        return pairs, np.concatenate(blocks)

    def _failed(self, displacement, factor, iteration, cause, length=0.0):
        relative = self.balance(displacement, factor).relative
        return StepResult(False, factor, displacement, iteration, relative, cause, None, length)


def unsettled(move: np.ndarray) -> str:
    """Return how an iteration without an end ends: forces alone may be in balance already."""
    return f"no convergence, the last correction still moves it by {abs(move).max():.2g} m"
