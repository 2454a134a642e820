"""Measuring: medians over repetitions, in microseconds per element and step."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.compilation.threads import use_threads
from lcmchain.elements.family import internal_forces
from lcmchain.jit import entry
from lcmchain.solver.simulation import Simulation

REPETITIONS = 11
KERNEL_CALLS = 200


@dataclass(frozen=True)
class Measurement:
    """Median [µs per element and step] with the smallest and largest of the repetitions."""

    name: str
    threads: int
    median: float
    least: float
    most: float


def measure(
    name: str,
    threads: int | None,
    element_steps: int,
    work: Callable[[], None],
    repetitions: int = REPETITIONS,
) -> Measurement:
    """Time ``work``, which makes ``element_steps`` element steps; once more before, unmeasured."""
    used = use_threads(threads)
    work()
    samples = []
    for _ in range(repetitions):
        start = time.perf_counter()
        work()
        samples.append(1e6 * (time.perf_counter() - start) / element_steps)
    return Measurement(name, used, statistics.median(samples), min(samples), max(samples))


def median_of(turns: Sequence[Measurement]) -> Measurement:
    """Return the median of the same measurement made several times."""
    return Measurement(
        turns[0].name,
        turns[0].threads,
        statistics.median(turn.median for turn in turns),
        min(turn.least for turn in turns),
        max(turn.most for turn in turns),
    )


@entry
def repeated_forces(data, position, corner_force, history, count):
    """Evaluate the internal forces of a body so often, without going back to Python."""
    for _ in range(count):
        internal_forces(data, position, corner_force, history)


def kernel_work(simulation: Simulation, data: Any, calls: int = KERNEL_CALLS) -> Callable[[], None]:
    """Return ``calls`` evaluations of the internal forces at the present positions.

    ``data`` are the constants of the body: those of the simulation's, or others of the same mesh.
    """
    position = simulation.state.position
    corner_force = np.zeros(simulation.model.corner_force_size)
    history = np.zeros(simulation.model.history_size)

    def work() -> None:
        repeated_forces(data, position, corner_force, history, calls)

    return work
