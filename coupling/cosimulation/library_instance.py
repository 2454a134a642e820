"""An instance of a unit in this process: calls into its library, by FMI 2.0 and 3.0; on fmpy."""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
import weakref
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from lcmchain.coupling.cosimulation.description import UnitDescription, Variable, VariableValues
from lcmchain.coupling.cosimulation.instance import CallFailed, EndRequested, Instance, Log
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

#: A status in words, by its number.
STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
DISCARD, FATAL = 2, 4
LONGEST_MESSAGE = 2000


class Access:
    """Arguments of the calls that read and write one variable: references and memory for values."""

    def __init__(self, variable: Variable) -> None:
        references: Any = np.ascontiguousarray(variable.references)
        self.count = references.size
        self.size = variable.size
        self._references = references  # ctypes only points to it
        self.references = (ctypes.c_uint * self.count).from_buffer(references)
        self._values: VariableValues | None = None
        self.memory: Any = None  # an array of ctypes
        if variable.is_text:
            self.memory = (ctypes.c_char_p * self.size)()
        else:
            numbers: Any = np.zeros(self.size, dtype=variable.dtype)
            kind = np.ctypeslib.as_ctypes_type(variable.dtype)
            self.memory = (kind * self.size).from_buffer(numbers)
            self._values = numbers

    def store(self, values: VariableValues) -> None:
        """Put values (n,) into the memory."""
        if self._values is None:
            self._texts = [str(text).encode() for text in values]
            self.memory[:] = self._texts
        else:
            self._values[:] = values

    def content(self) -> VariableValues:
        """Return a copy of the values (n,) in the memory."""
        if self._values is not None:
            return np.array(self._values)
        texts = np.empty(self.size, dtype=object)
        texts[:] = [(text or b"").decode("utf-8", errors="replace") for text in self.memory]
        return texts


class LibraryCalls:
    """Calls that both versions share.

    See :class:`lcmchain.coupling.cosimulation.instance.Instance`.
    """

    prefix = ""

    def __init__(
        self, description: UnitDescription, folder: Path, name: str, log: Log, *, debug: bool
    ) -> None:
        self.description, self.name = description, name
        self._log = log
        self._access: dict[Variable, Access] = {}
        self._last_words: list[str] = []
        self._dead = False  # after a fatal error nothing may be called, not even free
        self._alive = False
        self._unit = self._load(description, folder, name)
        self._instantiate(debug)
        self._alive = True

    def _load(self, description: UnitDescription, folder: Path, name: str) -> FMU2Slave | FMU3Slave:
        from fmpy import fmi2, fmi3

        library = self._library(folder, description)
        if not library.is_file():
            systems = sorted(path.name for path in (folder / "binaries").glob("*") if path.is_dir())
            raise InputError(
                f'unit "{name}": the archive holds no library for this machine '
                f"({library.parent.name}); it has {', '.join(systems) or 'none'}"
            )
        _require_whole(library, name)
        # fmpy changes into the folder of the library, and stays there when loading fails
        before = os.getcwd()
        kind = fmi2.FMU2Slave if description.major == 2 else fmi3.FMU3Slave
        try:
            return kind(
                guid=description.token,
                modelIdentifier=description.model_identifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
        except Exception as error:  # fmpy raises plain exceptions
            raise InputError(f'unit "{name}": its library cannot be loaded: {error}') from None
        finally:
            os.chdir(before)

    def _library(self, folder: Path, description: UnitDescription) -> Path:
        import fmpy

        system = fmpy.platform if description.major == 2 else fmpy.platform_tuple
        ending = fmpy.sharedLibraryExtension
        return folder / "binaries" / system / f"{description.model_identifier}{ending}"

    def _instantiate(self, debug: bool) -> None:
        raise NotImplementedError

    def message(self, status: int, category: bytes | None, text: bytes | None) -> None:
        """Log a message of the unit. It raises nothing, whatever the message holds."""
        words = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        message = (text or b"").decode("utf-8", errors="replace").strip()[:LONGEST_MESSAGE]
        if status > 0 and message:
            self._last_words = [*self._last_words[-2:], message]
        self._log(words, (category or b"").decode("utf-8", errors="replace"), message)

    def call(self, function: str, *arguments: object) -> None:
        """Call a function of the unit with the instance.

        Raises
        ------
        CallFailed : its status is worse than a warning.
        """
        from fmpy.fmi1 import FMICallException

        if self._dead:
            raise CallFailed("it cannot be called after its fatal error")
        self._last_words = []
        try:
            getattr(self._unit, self.prefix + function)(self._unit.component, *arguments)
        except FMICallException as error:
            status = int(error.status)
            self._dead = status == FATAL
            said = f": {'; '.join(self._last_words)}" if self._last_words else ""
            word = STATUS[status] if 0 <= status < len(STATUS) else f"status {status}"
            raise CallFailed(
                f"{self.prefix}{function} answered with {word}{said}", discarded=status == DISCARD
            ) from None

    def _prepared(self, variable: Variable) -> Access:
        access = self._access.get(variable)
        if access is None:
            access = self._access[variable] = Access(variable)
        return access

    def _function(self, variable: Variable) -> str:
        raise NotImplementedError

    def _counts(self, access: Access) -> tuple[int, ...]:
        """Return the arguments that follow the values in a call."""
        return ()

    def read(self, variable: Variable) -> VariableValues:
        access = self._prepared(variable)
        self.call(
            f"Get{self._function(variable)}", access.references, access.count, access.memory,
            *self._counts(access),
        )  # fmt: skip
        return access.content()

    def write(self, variable: Variable, values: VariableValues) -> None:
        access = self._prepared(variable)
        access.store(values)
        self.call(
            f"Set{self._function(variable)}", access.references, access.count, access.memory,
            *self._counts(access),
        )  # fmt: skip

    # the names of the functions differ in two capitals between the versions
    _state = "FMUState"
    _deserialise = "DeserializeFMUState"
    _byte: type[ctypes.c_uint8 | ctypes.c_char] = ctypes.c_uint8

    def save(self) -> int:
        state = ctypes.c_void_p()
        self.call(f"Get{self._state}", ctypes.byref(state))
        return state.value or 0

    def restore(self, handle: int) -> None:
        self.call(f"Set{self._state}", ctypes.c_void_p(handle))

    def release(self, handle: int) -> None:
        if self._alive and not self._dead:
            self.call(f"Free{self._state}", ctypes.byref(ctypes.c_void_p(handle)))

    def serialise(self, handle: int) -> bytes:
        state, size = ctypes.c_void_p(handle), ctypes.c_size_t()
        self.call(f"Serialized{self._state}Size", state, ctypes.byref(size))
        content = (self._byte * size.value)()
        self.call(f"Serialize{self._state}", state, content, size)
        return bytes(content)

    def deserialise(self, content: bytes) -> int:
        state = ctypes.c_void_p()
        memory = (self._byte * len(content)).from_buffer_copy(content)
        self.call(self._deserialise, memory, len(content), ctypes.byref(state))
        return state.value or 0

    def enter_initialization(self) -> None:
        raise NotImplementedError

    def exit_initialization(self) -> None:
        self.call("ExitInitializationMode")

    def terminate(self) -> None:
        if self._alive and not self._dead:
            self.call("Terminate")

    def free(self) -> None:
        if self._alive and not self._dead:
            self._alive = False
            self._unit.freeInstance()
        self._alive = False


def no_instance(name: str, said: list[str]) -> InputError:
    silent = " and gave no reason; it may with debug = true, or have printed one above"
    reason = f": {'; '.join(said)}" if said else silent
    return InputError(f'unit "{name}" could not be instantiated{reason}')


def end_text(reached: float | None, said: str) -> str:
    when = "" if reached is None else f" at {reached:g} s"
    return f"it asked for the end of the simulation{when}{f' ({said})' if said else ''}"


def _require_whole(library: Path, name: str) -> None:
    """Refuse a library of Linux that is cut off: loading it would end the process by a signal."""
    try:
        with library.open("rb") as file:
            if file.read(4) != b"\x7fELF":
                return  # fmpy reports what the loader of the system finds wrong
            size = file.seek(0, os.SEEK_END)
            ends = [s["p_offset"] + s["p_filesz"] for s in ELFFile(file).iter_segments()]
    except (ELFError, OSError):
        ends, size = [1], 0
    if max(ends, default=1) > size:
        raise InputError(
            f'unit "{name}": its library {library.name} is damaged, a part of it is missing; get '
            "the unit again"
        )


# --- FMI 2.0 --------------------------------------------------------------------------------------


#: Units of FMI 2 by their component environments. fmpy's library for messages keeps one callback
#: for the whole process: all units share it, and it looks up here which unit a message is from.
_speakers: weakref.WeakValueDictionary[int, Fmi2Instance] = weakref.WeakValueDictionary()
_environments = itertools.count(1)

#: Categories of the standard for messages of calls that did not succeed.
REASONS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


def _message2(
    environment: int | None, name: bytes | None, status: int, category: bytes, text: bytes
) -> None:
    speaker = _speakers.get(environment or 0)
    if speaker is None:  # the unit does not pass on its environment
        named = (name or b"").decode("utf-8", errors="replace")
        units = list(_speakers.values())
        speaker = next((unit for unit in units if unit.name == named), None)
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

    def configure(self, settings: Sequence[tuple[Variable, VariableValues]]) -> None:
        """FMI 2.0 has no structural parameters, so that there is nothing to set."""

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        has_tolerance = tolerance is not None
        self.call("SetupExperiment", has_tolerance, tolerance or 0.0, start, True, stop)

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
            # pythonfmu reports an end after every discarded step: one that got nowhere is no end
            if ends and (reached is None or reached > time):
                raise EndRequested(end_text(reached, str(failure))) from None
            raise CallFailed(str(failure), discarded=True, reached=reached) from None
        return False

    def _status(
        self, kind: str, number: int, value: ctypes.c_double | ctypes.c_int
    ) -> float | None:
        """Return a status after a discarded step; None where the unit does not know it."""
        try:
            self.call(f"Get{kind}Status", number, ctypes.byref(value))
        except CallFailed:
            return None
        return value.value


# --- FMI 3.0 --------------------------------------------------------------------------------------


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

    def configure(self, settings: Sequence[tuple[Variable, VariableValues]]) -> None:
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


def instance_in_process(
    description: UnitDescription, folder: Path, name: str, log: Log, *, debug: bool = False
) -> Instance:
    """Load the library of an unpacked unit and make an instance in this process.

    Raises
    ------
    InputError : no library for this machine, one that cannot be loaded, or no instance.
    """
    kind = Fmi2Instance if description.major == 2 else Fmi3Instance
    return kind(description, folder, name, log, debug=debug)
