"""Units of measurement of variables, and the conversion of values from one to another."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

#: Base units in the order of the exponents; angles count as plain numbers, as in the SI.
BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
_DIMENSIONS = {
    "[mass]": 0, "[length]": 1, "[time]": 2, "[current]": 3, "[temperature]": 4,
    "[substance]": 5, "[luminosity]": 6,
}  # fmt: skip
#: Spellings of model descriptions that pint reads as something else or not at all.
_SPELLINGS = {"1": "dimensionless", "-": "dimensionless", "": "dimensionless", "°C": "degC",
              "%": "percent", "C": "coulomb"}  # fmt: skip


class UnitError(ValueError):
    """A unit that is not known, or one that does not fit."""


@dataclass(frozen=True)
class PhysicalUnit:
    """A unit: a value v in it is ``factor v + offset`` in base units with these exponents."""

    name: str
    factor: float
    offset: float
    exponents: tuple[float, ...]

    @property
    def is_plain(self) -> bool:
        """Whether it measures plain numbers and angles."""
        return not any(self.exponents)


@dataclass(frozen=True)
class Conversion:
    """``factor v + offset``; exact where both are in the same unit."""

    factor: float = 1.0
    offset: float = 0.0

    @property
    def is_identity(self) -> bool:
        return self.factor == 1.0 and self.offset == 0.0

    def __call__(self, values: Values) -> Values:
        """Return the converted values, a new array."""
        if self.is_identity:
            return np.array(values, dtype=np.float64)
        return self.factor * values + self.offset

    def then(self, other: Conversion) -> Conversion:
        """Return this conversion followed by another one."""
        return Conversion(self.factor * other.factor, self.offset * other.factor + other.offset)


def conversion(source: PhysicalUnit, target: PhysicalUnit, *, relative: bool = False) -> Conversion:
    """Return the conversion between two units.

    Parameters
    ----------
    relative : the values are differences, to which an offset (0 degC) does not apply.

    Raises
    ------
    UnitError : they measure different quantities.
    """
    if source.exponents != target.exponents:
        raise UnitError(
            f"{source.name} ({_dimension_text(source)}) cannot be converted into "
            f"{target.name} ({_dimension_text(target)})"
        )
    if (source.factor, source.offset) == (target.factor, target.offset):
        return Conversion()
    factor = _tidy(source.factor / target.factor)
    offset = 0.0 if relative else (source.offset - target.offset) / target.factor
    return Conversion(factor, offset)


def unit_from_name(name: str, known: Mapping[str, PhysicalUnit] | None = None) -> PhysicalUnit:
    """Return the unit with a name as in model descriptions, such as ``N.m`` or ``m/s2``.

    Parameters
    ----------
    known : units that the archive defines; they go before the usual meaning of the name.

    Raises
    ------
    UnitError : it is not known.
    """
    name = name.strip()
    if known and name in known:
        return known[name]
    return _unit_from_name(name)


@functools.lru_cache(maxsize=1000)
def _unit_from_name(name: str) -> PhysicalUnit:
    registry = _registry()
    text = _SPELLINGS.get(name, name)
    # "m/s2" is m/s**2, "N.m" and "N m" are N*m, "kg.m-3" is kg*m**-3
    text = re.sub(r"(?<=[A-Za-z])\.(?=[A-Za-z])", "*", text)
    text = re.sub(r"(?<=[A-Za-z])(-?\d+)(?![\d.])", r"**\1", text)
    # newton metres, which pint takes for the metric count of yarns, and a capital ohm
    text = re.sub(r"(?<![A-Za-z])([kMGmµu]?)N(m{1,2})(?![A-Za-z])", r"(\1N*\2)", text)
    text = re.sub(r"(?<![A-Za-z])([kMGmµu]?)Ohm(?![A-Za-z])", r"\1ohm", text)
    try:
        if len(name) > 100 or set(text) & set("[]{}"):
            raise ValueError(name)
        unit = registry.parse_units(text)
        zero, one = (registry.Quantity(Decimal(value), unit).to_base_units() for value in (0, 1))
        exponents = [0.0] * len(BASE)
        for dimension, power in unit.dimensionality.items():
            exponents[_DIMENSIONS[dimension]] = float(power)
    # pint reports a malformed expression in many ways (tokenizer, syntax, attribute, offset)
    except Exception:
        raise UnitError(f'unknown unit "{name}"') from None
    offset = _tidy(float(zero.magnitude))
    factor = _tidy(float(one.magnitude - zero.magnitude))
    return PhysicalUnit(name, factor, offset, tuple(exponents))


def is_usual(unit: PhysicalUnit) -> bool:
    """Whether a unit has the usual meaning of its name."""
    try:
        return unit_from_name(unit.name) == unit
    except UnitError:
        return False


def unit_from_base(
    name: str, exponents: tuple[float, ...], factor: float, offset: float
) -> PhysicalUnit:
    """Return a unit that a model description defines by base units.

    Raises
    ------
    UnitError : its factor is no positive number.
    """
    if not (0.0 < factor < math.inf and math.isfinite(offset)):
        raise UnitError(f'unit "{name}" has the factor {factor:g} and the offset {offset:g}')
    return PhysicalUnit(name, factor, offset, exponents)


def display_unit(name: str, unit: PhysicalUnit, factor: float, offset: float) -> PhysicalUnit:
    """Return the unit whose values are ``factor v + offset`` for values v in ``unit``.

    Raises
    ------
    UnitError : its factor is no positive number.
    """
    if not (0.0 < factor < math.inf and math.isfinite(offset)):
        raise UnitError(f'unit "{name}" has the factor {factor:g} and the offset {offset:g}')
    scale = unit.factor / factor
    return PhysicalUnit(name, scale, unit.offset - scale * offset, unit.exponents)


def value_of(
    text: str,
    unit: PhysicalUnit,
    *,
    relative: bool = False,
    known: Mapping[str, PhysicalUnit] | None = None,
) -> float:
    """Return a number with a unit, such as ``"5 kN"``, in another unit.

    known : see :func:`unit_from_name`.

    Raises
    ------
    UnitError : no number with a unit, an unknown unit, or one of another dimension.
    """
    match = re.fullmatch(
        r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", text, re.DOTALL
    )
    if match is None:
        raise UnitError(f'"{text}" is not a number with a unit')
    if not match[2] and not unit.is_plain:
        raise UnitError(
            f'"{text}" has no unit; write it with one, such as "{match[1]} {unit.name}"'
        )
    given = unit_from_name(match[2], known)
    number = np.array([float(match[1])])
    return float(conversion(given, unit, relative=relative)(number)[0])


@functools.lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    # exact: 1 degF is 5/9 K, also as the difference of two temperatures
    registry: Any = pint.UnitRegistry(non_int_type=Decimal)
    registry.define("rev = turn")
    return registry


def _tidy(number: float) -> float:
    """Remove rounding errors: 1000.0000000000001 is meant to be 1000."""
    rounded = float(f"{number:.14g}")
    return rounded if math.isclose(rounded, number, rel_tol=4e-16) else number


def _dimension_text(unit: PhysicalUnit) -> str:
    powers = [f"{base}^{power:g}" if power != 1 else base
              for base, power in zip(BASE, unit.exponents) if power]  # fmt: skip
    return " ".join(powers) or "plain number or angle"
