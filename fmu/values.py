"""The values of a unit's variables, in one flat array."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lcmchain.fmu.layout import Layout
from lcmchain.fmu.variables import Kind, Variable


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

    def set_outputs(self, found: dict[str, float | np.ndarray]) -> None:
        """Set the named ones that the unit has."""
        for name, value in found.items():
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
