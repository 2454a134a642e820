"""Orders of convergence from runs on finer and finer meshes, and what they leave to the limit.

Runs on meshes of the sizes h are known by their distances from each other alone, root mean squares
of differences of fields; no run needs to be exact. The error of each is taken for C h^p. Were all
errors one field of shrinking size, distances would be differences of errors, and sums of each other
(Roache, "Perspective: a method for uniform reporting of grid refinement studies", J. Fluids Eng.
116 (1994)). On meshes that resolve folds and edges of contact one after the other they are not: a
finer mesh adds what a coarser one cannot hold, errors of unlike sizes are hardly alike, and
distances add by their squares. With the correlation (h_fine/h_coarse)^(kp) between errors

    d² = C² (h1^2p + h2^2p - 2 (h1 h2)^p (h2/h1)^(kp)),    h1 > h2

k = 0 is the former and k = 1 the latter; three meshes tell p, C and k. All orders and correlations
within bounds are weighed by how well they explain the distances, and the weighted mean is taken,
with a part of its scatter on the safe side.

Distances of coarse meshes scatter, and two meshes tell nothing of the order. Where the order that
studies usually find of a quantity is known, orders are weighed by how near they lie to it as well:
what runs tell then counts by as much as it is worth.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from lcmchain.study.comparison import BY_NAME, differences
from lcmchain.study.outcome import Outcome
from lcmchain.study.step_settings import AS_IT_IS, StepSettings

#: Orders and correlations that are weighed.
ORDERS = np.linspace(0.5, 2.0, 16)
CORRELATIONS = np.array([0.0, 0.25, 0.5, 1.0, 2.0])
#: Scatter of distances about the law, as a part of them; where orders are weighed by the usual one
#: as well, it is any of these, by what distances tell of it.
SCATTER = 0.05
SCATTERS = (0.05, 0.1, 0.2)
#: Standard deviation of orders about the usual one.
ORDER_SCATTER = 0.5
#: Standard deviations of the logarithm of the error, over all orders and correlations that explain
#: the distances, that are added to it. Two meshes leave order and correlation open: their number is
#: enough for the least favourable ones.
CAUTION, CAUTION_OF_TWO = 0.5, 2.0
#: The same for three pilots and more, where the usual order is known. Coarse meshes follow a law
#: less closely.
CAUTION_OF_PILOTS = 1.0


@dataclass(frozen=True)
class Convergence:
    """How a quantity depends on a size h: error(h) = factor h^order.

    Parameters
    ----------
    order : observed, not a number where the runs show none.
    factor : of the error. misfit : of the distances to the law, root mean square of logarithms.
    """

    order: float
    factor: float
    misfit: float = 0.0

    def error(self, size: float) -> float:
        """Return the expected distance from the limit at a size."""
        return self.factor * size**self.order

    def size(self, error: float) -> float:
        """Return the size at which the error is to be expected."""
        return float((error / self.factor) ** (1.0 / self.order))


NO_ORDER = Convergence(math.nan, math.nan)


def fitted(
    sizes: Sequence[float],
    distances: Mapping[tuple[int, int], float],
    usual_order: float | None = None,
    scatters: Sequence[float] = SCATTERS,
) -> Convergence:
    """Return the error law that explains the distances of runs from each other best.

    Parameters
    ----------
    sizes : of the meshes, the coarsest first. distances : between runs i and j, i < j; those that
        are not a number are left out. usual_order : of the quantity, where it is known. scatters :
        about the law that distances may have then, as parts of them.
    """
    pairs = [pair for pair, distance in distances.items() if math.isfinite(distance)]
    known = np.array([distances[pair] for pair in pairs])
    if not (len(pairs) and np.all(known > 0.0)):
        return NO_ORDER
    h = np.asarray(sizes) / sizes[-1]
    coarse, fine = (h[[pair[side] for pair in pairs]] for side in (0, 1))
    p, k = ORDERS[:, None, None], CORRELATIONS[None, :, None]
    squared = (
        coarse ** (2 * p) + fine ** (2 * p) - 2 * (coarse * fine) ** p * (fine / coarse) ** (k * p)
    )
    ratio = np.log(known) - 0.5 * np.log(squared)  # (orders, correlations, pairs): log of C
    mean = ratio.mean(axis=-1)
    squares = ((ratio - mean[..., None]) ** 2).sum(axis=-1)
    likelihood = -0.5 * squares / SCATTER**2  # logarithms
    if usual_order is not None:
        s = np.asarray(scatters)[:, None, None]
        scattered = -0.5 * squares / s**2 - (len(pairs) - 1) * np.log(s)
        likelihood = np.logaddexp.reduce(scattered, axis=0)
        likelihood -= 0.5 * ((ORDERS[:, None] - usual_order) / ORDER_SCATTER) ** 2
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    order = float((weight * ORDERS[:, None]).sum())
    caution = CAUTION if len(pairs) > 2 else CAUTION_OF_TWO
    if usual_order is not None and len(pairs) > 1:
        caution = CAUTION_OF_PILOTS
    likely = float((weight * mean).sum())
    spread = math.sqrt(float((weight * (mean - likely) ** 2).sum()))
    error = math.exp(likely + caution * spread)  # of the finest mesh
    misfit = math.sqrt(float((weight * squares).sum()) / len(pairs))
    return Convergence(order, error / sizes[-1] ** order, misfit)


def progress(sizes: Sequence[float], steps: Sequence[float], *, by_squares: bool = False) -> float:
    """Return by which factor the last difference is smaller than the one before.

    Both are taken per logarithm of the sizes, so at equal refinement; 1 means that finer meshes
    change the result by as much as coarse ones.

    Parameters
    ----------
    sizes : of three meshes, the coarsest first.
    steps : sizes of the differences between the first and second, and second and third run.
    by_squares : whether it is the squares of differences that add up.
    """
    h1, h2, h3 = sizes
    power = 0.5 if by_squares else 1.0
    first, second = steps[0] / math.log(h1 / h2) ** power, steps[1] / math.log(h2 / h3) ** power
    return first / second


# --- meshes of one scene that were run ------------------------------------------------------------


#: Meshes that a law is taken from: the finest ones, since coarse ones follow it less.
COUNTED = 4
#: Changes that fall by less than this factor from mesh to mesh, at equal refinement, show no
#: convergence: of three meshes of a study, and of pilots, whose changes scatter by as much.
LEAST_PROGRESS, LEAST_PROGRESS_OF_PILOTS = 1.0, 0.7
#: Distances show no order either that scatter about their law by more than this, root mean square
#: of logarithms.
MOST_MISFIT = 0.5
#: Error of a quantity that shows no order, in changes by a refinement by the root of two.
CHANGES_LEFT = 1.5
#: Least part of the square of a distance that is due to the meshes, where settings differ as well.
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

    A quantity that does not change less from mesh to mesh has the order 0. Its error is taken for a
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
    """Return the change by meshes that are finer by the root of two, in the mean of those seen."""
    once = [
        step * math.sqrt(0.5 * math.log(2.0) / math.log(coarse / fine))
        for coarse, fine, step in zip(sizes[:-1], sizes[1:], steps, strict=True)
        if math.isfinite(step)
    ]
    return math.sqrt(sum(change**2 for change in once) / len(once))


def _of_meshes(distance: float, one: Level, other: Level, name: str) -> float:
    """Return the part of a distance due to the meshes; not a number where settings make most."""
    settings = one.off.get(name, 0.0) - other.off.get(name, 0.0)
    left = distance**2 - settings**2
    return math.sqrt(left) if left > LEAST_OF_MESHES * distance**2 else math.nan


def expected_seconds(
    levels: Sequence[Level], edge: float, begun: Mapping[float, float] = MappingProxyType({})
) -> float:
    """Return the solver time [s] of the scene with an edge length [m].

    Parameters
    ----------
    levels : the coarsest first. begun : what runs would take that were all like their beginning
        [s], by edge length [m]; those of levels tell how the whole goes with the beginning.
    """
    known = [level for level in levels if level.edge in begun]
    if known:
        last = known[-1]
        near, *others = sorted(begun, key=lambda one: abs(math.log(one / edge)))
        power = COST_POWER
        if others:
            power = _power(near, begun[near], others[0], begun[others[0]])
        like = last.seconds * begun[near] / begun[last.edge]
        return like * (near / edge) ** max(power, 1.0)
    last, power = levels[-1], COST_POWER
    if len(levels) > 1:
        power = _power(last.edge, last.seconds, levels[-2].edge, levels[-2].seconds)
        power = min(max(power, COST_POWER - COST_SCATTER), COST_POWER + COST_SCATTER)
    return last.seconds * (last.edge / edge) ** power


def _power(edge: float, seconds: float, other_edge: float, other_seconds: float) -> float:
    """Return q of the law seconds = C edge^-q through two runs."""
    return math.log(seconds / other_seconds) / math.log(other_edge / edge)
