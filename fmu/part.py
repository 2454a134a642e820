"""What a unit is, and what the physics behind it offer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lcmchain.compilation.threads import use_threads
from lcmchain.fmu.messages import Messages
from lcmchain.fmu.saved_state import PartState
from lcmchain.fmu.values import Values
from lcmchain.fmu.variables import Variable


@dataclass(frozen=True)
class UnitDefinition:
    """What a unit is, before there is an instance of it.

    Parameters
    ----------
    guid : changes with what the unit computes and with its interface.
    fingerprint : hashes of what decides the numbers, by part.
    title, model_name : in words, and as an identifier of the C language.
    variables : the interface.
    stop_time, step_size : of the experiment that a master is proposed [s].
    """

    guid: str
    fingerprint: dict[str, str]
    title: str
    model_name: str
    variables: tuple[Variable, ...]
    stop_time: float
    step_size: float


class Part(ABC):
    """The physics of a unit; all raise :class:`lcmchain.errors.LcmchainError` where they cannot.

    ``values`` holds the parameters and inputs; ``say(text, status)`` hands a message to the master.
    ``target`` is the time since the start at which a step ends [s], as the master has it: sizes of
    steps that are added up drift from it by rounding.
    """

    values: Values
    say: Messages
    target: float = 0.0

    def attach(self, values: Values, say: Messages) -> None:
        """Take the values of the instance, and where messages go."""
        self.values, self.say = values, say

    @property
    def element_count(self) -> int | None:
        """Elements of the mesh, where a small one decides that further threads do not pay."""
        return None

    def use_threads(self) -> int:
        """Set the threads of the compiled loops to what the master asks for; return how many."""
        return use_threads(int(self.values.number("threads")), self.element_count)

    @abstractmethod
    def build(self) -> None:
        """Build and compile the simulation of the present parameters, at its start."""

    @abstractmethod
    def begin(self) -> None:
        """Do what is done once, after initialization: check where results go, save the start."""

    @property
    @abstractmethod
    def present(self) -> float:
        """Time since the start of the simulation [s]."""

    @abstractmethod
    def advance(self, size: float) -> None:
        """Go on by ``size`` > 0 [s], to ``target``, under the present inputs, all of them finite.

        What is left after an exception is undone by :meth:`reinstate`.
        """

    @abstractmethod
    def outputs(self, group: str) -> Mapping[str, Any]:
        """Return the values of the outputs of a group by name, at the present time."""

    @abstractmethod
    def capture(self) -> PartState:
        """Return a copy of the state of the simulation, which no later step changes."""

    @abstractmethod
    def reinstate(self, state: PartState) -> None:
        """Go back to a captured state, any number of times; going on from it is bit-identical."""

    @abstractmethod
    def finish(self, failure: str) -> None:
        """Write the results, if ``out_dir`` is set; failure: why the last step was undone."""
