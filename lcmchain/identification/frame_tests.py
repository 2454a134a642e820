"""Picture frames of a fabric that resists rates: angle, rate and what went before, row by row.

A test has a steady speed of the machine, or times: a pull, after which the frame may stand still.
Between two rows the machine keeps its speed, from zero travel at time zero on. A Maxwell element of
a relaxation time l has the moment G m, with

    m' + m / (a l) = γ',

which is followed exactly where the rate γ' is constant, over parts of the way between two rows; a
is the factor of the temperature on all times.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from lcmchain.coupons.analytic import PictureFrame
from lcmchain.identification.data import Column, CouponData
from lcmchain.quantities.units import FORCE, LENGTH, SPEED, TEMPERATURE, TIME

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
        own = kept.specimen == number
        speed[own & (speed < STILL * speed[own].max())] = 0.0
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
        own = np.flatnonzero(data.specimen[rows] == number)
        travel = np.append(0.0, displacement[rows[own]])
        if steady:
            time = np.maximum(np.diff(travel), 0.0) / data["speed"][rows[own]]
        else:
            time = np.diff(np.append(_start(data, rows[own[0]]), data["time"][rows[own]]))
        order.append(own)
        begins.append(np.arange(len(own)) == 0)
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
