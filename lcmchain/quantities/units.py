"""Physical quantities of a scene file: text with a unit in, SI number out."""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_NUMBER_AND_UNIT = re.compile(rf"\s*({_NUMBER})\s*(\S.*)?")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(\s|$|[^\d,])")
# A unit may begin with 1, as in "0.5 1 2 1/m".
_ROW = re.compile(rf"\s*((?:{_NUMBER}[\s,]+)+{_NUMBER})(?:\s+(1\s*/.*)|\s*([^\d\s.+/-].*))")

#: Longest text of one quantity: what is longer was pasted by mistake, and pint is slow on it.
LONGEST_QUANTITY = 200

#: Pattern of a quantity for editors (JSON Schema); the unit itself is checked when read.
# A unit may begin with 1, as in "200 1/s".
QUANTITY_PATTERN = rf"^\s*{_NUMBER}(\s+1\s*/|\s*[^\d\s.,]).*$"


@dataclass(frozen=True)
class Dimension:
    """A kind of physical quantity that scene files may hold.

    Parameters
    ----------
    name : what the field calls it, for messages.
    unit : SI unit in which the program computes.
    example : text that a user may copy.
    common_units : spellings offered when an unknown unit looks like one of them.
    smallest, largest : sizes in the SI unit that any use lies well between; zero is allowed.
    """

    name: str
    unit: str
    example: str
    common_units: tuple[str, ...]
    smallest: float
    largest: float

    @property
    def with_article(self) -> str:
        """The name as it stands in a sentence."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"

    def complaint(self, value: float, *, is_size: bool = True) -> str | None:
        """Say why a value in the SI unit is too large or too small to compute with, if it is.

        What is no size, such as a coordinate, may lie as near to zero as rounding leaves it.
        """
        if abs(value) > self.largest:
            return f"too large to compute with (at most {self.largest:g} {self.unit})"
        if is_size and 0.0 < abs(value) < self.smallest:
            return f"too small to compute with (at least {self.smallest:g} {self.unit}, or 0)"
        return None


LENGTH = Dimension("length", "m", "5 mm", ("mm", "cm", "m", "um", "inch"), 1e-10, 1e6)
TIME = Dimension("time", "s", "100 ms", ("ms", "s", "us", "min"), 1e-12, 1e9)
MASS = Dimension("mass", "kg", "1.7 kg", ("kg", "g", "t", "lb"), 1e-12, 1e9)
FORCE = Dimension("force", "N", "20 N", ("N", "kN", "mN", "kgf", "lbf"), 1e-12, 1e12)
ANGLE = Dimension("angle", "rad", "45 deg", ("deg", "degree", "rad"), 1e-15, 1e4)
STIFFNESS = Dimension(
    "stiffness", "Pa", "0.1563 MPa", ("MPa", "GPa", "kPa", "Pa", "N/mm^2"), 1e-6, 1e15
)
PRESSURE = Dimension("pressure", "Pa", "0.1 MPa", ("MPa", "kPa", "Pa", "bar", "N/mm^2"), 1e-6, 1e15)
DENSITY = Dimension("density", "kg/m^3", "1810 kg/m^3", ("kg/m^3", "g/cm^3"), 1e-6, 1e8)
AREAL_MASS = Dimension("mass per area", "kg/m^2", "600 g/m^2", ("g/m^2", "kg/m^2"), 1e-9, 1e6)
PENALTY = Dimension(
    "contact stiffness per area", "Pa/m", "1 MPa/mm", ("MPa/mm", "Pa/m", "N/mm^3"), 1e-6, 1e21
)
CURVATURE = Dimension("curvature", "1/m", "10 1/m", ("1/m", "1/mm", "1/cm"), 1e-9, 1e9)
RATE = Dimension("rate", "1/s", "50 1/s", ("1/s", "1/ms", "Hz"), 1e-12, 1e15)
SPEED = Dimension("speed", "m/s", "10 mm/s", ("mm/s", "m/s", "mm/min", "m/min"), 1e-15, 1e6)
ACCELERATION = Dimension("acceleration", "m/s^2", "9.81 m/s^2", ("m/s^2", "mm/s^2"), 1e-12, 1e12)
FLOW_RATE = Dimension(
    "flow rate", "m^3/s", "5 ml/s", ("ml/s", "cm^3/s", "ml/min", "l/min", "m^3/s"), 1e-18, 1e6
)
TEMPERATURE = Dimension("temperature", "K", "60 degC", ("degC", "K", "degF"), 1.0, 1e4)
MOLAR_ENERGY = Dimension(
    "molar energy", "J/mol", "50 kJ/mol", ("kJ/mol", "J/mol", "kcal/mol"), 1e-6, 1e9
)
DYNAMIC_VISCOSITY = Dimension(
    "viscosity", "Pa*s", "0.1 Pa*s", ("Pa*s", "mPa*s", "cP", "P"), 1e-30, 1e15
)
DIFFUSIVITY = Dimension("diffusivity", "m^2/s", "0.15 mm^2/s", ("mm^2/s", "m^2/s"), 1e-20, 1e6)
PERMEABILITY = Dimension(
    "permeability", "m^2", "5e-11 m^2", ("m^2", "um^2", "mm^2", "darcy"), 1e-30, 1.0
)
SPRING = Dimension("spring stiffness", "N/m", "0.5 N/mm", ("N/mm", "N/m", "kN/m"), 1e-12, 1e15)
#: A share of a whole; files write it as a plain number or in percent (:func:`parse_fraction`).
FRACTION = Dimension("fraction", "1", "0.55", ("%", "1", "-"), 1e-9, 1.0)
VISCOSITY = Dimension("viscous damping", "N*s/m", "5 N*s/m", ("N*s/m", "kg/s"), 1e-15, 1e15)


class QuantityError(ValueError):
    """A text that is not a quantity of the dimension asked for."""


@lru_cache(maxsize=1)
def _registry():
    import pint

    # Decimal arithmetic: "1.004 mm" becomes the float nearest to 0.001004, the same on any machine.
    return pint.UnitRegistry(non_int_type=Decimal)


def split_row(text: str) -> list[str] | None:
    """Split ``"0 20 75 mm"`` into one quantity per number, or return None if it is not a row."""
    match = _ROW.fullmatch(text)
    if match is None:
        return None
    unit = (match[2] or match[3]).strip()
    return [f"{number} {unit}" for number in re.split(r"[\s,]+", match[1].strip())]


def parse_quantity(text: str, dimension: Dimension, *, is_size: bool = True) -> float:
    """Read a number with a unit and return it in SI units.

    Parameters
    ----------
    text : for example ``"5 mm"``, ``"0.1563 MPa"``, ``"600 g/m²"``, ``"45 deg"``.
    dimension : the kind of quantity that is needed.
    is_size : False for coordinates and the like, which may be as small as rounding leaves them.

    Raises
    ------
    QuantityError : no number, no unit, an unknown unit, a unit of another dimension, a text far
        too long, or a value that is not finite or beyond any use; the message says what is needed
        with an example.
    """
    if len(text) > LONGEST_QUANTITY:
        raise QuantityError(
            f"is a text of {len(text):,} characters; write {dimension.with_article} with its unit, "
            f'for example "{dimension.example}"'
        )
    needed = f'write {dimension.with_article} with its unit, for example "{dimension.example}"'
    match = _NUMBER_AND_UNIT.fullmatch(text)
    if _DECIMAL_COMMA.match(text):
        raise QuantityError(f'"{text}" has a decimal comma; write a point, for example "1.5 mm"')
    if match is None:
        raise QuantityError(f'"{text}" is not a number with a unit; {needed}')
    number, unit_text = match[1], match[2]
    if unit_text is None:
        raise QuantityError(f'"{text}" has no unit; {needed}')
    unit_text = unit_text.strip()
    if dimension is LENGTH and unit_text in ("mil", "mils"):
        unit_text = "thou"  # pint's mil is an angle, which a length cannot be
    if dimension in (STIFFNESS, PRESSURE) and re.fullmatch(r"m(Pa|pa)", unit_text):
        raise QuantityError(f'"{text}" is in millipascal; megapascal is written "{number} MPa"')

    if dimension is TEMPERATURE and unit_text in ("C", "F"):
        raise QuantityError(f'"{text}" is in coulomb or farad; write "{number} deg{unit_text}"')

    registry = _registry()
    unit = _parse_unit(unit_text, dimension, needed)
    wanted = registry.parse_units(dimension.unit)
    try:
        # pint treats radians, percent and plain numbers alike, so angles are told apart here.
        is_angle = registry.get_root_units(unit)[1] == registry.radian
    except ArithmeticError:  # a power far too high
        raise QuantityError(f'unknown unit "{unit_text}"; {needed}') from None
    if unit.dimensionality != wanted.dimensionality or is_angle != (dimension is ANGLE):
        kind = "an angle" if is_angle else f"of dimension {_dimension_text(unit)}"
        raise QuantityError(f'"{text}" is {kind}; {needed}')
    try:
        value = float(registry.Quantity(Decimal(number), unit).to(wanted).magnitude)
    except ArithmeticError:
        value = math.inf
    complaint = dimension.complaint(value, is_size=is_size)
    if complaint:
        raise QuantityError(f'"{text}" is {complaint}; {needed}')
    return value


def parse_fraction(text: str) -> float:
    """Read a share as ``"0.55"`` or ``"55 %"``.

    Raises
    ------
    QuantityError : no number, another unit, or more than 1.
    """
    match = _NUMBER_AND_UNIT.fullmatch(text)
    unit = "" if match is None else (match[2] or "").strip()
    if match is None or unit not in ("", "1", "-", "%"):
        raise QuantityError(f'"{text}" is no fraction; write "0.55" or "55 %"')
    value = float(match[1]) * (0.01 if unit == "%" else 1.0)
    if not abs(value) <= FRACTION.largest:
        raise QuantityError(f'"{text}" is more than 1; write "0.55" or "55 %"')
    return value


def length_factor(unit_text: str) -> float:
    """Length in metres of one unit of a mesh file, for example 0.001 for ``"mm"``.

    Raises
    ------
    QuantityError : not a unit of length.
    """
    return parse_quantity(f"1 {unit_text}", LENGTH)


def _parse_unit(unit_text: str, dimension: Dimension, needed: str):
    try:
        if set(unit_text) & set("[]{}"):  # pint drops a closing one with Python 3.13's tokenizer
            raise ValueError(unit_text)
        return _registry().parse_units(unit_text)
    # pint reports a malformed expression in many ways (tokenizer, syntax, scaling factor, operand).
    except Exception:
        close = difflib.get_close_matches(unit_text, dimension.common_units, n=1, cutoff=0.3)
        hint = f' (did you mean "{close[0]}"?)' if close else ""
        raise QuantityError(f'unknown unit "{unit_text}"{hint}; {needed}') from None


def _dimension_text(unit) -> str:
    return re.sub(r"[\[\]]", "", str(unit.dimensionality)).replace(" ** ", "^")
