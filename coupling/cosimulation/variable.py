"""A variable of a unit: its type, its values in memory, its unit of measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.physical_units import PhysicalUnit

#: VariableValues (n,) of a variable in its own type; objects for texts.
VariableValues = NDArray[Any]

#: Types of numpy by the types of the standard; texts have none.
MEMORY = {
    "Real": "f8", "Integer": "i4", "Boolean2": "i4", "Enumeration2": "i4",
    "Float64": "f8", "Float32": "f4", "Int64": "i8", "UInt64": "u8", "Int32": "i4",
    "UInt32": "u4", "Int16": "i2", "UInt16": "u2", "Int8": "i1", "UInt8": "u1",
    "Enumeration": "i8", "Boolean": "?",
}  # fmt: skip
REALS = ("Real", "Float64", "Float32")
TEXT = "String"
TRUTHS = ("Boolean", "Boolean2")
#: Causality of the parameters that hold the sizes of arrays (FMI 3.0).
STRUCTURAL = "structuralParameter"
#: Types whose values are not exchanged.
LEFT_OUT = ("Binary", "Clock")


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable, or the scalars of FMI 2 that form one field.

    Parameters
    ----------
    name : of the variable; of a field of FMI 2 without the index.
    kind : its type in the standard; ``Boolean2`` and ``Enumeration2`` are those of FMI 2.
    references : value references (n,) in FMI 2, (1,) in FMI 3.
    size : number of its values.
    is_field : whether it is an array.
    start : texts of the start values, empty where there are none.
    unit : None where the description states none.
    relative : whether it measures differences.
    dimensions : of an array of FMI 3.0: numbers, and names of variables that hold them.
    limits : least and largest value of a structural parameter, None where there is no limit.
    """

    name: str
    kind: str
    causality: str
    variability: str
    initial: str | None
    references: NDArray[np.uint32]
    size: int
    is_field: bool
    start: tuple[str, ...] = ()
    unit: PhysicalUnit | None = None
    relative: bool = False
    description: str = ""
    dimensions: tuple[int | str, ...] = ()
    limits: tuple[float | None, float | None] = (None, None)

    @property
    def is_real(self) -> bool:
        return self.kind in REALS

    @property
    def is_text(self) -> bool:
        return self.kind == TEXT

    @property
    def is_signal(self) -> bool:
        """Whether it changes continuously; anything else changes at communication points."""
        return self.is_real and self.variability == "continuous"

    @property
    def dtype(self) -> np.dtype:
        """Return the type of its values in memory; objects for texts."""
        return np.dtype(object if self.is_text else MEMORY[self.kind])

    @property
    def type_name(self) -> str:
        return self.kind.removesuffix("2")

    @property
    def unit_text(self) -> str:
        return "1" if self.unit is None else self.unit.name
