"""What scene tables are made of: their base, and the types of their entries.

A type is that of a quantity, a plain number, a row of values, a name, or a text. It reads what a
scene file holds, refuses what is wrong with an example, and describes itself to JSON Schema.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StrictBool,
    ValidationInfo,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from lcmchain.errors import shortened
from lcmchain.quantities.units import (
    ACCELERATION,
    ANGLE,
    AREAL_MASS,
    CURVATURE,
    DENSITY,
    DIFFUSIVITY,
    DYNAMIC_VISCOSITY,
    FLOW_RATE,
    FORCE,
    LENGTH,
    MASS,
    MOLAR_ENERGY,
    PENALTY,
    PERMEABILITY,
    PRESSURE,
    QUANTITY_PATTERN,
    RATE,
    SPEED,
    SPRING,
    STIFFNESS,
    TEMPERATURE,
    TIME,
    VISCOSITY,
    Dimension,
    QuantityError,
    length_factor,
    parse_quantity,
    split_row,
)

#: Validation context of a scene file: there, a physical quantity without a unit is an error.
#: Models built in Python take SI numbers as well.
FROM_FILE = {"from_file": True}

#: Largest plain number, and most values of a row: far beyond any use.
LARGEST_NUMBER = 1e15
MOST_VALUES = 10_000

#: Longest name, which also stands in names of files and variables, and longest other text.
LONGEST_NAME = 60
LONGEST_TEXT = 1000


def wrong(message: str, *, field: str | None = None) -> PydanticCustomError:
    """Make the error of one scene entry; `field` names the sub-entry that a model check is about.

    The message travels in the context because pydantic's own templates would read braces in it.
    """
    return PydanticCustomError("scene", "{message}", {"message": message, "field": field or ""})


def toml_like(value: object) -> str:
    """Return a value about as it stands in the file; of a table only that it is one."""
    if isinstance(value, str):
        return f'"{shortened(value)}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    return shortened(repr(value))


# --- kinds of values ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Range:
    """Values that an entry may take; an end in `open_ends` is itself not allowed.

    `words` completes "must …" where the SI numbers would not be understood.
    """

    low: float = -math.inf
    high: float = math.inf
    open_ends: tuple[float, ...] = ()
    words: str = ""

    def complaint(self, value: float) -> str | None:
        """Say what is wrong with the value, or None when it lies in the range."""
        too_low = value < self.low or (value == self.low and self.low in self.open_ends)
        too_high = value > self.high or (value == self.high and self.high in self.open_ends)
        return f"must {self}" if too_low or too_high else None

    def __str__(self) -> str:
        if self.words:
            return self.words
        if math.isinf(self.high):
            if self.low == 0:
                return "be positive" if 0 in self.open_ends else "not be negative"
            return f"be {'above' if self.low in self.open_ends else 'at least'} {self.low:g}"
        low = f"above {self.low:g}" if self.low in self.open_ends else f"at least {self.low:g}"
        high = f"below {self.high:g}" if self.high in self.open_ends else f"at most {self.high:g}"
        return f"be {low} and {high}"


ANY = Range()
POSITIVE = Range(0.0, open_ends=(0.0,))
NOT_NEGATIVE = Range(0.0)


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: text with a unit in a scene file, SI float in the model."""

    dimension: Dimension
    allowed: Range = ANY
    example: str | None = None

    @property
    def example_text(self) -> str:
        """A correct TOML value."""
        return f'"{self.example or self.dimension.example}"'

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        example = self.example or self.dimension.example
        return {"type": "string", "pattern": QUANTITY_PATTERN, "examples": [example]}

    @property
    def _is_size(self) -> bool:
        """Whether the value is never negative, unlike a coordinate."""
        return self.allowed.low >= 0.0

    def _validate(self, value: object, info: ValidationInfo) -> float:
        is_number = False
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if (info.context or {}).get("from_file"):
                raise wrong(
                    f"{value!r} has no unit; write {self.dimension.with_article} in quotes with "
                    f"its unit, for example {self.example_text}"
                )
            is_number, si_value = True, float(value)
        elif isinstance(value, str):
            try:
                si_value = parse_quantity(value, self.dimension, is_size=self._is_size)
            except QuantityError as error:
                raise wrong(str(error)) from None
        else:
            raise wrong(
                f"must be {self.dimension.with_article} in quotes with its unit, "
                f"for example {self.example_text}"
            )
        if not math.isfinite(si_value):
            raise wrong(f"{value!r} is not finite; for example {self.example_text}")
        complaint = self.dimension.complaint(si_value, is_size=self._is_size)
        if is_number and complaint:
            raise wrong(f"{value!r} is {complaint}; for example {self.example_text}")
        complaint = self.allowed.complaint(si_value)
        if complaint:
            raise wrong(f'{complaint}, but is "{value}"; for example {self.example_text}')
        return si_value


class _Checked:
    """Base of the types whose check asks for the value alone, not for where it comes from."""

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self._validate)

    def _validate(self, value: object) -> object:
        raise NotImplementedError


@dataclass(frozen=True)
class Number(_Checked):
    """A dimensionless number, written without quotes and unit."""

    example: float
    allowed: Range = ANY
    whole: bool = False

    @property
    def example_text(self) -> str:
        """A correct TOML value."""
        return f"{self.example:g}"

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        json_schema: JsonSchemaValue = {
            "type": "integer" if self.whole else "number",
            "examples": [self.example],
        }
        for bound, key in ((self.allowed.low, "Minimum"), (self.allowed.high, "Maximum")):
            if math.isfinite(bound):
                is_open = bound in self.allowed.open_ends
                json_schema[f"exclusive{key}" if is_open else key.lower()] = bound
        return json_schema

    def _validate(self, value: object) -> float | int:
        kind = "whole number" if self.whole else "number"
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise wrong(
                f"must be a plain {kind} without quotes or unit, but is {toml_like(value)}; "
                f"for example {self.example_text}"
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise wrong(f"{value!r} is not finite; for example {self.example_text}")
        if abs(value) > LARGEST_NUMBER or 0.0 < abs(value) < 1.0 / LARGEST_NUMBER:
            size = "large" if abs(value) > 1.0 else "small"
            raise wrong(f"is too {size} to compute with; for example {self.example_text}")
        if self.whole and not isinstance(value, int):
            raise wrong(f"must be a whole number, but is {value!r}; write {round(value)}")
        complaint = self.allowed.complaint(value)
        if complaint:
            raise wrong(f"{complaint}, but is {value!r}; for example {self.example_text}")
        return int(value) if self.whole else float(value)


@dataclass(frozen=True)
class Row:
    """Several values: a list of quantities, or one text with the unit at its end (`"0 20 mm"`).

    Parameters
    ----------
    example_text : a correct TOML value.
    count : how many values there must be; None for any number.
    minimum_count, maximum_count : the least and the largest number where `count` is None.
    entries : what one value is called in messages.
    one : whether a single value may stand without brackets.
    units : False for rows of plain numbers and of points, which have no one-text form.
    """

    example_text: str
    count: int | None = None
    minimum_count: int = 0
    maximum_count: int = MOST_VALUES
    entries: str = "values"
    units: bool = True
    one: bool = False

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._prepare, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        json_schema = handler(schema)
        if not self.units:
            return json_schema
        return {"anyOf": [json_schema, {"type": "string"}], "description": self.example_text}

    def _prepare(self, value: Any) -> tuple[Any, ...] | None:
        if value is None:
            return None
        if isinstance(value, str) and self.units:
            value = split_row(value) or value
        if self.one and isinstance(value, str | int | float):
            value = (value,)
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
            raise wrong(
                f"must be a list of {self.entries}, but is {toml_like(value)}; "
                f"for example {self.example_text}"
            )
        if self.count is not None and len(value) != self.count:
            raise wrong(
                f"needs {self.count} {self.entries}, but has {len(value)}; "
                f"for example {self.example_text}"
            )
        if len(value) < self.minimum_count:
            raise wrong(
                f"needs at least {self.minimum_count} {self.entries}, but has {len(value)}; "
                f"for example {self.example_text}"
            )
        if len(value) > self.maximum_count:
            raise wrong(
                f"has {len(value):,} {self.entries}; at most {self.maximum_count:,} are read"
            )
        return tuple(value)


@dataclass(frozen=True)
class UnitVector:
    """Three numbers that are scaled to length one."""

    example_text: str = "[0, 0, 1]"

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._normalise, handler(source))

    def _normalise(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        length = math.hypot(*vector)
        if length < 1e-300:
            raise wrong(f"has no direction because it is zero; for example {self.example_text}")
        x, y, z = vector
        return x / length, y / length, z / length


@dataclass(frozen=True)
class _Quoted(_Checked):
    """Base of names and texts, which stand in quotes."""

    example: str

    @property
    def example_text(self) -> str:
        """A correct TOML value."""
        return f'"{self.example}"'


@dataclass(frozen=True)
class Name(_Quoted):
    """A name that can serve in file names, netCDF variables and FMU variables."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_-]*$", "examples": [self.example]}

    def _validate(self, value: object) -> str:
        if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", value):
            raise wrong(
                f"{toml_like(value)} is not a name: use letters, digits, _ and -, "
                f"starting with a letter; for example {self.example_text}"
            )
        if len(value) > LONGEST_NAME:
            raise wrong(
                f"{toml_like(value)} has {len(value):,} characters; use at most {LONGEST_NAME}"
            )
        return value


@dataclass(frozen=True)
class LengthUnit(_Checked):
    """The unit of the coordinates in a mesh file, for example ``"mm"``."""

    example_text: str = '"mm"'

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": "string", "examples": ["mm", "m"]}

    def _validate(self, value: object) -> str:
        try:
            if not isinstance(value, str):
                raise QuantityError("not a text")
            length_factor(value)
        except QuantityError:
            raise wrong(
                f"{toml_like(value)} is not a unit of length; for example {self.example_text}"
            ) from None
        return value


@dataclass(frozen=True)
class Text(_Quoted):
    """A text that is not empty."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": "string", "minLength": 1, "examples": [self.example]}

    def _validate(self, value: object) -> str:
        if not isinstance(value, str):
            raise wrong(f"must be a text in quotes; for example {self.example_text}")
        if not value.strip():
            raise wrong(f"is empty; for example {self.example_text}")
        if len(value) > LONGEST_TEXT:
            raise wrong(f"has {len(value):,} characters; use at most {LONGEST_TEXT:,}")
        return value


class FileName(Text):
    """Name of a file that the scene needs, relative to its folder."""


@dataclass(frozen=True)
class OrFile(FileName):
    """Name of a file in place of a list; what it holds takes the place of its name.

    Parameters
    ----------
    read : returns the entries of a scene that a file holds.
    """

    read: Callable[[Path], object]

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._require_list, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        name = {"type": "string", "minLength": 1, "examples": [self.example]}
        return {"anyOf": [handler(schema), name]}

    def _require_list(self, value: object) -> object:
        if isinstance(value, str):
            raise wrong(
                f"names a file, {toml_like(value)}, which is read with a scene file alone; give "
                "its contents, or read the scene from a file or text"
            )
        return value


@dataclass(frozen=True)
class AbsentMeans:
    """What leaving out an optional entry means, for the table of defaulted values.

    An empty text keeps the entry out of that table (where another entry takes its place).
    """

    text: str


# --- entries by what they are ---------------------------------------------------------------------


Length = Annotated[float, Quantity(LENGTH)]
PositiveLength = Annotated[float, Quantity(LENGTH, POSITIVE)]
LengthOrZero = Annotated[float, Quantity(LENGTH, NOT_NEGATIVE)]
TimeOrZero = Annotated[float, Quantity(TIME, NOT_NEGATIVE)]
PositiveTime = Annotated[float, Quantity(TIME, POSITIVE)]
PositiveMass = Annotated[float, Quantity(MASS, POSITIVE)]
FlowRate = Annotated[float, Quantity(FLOW_RATE)]
Force = Annotated[float, Quantity(FORCE)]
Pressure = Annotated[float, Quantity(PRESSURE)]
Speed = Annotated[float, Quantity(SPEED, NOT_NEGATIVE)]
Acceleration = Annotated[float, Quantity(ACCELERATION)]
Angle = Annotated[float, Quantity(ANGLE)]
AcuteAngle = Annotated[
    float,
    Quantity(ANGLE, Range(0.0, math.pi / 2, (0.0, math.pi / 2), "be above 0 and below 90 deg")),
]
Stiffness = Annotated[float, Quantity(STIFFNESS)]
PositiveStiffness = Annotated[float, Quantity(STIFFNESS, POSITIVE)]
SpringStiffness = Annotated[float, Quantity(SPRING, NOT_NEGATIVE)]
Modulus = Annotated[float, Quantity(STIFFNESS, POSITIVE, "210 GPa")]
PositiveCurvature = Annotated[float, Quantity(CURVATURE, POSITIVE)]
PositiveForce = Annotated[float, Quantity(FORCE, POSITIVE)]
ForceOrZero = Annotated[float, Quantity(FORCE, NOT_NEGATIVE)]
Density = Annotated[float, Quantity(DENSITY, POSITIVE)]
ArealMass = Annotated[float, Quantity(AREAL_MASS, POSITIVE)]
Penalty = Annotated[float, Quantity(PENALTY, POSITIVE)]
Rate = Annotated[float, Quantity(RATE, NOT_NEGATIVE)]
PositiveRate = Annotated[float, Quantity(RATE, POSITIVE)]
Temperature = Annotated[float, Quantity(TEMPERATURE, POSITIVE)]
ActivationEnergy = Annotated[float, Quantity(MOLAR_ENERGY, NOT_NEGATIVE)]
Viscosity = Annotated[float, Quantity(DYNAMIC_VISCOSITY, POSITIVE)]
Diffusivity = Annotated[float, Quantity(DIFFUSIVITY, POSITIVE)]
PermeabilityValue = Annotated[float, Quantity(PERMEABILITY, POSITIVE)]
ViscousDamping = Annotated[float, Quantity(VISCOSITY, NOT_NEGATIVE)]
FibreRadius = Annotated[float, Quantity(LENGTH, POSITIVE, "3.5 um")]
FrictionCoefficient = Annotated[float, Number(0.157, Range(0.0, 1.0))]

_Coordinate = Annotated[float, Number(1.0)]
Direction = Annotated[
    tuple[_Coordinate, _Coordinate, _Coordinate],
    Row("[0, 0, -1]", count=3, entries="numbers", units=False),
    UnitVector(),
]
Position = Annotated[tuple[Length, Length, Length], Row('["0 mm", "0 mm", "5 mm"]', count=3)]
PointInPlane = Annotated[tuple[Length, Length], Row('["0 mm", "5 mm"]', count=2)]
Switch = StrictBool

#: Most stages of a process.
MOST_STAGES = 50

#: Names of stages, or None for all of them.
AtWork = Annotated[
    Annotated[
        tuple[Annotated[str, Name("draw")], ...],
        Row('["draw", "close"]', entries="names", units=False, minimum_count=1,
            maximum_count=MOST_STAGES),
    ]
    | None,
    AbsentMeans(""),
]  # fmt: skip

#: What the entry means.
AT_WORK = "The stages of [[stages]] in which it is at work; left out, all of them."


def share_a_stage(one: tuple[str, ...] | None, other: tuple[str, ...] | None) -> bool:
    """Tell whether two entries are at work in a stage together; None is at work in all."""
    return one is None or other is None or bool(set(one) & set(other))


# --- tables ---------------------------------------------------------------------------------------


class SceneModel(BaseModel):
    """Base of all scene tables: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


class Named(Protocol):
    """An entry of a list of tables that has a name."""

    @property
    def name(self) -> str | None: ...


NamedEntry = TypeVar("NamedEntry", bound=Named)


def with_own_names(items: tuple[NamedEntry, ...]) -> tuple[NamedEntry, ...]:
    """Return the entries of a list; refuse two of the same name."""
    names = [item.name for item in items]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise wrong(
                f'has the name "{name}" twice, at [{names.index(name)}] and [{index}]; '
                "give each its own name"
            )
    return items


def no_such(name: str, known: Sequence[str], what: str) -> str:
    """Say that nothing has a name that an entry gives, and what may be meant instead."""
    if not known:
        return f"but there is no {what}"
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f'did you mean "{close[0]}"?' if close else f"there is {', '.join(known)}"
    return f"but there is no {what} of this name; {hint}"
