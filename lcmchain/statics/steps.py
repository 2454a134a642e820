"""Steps from one equilibrium to the next: what a step returns, and how large the next one is.

Steps are halved where an iteration fails and grow where it succeeds quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lcmchain.statics.convergence import FORCE_TOLERANCE
from lcmchain.statics.newton import Newton
from lcmchain.statics.problem import StaticProblem

# An iteration that needs at most this many corrections lets the next step grow.
QUICK_ITERATIONS = 6
GROWTH = 1.5
SMALLEST_STEP = 1e-4  # relative to the first one


class StaticStep(NamedTuple):
    """A converged state.

    load_factor : displacement : (3, node_count) [m]; iterations : corrections it took.
    residual : out-of-balance force over loads and reactions.
    """

    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float


def solve(
    problem: StaticProblem,
    load_factors: Sequence[float] | np.ndarray,
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
    newton = Newton(problem, force_tolerance)
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
                raise newton.failure(result, displacement, factor)
        history.append(StaticStep(factor, displacement, result.iterations, result.residual))
    return history
