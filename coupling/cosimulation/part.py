"""A unit as a part of a coupled system: fields, steps, and states to return to."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.description import UnitDescription, Variable, VariableValues
from lcmchain.coupling.cosimulation.instance import CallFailed, Instance
from lcmchain.coupling.cosimulation.start_values import Configuration
from lcmchain.coupling.iteration import PartFailed
from lcmchain.coupling.iteration.interface import Fields
from lcmchain.errors import InputError

_Result = TypeVar("_Result")


@dataclass
class Spent:
    """The cost of a unit: times [s] and numbers of calls."""

    instantiation: float = 0.0
    initialisation: float = 0.0
    steps: float = 0.0
    exchange: float = 0.0
    states: float = 0.0
    step_count: int = 0
    save_count: int = 0
    rollback_count: int = 0
    discard_count: int = 0

    @property
    def total(self) -> float:
        return self.instantiation + self.initialisation + self.steps + self.exchange + self.states


@dataclass(eq=False)
class SavedUnit:
    """A state in the memory of a unit; released with the last reference to it."""

    time: float
    handle: int
    instance: Instance

    def __del__(self) -> None:
        try:
            self.instance.release(self.handle)
        except CallFailed:
            pass  # the unit has failed; the process goes on without that memory


@dataclass(frozen=True)
class SerialisedUnit:
    """A state as bytes (n,) uint8, for a file."""

    time: float
    content: NDArray[np.uint8]


@dataclass(eq=False)
class FmuPart:
    """A unit that satisfies :class:`lcmchain.coupling.iteration.CoupledPart`.

    Its fields are its variables by name, whole arrays included, as float64 in the unit's own units
    of measurement. Values that change in jumps (whole numbers, switches, texts) do not go through
    the coupling: ``bring`` sets them just before every step.

    Parameters
    ----------
    name : in the system.
    file : the archive.
    sha256 : hash of the archive.
    time : begin [s].
    returns : whether the master may restore earlier states.
    bring : sets the inputs that change in jumps.
    wants_end : whether the unit has asked for the end of the simulation.
    apart : whether the unit is in a process of its own.
    given : the last numbers of its inputs, by name.
    configuration : structural parameters that are set before its initialisation.
    """

    name: str
    file: Path
    sha256: str
    description: UnitDescription
    instance: Instance
    time: float
    spent: Spent = field(default_factory=Spent)
    returns: bool = False
    bring: Callable[[], None] | None = None
    wants_end: bool = False
    apart: bool = False
    given: Fields = field(default_factory=dict)
    configuration: Configuration = field(default_factory=Configuration)

    def advance(self, step: float) -> None:
        """Do one communication step.

        Raises
        ------
        PartFailed : the unit refuses it or fails; tells how far it came.
        """
        if self.bring is not None:
            self.bring()
        with self._timed("steps"):
            self.spent.step_count += 1
            try:
                self.wants_end = self.instance.step(self.time, step, returns=self.returns)
            except CallFailed as failure:
                self.spent.discard_count += failure.discarded
                inputs = self.given if failure.is_loss else None
                raise PartFailed(_reason(failure), inputs=inputs) from failure
        self.time += step

    def save(self) -> SavedUnit:
        """Return the present state."""
        with self._timed("states"):
            self.spent.save_count += 1
            return SavedUnit(self.time, self._stated(self.instance.save), self.instance)

    def restore(self, saved: SavedUnit | SerialisedUnit) -> None:
        """Return to a state, from memory or from a file."""
        with self._timed("states"):
            if isinstance(saved, SerialisedUnit):
                content = saved.content.tobytes()
                handle = self._stated(lambda: self.instance.deserialise(content))
                kept = SavedUnit(saved.time, handle, self.instance)
            else:
                kept = saved
                self.spent.rollback_count += 1
            self._stated(lambda: self.instance.restore(kept.handle))
            self.time, self.wants_end = saved.time, False

    def serialised(self, saved: SavedUnit) -> SerialisedUnit:
        """Return a saved state as bytes."""
        with self._timed("states"):
            content = self._stated(lambda: self.instance.serialise(saved.handle))
        return SerialisedUnit(saved.time, np.frombuffer(content, dtype=np.uint8))

    def set_fields(self, fields: Mapping[str, NDArray[np.float64]]) -> None:
        """Set inputs (n,) by name.

        Raises
        ------
        InputError : a name that is no input, or a wrong number of values.
        """
        for name, values in fields.items():
            variable = self.description.find(name)
            if variable.causality != "input":
                raise InputError(f'"{name}" of unit "{self.name}" is no input')
            if np.shape(values) != (variable.size,):
                raise InputError(
                    f"{self.name}.{name} has {variable.size} values, but gets {np.size(values)}"
                )
            self.write(variable, values)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return the present values (n,) of variables by name.

        Raises
        ------
        InputError : there is none of that name, or it is a text.
        """
        fields: Fields = {}
        for name in names:
            variable = self.description.find(name)
            if variable.is_text:
                raise InputError(f'"{name}" of unit "{self.name}" is a text, not a field')
            fields[name] = self.read(variable).astype(np.float64)
        return fields

    def read(self, variable: Variable) -> VariableValues:
        """Return the values (n,) of a variable in its own type.

        Raises
        ------
        PartFailed : the unit does not give it.
        """
        with self._timed("exchange"), self._told(f'"{variable.name}" cannot be read'):
            return self.instance.read(variable)

    def write(self, variable: Variable, values: VariableValues) -> None:
        """Set the values (n,) of a variable.

        Raises
        ------
        PartFailed : the unit does not take it.
        """
        with self._timed("exchange"), self._told(f'"{variable.name}" cannot be set'):
            self.instance.write(variable, values)
        self.note(variable, values)

    def note(self, variable: Variable, values: VariableValues) -> None:
        """Note the values (n,) of an input, for the message where the unit is lost."""
        if variable.causality == "input" and not variable.is_text:
            self.given[variable.name] = np.atleast_1d(np.asarray(values, dtype=np.float64))

    def _stated(self, call: Callable[[], _Result]) -> _Result:
        with self._told("its state cannot be saved or restored"):
            return call()

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        try:
            yield
        except CallFailed as failure:
            inputs = self.given if failure.is_loss else None
            raise PartFailed(
                f"{what}: {failure}", part=self.name, time=self.time, inputs=inputs
            ) from failure

    @contextmanager
    def _timed(self, what: str) -> Iterator[None]:
        begin = clock.perf_counter()
        try:
            yield
        finally:
            setattr(self.spent, what, getattr(self.spent, what) + clock.perf_counter() - begin)


def _reason(failure: CallFailed) -> str:
    if not failure.discarded:
        return str(failure)
    if failure.reached is None or not math.isfinite(failure.reached):
        return f"it refused the step ({failure})"
    return f"it refused the step and came to {failure.reached:g} s ({failure})"
