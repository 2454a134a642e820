"""An instance of a unit of FMI 3.0."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from lcmchain.coupling.cosimulation.instance import CallFailed, EndRequested
from lcmchain.coupling.cosimulation.library_calls import (
    Access,
    LibraryCalls,
    end_text,
    no_instance,
)
from lcmchain.coupling.cosimulation.variable import Variable


class Fmi3Instance(LibraryCalls):
    """See :class:`lcmchain.coupling.cosimulation.instance.Instance`."""

    prefix = "fmi3"

    def _instantiate(self, debug: bool) -> None:
        try:
            self._unit.instantiate(
                loggingOn=debug,
                logMessage=lambda _, status, category, text: self.message(status, category, text),
            )
        except Exception:
            raise no_instance(self.name, self._last_words) from None

    def configure(self, settings: Sequence[tuple[Variable, Any]]) -> None:
        self.call("EnterConfigurationMode")
        for variable, values in settings:
            self.write(variable, values)
        self.call("ExitConfigurationMode")

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        self._experiment = (tolerance is not None, tolerance or 0.0, start, True, stop)

    def enter_initialization(self) -> None:
        self.call("EnterInitializationMode", *self._experiment)

    def _function(self, variable: Variable) -> str:
        return "Int64" if variable.kind == "Enumeration" else variable.kind

    def _counts(self, access: Access) -> tuple[int, ...]:
        return (access.size,)

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        event, end, early = (ctypes.c_bool() for _ in range(3))
        reached = ctypes.c_double(time)
        try:
            self.call(
                "DoStep", time, size, not returns, ctypes.byref(event), ctypes.byref(end),
                ctypes.byref(early), ctypes.byref(reached),
            )  # fmt: skip
        except CallFailed as failure:
            if not failure.discarded:
                raise
            raise CallFailed(str(failure), discarded=True, reached=reached.value) from None
        if end.value and reached.value < time + size * (1.0 - 1e-9):
            raise EndRequested(end_text(reached.value, ""))
        if early.value and not end.value:
            raise CallFailed(
                "it returned early, which was not allowed", discarded=True, reached=reached.value
            )
        return end.value
