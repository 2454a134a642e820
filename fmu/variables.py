"""The interface of a unit as data: one definition, from which both model descriptions come.

A field is one variable with a ``size``. FMI 3 passes it as one array; FMI 2 has no arrays, so that
there every entry becomes a scalar variable ``name[i]``. Indices start at 1 as in all structured FMI
names: ``thickness[1]`` belongs to element 0 (face 0 of ``forming.nc``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Literal


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
    declared_type : name of the type that the model description declares for it, its quantity; None
        for that of the unit (:data:`TYPE_OF_UNIT`).
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
        """Name of the declared type; None for what is no real number, or has no unit."""
        if self.declared_type is not None or self.unit is None:
            return self.declared_type
        return TYPE_OF_UNIT[self.unit]

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
    "s": {"s": 1},
    "1/s": {"s": -1},
    "rad": {"rad": 1},
    "K": {"K": 1},
    "1": {},
}

#: Quantities with their units and, where they are far from 1, nominal values: the types that model
#: descriptions declare for real variables. Areas and volumes are those of elements.
DECLARED_TYPES: dict[str, tuple[str, float | None]] = {
    "Length": ("m", None),
    "Thickness": ("m", 1e-3),
    "Velocity": ("m/s", None),
    "ThicknessRate": ("m/s", 1e-3),
    "Area": ("m2", 1e-4),
    "AreaRate": ("m2/s", 1e-4),
    "Volume": ("m3", 1e-7),
    "VolumeFlowRate": ("m3/s", 1e-7),
    "FlowPerPressure": ("m3/(s.Pa)", 1e-14),
    "FlowResistance": ("Pa.s/m3", 1e12),
    "Mass": ("kg", None),
    "Density": ("kg/m3", 1e3),
    "ArealMass": ("kg/m2", None),
    "Force": ("N", None),
    "Damping": ("N.s/m", None),
    "Pressure": ("Pa", 1e5),
    "Viscosity": ("Pa.s", None),
    "Energy": ("J", None),
    "Time": ("s", None),
    "Rate": ("1/s", None),
    "Angle": ("rad", None),
    "Temperature": ("K", None),
    "Fraction": ("1", None),
    "Ratio": ("1", None),
}

#: Types of what has no quantity of its own: the most general one of its unit.
TYPE_OF_UNIT = {unit: name for name, (unit, _) in reversed(DECLARED_TYPES.items())} | {"1": "Ratio"}

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
