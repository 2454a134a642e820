"""Terzaghi's consolidation as two coupled parts: the standard problem for fluid and stiff solid.

A saturated column of height H is loaded by the stress sigma at its drained top; its base is closed.
The solid carries sigma - p (Terzaghi), the incompressible fluid leaves by Darcy's law:

    (K/mu) p'' = d(strain)/dt,     strain = -(sigma - p) / M.

Either part may give the pressure. If the fluid does, a mode of conductance a turns a pressure error
e into -e C/(a dt), with the solid's compliance C: staggered coupling diverges for low permeability,
soft solids and short windows. If the solid does, the factor is the reciprocal, a dt/C.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.linalg import solveh_banded

from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    THICKNESS,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
    CoupledPart,
    Exchange,
    Fields,
    Tolerance,
    Values,
    fixed_stress_exchanges,
)
from lcmchain.coupling.iteration.schemes import Scheme
from lcmchain.coupling.iteration.system import CoupledSystem, WindowControl
from lcmchain.errors import InputError


@dataclass(frozen=True)
class Column:
    """A column of 1 m2 in equal cells, cell 0 at the closed base.

    Parameters
    ----------
    height : H [m].
    cell_count : number of cells.
    modulus : M, drained stiffness of the solid for strain along the column [Pa].
    hardening : b of the law effective stress = M/b (exp(b compression) - 1); linear for b = 0 and
        in tension.
    permeability : K [m2].
    viscosity : mu [Pa s].
    load : sigma, compressive stress on the top from time 0 on [Pa].
    """

    height: float = 0.01
    cell_count: int = 40
    modulus: float = 1e6
    hardening: float = 0.0
    permeability: float = 1e-12
    viscosity: float = 0.1
    load: float = 1e5

    def __post_init__(self) -> None:
        for name in ("height", "modulus", "permeability", "viscosity"):
            value = getattr(self, name)
            if not (0.0 < value < math.inf):
                raise InputError(f"{name} of a column must be positive, not {value:g}")
        if self.cell_count < 2:
            raise InputError(f"a column needs at least 2 cells, not {self.cell_count}")

    @property
    def cell(self) -> float:
        """Return the height of a cell [m], its volume [m3] too."""
        return self.height / self.cell_count

    @property
    def consolidation_coefficient(self) -> float:
        """Return c_v = K M / mu [m2/s]."""
        return self.permeability * self.modulus / self.viscosity

    @property
    def time_scale(self) -> float:
        """Return H^2 / c_v [s], the time at which T = 1."""
        return self.height**2 / self.consolidation_coefficient

    def centres(self) -> Values:
        """Return the centres of the cells (n, 3) [m]."""
        z = (np.arange(self.cell_count) + 0.5) * self.cell
        return np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=1)

    def conductance(self) -> Values:
        """Return the symmetric band matrix (2, n) [m3/(s Pa)] from pressures to outflows."""
        between = self.permeability / self.viscosity / self.cell
        band = np.zeros((2, self.cell_count))
        band[0, 1:] = -between
        band[1] = 2.0 * between
        band[1, 0] = between  # closed base
        band[1, -1] = 3.0 * between  # half a cell to the drained top
        return band


class _ColumnPart:
    """Inputs, outputs, time and saved states of a part of the column."""

    takes: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()

    def __init__(self, column: Column) -> None:
        self.column = column
        self._time = 0.0
        zeros = np.zeros(column.cell_count)
        self._fields: Fields = {name: zeros.copy() for name in (*self.takes, *self.gives)}

    @property
    def time(self) -> float:
        return self._time

    def places(self, name: str) -> Values | None:
        """Return the centres of the cells."""
        return self.column.centres()

    def save(self) -> tuple[float, Fields]:
        """Return a copy of the state."""
        return self._time, {name: values.copy() for name, values in self._fields.items()}

    def restore(self, saved: tuple[float, Fields]) -> None:
        """Return to a saved state."""
        self._time, fields = saved
        self._fields = {name: values.copy() for name, values in fields.items()}

    def set_fields(self, fields: Mapping[str, Values]) -> None:
        """Take inputs."""
        for name, values in fields.items():
            if name not in self.takes:
                raise InputError(f'"{name}" is no input of {type(self).__name__}')
            if np.shape(values) != (self.column.cell_count,):
                raise InputError(f"{name}: {np.size(values)} values, not {self.column.cell_count}")
            self._fields[name] = np.array(values, dtype=np.float64)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs."""
        for name in names:
            if name not in self.gives:
                raise InputError(f'"{name}" is no output of {type(self).__name__}')
        return {name: self._fields[name].copy() for name in names}


class FluidColumn(_ColumnPart):
    """Pressure from the rate of the cells' volumes: A p = -(rate + slope (p - reference))."""

    takes = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE)
    gives = (PORE_PRESSURE,)

    def advance(self, step: float) -> None:
        """Solve for the pressure at the end of the step; the fluid keeps no memory."""
        band = self.column.conductance()
        slope = self._fields[VOLUME_RATE_SLOPE]
        band[1] += slope
        source = slope * self._fields[REFERENCE_PRESSURE] - self._fields[VOLUME_RATE]
        self._fields[PORE_PRESSURE] = solveh_banded(band, source)
        self._time += step


class SolidColumn(_ColumnPart):
    """Volumes of the cells from the pore pressure under a constant total stress.

    ``slope_factor`` scales the slope that it reports; from 0.5 on the fixed-stress split converges.
    """

    takes = (PORE_PRESSURE,)
    gives = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, THICKNESS)

    def __init__(self, column: Column, slope_factor: float = 1.0) -> None:
        super().__init__(column)
        self.slope_factor = slope_factor
        self._fields[THICKNESS] = np.full(column.cell_count, column.cell)

    def advance(self, step: float) -> None:
        """Find the volumes under the effective stress sigma - p."""
        column, pressure = self.column, self._fields[PORE_PRESSURE]
        compression, compliance = _compression(column, column.load - pressure)
        thickness = column.cell * (1.0 - compression)
        self._fields[VOLUME_RATE] = (thickness - self._fields[THICKNESS]) / step
        self._fields[VOLUME_RATE_SLOPE] = self.slope_factor * column.cell * compliance / step
        self._fields[REFERENCE_PRESSURE] = pressure.copy()
        self._fields[THICKNESS] = thickness
        self._time += step


class OutflowColumn(_ColumnPart):
    """The inverse fluid: the rate of the cells' volumes from the pressure, rate = -A p."""

    takes = (PORE_PRESSURE,)
    gives = (VOLUME_RATE,)

    def advance(self, step: float) -> None:
        """Find the rate at the end of the step."""
        band, pressure = self.column.conductance(), self._fields[PORE_PRESSURE]
        outflow = band[1] * pressure
        outflow[1:] += band[0, 1:] * pressure[:-1]
        outflow[:-1] += band[0, 1:] * pressure[1:]
        self._fields[VOLUME_RATE] = -outflow
        self._time += step


class SqueezedColumn(_ColumnPart):
    """The inverse solid: the pressure from the rate of the volumes, total less effective stress."""

    takes = (VOLUME_RATE,)
    gives = (PORE_PRESSURE, THICKNESS)

    def __init__(self, column: Column) -> None:
        super().__init__(column)
        self._fields[THICKNESS] = np.full(column.cell_count, column.cell)
        self._fields[PORE_PRESSURE] = np.full(column.cell_count, column.load)

    def advance(self, step: float) -> None:
        """Change the volumes, and evaluate the effective stress by the law."""
        column = self.column
        thickness = self._fields[THICKNESS] + step * self._fields[VOLUME_RATE]
        compression = 1.0 - thickness / column.cell
        self._fields[THICKNESS] = thickness
        self._fields[PORE_PRESSURE] = column.load - _effective_stress(column, compression)
        self._time += step


#: Which part gives the pressure, and whether the fixed-stress split stabilises it.
Direction = Literal["pressure_from_fluid", "fixed_stress", "pressure_from_solid"]


def coupled_column(
    column: Column,
    scheme: Scheme,
    window: WindowControl | float,
    *,
    direction: Direction = "pressure_from_fluid",
    slope_factor: float = 1.0,
    relative: float = 1e-6,
    bounds: tuple[float, float] | None = None,
    **options: Any,
) -> CoupledSystem:
    """Return the column as a system of the parts ``solid`` and ``fluid``; see :data:`Direction`.

    ``relative`` is the tolerance of both fields, ``bounds`` those of the pressure [Pa]; ``options``
    go to :class:`CoupledSystem`.
    """
    tolerance = Tolerance(relative)
    parts: dict[str, CoupledPart]
    if direction == "pressure_from_solid":
        parts = {"fluid": OutflowColumn(column), "solid": SqueezedColumn(column)}
        exchanges = [
            Exchange("fluid", "solid", VOLUME_RATE, within="held", tolerance=tolerance),
            Exchange("solid", "fluid", PORE_PRESSURE, tolerance=tolerance, bounds=bounds),
        ]
    else:
        parts = {"solid": SolidColumn(column, slope_factor), "fluid": FluidColumn(column)}
        exchanges = [
            Exchange(
                "solid",
                "fluid",
                VOLUME_RATE,
                of_window="mean",
                within="held",
                tolerance=tolerance,
            ),
            Exchange("fluid", "solid", PORE_PRESSURE, tolerance=tolerance, bounds=bounds),
        ]
        if direction == "fixed_stress":
            exchanges += fixed_stress_exchanges("solid", "fluid")
    return CoupledSystem(parts, exchanges, scheme, window=window, **options)


def degree_of_consolidation(time_factor: float, terms: int = 200) -> float:
    """Return U(T) of Terzaghi's series (Terzaghi 1923)."""
    m = (2.0 * np.arange(terms) + 1.0) * math.pi / 2.0
    return float(1.0 - np.sum(2.0 / m**2 * np.exp(-(m**2) * time_factor)))


def settlement_share(system: CoupledSystem, column: Column) -> float:
    """Return the settlement over its final value."""
    thickness = system.get_fields([f"solid.{THICKNESS}"])[f"solid.{THICKNESS}"]
    final, _ = _compression(column, np.full(column.cell_count, column.load))
    return float((column.height - thickness.sum()) / (column.cell * final.sum()))


def _compression(column: Column, effective: Values) -> tuple[Values, Values]:
    """Return the compression under an effective stress and its derivative [1/Pa]."""
    b, modulus = column.hardening, column.modulus
    # a pressure above the load pulls: there the law is linear
    grown = 1.0 + b * np.maximum(effective, 0.0) / modulus
    pressed = np.log(grown) / b if b else effective / modulus
    return np.where(effective > 0.0, pressed, effective / modulus), 1.0 / (modulus * grown)


def _effective_stress(column: Column, compression: Values) -> Values:
    """Return the effective stress of a compression; the inverse of :func:`_compression`."""
    b, modulus = column.hardening, column.modulus
    if b == 0.0:
        return modulus * compression
    with np.errstate(over="ignore"):  # the system refuses infinite values
        pressed = modulus / b * np.expm1(b * compression)
    return np.where(compression > 0.0, pressed, modulus * compression)
