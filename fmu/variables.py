"""The interface of a unit as data: one definition, from which both model descriptions come.

A field is one variable with a ``size``. FMI 3 passes it as one array; FMI 2 has no arrays, so that
there every entry becomes a scalar variable ``name[i]``. Indices start at 1 as in all structured FMI
names: ``thickness[1]`` belongs to element 0 (face 0 of ``forming.nc``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple


class Kind(Enum):
    """Type of a variable, by its name in FMI 2."""

    REAL = "Real"
    INTEGER = "Integer"
    BOOLEAN = "Boolean"
    STRING = "String"


Causality = Literal["parameter", "input", "output", "local", "independent"]
Variability = Literal["constant", "fixed", "discrete", "continuous"]


@dataclass(frozen=True)
class Variable:
    """One entry of the interface.

    Parameters
    ----------
    name : structured FMI name.
    kind, causality, variability : as in the FMI standard.
    description : one line.
    unit : key of :data:`UNITS`, None where a unit has no meaning.
    declared_type : name of the type that the model description declares for it: its quantity
        (:data:`DECLARED_TYPES`), or what its integer codes (:data:`ENUMERATIONS`); None for that of
        the unit (:data:`TYPE_OF_UNIT`) or the kind (:data:`TYPE_OF_KIND`).
    start : value before the first step, one number also for a field; None for what is computed.
    minimum, maximum, nominal : as in the FMI standard.
    size : number of entries of a field, None for a scalar.
    group : outputs of one name are computed together, and only when a master asks for one of them;
        empty for what is set or always known.
    dependencies : names of the inputs that an output depends on at the same instant; a state that a
        step has reached depends on none.
    """

    name: str
    kind: Kind
    causality: Causality
    variability: Variability
    description: str
    unit: str | None = None
    declared_type: str | None = None
    start: float | int | bool | str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    size: int | None = None
    group: str = ""
    dependencies: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.unit is not None and self.unit not in UNITS:
            raise ValueError(f"{self.name}: no unit {self.unit}")
        if self.kind is Kind.STRING and self.size is not None:
            raise ValueError(f"{self.name}: fields of texts are not supported")
        if (self.start is None) != (self.causality in ("output", "independent")):
            raise ValueError(f"{self.name}: what is computed has no start, all else has one")

    @property
    def type_name(self) -> str | None:
        """Name of the declared type; None for a real number that has no unit."""
        if self.declared_type is not None:
            return self.declared_type
        if self.kind is not Kind.REAL:
            return TYPE_OF_KIND[self.kind]
        return None if self.unit is None else TYPE_OF_UNIT[self.unit]

    @property
    def is_enumeration(self) -> bool:
        """Whether it codes a state."""
        return self.declared_type in ENUMERATIONS

    @property
    def count(self) -> int:
        """Number of scalars."""
        return 1 if self.size is None else self.size

    def scalars(self) -> Iterator[tuple[str, str]]:
        """Yield name and description of every scalar that stands for the variable in FMI 2."""
        if self.size is None:
            yield self.name, self.description
            return
        for entry in range(self.size):
            yield f"{self.name}[{entry + 1}]", f"{self.description}, entry {entry}"


#: Units and their exponents of the SI base units.
UNITS: dict[str, dict[str, int]] = {
    "m": {"m": 1},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "m/s": {"m": 1, "s": -1},
    "m2/s": {"m": 2, "s": -1},
    "m3/s": {"m": 3, "s": -1},
    "m3/(s.Pa)": {"kg": -1, "m": 4, "s": 1},
    "Pa.s/m3": {"kg": 1, "m": -4, "s": -1},
    "kg": {"kg": 1},
    "kg/m3": {"kg": 1, "m": -3},
    "kg/m2": {"kg": 1, "m": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Pa.s": {"kg": 1, "m": -1, "s": -1},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "K": {"K": 1},
    "1": {},
}


class Quantity(NamedTuple):
    """A type of real variables: its unit, and how values of it are.

    nominal : value that is usual, where that is far from 1. shown_in : unit, one of
    :data:`DISPLAY_UNITS`, in which engineers expect it.
    """

    unit: str
    nominal: float | None = None
    shown_in: str | None = None


#: Units in which values may be shown, by the unit that they are in: how many of them that is.
DISPLAY_UNITS: dict[str, dict[str, float]] = {
    "m": {"mm": 1e3},
    "m2": {"mm2": 1e6},
    "m3": {"mm3": 1e9},
    "m/s": {"mm/s": 1e3},
    "m2/s": {"mm2/s": 1e6},
    "m3/s": {"mm3/s": 1e9},
    "Pa": {"kPa": 1e-3, "MPa": 1e-6},
    "s": {"us": 1e6},
    "rad": {"deg": math.degrees(1.0)},
}

#: Quantities: the types that model descriptions declare for real variables. Areas and volumes are
#: those of elements.
DECLARED_TYPES: dict[str, Quantity] = {
    "Length": Quantity("m", None, "mm"),
    "Thickness": Quantity("m", 1e-3, "mm"),
    "Velocity": Quantity("m/s", None, "mm/s"),
    "ThicknessRate": Quantity("m/s", 1e-3, "mm/s"),
    "Area": Quantity("m2", 1e-4, "mm2"),
    "AreaRate": Quantity("m2/s", 1e-4, "mm2/s"),
    "Volume": Quantity("m3", 1e-7, "mm3"),
    "VolumeFlowRate": Quantity("m3/s", 1e-7, "mm3/s"),
    "FlowPerPressure": Quantity("m3/(s.Pa)", 1e-14),
    "FlowResistance": Quantity("Pa.s/m3", 1e12),
    "Mass": Quantity("kg"),
    "Density": Quantity("kg/m3", 1e3),
    "ArealMass": Quantity("kg/m2"),
    "Force": Quantity("N"),
    "Damping": Quantity("N.s/m"),
    "Pressure": Quantity("Pa", 1e5, "kPa"),
    "Modulus": Quantity("Pa", 1e6, "MPa"),
    "Viscosity": Quantity("Pa.s"),
    "Energy": Quantity("J"),
    "Time": Quantity("s"),
    "TimeStep": Quantity("s", 1e-6, "us"),
    "Rate": Quantity("1/s"),
    "Angle": Quantity("rad", None, "deg"),
    "AngularVelocity": Quantity("rad/s"),
    "Moment": Quantity("N.m"),
    "Temperature": Quantity("K", 3e2),
    "Fraction": Quantity("1"),
    "Ratio": Quantity("1"),
}

#: Types of integers that code a state: name, value and meaning of every item.
ENUMERATIONS: dict[str, tuple[tuple[str, int, str], ...]] = {
    "StepOutcome": (
        ("done", 0, "the last step was done, or there was none yet"),
        ("undone", 1, "the last step was undone"),
        ("interrupted", 2, "the user has interrupted the unit"),
        ("not_initialized", 3, "not initialized, or that has failed"),
    ),
    "FrontState": (
        ("moving", 0, "the front moves or waits"),
        ("filled", 1, "all is filled"),
        ("gelled", 2, "the resin has gelled"),
        ("no_gate_open", 3, "no gate is open"),
        ("trapped", 4, "what is dry cannot be reached"),
    ),
}

#: Types of what has no quantity of its own: the most general one of its unit.
TYPE_OF_UNIT = {own.unit: name for name, own in reversed(DECLARED_TYPES.items())} | {"1": "Ratio"}

#: Types of what is no real number and codes no state.
TYPE_OF_KIND = {Kind.INTEGER: "Count", Kind.BOOLEAN: "Switch", Kind.STRING: "Text"}

#: Time of the unit; FMI 3 wants it as a variable, FMI 2 allows it.
TIME = Variable(
    "time", Kind.REAL, "independent", "continuous", "time of the unit", "s", "Time", group="time"
)


def quoted(name: str) -> str:
    """Return a name as an identifier of the structured naming convention, quoted if need be."""
    return name if re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) else f"'{name}'"


#: Parameters and outputs of every unit.
COMMON_PARAMETERS = (
    Variable(
        "threads",
        Kind.INTEGER,
        "parameter",
        "fixed",
        "threads of the compiled loops, 0 = all cores, or one for a small mesh; the results do not "
        "depend on it",
        start=0,
        minimum=0,
    ),
    Variable(
        "out_dir",
        Kind.STRING,
        "parameter",
        "fixed",
        "folder for the result file, written on termination; empty = write nothing",
        start="",
    ),
)
COMMON_OUTPUTS = (
    Variable(
        "status",
        Kind.INTEGER,
        "output",
        "discrete",
        "0: the last step was done, 1: it was undone, 2: the user interrupted, 3: not initialized",
        group="status",
    ),
    Variable(
        "message", Kind.STRING, "output", "discrete", "why the last step was undone, else empty"
    ),
    Variable(
        "result_file", Kind.STRING, "output", "discrete", "path of the result file, once written"
    ),
)
#: States once more as enumerations, behind all others: masters may know these by their references,
#: and some (ecos) read an integer only where it is declared as one.
STEP_OUTCOME = Variable(
    "step_outcome",
    Kind.INTEGER,
    "output",
    "discrete",
    "status, as an enumeration",
    declared_type="StepOutcome",
    group="status",
)
