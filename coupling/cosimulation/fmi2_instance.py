"""An instance of a unit of FMI 2.0."""

from __future__ import annotations

import ctypes
import functools
import itertools
import weakref
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from lcmchain.coupling.cosimulation.instance import CallFailed, EndRequested
from lcmchain.coupling.cosimulation.library_calls import LibraryCalls, end_text, no_instance
from lcmchain.coupling.cosimulation.variable import Variable

#: Units of FMI 2 by the environment that they are given; fmpy's library for their messages keeps
#: one callback for the whole process, so that all units share one that finds out whose it is.
_speakers: weakref.WeakValueDictionary[int, Fmi2Instance] = weakref.WeakValueDictionary()
_environments = itertools.count(1)

#: Categories of messages that the standard names for calls which did not succeed.
REASONS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


def _message2(
    environment: int | None, name: bytes | None, status: int, category: bytes, text: bytes
) -> None:
    speaker = _speakers.get(environment or 0)
    if speaker is None:  # a unit that does not pass on what it was given
        named = (name or b"").decode("utf-8", errors="replace")
        speaker = next((one for one in list(_speakers.values()) if one.name == named), None)
    if speaker is not None:
        speaker.message(status, category, text)


@functools.cache
def _logger2() -> Any:
    from fmpy import fmi2

    return fmi2.fmi2CallbackLoggerTYPE(_message2)


class Fmi2Instance(LibraryCalls):
    """See :class:`lcmchain.coupling.cosimulation.instance.Instance`."""

    prefix = "fmi2"
    _state = "FMUstate"
    _deserialise = "DeSerializeFMUstate"
    _byte = ctypes.c_char

    def _instantiate(self, debug: bool) -> None:
        from fmpy import calloc, fmi2, free

        callbacks = fmi2.fmi2CallbackFunctions()
        self._environment = next(_environments)
        _speakers[self._environment] = self
        callbacks.logger = _logger2()
        callbacks.componentEnvironment = self._environment
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        try:
            from fmpy.logging import addLoggerProxy

            addLoggerProxy(ctypes.byref(callbacks))
        except OSError:
            pass  # fmpy has no such library for this machine: messages come without their values
        try:
            self._unit.instantiate(callbacks=callbacks, loggingOn=debug)
        except Exception:
            raise no_instance(self.name, self._last_words) from None
        if not debug:
            self._ask_for_reasons()

    def _ask_for_reasons(self) -> None:
        """Switch on the messages that say why a call failed; some units are silent otherwise."""
        wanted = [name for name in self.description.log_categories if name in REASONS]
        if wanted:
            names = (ctypes.c_char_p * len(wanted))(*(name.encode() for name in wanted))
            with suppress(CallFailed):
                self.call("SetDebugLogging", True, len(wanted), names)

    def configure(self, settings: Sequence[tuple[Variable, Any]]) -> None:
        """FMI 2.0 has no structural parameters, so that there is nothing to set."""

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        given = tolerance is not None
        self.call("SetupExperiment", given, tolerance or 0.0, start, True, stop)

    def enter_initialization(self) -> None:
        self.call("EnterInitializationMode")

    def _function(self, variable: Variable) -> str:
        kind = variable.type_name
        return "Integer" if kind == "Enumeration" else kind

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        try:
            self.call("DoStep", time, size, not returns)
        except CallFailed as failure:
            if not failure.discarded:
                raise
            reached = self._status("Real", 2, ctypes.c_double())  # fmi2LastSuccessfulTime
            ends = self._status("Boolean", 3, ctypes.c_int())  # fmi2Terminated
            # pythonfmu says so after every discard: an end needs a step towards it
            if ends and (reached is None or reached > time):
                raise EndRequested(end_text(reached, str(failure))) from None
            raise CallFailed(str(failure), discarded=True, reached=reached) from None
        return False

    def _status(self, kind: str, number: int, value: Any) -> Any:
        """Ask for a status after a discarded step; None where the unit does not know it."""
        try:
            self.call(f"Get{kind}Status", number, ctypes.byref(value))
        except CallFailed:
            return None
        return value.value
