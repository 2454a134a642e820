"""Initialisation of all units together: outputs reach inputs, and loops between them are solved."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.cosimulation.connections import Link
from lcmchain.coupling.cosimulation.instance import CallFailed
from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.iteration.attempt import largest_size
from lcmchain.coupling.iteration.schemes import QuasiNewton
from lcmchain.errors import SimulationError

#: Iterations of a loop, and the change that ends them, relative to the values.
MOST_ITERATIONS = 100
TOLERANCE = 1e-12
#: Growth over the first answers beyond which a loop has no solution: there y + 1 is y.
HOPELESS = 1e12


def initialise(parts: Sequence[FmuPart], links: Sequence[Link]) -> dict[str, int]:
    """Bring units, whose start values are set, through their initialisation.

    Returns
    -------
    Iterations by the names of the connections of each loop.

    Raises
    ------
    SimulationError : a unit fails, or a loop does not converge; names its connections.
    """
    for part in parts:
        _initialising(part, part.instance.enter_initialization)
    iterations = {}
    for group in _in_order(links):
        if len(group) == 1 and not _feeds(group[0], group[0]):
            group[0].deliver(group[0].fetch())
        else:
            iterations[", ".join(link.name for link in group)] = _solve(group)
    for part in parts:
        _initialising(part, part.instance.exit_initialization)
    return iterations


def _initialising(part: FmuPart, call: Callable[[], None]) -> None:
    begin = clock.perf_counter()
    try:
        call()
    except CallFailed as failure:
        raise SimulationError(
            f'unit "{part.name}" failed in its initialisation at {part.time:g} s: {failure}'
        ) from failure
    finally:
        part.spent.initialisation += clock.perf_counter() - begin


def _feeds(one: Link, other: Link) -> bool:
    """Whether what a connection brings acts directly on the output of another one."""
    if one.target is not other.source:
        return False
    description, output = other.source.description, other.output.name
    if other.output.causality in ("parameter", "calculatedParameter"):
        return False
    depends = description.depends_initially.get(output, description.depends.get(output))
    return depends is None or one.input.name in depends


def _in_order(links: Sequence[Link]) -> list[list[Link]]:
    """Return the connections in an order in which each acts on later ones only; loops together."""
    count = len(links)
    if count == 0:
        return []
    pairs = [(i, j) for i, one in enumerate(links) for j, other in enumerate(links)
             if _feeds(one, other)]  # fmt: skip
    rows, columns = ([pair[side] for pair in pairs] for side in (0, 1))
    graph = coo_matrix((np.ones(len(pairs)), (rows, columns)), shape=(count, count))
    group_count, group_of = connected_components(graph, directed=True, connection="strong")
    # by how many come before: sources first
    before: dict[int, set[int]] = {group: set() for group in range(group_count)}
    for i, j in pairs:
        if group_of[i] != group_of[j]:
            before[int(group_of[j])].add(int(group_of[i]))
    order = TopologicalSorter(before).static_order()
    return [[link for i, link in enumerate(links) if group_of[i] == group] for group in order]


def _solve(loop: list[Link]) -> int:
    """Iterate a loop of connections until all of them carry what their sources give."""
    signals = [link for link in loop if link.is_signal]
    newton = QuasiNewton(relaxation=1.0, windows_reused=0)
    newton.begin_window()
    given: list[NDArray[Any]] | None = None
    first = 0.0
    for iteration in range(1, MOST_ITERATIONS + 1):
        answers = {link: link.fetch() for link in loop}
        if given is None:
            for link in loop:
                link.deliver(answers[link])
            given = [answers[link] for link in loop]
            first = max((largest_size(answers[link]) for link in signals), default=0.0) or 1.0
            continue
        if any(not largest_size(answers[link]) < HOPELESS * first for link in signals):
            break
        if all(_same(before, answers[link]) for before, link in zip(given, loop)):
            return iteration
        proposed = dict(answers)
        if signals:
            x = np.concatenate([v for v, link in zip(given, loop) if link.is_signal])
            answer = np.concatenate([answers[link] for link in signals])
            weights = np.full(x.size, 1.0 / max(float(np.abs(answer).max()), 1e-300))
            following, at = newton.propose(x, answer, weights), 0
            for link in signals:
                proposed[link] = following[at : at + link.input.size]
                at += link.input.size
        for link in loop:
            link.deliver(proposed[link])
        given = [proposed[link] for link in loop]
    worst = ", ".join(link.name for link in loop)
    raise SimulationError(
        f"the algebraic loop of the initialisation does not converge in {MOST_ITERATIONS} "
        f"iterations: {worst}. It may have no solution, or several: give the inputs start values "
        "near one, or break the loop (an output that follows the input after a step only)"
    )


def _same(before: NDArray[Any], now: NDArray[Any]) -> bool:
    """Whether values agree up to the tolerance, texts and switches exactly."""
    if now.dtype.kind != "f":
        return bool(np.array_equal(before, now))
    return bool(np.all(np.abs(now - before) <= TOLERANCE * largest_size(now)))
