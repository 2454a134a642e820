"""Extrapolation of exchanged fields over the windows, as the first guess in a new one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import InputError

Values = NDArray[np.float64]


class Predictor:
    """Extrapolate from the ends of the last windows by a polynomial of ``order`` 0, 1 or 2.

    Windows may differ in size. As long as there are fewer windows the order is lower.
    """

    def __init__(self, order: int) -> None:
        if order not in (0, 1, 2):
            raise InputError(f"the order of extrapolation must be 0, 1 or 2, not {order}")
        self.order = order
        self._times: list[float] = []  # newest first
        self._values: list[list[Values]] = []

    @property
    def started(self) -> bool:
        return bool(self._times)

    @property
    def extrapolates(self) -> bool:
        """Return whether there are windows enough for more than holding the last values."""
        return len(self._times) > 1

    @property
    def latest(self) -> list[Values]:
        """Return the fields at the end of the last window."""
        return self._values[0]

    def accept(self, time: float, values: list[Values]) -> None:
        """Take the fields (one array per exchange) at the end of a window."""
        self._times.insert(0, time)
        self._values.insert(0, [field.copy() for field in values])
        del self._times[self.order + 1 :], self._values[self.order + 1 :]

    def held(self) -> list[Values]:
        """Return the fields as they were at the end of the last window, new arrays."""
        return [field.copy() for field in self._values[0]]

    def at(self, time: float) -> list[Values]:
        """Return the fields extrapolated to ``time``, new arrays."""
        weights = lagrange_weights(self._times, time)
        fields = []
        for number in range(len(self._values[0])):
            # From the newest value on: a field that does not change stays bit-identical.
            field = self._values[0][number].copy()
            for weight, values in zip(weights[1:], self._values[1:]):
                field += weight * (values[number] - self._values[0][number])
            fields.append(field)
        return fields

    def save(self) -> Any:
        """Return a copy of the memory."""
        return list(self._times), [[field.copy() for field in row] for row in self._values]

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        times, values = saved
        self._times, self._values = list(times), [[field.copy() for field in row] for row in values]


def lagrange_weights(nodes: list[float], time: float) -> list[float]:
    """Return the weights of the values at ``nodes`` for their polynomial at ``time``; sum 1."""
    weights = []
    for i, here in enumerate(nodes):
        weight = 1.0
        for j, other in enumerate(nodes):
            if j != i:
                weight *= (time - other) / (here - other)
        weights.append(weight)
    return weights
