"""Quasi-static equilibrium of a sheet: Newton's method, arc length, linear analyses.

Forces are those of the compiled element kernel, the tangent is its exact derivative
(``elements/solid_shell/tangent.py``). Three things make it work for thin, very anisotropic sheets:

- Unknowns are the mean and the half difference of each pair of a bottom and a top node, the latter
  scaled by thickness over edge length. The tangent is built in them, so that the large stiffness
  through the thickness never cancels against itself: a sheet of slenderness 10⁴ has the condition
  number of a shear-flexible plate instead of one that exhausts double precision.
- The geometric stiffness takes the stress resultants extrapolated linearly over the last correction
  instead of those of the corrected displacement ("mixed integration points": Magisano, Leonetti,
  Garcea, Int. J. Numer. Meth. Engng 109 (2017) 1237). Newton's method of the displacements takes
  rotations of a stiff sheet for huge membrane stresses; this one does not, and converges over load
  steps that are many times larger. The equilibrium found is the same.
- Steps are halved where an iteration fails and grow where it succeeds quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.tangent import PAIR_MODES, linearise, node_stiffness
from lcmchain.errors import InputError, SimulationError
from lcmchain.model import Model

MAXIMUM_ITERATIONS = 20
# Out-of-balance force relative to loads and reactions, and energy of the last correction relative
# to that of the first one of the step: both must hold.
FORCE_TOLERANCE = 1e-6
ENERGY_TOLERANCE = 1e-8
# An iteration that needs at most this many corrections lets the next step grow.
QUICK_ITERATIONS = 6
GROWTH = 1.5
SMALLEST_STEP = 1e-4  # relative to the first one
# Strain whose force over the whole sheet counts as round-off: a sheet that only turns has no force
# to compare with.
NEGLIGIBLE_STRAIN = 1e-13
LARGEST_MOVE = 10.0  # correction of a displacement over the size of the sheet


class DirectorCouples(NamedTuple):
    """Couples that follow the director of node pairs: a moment about a fixed axis.

    The pair of opposite forces stays normal to the line from bottom to top node and to the axis; in
    the plane normal to the axis it has the potential -M θ.

    pairs : (n,) numbers of the pairs.
    axis : (3,) unit vector.
    moments : (n,) [N m] at load factor 1.
    """

    pairs: np.ndarray
    axis: np.ndarray
    moments: np.ndarray

    def force_and_gradient(self, director: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the force (n, 3) on the top nodes and its derivative (n, 3, 3).

        ``director`` (n, 3) points from the bottom to the top nodes; the bottom nodes get the
        opposite force.
        """
        in_plane = np.eye(3) - np.outer(self.axis, self.axis)
        x, y, z = self.axis
        turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        d = director @ in_plane
        square = np.einsum("nd,nd->n", d, d)[:, None]
        force = self.moments[:, None] * (d @ turn.T) / square
        gradient = self.moments[:, None, None] * turn / square[..., None]
        gradient = gradient - 2.0 * force[:, :, None] * d[:, None, :] / square[..., None]
        return force, gradient


@dataclass(frozen=True, kw_only=True)
class StaticProblem:
    """A sheet with supports and loads; everything below is scaled by the load factor.

    Parameters
    ----------
    model : with one element over the thickness, node ``i + pair_count`` above node ``i``.
    held : (3, node_count) bool, displacement components that are prescribed.
    held_middle : (3, pair_count) bool, components in which the mid-surface is held in place while
        the director is free: a hinge that remains one under large rotations, unlike two held faces.
    forces : (3, node_count) dead loads [N]; none by default.
    gravity : (3,) acceleration [m/s²] that acts on the nodal masses.
    displacements : (3, node_count) [m] prescribed where ``held``; 0 by default.
    couples : moments that follow the directors.

    Raises
    ------
    InputError : arrays that do not fit the model, or supports that let the sheet move rigidly.
    """

    model: Model
    held: np.ndarray
    forces: np.ndarray | None = None
    gravity: Sequence[float] = (0.0, 0.0, 0.0)
    displacements: np.ndarray | None = None
    couples: tuple[DirectorCouples, ...] = ()
    held_middle: np.ndarray | None = None
    dead_forces: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        shape = (3, self.model.node_count)
        for name in ("held", "forces", "displacements"):
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(f"must have the shape {shape}, not {np.shape(value)}", key=name)
        elements, pair_count = self.model.blank.elements, self.model.blank.pair_count
        if self.held_middle is not None and np.shape(self.held_middle) != (3, pair_count):
            shape = np.shape(self.held_middle)
            raise InputError(
                f"must have the shape {(3, pair_count)}, not {shape}", key="held_middle"
            )
        if not np.array_equal(elements[:, 4:], elements[:, :4] + pair_count):
            raise InputError(
                "the static solver needs one element over the thickness, with node i + n/2 above "
                "node i",
                key="model",
            )
        _require_supports(self.model, self.held, self.held_middle)
        forces = np.zeros(shape) if self.forces is None else np.array(self.forces, dtype=float)
        forces += np.outer(self.gravity, self.model.nodes.mass)
        object.__setattr__(self, "dead_forces", forces)

    @property
    def prescribed(self) -> np.ndarray:
        """Prescribed displacements (3, node_count) [m] at load factor 1; 0 elsewhere."""
        if self.displacements is None:
            return np.zeros((3, self.model.node_count))
        return np.where(self.held, self.displacements, 0.0)

    def directors(self, displacement: np.ndarray) -> np.ndarray:
        """Return the vectors (pair_count, 3) [m] from bottom to top nodes."""
        position = self.model.blank.node_positions + displacement.T
        n = self.model.blank.pair_count
        return position[n:] - position[:n]

    def external_forces(self, displacement: np.ndarray) -> np.ndarray:
        """Return the loads (3, node_count) [N] at load factor 1."""
        forces = self.dead_forces.copy()
        if self.couples:
            directors = self.directors(displacement)
            n = self.model.blank.pair_count
            for couple in self.couples:
                force, _ = couple.force_and_gradient(directors[couple.pairs])
                np.add.at(forces.T, couple.pairs + n, force)
                np.add.at(forces.T, couple.pairs, -force)
        return forces


def _require_supports(model: Model, held: np.ndarray, held_middle=None) -> None:
    """Require that no rigid motion leaves all held components in place."""
    held = np.asarray(held, dtype=bool)
    if held_middle is not None:
        held = held | np.tile(held_middle, 2)
    centred = model.blank.node_positions - model.blank.node_positions.mean(axis=0)
    centred = centred / abs(centred).max()
    motions = [np.tile(axis, (len(centred), 1)) for axis in np.eye(3)]
    motions += [np.cross(axis, centred) for axis in np.eye(3)]
    at_supports = np.array([motion.T[held] for motion in motions])
    if np.linalg.matrix_rank(at_supports) < 6:
        raise InputError("lets the sheet move rigidly; hold more components", key="held")


class StaticStep(NamedTuple):
    """A converged state.

    load_factor : displacement : (3, node_count) [m]; iterations : corrections it took.
    residual : out-of-balance force over loads and reactions.
    """

    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float


# --- the nonlinear solver -------------------------------------------------------------------------


def solve(
    problem: StaticProblem,
    load_factors: Sequence[float],
    *,
    first_step: float | None = None,
    largest_step: float | None = None,
    force_tolerance: float = FORCE_TOLERANCE,
    on_step: Callable[[StaticStep], None] | None = None,
) -> list[StaticStep]:
    """Return the equilibria at the given load factors, reached from 0 one after the other.

    Parameters
    ----------
    load_factors : in the order in which they are to be reached.
    first_step, largest_step : of the load factor; by default the first load factor, and no limit.
    force_tolerance : out-of-balance force over loads and reactions.
    on_step : called with every converged state, those between the load factors too.

    Raises
    ------
    SimulationError : a step cannot be made to converge; names load factor and node.
    """
    newton = _Newton(problem, force_tolerance)
    factor, displacement = 0.0, np.zeros((3, problem.model.node_count))
    step = first_step if first_step is not None else abs(load_factors[0])
    smallest = SMALLEST_STEP * step
    limit = largest_step if largest_step is not None else np.inf
    history = []
    for target in load_factors:
        while factor != target:
            remaining = target - factor
            increment = float(np.clip(remaining, -min(step, limit), min(step, limit)))
            # no sliver of a step before the target
            if abs(increment) < abs(remaining) < 1.5 * abs(increment):
                increment = 0.5 * remaining
            next_factor = target if increment == remaining else factor + increment
            result = newton.correct(displacement, factor, next_factor)
            if result.converged:
                factor, displacement = next_factor, result.displacement
                done = StaticStep(factor, displacement, result.iterations, result.residual)
                if on_step is not None:
                    on_step(done)
                if result.iterations <= QUICK_ITERATIONS:
                    step = max(step, GROWTH * abs(increment))
                continue
            step = 0.5 * abs(increment)
            if step < smallest:
                raise newton.failure(result, factor)
        history.append(StaticStep(factor, displacement, result.iterations, result.residual))
    return history


def trace(
    problem: StaticProblem,
    last_factor: float,
    *,
    first_step: float,
    largest_step: float = np.inf,
    maximum_steps: int = 1000,
    force_tolerance: float = FORCE_TOLERANCE,
    on_step: Callable[[StaticStep], None] | None = None,
) -> list[StaticStep]:
    """Follow the equilibrium path by its arc length until the load factor passes ``last_factor``.

    The load factor is an unknown and may fall where the sheet snaps through or back. The arc is
    measured by the displacements (cylindrical constraint: Crisfield, Comput. Struct. 13 (1981) 55),
    the constraint is solved together with equilibrium by Newton's method.

    Parameters
    ----------
    first_step : load factor of the first step, which fixes the first arc length.
    largest_step : limit of the arc length relative to the first one.

    Raises
    ------
    SimulationError : an arc cannot be made to converge, or ``maximum_steps`` do not suffice.
    """
    newton = _Newton(problem, force_tolerance)
    factor, displacement = 0.0, np.zeros((3, problem.model.node_count))
    history = []
    length = previous = None
    while len(history) < maximum_steps:
        result = newton.correct_on_arc(displacement, factor, first_step, length, previous)
        if length is None:
            first_length = length = result.length
        if not result.converged:
            length *= 0.5
            if length < SMALLEST_STEP * first_length:
                raise newton.failure(result, factor)
            continue
        factor, previous = result.load_factor, result.change
        displacement = result.displacement
        history.append(StaticStep(factor, displacement, result.iterations, result.residual))
        if on_step is not None:
            on_step(history[-1])
        if factor >= last_factor:
            return history
        if result.iterations <= QUICK_ITERATIONS:
            length = min(GROWTH * length, largest_step * first_length)
    raise SimulationError(
        f"the arc-length method has made {maximum_steps} steps and only reached the load factor "
        f"{factor:.4g} of {last_factor:.4g}; allow larger or more steps"
    )


class _Result(NamedTuple):
    """Outcome of one step; ``change`` (unknowns) and ``length`` serve the arc-length method."""

    converged: bool
    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float
    cause: str = ""
    change: np.ndarray | None = None
    length: float = 0.0


class _Newton:
    """Newton's method with extrapolated stress resultants, at a given load or on a given arc."""

    def __init__(self, problem: StaticProblem, force_tolerance: float):
        self.problem = problem
        self.force_tolerance = force_tolerance
        self.size = float(np.ptp(problem.model.blank.node_positions, axis=0).max())
        material = problem.model.material
        stiffness = material.stress_and_tangent(np.zeros(6))[1].max()
        section = self.size * material.thickness
        self.negligible_force = NEGLIGIBLE_STRAIN * stiffness * section
        self.system = PairSystem(problem.model, problem.held, problem.held_middle)

    def correct(self, displacement, factor, next_factor) -> _Result:
        """Find equilibrium at ``next_factor`` from the equilibrium ``displacement``."""
        system = self.system
        support_motion = (next_factor - factor) * self.problem.prescribed
        resultants, first_energy = None, None
        for iteration in range(1, MAXIMUM_ITERATIONS + 1):
            state = linearise(self.problem.model, displacement, resultants)
            K = system.assemble(state.stiffness, self._load_stiffness(displacement, next_factor))
            residual, _ = self._out_of_balance(displacement, next_factor)
            right = system.reduce(residual)
            if iteration == 1:
                right = right - system.reduced_product(K, support_motion)
            else:
                support_motion = np.zeros_like(displacement)
            try:
                correction = system.factorise(K).solve(right)
            except RuntimeError:
                return self._failed(displacement, next_factor, iteration, "singular tangent")
            move = system.expand(correction) + support_motion
            if not self._plausible(move):
                return self._failed(displacement, next_factor, iteration, "divergence")
            displacement = displacement + move
            energy = abs(correction @ right)
            first_energy = energy if first_energy is None else first_energy
            residual, relative = self._out_of_balance(displacement, next_factor)
            if self._converged(relative, energy, first_energy):
                return _Result(True, next_factor, displacement, iteration, relative)
            resultants = self._extrapolated(state, move)
        return self._failed(displacement, next_factor, iteration, "no convergence")

    def correct_on_arc(self, start, factor, first_step, length, previous) -> _Result:
        """Find equilibrium at the arc length ``length`` from the equilibrium ``start``.

        Without a length the step of the load factor is ``first_step``. ``previous`` is the change
        of the unknowns over the last step, which the path goes on from.
        """
        system, problem = self.system, self.problem
        displacement, start_factor = start, factor
        resultants, first_energy, change = None, None, None
        for iteration in range(1, MAXIMUM_ITERATIONS + 1):
            state = linearise(problem.model, displacement, resultants)
            K = system.assemble(state.stiffness, self._load_stiffness(displacement, factor))
            try:
                factors = system.factorise(K)
            except RuntimeError:
                return self._failed(displacement, factor, iteration, "singular tangent", length)
            load = system.reduce(problem.external_forces(displacement))
            load = load - system.reduced_product(K, problem.prescribed)
            along = factors.solve(load)
            if change is None:
                step = first_step
                if length is not None:
                    step = length / np.linalg.norm(along)
                    step *= np.sign(previous @ along) if previous is not None else 1.0
                else:
                    length = abs(step) * np.linalg.norm(along)
                correction, energy = step * along, abs(step * step * (along @ load))
                change = correction
            else:
                residual, _ = self._out_of_balance(displacement, factor)
                right = system.reduce(residual)
                towards = factors.solve(right)
                miss = 0.5 * (change @ change - length**2)
                step = -(miss + change @ towards) / (change @ along)
                correction = towards + step * along
                energy = abs(correction @ (right + step * load))
                change = change + correction
            factor += step
            move = system.expand(correction) + step * problem.prescribed
            if not self._plausible(move):
                return self._failed(displacement, factor, iteration, "divergence", length)
            displacement = displacement + move
            first_energy = energy if first_energy is None else first_energy
            residual, relative = self._out_of_balance(displacement, factor)
            if self._converged(relative, energy, first_energy):
                if previous is not None and change @ previous < 0.0:
                    return self._failed(displacement, factor, iteration, "turned back", length)
                return _Result(True, factor, displacement, iteration, relative, "", change, length)
            resultants = self._extrapolated(state, move)
        return self._failed(displacement, start_factor, iteration, "no convergence", length)

    def failure(self, result: _Result, factor: float) -> SimulationError:
        """Return the error of a step that could not be made to converge."""
        model = self.problem.model
        residual, _ = self._out_of_balance(result.displacement, result.load_factor)
        supported = self.problem.held
        if self.problem.held_middle is not None:
            supported = supported | np.tile(self.problem.held_middle, 2)
        size = np.linalg.norm(np.where(supported, 0.0, residual), axis=0)
        node = int(np.argmax(size))
        x, y, z = model.blank.node_positions[node]
        return SimulationError(
            f"no equilibrium was found beyond the load factor {factor:.6g} ({result.cause} after "
            f"{result.iterations} iterations, relative residual {result.residual:.3g}). "
            f"The largest out-of-balance force is {size[node]:.3g} N at node {node}, initially at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m. Likely cause: a limit or bifurcation point; follow "
            "the path by its arc length, prescribe displacements instead of forces, or support the "
            "sheet"
        )

    def _converged(self, relative, energy, first_energy):
        if relative == 0.0:
            return True
        return relative <= self.force_tolerance and energy <= ENERGY_TOLERANCE * first_energy

    def _plausible(self, move):
        """Whether a correction is finite and no larger than a few times the sheet."""
        return bool(np.all(abs(move) < LARGEST_MOVE * self.size))  # false for not-a-numbers

    def _extrapolated(self, state, move):
        """Return the resultants (E, 42) predicted linearly over the displacement ``move``."""
        modes = self.system.modes(move)
        return state.resultants + np.einsum("eij,ej->ei", state.resultant_gradient, modes)

    def _out_of_balance(self, displacement, factor):
        """Return the nodal out-of-balance forces, and their norm over loads and reactions."""
        external = factor * self.problem.external_forces(displacement)
        residual = external - nodal_forces(self.problem.model, displacement)
        free = np.linalg.norm(self.system.reduce(residual))
        if free < self.negligible_force:
            return residual, 0.0
        # the residual at supports is their reaction
        return residual, free / (np.linalg.norm(external) + np.linalg.norm(residual))

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
        _, relative = self._out_of_balance(displacement, factor)
        return _Result(False, factor, displacement, iteration, relative, cause, None, length)


# --- linear analyses ------------------------------------------------------------------------------


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
    _require_supports(model, held)
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


def nodal_forces(model: Model, displacement: np.ndarray) -> np.ndarray:
    """Return the internal forces (3, node_count) [N] of the compiled element kernel."""
    position = np.ascontiguousarray(model.blank.node_positions.T + displacement)
    corner_force = np.zeros(model.corner_force_size)
    internal_forces(model.body.data, position, corner_force, np.empty(0))
    slot = model.nodes.force_slot
    return np.stack([corner_force[slot + d * LANES].sum(axis=0) for d in range(3)])


# --- unknowns -------------------------------------------------------------------------------------


class PairSystem:
    """Equations in means m and scaled half differences q of pairs of a bottom and a top node.

    Bottom and top node are displaced by m ∓ s q with one s = thickness / edge length, so that q,
    edge length times a rotation, is as large as m. Components that are held on both faces are no
    unknowns; where one face is held, the other moves with m = ± s q; where the middle is held, q
    remains.
    """

    def __init__(self, model: Model, held: np.ndarray, held_middle: np.ndarray | None = None):
        self.model = model
        n = self.pair_count = model.blank.pair_count
        geometry = model.geometry
        area = geometry.volume / (2.0 * geometry.height)
        self.scale = s = float(np.mean(geometry.height) / np.mean(np.sqrt(area)))
        basis = PAIR_MODES.copy()
        basis[:, 4:] *= s
        self.basis = basis

        corners = model.blank.elements
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

    def assemble(self, mode_stiffness, load_stiffness=None):
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

    def reduced(self, K):
        """Return the tangent of the unknowns."""
        return (self.Z.T @ K @ self.Z).tocsc()

    def factorise(self, K):
        """Return the LU factors of the unknowns' tangent; RuntimeError if it is singular."""
        # the pattern is symmetric and the diagonal large: pivots may stay on it
        return splu(
            self.reduced(K),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=1e-3,
            options={"SymmetricMode": True},
        )

    def reduced_product(self, K, displacement):
        """Return the unknowns' part of K times a nodal displacement (3, node_count)."""
        if not displacement.any():
            return np.zeros(self.Z.shape[1])
        return self.Z.T @ (K @ self._from_nodes(displacement))

    def reduced_mass(self, mass):
        """Return the mass matrix of the unknowns of lumped nodal masses (node_count,)."""
        n, s = self.pair_count, self.scale
        bottom, top = np.repeat(mass[:n], 3), np.repeat(mass[n:], 3)
        own = np.concatenate([bottom + top, s**2 * (bottom + top)])
        cross = s * (top - bottom)
        M = diags_array([own, cross, cross], offsets=[0, 3 * n, -3 * n])
        return (self.Z.T @ M @ self.Z).tocsc()

    def reduce(self, forces):
        """Return the generalised forces of nodal ones (3, node_count)."""
        n = self.pair_count
        bottom, top = forces[:, :n].T, forces[:, n:].T
        both = np.concatenate([bottom + top, self.scale * (top - bottom)])
        return self.Z.T @ both.ravel()

    def expand(self, unknowns):
        """Return the nodal displacement (3, node_count) of the unknowns."""
        m, q = (self.Z @ unknowns).reshape(2, -1, 3)
        return np.concatenate([m - self.scale * q, m + self.scale * q]).T

    def modes(self, displacement):
        """Return the change (E, 21) of the mode vectors with a nodal displacement."""
        both = self._from_nodes(displacement).reshape(-1, 3)
        modes = np.einsum("kn,end->ekd", self.basis, both[self.model.blank.elements])
        return modes.reshape(-1, 21)

    def _from_nodes(self, displacement):
        n = self.pair_count
        bottom, top = displacement[:, :n].T, displacement[:, n:].T
        both = np.concatenate([0.5 * (top + bottom), 0.5 * (top - bottom) / self.scale])
        return both.ravel()
