"""Picture frames of a fabric that resists rates, and the fit of the laws that it may follow.

A test has a steady speed of the machine, or times: a pull, after which the frame may stand still.
Between two rows the machine keeps its speed, from zero travel at time zero on. A Maxwell element of
a relaxation time l has the moment G m, with

    m' + m / (a l) = γ',

which is followed exactly where the rate γ' is constant, over parts of the way between two rows; a
is the factor of the temperature on all times.

The force of a frame is linear in the shear polynomial, the viscosities and the moduli of the
Maxwell elements, once the time constant M and the exponent N of Cross's law, the relaxation times
and the energy of activation are given. Only these few are searched for. At each of their values the
others follow from linear least squares, those of the rate not negative (variable projection, Golub
and Pereyra 1973).

Maxwell elements are added one at a time, at the relaxation time of a logarithmic grid that helps
most; then all times are refined together. An element stays if it lowers the sum of squares by more
than chance would (F test).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares, nnls

from lcmchain.coupons.analytic import PictureFrame, shear_strain
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.regression import (
    Fit,
    exponential,
    fit_linear,
    is_better_by_more_than_chance,
    noise_scale,
)
from lcmchain.identification.shear import COEFFICIENT_COUNT, mean_secant, rising_stress
from lcmchain.materials.features.temperature_field import GAS_CONSTANT
from lcmchain.quantities.units import FORCE, LENGTH, SPEED, TEMPERATURE, TIME

# --- tests: angle, rate and what went before, row by row ------------------------------------------


_PULLED = (Column("displacement", LENGTH, loading=1), Column("force", FORCE))
_SPEED, _TIME, _TEMPERATURE = (
    Column("speed", SPEED), Column("time", TIME), Column("temperature", TEMPERATURE),
)  # fmt: skip
#: What a file may hold; the first that fits is taken.
COLUMNS = (
    (*_PULLED, _SPEED, _TEMPERATURE),
    (*_PULLED, _SPEED),
    (_TIME, *_PULLED, _TEMPERATURE),
    (_TIME, *_PULLED),
)
# Parts of the way between two rows with a constant rate of the angle each.
PARTS = 4
# Below this part of the largest speed of its test a frame stands still.
STILL = 0.01
LARGEST_ANGLE = np.radians(85.0)


@dataclass(frozen=True)
class FrameTests:
    """Rows of picture frames, the same in all arrays [row_count], and the way between them.

    Attributes
    ----------
    data : the rows, with travel above zero.
    angle : shear angle [rad]. rate : of it, in the interval before the row [1/s].
    speed : of the machine in that interval [m/s], 0 where it stands still.
    lever : force of the frame per S12 [m²].
    since_stop : time since the frame stopped [s], not-a-number while it moves.
    temperature : [K], None where the file tells none.
    """

    data: CouponData
    angle: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    lever: np.ndarray
    since_stop: np.ndarray
    temperature: np.ndarray | None
    # The way: its rows in their order, which of them begin a test, and of each the time [s] and the
    # turn [rad] of the parts of the way to it, shape [row_count, PARTS].
    _order: np.ndarray
    _begins: np.ndarray
    _time: np.ndarray
    _turn: np.ndarray

    @property
    def force(self) -> np.ndarray:
        return self.data["force"]

    @property
    def still(self) -> np.ndarray:
        """Whether the frame stands still, shape [row_count]."""
        return ~np.isnan(self.since_stop)

    @property
    def speeds(self) -> np.ndarray:
        """Speeds of the machine that differ by more than a tenth [m/s]."""
        return _distinct(self.speed[self.speed > 0.0], 1.1, 0.0)

    @property
    def temperatures(self) -> np.ndarray:
        """Temperatures that differ by more than 2 K [K]; none where the file tells none."""
        return np.zeros(0) if self.temperature is None else _distinct(self.temperature, 1.0, 2.0)

    def moments(self, time: float, factor: np.ndarray) -> np.ndarray:
        """Return m [row_count] of a Maxwell element; factor : on its time, shape [row_count]."""
        x = self._time / (time * factor[self._order, None])
        left = np.exp(-x)
        left[self._begins, 0] = 0.0
        short = np.maximum(x, 1e-12)
        gain = self._turn * -np.expm1(-short) / short
        followed = accumulate(
            zip(left.ravel().tolist(), gain.ravel().tolist(), strict=True),
            lambda m, part: part[0] * m + part[1],
            initial=0.0,
        )
        after = np.fromiter(followed, dtype=float)[1:].reshape(x.shape)
        moment = np.empty(len(self.angle))
        moment[self._order] = after[:, -1]
        return moment


def _distinct(values: np.ndarray, ratio: float, difference: float) -> np.ndarray:
    """Return the least of each group of values that lie nearer to each other than stated."""
    found: list[float] = []
    for value in np.sort(values):
        if not found or value > ratio * found[-1] + difference:
            found.append(float(value))
    return np.array(found)


def frame_tests(data: CouponData, frame: PictureFrame) -> FrameTests:
    """Return the rows of a file as tests of a frame.

    Raises
    ------
    InputError : a frame beyond 85°, a speed of zero, or a travel at time zero.
    """
    rows = np.flatnonzero(data["displacement"] > 0.0)
    beyond = rows[frame.shear_angle(data["displacement"][rows]) > LARGEST_ANGLE]
    if beyond.size:
        raise data.wrong("displacement", beyond[0], "shears the frame by more than 85 deg")
    order, begins, start, passed = _ways(data, rows)
    kept = data.keep(data["displacement"] > 0.0)
    way = kept["displacement"][order] - start
    shares = np.linspace(0.0, 1.0, PARTS + 1)
    angles = frame.shear_angle(start[:, None] + shares * way[:, None])
    speed, since_stop = np.empty(len(rows)), np.empty(len(rows))
    speed[order] = np.maximum(way, 0.0) / np.maximum(passed, 1e-300)
    if "speed" in kept:
        speed = kept["speed"].copy()
    for number in np.unique(kept.specimen):
        of_test = kept.specimen == number
        speed[of_test & (speed < STILL * speed[of_test].max())] = 0.0
    since_stop[order] = _standing(speed[order], passed, begins)
    angle = frame.shear_angle(kept["displacement"])
    return FrameTests(
        data=kept,
        angle=angle,
        rate=speed / (frame.side * np.sin(0.25 * np.pi - 0.5 * angle)),
        speed=speed,
        lever=frame.force(angle, lambda g: np.ones_like(g)),
        since_stop=since_stop,
        temperature=kept["temperature"] if "temperature" in kept else None,
        _order=order,
        _begins=begins,
        _time=np.repeat(passed[:, None] / PARTS, PARTS, axis=1),
        _turn=np.diff(angles, axis=1),
    )


def _ways(
    data: CouponData, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the ways to the rows with travel, test by test.

    They are: the place of each row among them, whether it is the first of its test, the travel
    [m] from which its way starts, and the time [s] that it takes.
    """
    displacement, steady = data["displacement"], "speed" in data
    if steady:
        standing = rows[data["speed"][rows] <= 0.0]
        if standing.size:
            raise data.wrong(
                "speed", standing[0],
                "is not above 0; a test that stands still relaxes, and needs a column time [s] in "
                "place of the speed",
            )  # fmt: skip
    order, begins, start, passed = [], [], [], []
    for number in np.unique(data.specimen[rows]):
        of_test = np.flatnonzero(data.specimen[rows] == number)
        travel = np.append(0.0, displacement[rows[of_test]])
        if steady:
            time = np.maximum(np.diff(travel), 0.0) / data["speed"][rows[of_test]]
        else:
            time = np.diff(np.append(_start(data, rows[of_test[0]]), data["time"][rows[of_test]]))
        order.append(of_test)
        begins.append(np.arange(len(of_test)) == 0)
        start.append(travel[:-1])
        passed.append(time)
    if not order:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=bool), np.zeros(0), np.zeros(0)
    return tuple(np.concatenate(parts) for parts in (order, begins, start, passed))  # type: ignore[return-value]


def _start(data: CouponData, first: int) -> float:
    """Return the time [s] at which the pull of a test starts, whose first travelled row this is."""
    ahead = np.flatnonzero(data.specimen[:first] == data.specimen[first])
    if len(ahead):
        return float(data["time"][ahead[-1]])
    if data["time"][first] <= 0.0:
        raise data.wrong(
            "displacement", first,
            "is not 0 at the first time; let times count from the start of the pull",
        )  # fmt: skip
    return 0.0


def _standing(speed: np.ndarray, passed: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Return the time since each stop [s], not-a-number where the frame moves."""
    since = np.full(len(speed), np.nan)
    for k in range(len(speed)):
        if speed[k] == 0.0 and not begins[k]:
            before = since[k - 1]
            since[k] = passed[k] + (0.0 if np.isnan(before) else before)
    return since


# --- laws -----------------------------------------------------------------------------------------


MOST_ELEMENTS = 8
# Chance that a part is added to pure noise.
FALSE_PART = 1e-4
# Relaxation times per decade of the grid; how far it goes beyond the shortest and longest time.
_PER_DECADE, _BEYOND = 4, 3.0
# Exponents of Cross's law: up to here the viscosity falls at all.
_LARGEST_EXPONENT = 0.95
# Energies of activation are searched for in this unit, up to 500 kJ/mol.
_ENERGY_UNIT, _MOST_ENERGY = 1e4, 50.0
# Starts of the search: count of time constants, exponents, and energies.
_CONSTANTS, _EXPONENTS, _ENERGIES = 9, (0.1, 0.5), (2.0, 5.0, 10.0)
# How far beyond the rates of the tests one over the time constant may lie.
_FARTHEST_RATE = 1e3
_PASSES = 6


@dataclass(frozen=True)
class Form:
    """Which law is fitted.

    cross : the viscosity falls with the rate. infinite : to a value above zero.
    elements : count of Maxwell elements. heated : times follow the temperature.
    """

    cross: bool = False
    infinite: bool = False
    elements: int = 0
    heated: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that the force is linear in, behind those of the polynomial."""
        dashpot = ("viscosity", "infinite_viscosity") if self.infinite else ("viscosity",)
        return (*dashpot, *(f"modulus_{k + 1}" for k in range(self.elements)))

    @property
    def searched(self) -> tuple[str, ...]:
        """Parameters that it is not linear in."""
        return (
            *(("time_constant", "exponent") if self.cross else ()),
            *(("activation_energy",) if self.heated else ()),
            *(f"relaxation_time_{k + 1}" for k in range(self.elements)),
        )

    def values(self, theta: np.ndarray) -> np.ndarray:
        """Return the searched parameters in SI units."""
        units = {"activation_energy": _ENERGY_UNIT, "exponent": 1.0}
        return np.array(
            [
                units[name] * x if name in units else exponential(x)
                for name, x in zip(self.searched, theta, strict=True)
            ]
        )


@dataclass(frozen=True)
class RateFit:
    """A law fitted to the forces of frames.

    form : its parts. theta : what was searched for. linear : fit of all others with the bounds of
    scene. free : without them. whole : ``free`` with the searched parameters, for intervals.
    """

    form: Form
    theta: np.ndarray
    linear: Fit
    free: Fit
    whole: Fit
    held: tuple[str, ...] = ()

    def value(self, name: str) -> float:
        """Return a parameter in SI units, zero for one that the law does not have."""
        if name in self.form.searched:
            return float(self.form.values(self.theta)[self.form.searched.index(name)])
        if name not in self.form.names:
            return 0.0
        return float(self.linear.parameters[COEFFICIENT_COUNT + self.form.names.index(name)])


class RateLaws:
    """Laws that resist rates, fitted to tests of a frame.

    Parameters
    ----------
    tests : rows of the frame. reference : temperature of all times [K].
    noise_floor : smallest noise of the force relative to the largest force.
    """

    def __init__(self, tests: FrameTests, reference: float, noise_floor: float) -> None:
        self.tests, self.reference, self.noise_floor = tests, reference, noise_floor
        self._scale = noise_scale(tests.force, tests.force, noise_floor)

    @cached_property
    def polynomial(self) -> np.ndarray:
        """Force [N] per unit of s0 ... s4, shape [row_count, 5]."""
        powers = shear_strain(self.tests.angle)[:, None] ** np.arange(1, COEFFICIENT_COUNT + 1)
        return 2.0 * self.tests.lever[:, None] * powers

    def of_rate(self, form: Form, theta: np.ndarray) -> np.ndarray:
        """Return the force [N] per unit of what is linear in the rate, none of it negative.

        Shape [row_count, name_count] as ``form.names``; the first is that of η0 - η∞.
        """
        tests, value_of = self.tests, dict(zip(form.searched, form.values(theta), strict=True))
        factor = np.ones(len(tests.angle))
        if form.heated and tests.temperature is not None:
            inverse = 1.0 / tests.temperature - 1.0 / self.reference
            factor = np.exp(value_of["activation_energy"] / GAS_CONSTANT * inverse)
        lever = tests.lever / np.cos(tests.angle)
        dashpot = lever * factor * tests.rate
        columns = [dashpot]
        if form.cross:
            thinning = (value_of["time_constant"] * factor * tests.rate) ** (
                1.0 - value_of["exponent"]
            )
            columns = [dashpot / (1.0 + thinning)]
        if form.infinite:
            columns.append(dashpot)
        for k in range(form.elements):
            columns.append(lever * tests.moments(value_of[f"relaxation_time_{k + 1}"], factor))
        return np.stack(columns, axis=-1)

    def design(self, form: Form, theta: np.ndarray) -> np.ndarray:
        """Return the force [N] per unit of s0 ... s4 and ``form.names``."""
        of_rate = self.of_rate(form, theta)
        if form.infinite:  # of η0 and η∞, in place of η0 - η∞ and η∞
            of_rate[:, 1] -= of_rate[:, 0]
        return np.hstack([self.polynomial, of_rate])

    def fitted(self, form: Form, start: np.ndarray | None = None) -> RateFit:
        """Fit a law; ``start`` of what is searched for, by default from a coarse grid."""
        theta = self._starting(form) if start is None else start
        scale = self._scale
        for _ in range(_PASSES if len(theta) else 1):
            before, theta = theta, self._refined(form, theta, scale)
            linear = self._linear(form, theta)
            scale = noise_scale(linear.model, self.tests.force, self.noise_floor)
            if np.max(np.abs(theta - before), initial=0.0) < 1e-7:
                break
        return self._finished(form, theta)

    def with_elements(self, form: Form) -> RateFit:
        """Fit a law with as many Maxwell elements as the tests tell, of frames that stand still."""
        theta = self._starting(form)
        misfit = self._misfit(form, theta)
        grid = self._relaxation_times()
        while form.elements < MOST_ELEMENTS and len(grid):
            more = replace(form, elements=form.elements + 1)
            tried = [self._misfit(more, np.append(theta, x)) for x in grid]
            start = np.append(theta, grid[int(np.argmin(tried))])
            start = self._refined(more, start, self._scale)
            left = self._misfit(more, start)
            if not self._is_better(misfit, left, 2, more):
                break
            form, theta, misfit = more, start, left
        return self.fitted(form, self._in_order(form, theta))

    def needs(self, more: RateFit, less: RateFit, *, chance: float = FALSE_PART) -> bool:
        """Whether a law describes the tests better than one with less, by more than chance."""
        before, left = (self._misfit(fit.form, fit.theta) for fit in (less, more))
        count = len(more.whole.parameters) - len(less.whole.parameters)
        return self._is_better(before, left, count, more.form, chance)

    def _is_better(
        self, before: float, left: float, count: int, form: Form, chance: float = FALSE_PART
    ) -> bool:
        free = len(self.tests.angle) - COEFFICIENT_COUNT - len(form.names) - len(form.searched)
        return is_better_by_more_than_chance(before, left, count, free, chance)

    def _in_order(self, form: Form, theta: np.ndarray) -> np.ndarray:
        first = len(theta) - form.elements
        return np.append(theta[:first], np.sort(theta[first:]))

    def _relaxation_times(self) -> np.ndarray:
        """Return the logarithms of the times of the grid; none where no frame stands still."""
        if not self.tests.still.any():
            return np.zeros(0)
        low, high = self._relaxation_bounds()
        return np.linspace(low, high, max(2, int(_PER_DECADE * (high - low) / np.log(10.0)) + 1))

    def _relaxation_bounds(self) -> tuple[float, float]:
        passed = self.tests.since_stop[self.tests.still]
        return float(np.log(passed.min() / _BEYOND)), float(np.log(passed.max() * _BEYOND))

    def _bounds(self, form: Form) -> tuple[np.ndarray, np.ndarray]:
        rates = self.tests.rate[self.tests.rate > 0.0]
        bounds = {
            "time_constant": np.log([1.0 / (_FARTHEST_RATE * rates.max()),
                                     _FARTHEST_RATE / rates.min()]),
            "exponent": (0.0, _LARGEST_EXPONENT),
            "activation_energy": (0.0, _MOST_ENERGY),
        }  # fmt: skip
        if form.elements:
            bounds |= {
                name: self._relaxation_bounds() for name in form.searched if "relaxation" in name
            }
        low, high = zip(*(bounds[name] for name in form.searched), strict=True)
        return np.array(low), np.array(high)

    def _starting(self, form: Form) -> np.ndarray:
        """Return the best values of a coarse grid, refined."""
        grids: list[np.ndarray] = []
        if form.cross:
            low, high = np.log(1.0 / self.tests.rate.max()), np.log(1.0 / self._least_rate())
            grids.append(np.linspace(low - 1.0, high + 1.0, _CONSTANTS))
            grids.append(np.array(_EXPONENTS))
        if form.heated:
            grids.append(np.array(_ENERGIES))
        if not grids:
            return np.zeros(0)
        every = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, len(grids))
        best = min(every, key=lambda theta: self._misfit(form, theta))
        return self._refined(form, best, self._scale)

    def _least_rate(self) -> float:
        return float(self.tests.rate[self.tests.rate > 0.0].min())

    def _refined(self, form: Form, theta: np.ndarray, scale: np.ndarray) -> np.ndarray:
        if not len(theta):
            return theta
        low, high = self._bounds(form)
        solution = least_squares(
            lambda tried: self._residuals(form, tried, scale), np.clip(theta, low, high),
            bounds=(low, high), jac="3-point", xtol=1e-10, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip
        return solution.x

    def _misfit(self, form: Form, theta: np.ndarray) -> float:
        return float(np.sum(self._residuals(form, theta, self._scale) ** 2))

    def _residuals(self, form: Form, theta: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Return what is left of the forces over their noise, with the best linear parameters."""
        basis, _ = np.linalg.qr(self.polynomial / scale[:, None])
        force = self.tests.force / scale
        columns = self.of_rate(form, theta) / scale[:, None]
        # what the polynomial can take is its own
        columns = columns - basis @ (basis.T @ columns)
        force = force - basis @ (basis.T @ force)
        lengths = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        found, _ = nnls(columns / lengths, force)
        return force - columns / lengths @ found

    def _limits(self, form: Form, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds of a scene: the stress rises, and nothing of the rate is negative."""
        tangent, least = rising_stress(mean_secant(design, self.tests.force))
        signs = np.eye(len(form.names))
        if form.infinite:
            signs[0, 1] = -1.0
        return block_diag(tangent, signs), np.append(least, np.zeros(len(signs)))

    def _linear(self, form: Form, theta: np.ndarray) -> Fit:
        design = self.design(form, theta)
        return fit_linear(
            design, self.tests.force, self.noise_floor, at_least=self._limits(form, design)
        )

    def _finished(self, form: Form, theta: np.ndarray) -> RateFit:
        linear = self._linear(form, theta)
        free = fit_linear(self.design(form, theta), self.tests.force, self.noise_floor)
        slopes = []
        for k, x in enumerate(theta):
            step = 1e-5 * max(1.0, abs(x)) * np.eye(len(theta))[k]
            either = [self.design(form, theta + sign * step) for sign in (1.0, -1.0)]
            change = (either[0] - either[1]) @ linear.parameters
            slopes.append(change / (2.0 * step[k]) / free.noise_scale)
        whole = replace(
            free,
            parameters=np.append(free.parameters, theta),
            jacobian=np.column_stack([free.jacobian, *slopes]),
        )
        low, high = self._bounds(form) if len(theta) else (theta, theta)
        stops = np.minimum(theta - low, high - theta) < 1e-3
        held = tuple(name for name, stopped in zip(form.searched, stops, strict=True) if stopped)
        return RateFit(form, theta, linear, free, whole, held)
