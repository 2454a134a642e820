"""Cure of resin over a time step: bounded for any step, and as accurate as asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Largest error of the cure that one sub-step may make.
TOLERANCE = 1e-7

# What is left to react is taken as at least this, so that an order below one, whose rate has an
# infinite slope at the end of the reaction, needs no smaller steps there.
_LEAST_LEFT = 1e-12
# A sub-step is never shorter than this share of the whole step.
_SHORTEST = 1e-9
_SAFETY, _MOST_GROWTH, _MOST_CUT = 0.9, 5.0, 0.1


def advance_cure(
    cure_rate: Callable[[np.ndarray, np.ndarray], np.ndarray],
    cure: np.ndarray,
    temperature: np.ndarray,
    step: float,
    *,
    end_temperature: np.ndarray | None = None,
    tolerance: float = TOLERANCE,
) -> np.ndarray:
    """Return the cure after a step of resin that stays where it is.

    The equation is solved for b = -ln((1 - cure) / (1 - start)), which only grows and may be of any
    size: with stages and weights that are not negative the cure rises from its start and stays
    below one, whatever the step. Bogacki and Shampine's pair of orders 3 and 2 (Applied Mathematics
    Letters 2 (1989) 321) chooses the sub-steps of every place by itself: its cure does
    not depend on which others are computed beside it.

    Parameters
    ----------
    cure_rate : of arrays temperature [K] and cure [1], [1/s]; not negative.
    cure : 0 to 1, any shape; places that are not a number stay so.
    temperature, end_temperature : [K] at start and end of the step, of a shape that broadcasts to
        that of the cure, linear between; without the latter constant.
    step : [s], not negative.
    tolerance : largest error of the cure in a sub-step.

    Raises
    ------
    ValueError : a cure outside 0 to 1, or a negative step.
    """
    cure = np.asarray(cure, dtype=float)
    flat = cure.ravel()
    if not step >= 0.0:
        raise ValueError(f"a step of {step} s")
    if np.any((flat < 0.0) | (flat > 1.0)):
        raise ValueError("a cure outside 0 to 1")
    start = np.broadcast_to(temperature, cure.shape).ravel().astype(float)
    end = start if end_temperature is None else np.broadcast_to(end_temperature, cure.shape).ravel()
    result = flat.copy()
    active = np.flatnonzero(np.isfinite(flat) & np.isfinite(start) & np.isfinite(end))
    if step > 0.0 and active.size:
        march = _March(cure_rate, flat[active], start[active], (end - start)[active], step)
        result[active] = march.run(tolerance)
    return result.reshape(cure.shape)


class _March:
    """Sub-steps of many places, each with a step size of its own."""

    def __init__(self, cure_rate, cure, temperature, warming, step) -> None:
        self.cure_rate = cure_rate
        self.left, self.temperature, self.warming = 1.0 - cure, temperature, warming
        self.step = step
        self.grown = np.zeros(cure.shape)  # b
        self.done = np.zeros(cure.shape)  # share of the step, 0 to 1

    def run(self, tolerance: float) -> np.ndarray:
        """Return the cure at the end of the step."""
        size = np.ones(self.done.shape)
        rows = np.arange(self.done.size)
        while rows.size:
            share = np.minimum(size[rows], 1.0 - self.done[rows])
            grown, error = self._try(rows, share)
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                factor = _SAFETY * np.cbrt(tolerance / error)
            factor = np.where(np.isfinite(factor), factor, _MOST_CUT)
            factor = np.where(error == 0.0, _MOST_GROWTH, np.clip(factor, _MOST_CUT, _MOST_GROWTH))
            taken = (error <= tolerance) | (share <= _SHORTEST)
            good = rows[taken]
            self.grown[good] = grown[taken]
            last = share[taken] >= 1.0 - self.done[good]
            self.done[good] = np.where(last, 1.0, self.done[good] + share[taken])
            size[rows] = np.maximum(share * factor, _SHORTEST)
            rows = rows[self.done[rows] < 1.0]
        return np.minimum(1.0 - self.left * np.exp(-self.grown), 1.0)

    def _try(self, rows: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return b after a sub-step and the error of the cure there."""
        time = share * self.step
        done, grown = self.done[rows], self.grown[rows]
        first = self._growth(rows, done, grown)
        second = self._growth(rows, done + 0.5 * share, grown + 0.5 * time * first)
        third = self._growth(rows, done + 0.75 * share, grown + 0.75 * time * second)
        end = grown + time * (2.0 * first + 3.0 * second + 4.0 * third) / 9.0
        last = self._growth(rows, done + share, end)
        difference = (-5.0 * first + 6.0 * second + 8.0 * third - 9.0 * last) / 72.0
        # An error of b counts by what it changes of the cure, over the whole sub-step.
        return end, np.abs(time * difference) * self.left[rows] * np.exp(-grown)

    def _growth(self, rows: np.ndarray, done: np.ndarray, grown: np.ndarray) -> np.ndarray:
        """Return the rate of b [1/s]."""
        left = np.maximum(self.left[rows] * np.exp(-grown), _LEAST_LEFT)
        temperature = self.temperature[rows] + done * self.warming[rows]
        return self.cure_rate(temperature, 1.0 - left) / left
