"""One instance of a unit: what it offers, in FMI 2.0 and 3.0 alike, and its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from lcmchain.coupling.cosimulation.description import Variable, VariableValues
from lcmchain.errors import SimulationError

#: Takes a message of a unit: its status in words, its category and its text.
Log = Callable[[str, str, str], None]


class CallFailed(SimulationError):
    """A call that the unit answered with an error, or not at all.

    Parameters
    ----------
    discarded : the call did nothing and the unit can go on.
    reached : how far a step came [s].
    """

    #: Whether the unit is gone, together with its process.
    is_loss = False

    def __init__(
        self, message: str, *, discarded: bool = False, reached: float | None = None
    ) -> None:
        self.discarded, self.reached = discarded, reached
        super().__init__(message)


class EndRequested(SimulationError):
    """The unit wants the simulation to end before the end of a step."""


class Instance(Protocol):
    """An instance of a unit. Every call raises CallFailed where the unit answers with an error.

    A state of the unit goes by a number, ``handle``: its address in this process, or a count in a
    process of the unit's own.
    """

    def configure(self, settings: Sequence[tuple[Variable, VariableValues]]) -> None:
        """Set structural parameters (n,) in the configuration mode, before all else (FMI 3.0)."""

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        """Set the times of the experiment [s] and its tolerance, before the initialisation."""

    def enter_initialization(self) -> None:
        """Begin the initialisation."""

    def exit_initialization(self) -> None:
        """End the initialisation."""

    def read(self, variable: Variable) -> VariableValues:
        """Return the values (n,) of a variable, a new array."""

    def write(self, variable: Variable, values: VariableValues) -> None:
        """Set the values (n,) of a variable."""

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        """Go on from ``time`` by ``size`` [s]; return whether the unit wants the simulation to end.

        returns : the master may restore a state of an earlier time.

        Raises
        ------
        CallFailed : with ``discarded`` and ``reached`` where the unit refuses the step.
        EndRequested : the unit wants the simulation to end before the end of the step.
        """

    def save(self) -> int:
        """Return the handle of the present state, valid until it is released."""

    def restore(self, handle: int) -> None:
        """Return to a state."""

    def release(self, handle: int) -> None:
        """Free the memory of a state."""

    def serialise(self, handle: int) -> bytes:
        """Return a state as bytes."""

    def deserialise(self, content: bytes) -> int:
        """Return the handle of a state that is read from bytes."""

    def terminate(self) -> None:
        """End the simulation."""

    def free(self) -> None:
        """Free the instance; nothing may be called after it."""
