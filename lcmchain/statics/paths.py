"""Equilibrium paths: load steps, and arcs where the load factor may fall.

Steps are halved where an iteration fails and grow where it succeeds quickly. The arc is measured by
the displacements (cylindrical constraint: Crisfield, Comput. Struct. 13 (1981) 55), the constraint
is solved together with equilibrium by Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.errors import SimulationError
from lcmchain.statics.newton import (
    FORCE_TOLERANCE,
    MAXIMUM_ITERATIONS,
    Newton,
    SecantAcceleration,
    StepResult,
    in_equilibrium,
    unsettled,
)
from lcmchain.statics.problem import StaticProblem

# An iteration that needs at most this many corrections lets the next step grow.
QUICK_ITERATIONS = 6
GROWTH = 1.5
SMALLEST_STEP = 1e-4  # relative to the first one


class StaticStep(NamedTuple):
    """A converged state.

    load_factor : of all loads. displacement : (3, node_count) [m].
    iterations : corrections it took.
    residual : out-of-balance force over loads and reactions.
    """

    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float


# --- arcs -----------------------------------------------------------------------------------------


# Arcs after which a limit point counts as not to be passed.
MOST_ARCS = 200


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

    The load factor is an unknown and may fall where the sheet snaps through or back.

    Parameters
    ----------
    first_step : load factor of the first step, which fixes the first arc length.
    largest_step : limit of the arc length relative to the first one.

    Raises
    ------
    SimulationError : an arc cannot be made to converge, or ``maximum_steps`` do not suffice.
    """
    newton = NewtonOnArc(problem, force_tolerance)
    start = np.zeros((3, problem.model.node_count))
    history: list[StaticStep] = []
    for step in islice(newton.path(start, 0.0, first_step, largest_step), maximum_steps):
        history.append(step)
        if on_step is not None:
            on_step(step)
        if step.load_factor >= last_factor:
            return history
    raise SimulationError(
        f"the arc-length method has made {maximum_steps} steps and only reached the load factor "
        f"{history[-1].load_factor:.4g} of {last_factor:.4g}; allow larger or more steps"
    )


def pass_limit(
    problem: StaticProblem, limit: StaticStep, target: float, step: float, force_tolerance: float
) -> Iterator[StaticStep]:
    """Follow the path from just before a limit point until the load has fallen and rises again.

    It also ends where it comes to ``target``, back to the unloaded sheet, or after
    :data:`MOST_ARCS`.

    Parameters
    ----------
    limit : the last equilibrium that load control has found.
    target : load factor that lies beyond the limit.
    step : size of the first step of the load factor, towards the target.
    """
    newton = NewtonOnArc(problem, force_tolerance)
    sign = 1.0 if target > limit.load_factor else -1.0
    last, has_fallen = limit.load_factor, False
    path = newton.path(limit.displacement, limit.load_factor, sign * step, np.inf)
    for state in islice(path, MOST_ARCS):
        yield state
        rises = sign * (state.load_factor - last) > 0.0
        at_target = sign * (state.load_factor - target) >= 0.0
        unloaded = state.load_factor * limit.load_factor <= 0.0
        if at_target or unloaded or (has_fallen and rises):
            return
        last, has_fallen = state.load_factor, has_fallen or not rises


class NewtonOnArc(Newton):
    """Newton's method with the load factor as an unknown, at a given arc length."""

    def path(
        self, displacement: np.ndarray, factor: float, first_step: float, largest_step: float
    ) -> Iterator[StaticStep]:
        """Yield the equilibria along the path from an equilibrium, without end.

        ``first_step`` of the load factor fixes the first arc length, ``largest_step`` limits the
        others relative to it.
        """
        length: float | None = None
        previous: np.ndarray | None = None
        while True:
            result = self.correct_on_arc(displacement, factor, first_step, length, previous)
            if length is None:
                first_length = length = result.length
            if not result.converged:
                length *= 0.5
                if length < SMALLEST_STEP * first_length:
                    raise self.failure(result, displacement, factor)
                continue
            factor, previous = result.load_factor, result.change
            displacement = result.displacement
            yield StaticStep(factor, displacement, result.iterations, result.residual)
            if result.iterations <= QUICK_ITERATIONS:
                length = min(GROWTH * length, largest_step * first_length)

    def correct_on_arc(
        self,
        start: np.ndarray,
        factor: float,
        first_step: float,
        length: float | None,
        previous: np.ndarray | None,
    ) -> StepResult:
        """Find equilibrium at the arc length ``length`` from the equilibrium ``start``.

        Without a length the step of the load factor is ``first_step``. ``previous`` is the change
        of the unknowns over the last step, which the path goes on from.
        """
        system, problem = self.system, self.problem
        displacement, start_factor = start, factor
        resultants, first_energy, change = None, None, None
        acceleration = SecantAcceleration()
        now = self.balance(displacement, factor)
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
                    step = length / float(np.linalg.norm(along))
                    step *= np.sign(previous @ along) if previous is not None else 1.0
                else:
                    length = abs(step) * float(np.linalg.norm(along))
                correction, energy = step * along, abs(step * step * (along @ load))
                change = correction
            else:
                right = system.reduce(now.residual)
                towards = factors.solve(right)
                miss = 0.5 * (change @ change - length**2)  # type: ignore[operator]
                step = -(miss + change @ towards) / (change @ along)
                correction = towards + step * along
                energy = abs(correction @ (right + step * load))
                *moved, step = acceleration.move(np.append(correction, step))
                correction = np.array(moved)
                change = change + correction
            factor += step
            move = system.expand(correction) + step * problem.prescribed
            if not self._plausible(move):
                return self._failed(displacement, factor, iteration, "divergence", length)
            displacement = displacement + move
            first_energy = energy if first_energy is None else first_energy
            now = self.balance(displacement, factor)
            if in_equilibrium(now, correction, energy, first_energy, self.force_tolerance):
                if previous is not None and change @ previous < 0.0:
                    return self._failed(displacement, factor, iteration, "turned back", length)
                return StepResult(
                    True,
                    factor,
                    displacement,
                    iteration,
                    now.relative,
                    "",
                    change,
                    length,  # type: ignore[arg-type]
                )
            resultants = self._extrapolated(state, move)
        return self._failed(displacement, start_factor, iteration, unsettled(move), length)


# --- load steps -----------------------------------------------------------------------------------


MOST_LIMITS = 50  # limit points that a path may pass


def solve(
    problem: StaticProblem,
    load_factors: Sequence[float] | np.ndarray,
    *,
    first_step: float | None = None,
    largest_step: float | None = None,
    past_limits: bool = False,
    force_tolerance: float = FORCE_TOLERANCE,
    on_step: Callable[[StaticStep], None] | None = None,
) -> list[StaticStep]:
    """Return the equilibria at the given load factors, reached from 0 one after the other.

    Parameters
    ----------
    load_factors : in the order in which they are to be reached.
    first_step, largest_step : of the load factor; by default the first load factor, and no limit.
    past_limits : where a load cannot be raised further, follow the path by its arc length until the
        load has fallen and rises again: the sheet snaps through.
    force_tolerance : out-of-balance force over loads and reactions.
    on_step : called with every converged state, those between the load factors too.

    Raises
    ------
    SimulationError : a step cannot be made to converge; names load factor and node.
    """
    step = first_step if first_step is not None else abs(load_factors[0])
    limit = largest_step if largest_step is not None else np.inf
    loading = _Loading(problem, force_tolerance, step, limit, past_limits)
    history = []
    for target in load_factors:
        for state in loading.towards(target):
            if on_step is not None:
                on_step(state)
        history.append(loading.state)
    return history


class _Loading:
    """Load control: the equilibrium reached, and the size of the next step."""

    def __init__(
        self,
        problem: StaticProblem,
        force_tolerance: float,
        first_step: float,
        largest_step: float,
        past_limits: bool,
    ) -> None:
        self.problem = problem
        self.newton = Newton(problem, force_tolerance)
        self.step = first_step
        self.smallest = SMALLEST_STEP * first_step
        self.largest = largest_step
        self.limits_left = MOST_LIMITS if past_limits else 0
        self.state = StaticStep(0.0, np.zeros((3, problem.model.node_count)), 0, 0.0)

    def towards(self, target: float) -> Iterator[StaticStep]:
        """Yield the equilibria on the way to a load factor, its own as the last one."""
        while (factor := self.state.load_factor) != target:
            remaining = target - factor
            size = min(self.step, self.largest)
            increment = float(np.clip(remaining, -size, size))
            # no sliver of a step before the target
            if abs(increment) < abs(remaining) < 1.5 * abs(increment):
                increment = 0.5 * remaining
            next_factor = target if increment == remaining else factor + increment
            result = self.newton.correct(self.state.displacement, factor, next_factor)
            if result.converged:
                self.state = StaticStep(
                    next_factor, result.displacement, result.iterations, result.residual
                )
                yield self.state
                if result.iterations <= QUICK_ITERATIONS:
                    self.step = max(self.step, GROWTH * abs(increment))
                continue
            self.step = 0.5 * abs(increment)
            if self.step < self.smallest:
                failure = self.newton.failure(result, self.state.displacement, factor)
                if self.limits_left == 0 or factor == 0.0:
                    raise failure
                yield from self._past_the_limit(target, failure)

    def _past_the_limit(self, target: float, failure: SimulationError) -> Iterator[StaticStep]:
        """Yield the equilibria along the path past a limit point; raise ``failure`` if none is."""
        limit, last = self.state, self.state
        tolerance = self.newton.force_tolerance
        for state in pass_limit(self.problem, limit, target, self.smallest, tolerance):
            last, self.state = self.state, state
            yield state
        rise = self.state.load_factor - last.load_factor
        if rise * (target - limit.load_factor) <= 0.0:
            raise failure
        self.limits_left -= 1
        self.step = abs(rise)
