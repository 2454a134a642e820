"""Measured bulk permeability of a textile, and its change as the fibres shear.

In a textile with gaps between its tows most of the flow runs in the gaps, so that its permeability
does not follow from the fibres: it is measured. A measurement gives principal values of the flat
textile over the fibre volume fraction, and the direction of the first axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.coupling.principal_permeability import PrincipalPermeabilities, unit, within
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, read_coupon
from lcmchain.quantities.units import PERMEABILITY, Dimension
from lcmchain.scene.infiltration import laws as tables

_FRACTION = Dimension("fibre volume fraction", "1", "55 %", ("%", "1"), 1e-3, 1.0)
_COLUMNS = (
    Column("fibre volume fraction", _FRACTION),
    Column("k1", PERMEABILITY),
    Column("k2", PERMEABILITY),
    Column("k3", PERMEABILITY),
)


@dataclass(frozen=True)
class MeasuredPermeability:
    """Principal permeabilities of a flat textile over its fibre volume fraction.

    Parameters
    ----------
    law : name, for messages.
    logarithms : natural logarithms of K1, K2, K3 [m2], shape (3, ...), at fibre volume fractions
        of any shape.
    limits : smallest and largest fibre volume fraction for which they were measured.
    angle : from fibre direction 1 to the axis of K1 [rad], towards fibre direction 2, in the
        unsheared textile.
    """

    law: str
    logarithms: Callable[[np.ndarray], np.ndarray]
    limits: tuple[float, float]
    angle: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.limits
        if not 0.0 <= low < high <= 1.0:
            raise InputError(
                f"has the range {low:g} to {high:g}; it must rise and lie between 0 and 1",
                key="permeability.fibre_volume_fraction_range",
            )

    def values(
        self, fibre_volume_fraction: ArrayLike, *, out_of_range: str = "raise"
    ) -> np.ndarray:
        """Permeabilities K1, K2, K3 [m2] of the flat textile, shape (3, ...).

        Raises
        ------
        InputError : outside the measured range, unless ``out_of_range="nan"``.
        """
        v = np.asarray(fibre_volume_fraction, dtype=float)
        low, high = self.limits
        # a value beyond a bound by rounding is still within
        rounding = 1e-9
        outside = (v < low - rounding) | (v > high + rounding) | (v <= 0.0) | (v >= 1.0)
        name = f'the measured permeability ("{self.law}")'
        v = within(v, outside, self.limits, name=name, out_of_range=out_of_range)
        return np.exp(self.logarithms(v))

    def factor(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the mean permeability in the plane at fibre volume fractions over that before."""
        return self.values(now)[:2].sum(axis=0) / self.values(before)[:2].sum(axis=0)

    def principal(
        self,
        fibre_volume_fraction: np.ndarray,
        fibre_direction_1: np.ndarray,
        fibre_direction_2: np.ndarray,
        *,
        out_of_range: str = "raise",
    ) -> PrincipalPermeabilities:
        """Principal permeabilities of the sheared textile.

        The fibres carry the tensor of the flat textile at the present fibre volume fraction along:
        K = sum K_ij a_i a_j, with its components K_ij in the axes of the unsheared fibres and the
        present unit vectors a_i. The sum of both values in the plane does not change. For K1 = K2
        the axes lie on the bisectors, and the values have the ratio (1 + sin) : (1 - sin) of the
        shear angle, as for two plies of aligned fibres. This is a rule, not a measurement: the
        tensors of sheared fabrics turn and stretch in this sense (C.-L. Lai, W.-B. Young, Polymer
        Composites 18 (1997) 642), but by other amounts.

        Parameters
        ----------
        fibre_volume_fraction : shape (C,).
        fibre_direction_1, fibre_direction_2 : unit vectors (C, 3). Their signs matter only for an
            ``angle`` other than 0 and 90°; then they must be those that forming writes.
        """
        k1, k2, k3 = self.values(fibre_volume_fraction, out_of_range=out_of_range)
        a1 = np.asarray(fibre_direction_1, dtype=float)
        a2 = np.asarray(fibre_direction_2, dtype=float)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        k11 = k1 * cosine**2 + k2 * sine**2
        k22 = k1 * sine**2 + k2 * cosine**2
        k12 = (k1 - k2) * cosine * sine
        normal = unit(np.cross(a1, a2))
        across = np.cross(normal, a1)
        # fibre 2 in the frame of fibre 1 and the normal
        along_1 = np.einsum("ci,ci->c", a2, a1)
        along_2 = np.einsum("ci,ci->c", a2, across)
        xx = k11 + 2.0 * k12 * along_1 + k22 * along_1**2
        xy = (k12 + k22 * along_1) * along_2
        yy = k22 * along_2**2
        middle, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        turn = 0.5 * np.arctan2(xy, 0.5 * (xx - yy))[:, None]
        axis = np.cos(turn) * a1 + np.sin(turn) * across
        return PrincipalPermeabilities(
            middle + half, middle - half, k3, axis, np.cross(normal, axis), normal
        )


def measured_law(entry: tables.Permeability, directory: Path | None = None) -> MeasuredPermeability:
    """Return the law of a scene's ``permeability`` entry, which must be a measured one.

    directory : folder to which files are relative.

    Raises
    ------
    InputError : a table that cannot be read or that is no table of permeabilities.
    """
    return _LAWS[entry.law](entry, Path(directory or "."))


def read_permeabilities(
    file: Path, *, law: str = "table", angle: float = 0.0
) -> MeasuredPermeability:
    """Read a measured permeability from a CSV file.

    The header names the units: ``fibre volume fraction [%],k1 [m^2],k2 [m^2],k3 [m^2]``. Between
    the rows every permeability is a power of the fibre volume fraction.

    Raises
    ------
    InputError : a column or unit is missing, fewer than two rows, a fibre volume fraction that
        does not rise or is not between 0 and 1, a permeability that is not positive; names file,
        line and column.
    """
    data = read_coupon(file, (_COLUMNS,), minimum_rows=2)
    fraction = data["fibre volume fraction"]
    for row in np.flatnonzero((fraction <= 0.0) | (fraction >= 1.0))[:1]:
        raise data.wrong("fibre volume fraction", row, f"{fraction[row]:g} is not between 0 and 1")
    for row in np.flatnonzero(np.diff(fraction) <= 0.0)[:1]:
        raise data.wrong("fibre volume fraction", row + 1, "does not rise; sort the rows by it")
    names = ("k1", "k2", "k3")
    for name in names:
        for row in np.flatnonzero(data[name] <= 0.0)[:1]:
            raise data.wrong(name, row, f"{data[name][row]:g} is not positive")
    log_fraction, log_values = np.log(fraction), [np.log(data[name]) for name in names]

    def logarithms(v: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(np.log(v), log_fraction, values) for values in log_values])

    return MeasuredPermeability(law, logarithms, (fraction[0], fraction[-1]), angle)


def _constant(entry: tables.ConstantPermeability, directory: Path) -> MeasuredPermeability:
    return MeasuredPermeability(
        entry.law,
        lambda v: np.stack([np.full(v.shape, start) + 0.0 * v for start in _logs(entry)]),
        entry.fibre_volume_fraction_range or (0.0, 1.0),
        entry.angle,
    )


def _power(entry: tables.PowerPermeability, directory: Path) -> MeasuredPermeability:
    return _by_slope(entry, entry.exponents, lambda v: np.log(v / entry.fibre_volume_fraction))


def _exponential(entry: tables.ExponentialPermeability, directory: Path) -> MeasuredPermeability:
    return _by_slope(entry, entry.rates, lambda v: v - entry.fibre_volume_fraction)


def _by_slope(
    entry: tables.PowerPermeability | tables.ExponentialPermeability,
    slopes: tuple[float, ...],
    over: Callable[[np.ndarray], np.ndarray],
) -> MeasuredPermeability:
    """Return a law whose logarithms fall linearly, by ``slopes``, over a function of v."""

    def logarithms(v: np.ndarray) -> np.ndarray:
        return np.stack(
            [start - slope * over(v) for start, slope in zip(_logs(entry), slopes, strict=True)]
        )

    return MeasuredPermeability(
        entry.law, logarithms, entry.fibre_volume_fraction_range, entry.angle
    )


def _table(entry: tables.TablePermeability, directory: Path) -> MeasuredPermeability:
    return read_permeabilities(directory / entry.file, law=entry.law, angle=entry.angle)


def _logs(
    entry: tables.ConstantPermeability | tables.PowerPermeability | tables.ExponentialPermeability,
) -> tuple[float, ...]:
    return tuple(float(np.log(value)) for value in (entry.k1, entry.k2, entry.k3))


_LAWS: dict[str, Callable[..., MeasuredPermeability]] = {
    "constant": _constant,
    "power": _power,
    "exponential": _exponential,
    "table": _table,
}

#: Names of the measured laws.
MEASURED_LAWS = tuple(_LAWS)
