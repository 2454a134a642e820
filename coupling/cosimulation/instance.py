"""One instance of a unit: what it offers, in FMI 2.0 and 3.0 alike, and its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.variable import Variable
from lcmchain.errors import SimulationError

#: Takes the status in words, the category and the text of a message of a unit.
Log = Callable[[str, str, str], None]


class CallFailed(SimulationError):
    """A call that the unit answered with an error, or not at all.

    ``discarded``: it did nothing and the unit can go on; ``reached``: how far a step came [s].
    """

    #: Whether the unit is gone, with the process that it was in.
    is_loss = False

    def __init__(
        self, message: str, *, discarded: bool = False, reached: float | None = None
    ) -> None:
        self.discarded, self.reached = discarded, reached
        super().__init__(message)


class EndRequested(SimulationError):
    """A step before whose end the unit wants the simulation to end."""


class Instance(Protocol):
    """An instance of a unit. Every call raises CallFailed where the unit answers with an error."""

    def configure(self, settings: Sequence[tuple[Variable, Any]]) -> None:
        """Set structural parameters (n,) in the configuration mode, before all else (FMI 3.0)."""

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        """Tell the experiment, before the initialisation."""

    def enter_initialization(self) -> None:
        """Begin the initialisation."""

    def exit_initialization(self) -> None:
        """End the initialisation."""

    def read(self, variable: Variable) -> NDArray[Any]:
        """Return the values (n,) of a variable, a new array."""

    def write(self, variable: Variable, values: Any) -> None:
        """Set the values (n,) of a variable."""

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        """Go on from ``time`` by ``size`` [s]; return whether the unit wants the simulation to end.

        returns : it may go back to an earlier time.

        Raises
        ------
        CallFailed : with ``discarded`` and ``reached`` where the unit refuses the step.
        EndRequested : the unit wants the simulation to end before the end of the step.
        """

    def save(self) -> Any:
        """Return a handle of the present state, valid until it is released."""

    def restore(self, handle: Any) -> None:
        """Return to a state."""

    def release(self, handle: Any) -> None:
        """Give a state back."""

    def serialise(self, handle: Any) -> bytes:
        """Return a state as bytes."""

    def deserialise(self, content: bytes) -> Any:
        """Return a handle of a state."""

    def terminate(self) -> None:
        """End the simulation."""

    def free(self) -> None:
        """Free the instance; nothing may be called after it."""
