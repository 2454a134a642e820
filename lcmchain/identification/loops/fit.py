"""Loops of coupon tests: an elastic law and Dahl's friction, fitted to rows there and back.

Along a way a (a curvature, a shear angle) a test measures

    y = Σ e_k p_k + v T,   dT = G (da - T/T_y |da|),   T_y = T_0 + c |T_el|,   G = T_0/l,

linear in the elastic parameters p_k, with the moment T of friction as in
:mod:`lcmchain.materials.features.rheology`. A step between two rows is exact where T_y is constant.
On the way there a loop shows elastic part and friction as one; the way back tells them apart. Every
test begins at rest, at zero.

Both are fitted together (Gauss-Newton, with the bounds of a scene kept exactly). Friction, and its
growth with the elastic moment, are taken only where they describe the rows better by more than
chance. Whether they do is judged in :mod:`lcmchain.identification.loops.judgement`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from scipy.linalg import block_diag

from lcmchain.identification.data import CouponData
from lcmchain.identification.regression import (
    Fit,
    exponential,
    fit_linear,
    is_better_by_more_than_chance,
    least_squares_within,
    noise_scale,
)
from lcmchain.identification.result import Band, Panel, Parameter, Points

# A test turns round where it goes back by more than this part of its largest way.
TURNS = 0.03
# A test begins within this part of its largest way from zero.
BEGINS = 0.2
# So much of the largest way back tells friction from the elastic part.
TELLS = 0.05
#: Smallest noise of a measured value relative to the largest one, by default: errors of a loop,
#: whose values pass through zero, are nearly of one size.
NOISE_FLOOR = 0.5
# Friction below this part of the elastic force, in the mean of the way, counts as none: inertia and
# damping of a test, and of a simulated one, look like it.
TRACE = 0.02
#: Chance that scatter adds friction to an elastic law, or a growth to the friction.
FALSE_PART = 1e-3
# Length in which friction comes up, over the largest way.
SHORTEST, LONGEST = 1e-3, 3.0
_LENGTHS = 16  # of a first search
_PASSES, _HALVINGS = 40, 12
# Rows of this weight hold each parameter of which the data say nothing.
_STAY = 1e-7


@dataclass(frozen=True)
class Loops:
    """Rows of tests that go there and back, test by test, each in the order of its course.

    Attributes
    ----------
    data : the rows. place : a, curvature [1/m] or angle [rad], shape [row_count].
    measured : y, shape [row_count].
    elastic : e_k, measured value per elastic parameter, shape [row_count, elastic_count].
    lever : v, measured value per moment of friction, shape [row_count].
    moments : elastic moment per elastic parameter at the ends of the parts of the way to each row,
        shape [row_count, part_count, elastic_count]; what the limit of the friction may grow with.
        None where it does not grow.
    at_least : (G, h), bounds G @ elastic parameters >= h.
    stiffness : size of an elastic parameter.
    branch : number of the branch of each row, counted through all tests, shape [row_count].
    ways : parts of the way to each row, shape [row_count, part_count].
    begins : whether a row is the first one of its test, shape [row_count].
    """

    data: CouponData
    place: np.ndarray
    measured: np.ndarray
    elastic: np.ndarray
    lever: np.ndarray
    moments: np.ndarray | None
    at_least: tuple[np.ndarray, np.ndarray]
    stiffness: float
    branch: np.ndarray
    ways: np.ndarray
    begins: np.ndarray

    @property
    def largest(self) -> float:
        """Size of the largest way from zero."""
        return float(np.abs(self.place).max())

    @property
    def turn_back(self) -> bool:
        """Whether a test goes back so far that friction is told from the elastic part."""
        back = [
            float(np.abs(self.ways[self.branch == number].sum()))
            for number in np.unique(self.branch)
            if not self.begins[np.argmax(self.branch == number)]
        ]
        return max(back, default=0.0) > TELLS * self.largest

    def keep(self, rows: np.ndarray) -> Loops:
        """Return the first rows of each test, as a mask."""
        moments = None if self.moments is None else self.moments[rows]
        return replace(
            self, data=self.data.keep(rows), place=self.place[rows], measured=self.measured[rows],
            elastic=self.elastic[rows], lever=self.lever[rows], moments=moments,
            branch=self.branch[rows], ways=self.ways[rows], begins=self.begins[rows],
        )  # fmt: skip

    def friction(self, length: float, growth: np.ndarray | float = 0.0) -> np.ndarray:
        """Return T/T_0 at the rows, shape [row_count].

        growth : T_y/T_0 - 1 at the ends of the parts, shape as ``ways``.
        """
        limit = 1.0 + np.broadcast_to(growth, self.ways.shape)
        x = np.abs(self.ways) / (length * limit)
        left, gain = np.exp(-x), -np.sign(self.ways) * limit * np.expm1(-x)
        left[self.begins, 0] = 0.0
        followed = accumulate(
            zip(left.ravel().tolist(), gain.ravel().tolist(), strict=True),
            lambda moment, part: part[0] * moment + part[1],
            initial=0.0,
        )
        return np.fromiter(followed, dtype=float)[1:].reshape(self.ways.shape)[:, -1]


def courses(data: CouponData, place: np.ndarray, name: str, parts: int) -> tuple[np.ndarray, ...]:
    """Return the order of the rows test by test, and of it branch, ways and which rows begin.

    What scatters about a way in one sense, as the resolution of a sensor does, turns nothing round.

    Parameters
    ----------
    place : curvature or angle of the rows, shape [row_count]. name : of it, in the file.
    parts : of the way to a row.

    Raises
    ------
    InputError : a test that does not begin near zero, or goes nowhere.
    """
    order, branches, ways, begins = [], [], [], []
    first = 0
    for number in np.unique(data.specimen):
        of_test = np.flatnonzero(data.specimen == number)
        course = place[of_test]
        largest = float(np.abs(course).max())
        if largest <= 0.0:
            raise data.wrong(name, of_test[0], "stays zero in the whole test")
        if abs(course[0]) > BEGINS * largest:
            raise data.wrong(
                name, of_test[0],
                "is far from zero at the start of the test, where the friction is not known; begin "
                "with the first loading, from rest",
            )  # fmt: skip
        branch, smooth = _branches(course, TURNS * largest)
        way = np.diff(smooth, prepend=0.0)
        order.append(of_test)
        branches.append(first + branch)
        ways.append(np.repeat(way[:, None] / parts, parts, axis=1))
        begins.append(np.arange(len(of_test)) == 0)
        first += int(branch.max()) + 1
    return tuple(np.concatenate(found) for found in (order, branches, ways, begins))


def _branches(course: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the branch of each row, and the course without its scatter."""
    branch = np.zeros(len(course), dtype=int)
    # the sign of the start is not known before the test has gone so far
    away = np.flatnonzero(np.abs(course) > least)
    sense = float(np.sign(course[away[0]]))
    extreme = 0
    for row in range(1, len(course)):
        if sense * (course[row] - course[extreme]) >= 0.0:
            extreme = row
        elif sense * (course[extreme] - course[row]) > least:
            branch[extreme + 1 :] += 1
            sense, extreme = -sense, row
    smooth, last, sense = np.empty(len(course)), 0.0, float(np.sign(course[away[0]]))
    for number in range(int(branch.max()) + 1):
        rows = branch == number
        smooth[rows] = (
            sense * np.maximum.accumulate(np.append(sense * last, sense * course[rows]))[1:]
        )
        last, sense = float(smooth[rows][-1]), -sense
    return branch, smooth


# --- the fit --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LoopFit:
    """A law fitted to loops.

    elastic : p_k. limit, length, growth : T_0, l and c of the friction; None without.
    fit : of elastic parameters, T_0, ln l and c, as many as were fitted.
    """

    loops: Loops
    elastic: np.ndarray
    limit: float | None
    length: float | None
    growth: float | None
    fit: Fit

    @property
    def stops(self) -> bool:
        """Whether the length of the friction stops at a bound of the search."""
        if self.length is None:
            return False
        part = self.length / self.loops.largest
        return part < SHORTEST * 1.001 or part > LONGEST * 0.999

    def misfit(self, noise_floor: float) -> float:
        """Return the sum of squares by the noise of the measured values, for comparisons."""
        measured = self.loops.measured
        scale = noise_scale(measured, measured, noise_floor)
        return float(np.sum(((measured - self.fit.model) / scale) ** 2))

    def friction(self) -> np.ndarray:
        """Return what the friction bears at most at the rows, in the measured quantity.

        It is the limit where the loops are so long that it is reached.
        """
        loops = self.loops
        assert self.limit is not None and self.length is not None
        grown: np.ndarray | float = 0.0
        if self.growth is not None and loops.moments is not None:
            grown = self.growth / self.limit * np.abs(loops.moments @ self.elastic)
        limit = 1.0 + np.broadcast_to(grown, loops.ways.shape)
        reached = np.abs(loops.friction(self.length, grown)) / limit[:, -1]
        return np.abs(loops.lever) * self.limit * limit[:, -1] * float(reached.max())


def fit_loops(
    loops: Loops, noise_floor: float, *, friction: bool = True, growth: bool = False
) -> LoopFit:
    """Fit elastic parameters, and friction if asked for, to all rows."""
    plain = fit_linear(loops.elastic, loops.measured, noise_floor, at_least=loops.at_least)
    if not friction:
        return LoopFit(loops, plain.parameters, None, None, None, plain)
    count = loops.elastic.shape[1]
    unit = _unit_of_moment(loops)
    units = np.array([*[loops.stiffness] * count, unit, 1.0, *[1.0] * growth])
    theta = _start(loops, noise_floor, unit, growth)
    bounds = _bounds(loops, unit, growth)
    scaled = (bounds[0] * units, bounds[1])
    model = _predicted(loops, theta)
    for _ in range(_PASSES):
        scale = noise_scale(model, loops.measured, noise_floor)
        slopes = _slopes(loops, theta, units)
        linear = slopes / scale[:, None]
        target = (loops.measured - model) / scale + linear @ (theta / units)
        stay = _STAY * np.linalg.norm(linear) * np.eye(len(theta))
        found = least_squares_within(
            np.vstack([linear, stay]), np.append(target, stay @ (theta / units)), scaled
        )
        step = found * units - theta
        before = np.sum(((loops.measured - model) / scale) ** 2)
        for half in range(_HALVINGS):
            tried = theta + 0.5**half * step
            model = _predicted(loops, tried)
            if np.sum(((loops.measured - model) / scale) ** 2) <= before * (1.0 + 1e-12):
                break
        change = float(np.max(np.abs(tried - theta) / units))
        theta = tried
        if change < 1e-8:
            break
    scale = noise_scale(model, loops.measured, noise_floor)
    jacobian = _slopes(loops, theta, units) / units / scale[:, None]
    held = bool(np.any(bounds[0] @ theta < bounds[1] + 1e-9 * np.abs(bounds[1])))
    fit = Fit(theta, model, (loops.measured - model) / scale, scale, jacobian, held)
    return LoopFit(
        loops, theta[:count], float(theta[count]), math.exp(theta[count + 1]),
        float(theta[count + 2]) if growth else None, fit,
    )  # fmt: skip


def rubs(law: LoopFit, plain: LoopFit, noise_floor: float) -> bool:
    """Whether friction describes the loops better than an elastic law, by more than a trace."""
    loops = law.loops
    way = np.abs(loops.ways.sum(axis=1))
    elastic = loops.elastic @ law.elastic
    lost = float(way @ np.abs(law.fit.model - elastic))
    return lost > TRACE * float(way @ np.abs(elastic)) and needs(law, plain, noise_floor)


def needs(more: LoopFit, less: LoopFit, noise_floor: float) -> bool:
    """Whether a law describes the loops better than one with less, by more than chance."""
    return is_better_by_more_than_chance(
        less.misfit(noise_floor), more.misfit(noise_floor),
        len(more.fit.parameters) - len(less.fit.parameters), more.fit.degrees_of_freedom,
        FALSE_PART,
    )  # fmt: skip


def _unit_of_moment(loops: Loops) -> float:
    """Return a tenth of the largest moment of the friction that the rows could bear."""
    return 0.1 * float(np.abs(loops.measured).max() / np.abs(loops.lever).max())


def _predicted(loops: Loops, theta: np.ndarray) -> np.ndarray:
    """Return y of elastic parameters, T_0, ln l and c, where the last is there."""
    count = loops.elastic.shape[1]
    elastic, limit, length = theta[:count], theta[count], math.exp(theta[count + 1])
    grown: np.ndarray | float = 0.0
    if len(theta) > count + 2 and loops.moments is not None:
        grown = theta[count + 2] / limit * np.abs(loops.moments @ elastic)
    return loops.elastic @ elastic + loops.lever * limit * loops.friction(length, grown)


def _slopes(loops: Loops, theta: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Return the derivatives of y by the parameters in their units, [row_count, count]."""
    found = np.empty((len(loops.measured), len(theta)))
    for k in range(len(theta)):
        ahead, behind = theta.copy(), theta.copy()
        ahead[k] += 1e-5 * units[k]
        behind[k] -= 1e-5 * units[k]
        found[:, k] = (_predicted(loops, ahead) - _predicted(loops, behind)) / 2e-5
    return found


def _start(loops: Loops, noise_floor: float, unit: float, growth: bool) -> np.ndarray:
    """Return the best of lengths on a grid; without growth all else is linear."""
    count = loops.elastic.shape[1]
    least = block_diag(loops.at_least[0], np.ones((1, 1)))
    bounds = (least, np.append(loops.at_least[1], 1e-3 * unit))
    scale = noise_scale(loops.measured, loops.measured, noise_floor)
    best, start = math.inf, np.zeros(count + 2)
    for part in np.geomspace(3.0 * SHORTEST, 0.5 * LONGEST, _LENGTHS):
        length = part * loops.largest
        design = np.column_stack([loops.elastic, loops.lever * loops.friction(length)])
        found = fit_linear(design, loops.measured, noise_floor, at_least=bounds)
        misfit = float(np.sum(((loops.measured - found.model) / scale) ** 2))
        if misfit < best:
            best, start = misfit, np.append(found.parameters, math.log(length))
    start[count] = np.fmax(start[count], 1e-2 * unit)
    return np.append(start, 0.0) if growth else start


def _bounds(loops: Loops, unit: float, growth: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds of the elastic part, of T_0, of ln l to both sides, and of c."""
    rows = block_diag(loops.at_least[0], np.ones((1, 1)), np.array([[1.0], [-1.0]]))
    low, high = (math.log(part * loops.largest) for part in (SHORTEST, LONGEST))
    least = np.concatenate([loops.at_least[1], [1e-3 * unit, low, -high]])
    if growth:
        rows, least = block_diag(rows, np.ones((1, 1))), np.append(least, 0.0)
    return rows, least


# --- what is told ---------------------------------------------------------------------------------


def friction_parameters(law: LoopFit, name: str, unit: str, unit_of_length: str) -> list[Parameter]:
    """Return the parameters of the friction with their intervals; none without friction."""
    if law.limit is None or law.length is None:
        return []
    half = law.fit.half_widths()[len(law.elastic) :]
    place = {"1/m": "friction_curvature", "rad": "friction_angle"}[unit_of_length]
    found = [
        Parameter(name, law.limit, unit, law.limit - half[0], law.limit + half[0]),
        Parameter(
            place, law.length, unit_of_length, law.length * math.exp(-half[1]),
            law.length * exponential(half[1]),
        ),
    ]  # fmt: skip
    if law.growth is not None:
        low = min(law.growth - half[2], law.growth)
        found.append(Parameter("friction_growth", law.growth, "1", low, law.growth + half[2]))
    return found


def friction_notes(law: LoopFit, turned_back: bool, place: str) -> list[str]:
    """Say what the tests do not tell of the friction."""
    if not turned_back:
        return [
            "no test turns back: the friction is left open, and the elastic law holds all that "
            "the fabric resists, its friction too; unload, and load to the other side"
        ]
    if law.limit is None:
        return [
            "the loops are closed within their scatter, or within "
            f"{100.0 * TRACE:g} % of what the elastic law bears: no friction is found"
        ]
    if law.stops:
        return [
            f"the {place} of the friction stops at a bound of the search; the other intervals "
            "take that as given"
        ]
    return []


def loop_panels(
    law: LoopFit, place: str, measured: str, factor: float, unit: float
) -> tuple[Panel, ...]:
    """Return the loops, what the friction is of them, and what is left.

    place, measured : labels of the axes; factor, unit : from SI units to theirs.
    """
    loops = law.loops
    a, y, group = factor * loops.place, unit * loops.measured, loops.data.specimen
    elastic = unit * (loops.elastic @ law.elastic)
    rubs = unit * law.fit.model - elastic
    return (
        Panel(
            place, measured, (Points(a, y, "measured", group),),
            (Band(a, unit * law.fit.model, "fit"), Band(a, elastic, "elastic", dashed=True)),
        ),
        Panel(
            place, f"friction: {measured}", (Points(a, y - elastic, "measured", group),),
            (Band(a, rubs, "fit"),),
        ),
        Panel(
            place, "residual [%]", (Points(a, 100.0 * law.fit.residuals, "measured", group),),
            is_residual=True,
        ),
    )  # fmt: skip
