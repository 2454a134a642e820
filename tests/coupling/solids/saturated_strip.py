"""A fluid in a strip of cells: Darcy flow along x by finite volumes, to verify solid sides with.

K/mu dp/dx integrated over the thickness, incompressible: what a cell loses in volume flows out,
(h K/mu p')' = dh/dt. An infiltration is :mod:`lcmchain.coupling.infiltration`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from lcmchain.coupling.iteration import (
    CoupledPart,
    CoupledSystem,
    Exchange,
    Scheme,
    Tolerance,
    fixed_stress_exchanges,
)
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    THICKNESS,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
    Fields,
    checked_field,
    selected_fields,
)
from lcmchain.errors import InputError


class Strip:
    """Pressure in a saturated strip from the rate of its cells' volumes; a ``CoupledPart``.

    Parameters
    ----------
    thickness : at the start (C,) [m]. length, width : of each cell [m].
    mobility : K/mu [m²/(Pa s)], or a function of the thickness (C,).
    start : pressure at the start [Pa]. left, right : at the ends [Pa]; None is closed.
    """

    takes = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, THICKNESS)

    def __init__(
        self,
        thickness: np.ndarray,
        length: float,
        width: float,
        mobility: float | Callable[[np.ndarray], np.ndarray],
        *,
        start: float,
        left: float | None = None,
        right: float | None = 0.0,
    ) -> None:
        n = thickness.size
        self.length, self.width, self.mobility = length, width, mobility
        self.left, self.right = left, right
        self._time = 0.0
        zero = np.zeros(n)
        self._fields = {name: zero.copy() for name in self.takes}
        self._fields[THICKNESS] = np.array(thickness)
        self._fields[PORE_PRESSURE] = np.full(n, start)

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self._time

    def advance(self, step: float) -> None:
        """Solve for the pressure at the end of the step; the fluid keeps no memory."""
        f = self._fields
        h = f[THICKNESS]
        mobility = self.mobility(h) if callable(self.mobility) else np.full_like(h, self.mobility)
        resistance = self.length / (self.width * h * mobility)  # of a cell
        between = 2.0 / (resistance[:-1] + resistance[1:])
        band = np.zeros((3, h.size))
        band[0, 1:] = band[2, :-1] = -between
        band[1] = f[VOLUME_RATE_SLOPE]
        band[1, :-1] += between
        band[1, 1:] += between
        source = f[VOLUME_RATE_SLOPE] * f[REFERENCE_PRESSURE] - f[VOLUME_RATE]
        for end, pressure in ((0, self.left), (-1, self.right)):
            if pressure is not None:
                band[1, end] += 2.0 / resistance[end]
                source[end] += 2.0 / resistance[end] * pressure
        f[PORE_PRESSURE] = solve_banded((1, 1), band, source)
        self._time += step

    def save(self) -> Any:
        """Return a copy of the state."""
        return self._time, {name: values.copy() for name, values in self._fields.items()}

    def restore(self, saved: Any) -> None:
        """Go back to a saved state."""
        self._time, fields = saved
        self._fields = {name: values.copy() for name, values in fields.items()}

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Take inputs."""
        for name, values in fields.items():
            if name not in self.takes:
                raise InputError(f'"{name}" is no input of a strip')
            self._fields[name] = checked_field(name, values, self._fields[THICKNESS].size)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return the pressure, or inputs."""
        return selected_fields(names, self._fields)


def coupled_strip(
    solid: CoupledPart,
    fluid: Strip,
    scheme: Scheme,
    window: float,
    *,
    split: bool = True,
    tolerance: float = 1e-8,
) -> CoupledSystem:
    """Return solid and strip as a system; ``split``: by the fixed-stress split."""
    exchanges = [
        Exchange(
            "solid", "fluid", VOLUME_RATE, of_window="mean", within="held",
            tolerance=Tolerance(tolerance),
        ),
        Exchange("solid", "fluid", THICKNESS, tolerance=None, iterated=False, within="held"),
        Exchange("fluid", "solid", PORE_PRESSURE, tolerance=Tolerance(tolerance)),
    ]  # fmt: skip
    if split:
        exchanges += fixed_stress_exchanges("solid", "fluid")
    return CoupledSystem({"solid": solid, "fluid": fluid}, exchanges, scheme, window=window)
