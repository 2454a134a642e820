"""The interface of a unit as data: one definition, from which both model descriptions come.

A field is one variable with a ``size``. FMI 3 passes it as one array; FMI 2 has no arrays, so that
there every entry becomes a scalar variable ``name[i]``. Indices start at 1 as in all structured FMI
names: ``thickness[1]`` belongs to element 0 (face 0 of ``forming.nc``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np


class Kind(Enum):
    """Type of a variable, by its name in FMI 2."""

    REAL = "Real"
    INTEGER = "Integer"
    BOOLEAN = "Boolean"
    STRING = "String"


Causality = Literal["parameter", "input", "output", "local", "independent"]
Variability = Literal["constant", "fixed", "discrete", "continuous"]

#: Values of outputs by name: numbers, and arrays of fields.
Outputs = Mapping[str, float | np.ndarray]


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


# --- values of an instance: where they lie in one flat array, by reference and by name ------------


class Layout:
    """Where the values of variables lie in one flat array, and which reference means which.

    With ``arrays`` (FMI 3) a variable has one value reference, its place in the definition; without
    (FMI 2) every scalar has one, which is its slot.

    Parameters
    ----------
    variables : the definition. arrays : whether fields have one reference.
    """

    def __init__(self, variables: Sequence[Variable], *, arrays: bool) -> None:
        self.variables, self.arrays = tuple(variables), arrays
        counts = np.array([variable.count for variable in self.variables], dtype=np.int64)
        self.first = np.concatenate([[0], np.cumsum(counts)])
        self.slot_count = int(self.first[-1])
        self.slots = {
            variable.name: slice(int(self.first[i]), int(self.first[i + 1]))
            for i, variable in enumerate(self.variables)
        }
        self.of_slot = np.repeat(np.arange(len(self.variables)), counts)
        kinds = [list(Kind).index(variable.kind) for variable in self.variables]
        self._kind_of_variable = np.array(kinds, dtype=np.int8)
        if arrays:
            self._kind = self._kind_of_variable
        else:
            self._kind = self._kind_of_variable[self.of_slot]
        self._all = list(range(self._kind.size))

    def locate(self, references: Sequence[int], kind: Kind) -> slice | np.ndarray:
        """Return the slots of references, a slice where they follow each other.

        Raises
        ------
        KeyError : a reference that no variable of this kind has; its argument is the reference.
        """
        references = list(references)
        if not references:
            return slice(0, 0)
        first, last = references[0], references[-1]
        if 0 <= first <= last < self._kind.size and references == self._all[first : last + 1]:
            fits = self._kind[first : last + 1] == list(Kind).index(kind)
            if not fits.all():
                raise KeyError(references[int(np.flatnonzero(~fits)[0])])
            if self.arrays:
                return slice(int(self.first[first]), int(self.first[last + 1]))
            return slice(first, last + 1)
        code = list(Kind).index(kind)
        for reference in references:
            if not 0 <= reference < self._kind.size or self._kind[reference] != code:
                raise KeyError(reference)
        if not self.arrays:
            return np.array(references)
        ranges = [np.arange(self.first[one], self.first[one + 1]) for one in references]
        return np.concatenate(ranges)

    def touched(self, slots: slice | np.ndarray) -> list[Variable]:
        """Return the variables that slots belong to."""
        of_slot = self.of_slot[slots]
        if of_slot.size == 0:
            return []
        if isinstance(slots, slice):
            return list(self.variables[of_slot[0] : of_slot[-1] + 1])
        return [self.variables[index] for index in np.unique(of_slot)]


class Values:
    """Values of all variables; those of texts by name.

    Parameters
    ----------
    layout : where the values lie.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.numbers = np.zeros(layout.slot_count)
        self.texts: dict[str, str] = {}
        for variable in layout.variables:
            if variable.kind is Kind.STRING:
                self.texts[variable.name] = str(variable.start or "")
            elif variable.start is not None:
                self.numbers[layout.slots[variable.name]] = variable.start

    def number(self, name: str) -> float:
        """Return the value of a scalar, 0 where there is none of this name."""
        where = self.layout.slots.get(name)
        return 0.0 if where is None else float(self.numbers[where.start])

    def field(self, name: str) -> np.ndarray:
        """Return a copy of the values of a field."""
        return self.numbers[self.layout.slots[name]].copy()

    def set_outputs(self, outputs: Outputs) -> None:
        """Set the named ones that the unit has."""
        for name, value in outputs.items():
            if name in self.layout.slots:
                self.numbers[self.layout.slots[name]] = value

    def inputs(self) -> Iterator[tuple[Variable, np.ndarray]]:
        """Yield the inputs with their values."""
        for variable in self.layout.variables:
            if variable.causality == "input":
                yield variable, self.numbers[self.layout.slots[variable.name]]

    def not_finite(self) -> str:
        """Name an input that is no finite number; empty if all are."""
        for variable, values in self.inputs():
            if not np.isfinite(values).all():
                entry = int(np.flatnonzero(~np.isfinite(values))[0])
                place = "" if variable.size is None else f"[{entry + 1}]"
                return f"the input {variable.name}{place} is {values[entry]}"
        return ""

    def inputs_in_words(self) -> str:
        """Return the inputs with their values, of fields their range."""
        words = []
        for variable, values in self.inputs():
            if variable.size is not None:
                words.append(f"{variable.name} = {values.min():.6g} to {values.max():.6g}")
            elif variable.kind is Kind.BOOLEAN:
                words.append(f"{variable.name} = {bool(values[0])}")
            else:
                words.append(f"{variable.name} = {float(values[0])!r}")
        return ", ".join(words) or "none"

    def settings(self) -> tuple[dict[str, np.ndarray], dict[str, str]]:
        """Return copies of the parameters and inputs: numbers and texts, by name."""
        numbers, texts = {}, {}
        for variable in self.layout.variables:
            if variable.causality not in ("parameter", "input"):
                continue
            if variable.kind is Kind.STRING:
                texts[variable.name] = self.texts[variable.name]
            else:
                numbers[variable.name] = self.field(variable.name)
        return numbers, texts

    def take(self, numbers: dict[str, np.ndarray], texts: dict[str, str]) -> None:
        """Set parameters and inputs from :meth:`settings`."""
        for name, values in numbers.items():
            self.numbers[self.layout.slots[name]] = values
        self.texts |= texts
