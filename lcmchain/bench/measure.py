"""Measuring: what one core can do at most, medians over repetitions, memory of this process."""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.compilation.threads import use_threads
from lcmchain.elements.family import internal_forces
from lcmchain.jit import entry, equation
from lcmchain.solver.simulation import Simulation

PEAK_REPETITIONS = 5
# Numbers that stay in the first cache, in independent chains of operations.
CHAINS = 256
FMAS = 16  # of a number between reading and writing it
ROUNDS = 20_000
# Numbers of each of three arrays, together far beyond the caches of one core.
STREAM = 8_000_000


@dataclass(frozen=True)
class Machine:
    """Largest measured rates of one core.

    arithmetic : of fused multiply-adds in double precision, two operations each [GFLOP/s].
    bandwidth : of reading two arrays and writing a third one [GB/s].
    """

    arithmetic: float
    bandwidth: float


@equation
def four_fmas(x, a, b):
    return (((x * a + b) * a + b) * a + b) * a + b


@entry
def multiply_add(numbers, a, b, rounds):
    """Apply x = a x + b so often to every number: FMAS times in every round."""
    for _ in range(rounds):
        for i in range(numbers.size):
            x = four_fmas(four_fmas(numbers[i], a, b), a, b)
            numbers[i] = four_fmas(four_fmas(x, a, b), a, b)


@entry
def add_scaled(total, first, second, factor):
    """Write first + factor * second to ``total``."""
    for i in range(total.size):
        total[i] = first[i] + factor * second[i]


def measure_machine() -> Machine:
    """Measure one core; takes about a second."""
    numbers = np.ones(CHAINS)
    first, second, total = np.ones(STREAM), np.ones(STREAM), np.zeros(STREAM)
    arithmetic = _shortest(lambda: multiply_add(numbers, 0.5, 0.25, ROUNDS))
    stream = _shortest(lambda: add_scaled(total, first, second, 0.5))
    return Machine(
        arithmetic=2.0 * FMAS * CHAINS * ROUNDS / arithmetic * 1e-9,
        bandwidth=3.0 * first.nbytes / stream * 1e-9,
    )


def _shortest(work: Callable[[], None]) -> float:
    work()
    times = []
    for _ in range(PEAK_REPETITIONS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


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


def kernel_work(
    simulation: Simulation, data: tuple, calls: int = KERNEL_CALLS
) -> Callable[[], None]:
    """Return ``calls`` evaluations of the internal forces at the present positions.

    ``data`` are the constants of the body: those of the simulation's, or others of the same mesh.
    """
    position = simulation.state.position
    corner_force = np.zeros(simulation.model.corner_force_size)
    history = np.zeros(simulation.model.history_size)

    def work() -> None:
        repeated_forces(data, position, corner_force, history, calls)

    return work


# --- memory of this process -----------------------------------------------------------------------


def largest_memory() -> int:
    """Return the most memory that this process has held so far [byte]; 0 where nothing tells it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest if sys.platform == "darwin" else 1024 * largest


def resident_memory() -> int:
    """Return the memory that this process holds [byte]; 0 where nothing tells it."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, AttributeError):  # another system than Linux
        return 0
