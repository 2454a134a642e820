"""Temperature of the resin: uniform, or approaching that of the mould.

No model contains the heat of the reaction and of the flow, conduction along the sheet, or the
cooling of the mould by cold resin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.coupling.infiltration.flow.medium import ResinTemperature
from lcmchain.errors import InputError
from lcmchain.scene.infiltration import laws as tables


@dataclass(frozen=True)
class ConstantTemperature:
    """The same temperature ``value`` [K] everywhere and always."""

    value: float

    def __post_init__(self) -> None:
        _require_temperatures("temperature", [self.value])

    def inlet(self, time: float) -> float:
        """Temperature [K] of the resin that enters."""
        return self.value

    def advance(
        self, temperature: np.ndarray, thickness: np.ndarray, time: float, step: float
    ) -> np.ndarray:
        """Return the temperature [K] after a step."""
        return np.full(np.shape(temperature), self.value)


@dataclass(frozen=True)
class PrescribedTemperature:
    """The same temperature everywhere, linear between ``values`` [K] at ``times`` [s].

    It is constant before the first and after the last time.

    Raises
    ------
    InputError : times that do not rise, or another number of values than of times.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        _require_table("temperature", self.times, self.values)

    def inlet(self, time: float) -> float:
        """Temperature [K] of all resin."""
        return float(np.interp(time, self.times, self.values))

    def advance(
        self, temperature: np.ndarray, thickness: np.ndarray, time: float, step: float
    ) -> np.ndarray:
        """Return the temperature [K] after a step."""
        return np.full(np.shape(temperature), self.inlet(time + step))


@dataclass(frozen=True)
class MouldTemperature:
    """Resin that enters with one temperature and approaches that of a mould everywhere.

    The two faces of a layer of thickness h have the temperature of the mould. The mean over the
    thickness relaxes with the time h²/(π² a) of its first Fourier mode (H. S. Carslaw, J. C.
    Jaeger, Conduction of Heat in Solids, 2nd ed. 1959, section 3.3), with the diffusivity a of
    resin and fibres together. Higher modes are left out: they remove 19 % of the difference within
    a fifth of that time, so that the resin may be too cold by up to this part of the difference.

    Parameters
    ----------
    inlet_temperature : [K] of the resin that enters.
    times, values : temperature of the mould [K] over time [s], linear between, constant outside
        the times.
    diffusivity : a [m2/s].
    """

    inlet_temperature: float
    times: tuple[float, ...]
    values: tuple[float, ...]
    diffusivity: float

    def __post_init__(self) -> None:
        _require_temperatures("inlet", [self.inlet_temperature])
        _require_table("mould", self.times, self.values)
        if not (np.isfinite(self.diffusivity) and self.diffusivity > 0.0):
            raise InputError(
                f"must be positive, but is {self.diffusivity}", key="resin.temperature.diffusivity"
            )

    def inlet(self, time: float) -> float:
        """Temperature [K] of the resin that enters."""
        return self.inlet_temperature

    def advance(
        self, temperature: np.ndarray, thickness: np.ndarray, time: float, step: float
    ) -> np.ndarray:
        """Return the temperature [K] after a step, exact for the piecewise linear mould's."""
        relaxation = np.square(thickness) / (np.pi**2 * self.diffusivity)
        between = [t for t in self.times if time < t < time + step]
        moments = [time, *between, time + step]
        values = np.interp(moments, self.times, self.values)
        result = np.array(temperature, dtype=float)
        for index in range(len(moments) - 1):
            length = moments[index + 1] - moments[index]
            if length <= 0.0:
                continue
            slope = (values[index + 1] - values[index]) / length
            lag = slope * relaxation
            # solution of T' = (mould - T) / relaxation for a mould that warms linearly
            result = (
                values[index + 1]
                - lag
                + (result - values[index] + lag) * np.exp(-length / relaxation)
            )
        return result


def _require_table(name: str, times: tuple[float, ...], values: tuple[float, ...]) -> None:
    if not times or len(times) != len(values):
        raise InputError(
            f"needs as many values as times, but has {len(values)} and {len(times)}",
            key=f"resin.temperature.{name}",
        )
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise InputError("has times that do not rise", key=f"resin.temperature.{name}")
    _require_temperatures(name, values)


def _require_temperatures(name: str, values: Sequence[float]) -> None:
    if not (np.all(np.isfinite(values)) and np.all(np.asarray(values) > 0.0)):
        raise InputError("must be above absolute zero", key=f"resin.temperature.{name}")


def temperature_of(table: tables.Resin) -> ResinTemperature | None:
    """Return the temperature by the table of a resin; None where it has none."""
    entry = table.temperature
    return None if entry is None else _TEMPERATURES[entry.law](entry)


def _constant_temperature(table: tables.ConstantResinTemperature) -> ResinTemperature:
    return ConstantTemperature(table.value)


def _prescribed(table: tables.PrescribedResinTemperature) -> ResinTemperature:
    return PrescribedTemperature(table.times, table.values)


def _mould(table: tables.MouldResinTemperature) -> ResinTemperature:
    times = (0.0,) if table.times is None else table.times
    return MouldTemperature(table.inlet, times, table.mould, table.diffusivity)


_TEMPERATURES: dict[str, Callable[..., ResinTemperature]] = {
    "constant": _constant_temperature,
    "prescribed": _prescribed,
    "mould": _mould,
}
