"""Load steps from one equilibrium to the next, past limit points where they are asked to be."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lcmchain.errors import SimulationError
from lcmchain.statics.arc_length import pass_limit
from lcmchain.statics.control import GROWTH, QUICK_ITERATIONS, SMALLEST_STEP, StaticStep
from lcmchain.statics.convergence import FORCE_TOLERANCE
from lcmchain.statics.newton import Newton
from lcmchain.statics.problem import StaticProblem

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
