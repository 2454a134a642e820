"""Meshes of one scene that were run: how errors and time depend on the edge length, by them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from lcmchain.study.comparison import BY_NAME, differences
from lcmchain.study.convergence import Convergence, fitted, progress
from lcmchain.study.outcome import Outcome
from lcmchain.study.step_settings import AS_IT_IS, StepSettings

#: Meshes that a law is taken from: the finest ones, since coarse ones follow it less.
COUNTED = 4
#: Changes that fall by less than this factor from mesh to mesh, at equal refinement, show no
#: convergence: of three meshes of a study, and of pilots, whose changes scatter by as much.
LEAST_PROGRESS, LEAST_PROGRESS_OF_PILOTS = 1.0, 0.7
#: Neither do distances that lie about their law by more than this, root mean square of logarithms.
MOST_MISFIT = 0.5
#: The error of what shows none is taken for this many changes, at refinement by the root of two.
CHANGES_LEFT = 1.5
#: Part of the square of a distance that has to be the meshes', where settings differ as well.
LEAST_OF_MESHES = 0.3
#: Solver time goes with h^-q, with these q: elements and steps alone make 3.
COST_POWER, COST_SCATTER = 3.0, 0.5


class Level(NamedTuple):
    """A mesh that was run.

    Parameters
    ----------
    edge : its edge length [m]. seconds : solver time of it with the settings of the scene [s].
    outcome : of the run, whose ``settings`` are ``off`` by so much, by quantity.
    """

    edge: float
    seconds: float
    outcome: Outcome
    off: Mapping[str, float] = MappingProxyType({})
    settings: StepSettings = AS_IT_IS


def error_laws(levels: Sequence[Level]) -> dict[str, Convergence]:
    """Return how the errors of all quantities depend on the edge length; the coarsest level first.

    What changes from mesh to mesh by no less than before has the order 0: its error is taken for a
    multiple of that change on any mesh (Eça, Hoekstra, "A procedure for the estimation of the
    numerical uncertainty of CFD calculations", J. Comput. Phys. 262 (2014), take the range of the
    data where no order is seen).
    """
    counted = list(levels)[-COUNTED:]
    if len(counted) < 2:
        return {}
    sizes = [level.edge for level in counted]
    between = {
        (i, j): differences(counted[i].outcome, counted[j].outcome)
        for i, j in itertools.combinations(range(len(counted)), 2)
    }
    laws = {}
    for name in BY_NAME:
        known = {
            (i, j): _of_meshes(found[name].typical, counted[i], counted[j], name)
            for (i, j), found in between.items()
        }
        steps = [known[i, i + 1] for i in range(len(counted) - 1)]
        law = fitted(sizes, known, BY_NAME[name].usual_order)
        if not math.isfinite(law.order):
            continue
        laws[name] = law
        if len(steps) > 1:
            last = progress(sizes[-3:], steps[-2:], by_squares=True)
            if last < LEAST_PROGRESS_OF_PILOTS or law.misfit > MOST_MISFIT:
                laws[name] = Convergence(0.0, CHANGES_LEFT * _usual_change(sizes, steps))
    return laws


def _usual_change(sizes: Sequence[float], steps: Sequence[float]) -> float:
    """Return what meshes change that are finer by the root of two: the mean of what was seen."""
    once = [
        step * math.sqrt(0.5 * math.log(2.0) / math.log(coarse / fine))
        for coarse, fine, step in zip(sizes[:-1], sizes[1:], steps, strict=True)
        if math.isfinite(step)
    ]
    return math.sqrt(sum(change**2 for change in once) / len(once))


def _of_meshes(distance: float, one: Level, other: Level, name: str) -> float:
    """Return what of a distance is left to the meshes; not a number where settings make most."""
    settings = one.off.get(name, 0.0) - other.off.get(name, 0.0)
    left = distance**2 - settings**2
    return math.sqrt(left) if left > LEAST_OF_MESHES * distance**2 else math.nan


def expected_seconds(
    levels: Sequence[Level], edge: float, rehearsed: Mapping[float, float] = MappingProxyType({})
) -> float:
    """Return the solver time [s] of the scene with an edge length [m].

    Parameters
    ----------
    levels : the coarsest first. rehearsed : what runs would take that were all like their beginning
        [s], by edge length [m]; those of levels tell how the whole goes with the beginning.
    """
    begun = [level for level in levels if level.edge in rehearsed]
    if begun:
        last = begun[-1]
        near, *others = sorted(rehearsed, key=lambda one: abs(math.log(one / edge)))
        power = COST_POWER
        if others:
            power = _power(near, rehearsed[near], others[0], rehearsed[others[0]])
        like = last.seconds * rehearsed[near] / rehearsed[last.edge]
        return like * (near / edge) ** max(power, 1.0)
    last, power = levels[-1], COST_POWER
    if len(levels) > 1:
        power = _power(last.edge, last.seconds, levels[-2].edge, levels[-2].seconds)
        power = min(max(power, COST_POWER - COST_SCATTER), COST_POWER + COST_SCATTER)
    return last.seconds * (last.edge / edge) ** power


def _power(edge: float, seconds: float, other_edge: float, other_seconds: float) -> float:
    """Return q of the law seconds = C edge^-q through two runs."""
    return math.log(seconds / other_seconds) / math.log(other_edge / edge)
