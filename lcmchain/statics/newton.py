"""Newton's method for the equilibrium of a sheet at a given load factor.

Forces are those of the compiled element kernel, the tangent is its exact derivative
(``elements/solid_shell/tangent.py``). The geometric stiffness takes the stress resultants
extrapolated linearly over the last correction instead of those of the corrected displacement
("mixed integration points": Magisano, Leonetti, Garcea, Int. J. Numer. Meth. Engng 109 (2017)
1237). Newton's method of the displacements takes rotations of a stiff sheet for huge membrane
stresses; this one does not, and converges over load steps that are many times larger. The
equilibrium found is the same.

Two conditions tell equilibrium, because each alone can deceive: a soft sheet moves far under a
small force, a stiff one stands still under a large one. Forces: what is out of balance is small
beside loads and reactions, or no more than the round-off of the internal forces, below which no
iteration gets. Energy: the last correction did little work beside the first one of the step or,
where a small step starts within the tolerance already, beside the work of all forces so far or that
of the round-off.

Round-off is measured. Internal forces do not depend on where the sheet is, so those of the same
shape moved aside differ by nothing else. In thin sheets it is far above the machine's precision:
the thickness is a small difference of large coordinates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.errors import SimulationError
from lcmchain.statics.linear import PairSystem
from lcmchain.statics.problem import StaticProblem, nodal_forces

# --- acceleration ---------------------------------------------------------------------------------


# Corrections closer to one direction than this (cosine) follow one another on the same line.
SAME_LINE = 0.95
# Corrections shrink more slowly than this: Newton's method no longer converges quadratically.
SLOW = 0.3
# Corrections below this part of the largest one are close to the end. Before, Newton's method finds
# its way along the path, and another move may lead it to another one: there only corrections that
# swing to and fro twice in succession are stopped.
CLOSE = 0.05


class SecantAcceleration:
    """Acceleration of an iteration that closes in on its end along one direction.

    It remembers the last correction and the move that was made instead of it. The tangent leaves
    out what elements share with their neighbours (``elements/solid_shell/curvature.py``). Where a
    sheet folds within a few elements, corrections then change by a constant factor instead of
    vanishing faster and faster, along nearly the same direction; they may even swing to and fro and
    grow. Two in succession show that factor, and with it the end.

    Source: Anderson acceleration of depth one (Walker, Ni: SIAM J. Numer. Anal. 49 (2011) 1715).
    """

    def __init__(self) -> None:
        self._correction: np.ndarray | None = None
        self._move: np.ndarray | None = None
        self._largest = 0.0
        self._swings = 0
        self._is_slow = False

    def move(self, correction: np.ndarray) -> np.ndarray:
        """Return the move to make for a ``correction`` of the unknowns.

        The correction is zero at the end; between its values before and after the last move it is
        taken to be linear.
        """
        move = correction
        size = float(np.linalg.norm(correction))
        self._largest = max(self._largest, size)
        if self._correction is not None and self._move is not None:
            last_size = float(np.linalg.norm(self._correction))
            along = float(correction @ self._correction) / last_size
            self._swings = self._swings + 1 if along < -SAME_LINE * size else 0
            creeps = along > SAME_LINE * size and size < last_size
            self._is_slow = self._is_slow or size > SLOW * last_size
            is_close = size < CLOSE * self._largest
            if self._is_slow and (is_close and (creeps or self._swings) or self._swings > 1):
                change = correction - self._correction
                part = (correction @ change) / (change @ change)
                move = correction - part * (self._move + change)
        self._correction, self._move = correction, move
        return move


# --- when an iteration has found equilibrium ------------------------------------------------------


# Out-of-balance force over loads and reactions.
FORCE_TOLERANCE = 1e-6
# Energy of the last correction over that of the first one of the step.
ENERGY_TOLERANCE = 1e-8
# Energy of the last correction over the work of all forces: 1e-6 of the displacements.
WORK_TOLERANCE = 1e-12
# Out-of-balance forces up to this multiple of the measured round-off are taken for round-off.
ROUND_OFF_MARGIN = 2.0
# By how much of its size the sheet is moved aside to measure it: no round numbers.
ASIDE = np.array([[0.371], [0.613], [-0.437]])


class Balance(NamedTuple):
    """Forces of a state and what they are measured by.

    residual : (3, node_count) loads less internal forces [N]; at supports less their reaction.
    free : norm of its part on the unknowns [N]; scale : norms of loads and reactions [N].
    round_off : norm of the round-off of the internal forces on the unknowns [N].
    work : of all forces on the displacements, without regard to signs [J].
    """

    residual: np.ndarray
    free: float
    scale: float
    round_off: float
    work: float

    @property
    def relative(self) -> float:
        """Out-of-balance force over loads and reactions; 0 without any."""
        return self.free / self.scale if self.scale else 0.0

    @property
    def within_round_off(self) -> bool:
        return self.free <= ROUND_OFF_MARGIN * self.round_off


def balance(
    problem: StaticProblem, system: PairSystem, displacement: np.ndarray, factor: float, size: float
) -> Balance:
    """Return the balance of forces of a displacement (3, node_count) [m] at a load factor.

    ``size`` [m] is that of the sheet.
    """
    external = factor * problem.external_forces(displacement)
    internal = nodal_forces(problem.model, displacement)
    aside = nodal_forces(problem.model, displacement + size * ASIDE)
    residual = external - internal
    return Balance(
        residual,
        free=float(np.linalg.norm(system.reduce(residual))),
        scale=float(np.linalg.norm(external) + np.linalg.norm(residual)),
        round_off=float(np.linalg.norm(system.reduce(aside - internal))),
        work=float(abs(internal * displacement).sum()),
    )


def in_equilibrium(
    after: Balance,
    correction: np.ndarray,
    energy: float,
    first_energy: float,
    force_tolerance: float,
) -> bool:
    """Tell whether a correction has led to equilibrium.

    Parameters
    ----------
    after : balance that it led to.
    correction : of the unknowns.
    energy, first_energy : work of the forces that were out of balance on this correction and on the
        first one of the step [J].
    force_tolerance : of the out-of-balance force over loads and reactions.
    """
    if not (after.free <= force_tolerance * after.scale or after.within_round_off):
        return False
    least_energy = ROUND_OFF_MARGIN * after.round_off * np.linalg.norm(correction)
    return bool(
        energy <= ENERGY_TOLERANCE * first_energy
        or energy <= WORK_TOLERANCE * after.work
        or energy <= least_energy
    )


# --- the iteration --------------------------------------------------------------------------------


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
