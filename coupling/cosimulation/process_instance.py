"""An instance in a process of its own, which may crash, end or hang without taking the master.

Master and process send frames over a pipe: the length as eight bytes, then a pickled message. The
master asks with ``(operation, arguments, released states)``. The process answers with ``("said",
status, category, text)`` any number of times, then with ``("done", result)`` or ``("failed",
error)``. The unit has neither standard input nor standard output, so that nothing that it reads or
prints disturbs the pipe. The process ends with its master.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from lcmchain.coupling.cosimulation.description import UnitDescription, Variable, VariableValues
from lcmchain.coupling.cosimulation.instance import CallFailed, Instance, Log
from lcmchain.coupling.cosimulation.library_instance import instance_in_process
from lcmchain.coupling.cosimulation.stopping import StopRequests
from lcmchain.errors import LcmchainError, SimulationInterrupted
from lcmchain.quantities.readable import duration_text

# --- frames ---------------------------------------------------------------------------------------

_LENGTH = struct.Struct("<Q")


def write_frame(stream: BinaryIO, message: object) -> None:
    """Send a message."""
    content = pickle.dumps(message, protocol=5)
    stream.write(_LENGTH.pack(len(content)))
    stream.write(content)
    stream.flush()


def read_frame(stream: BinaryIO) -> Any:
    """Wait for a message.

    Raises
    ------
    EOFError : the other side is gone.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (size,) = _LENGTH.unpack(head)
    content = stream.read(size)
    if len(content) < size:
        raise EOFError
    return pickle.loads(content)


# --- the process of the unit ----------------------------------------------------------------------

#: How often the process checks that its master still runs [s].
MASTER_CHECK = 1.0
#: Operations whose arguments go to the instance unchanged.
UNCHANGED = ("set_up", "enter_initialization", "exit_initialization", "terminate", "free")


class _Server:
    """Makes the instance at the first message, and answers the others."""

    def __init__(self, requests: BinaryIO, answers: BinaryIO) -> None:
        self._requests, self._answers = requests, answers
        self._sending = threading.Lock()  # a unit may log from a thread of its own
        self._instance: Instance
        self._variables: dict[int, Variable] = {}
        self._states: dict[int, int] = {}  # handles of the instance by those of the master
        self._state_count = 0

    def serve(self) -> None:
        """Answer until the unit is freed or the master is gone."""
        operation = ""
        with suppress(EOFError, BrokenPipeError):
            while operation != "free":
                operation, arguments, released = read_frame(self._requests)
                self._send(*self._answer(operation, arguments, released))

    def _send(self, *message: object) -> None:
        with self._sending:
            write_frame(self._answers, message)

    def _log(self, status: str, category: str, text: str) -> None:
        self._send("said", status, category, text)

    def _answer(
        self, operation: str, arguments: tuple[Any, ...], released: list[int]
    ) -> tuple[str, object]:
        try:
            for number in released:
                with suppress(CallFailed):  # the unit has failed; its memory goes with the process
                    self._instance.release(self._states.pop(number))
            return "done", self._do(operation, *arguments)
        except LcmchainError as error:
            return "failed", error
        except Exception as error:
            return "failed", CallFailed(f"{type(error).__name__}: {error}")

    def _do(self, operation: str, *arguments: Any) -> object:
        if operation == "make":
            description, folder, name, debug = arguments
            self._instance = instance_in_process(description, folder, name, self._log, debug=debug)
            return None
        instance = self._instance
        if operation in UNCHANGED:
            return getattr(instance, operation)(*arguments)
        if operation == "define":
            number, variable = arguments
            self._variables[number] = variable
            return None
        if operation == "configure":
            settings = [(self._variables[number], values) for number, values in arguments[0]]
            instance.configure(settings)
            return None
        if operation == "read":
            return instance.read(self._variables[arguments[0]])
        if operation == "write":
            instance.write(self._variables[arguments[0]], arguments[1])
            return None
        if operation == "step":
            moment, size, returns = arguments
            return instance.step(moment, size, returns=returns)
        if operation == "restore":
            instance.restore(self._states[arguments[0]])
            return None
        if operation == "serialise":
            return instance.serialise(self._states[arguments[0]])
        state = instance.save() if operation == "save" else instance.deserialise(arguments[0])
        self._state_count += 1
        self._states[self._state_count] = state
        return self._state_count


def _end_with(master: int) -> None:
    """End this process, and those that the unit has started, when the master is gone."""
    while os.getppid() == master:
        time.sleep(MASTER_CHECK)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def main(master: int) -> None:
    """Serve the master with this process number."""
    threading.Thread(target=_end_with, args=(master,), daemon=True).start()
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)  # the unit prints on standard error
    if sys.stdout is not None:
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    _Server(requests, answers).serve()


# --- the side of the master -----------------------------------------------------------------------

#: How often a call at work is checked for being late [s].
CALL_CHECK = 0.1
#: Least time that any call but a step may take, such as loading a unit [s].
LEAST_LIMIT = 60.0
#: How long a unit may take to be freed, and its process to end after that [s].
CLOSING = 10.0

# the path of the master, because units in Python may import what it can import
_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from lcmchain.coupling.cosimulation.process_instance import main; main(int(sys.argv[2]))"
)

_DURING = {
    "make": "while it was loaded and instantiated",
    "configure": "while its structural parameters were set",
    "set_up": "while its experiment was set up",
    "enter_initialization": "in its initialisation",
    "exit_initialization": "in its initialisation",
    "read": "while values were read",
    "write": "while values were set",
    "step": "in a step",
    "save": "while its state was saved",
    "restore": "while its state was restored",
    "serialise": "while its state was written",
    "deserialise": "while its state was read",
    "terminate": "while it was terminated",
    "free": "while it was freed",
}


class UnitLost(CallFailed):
    """The process of a unit has ended, or was ended because the unit did not come back."""

    is_loss = True


class LeftInCall(SimulationInterrupted):
    """The user stopped the run while a unit had not come back."""


class ProcessInstance:
    """See :class:`lcmchain.coupling.cosimulation.instance.Instance`.

    Parameters
    ----------
    limit : wall-clock time that a step may take [s]; other calls have at least a minute.
    requests : of the user to stop, after which a call has little time left.

    Raises
    ------
    UnitLost : its process ended while the instance was made.
    InputError : as for an instance in this process.
    """

    def __init__(
        self,
        description: UnitDescription,
        folder: Path,
        name: str,
        log: Log,
        *,
        debug: bool,
        limit: float,
        requests: StopRequests,
    ) -> None:
        self.name, self._log, self._limit, self._requests = name, log, limit, requests
        self._numbers: dict[Variable, int] = {}
        self._released: list[int] = []  # states that the process is told of with the next request
        self._lost = ""  # why nothing can be asked any more
        self._freed = False
        self._guard = threading.Lock()
        self._begin: float | None = None  # of the call at work, by the monotonic clock [s]
        self._allowed = limit  # for that call [s]
        self._ended_because = ""
        self._over = threading.Event()
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-c",
                _START,
                json.dumps([*map(str, sys.path)]),
                str(os.getpid()),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C in the terminal is for the master
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._to: BinaryIO = self._process.stdin  # type: ignore[assignment]
        self._from: BinaryIO = self._process.stdout  # type: ignore[assignment]
        threading.Thread(target=self._watch, daemon=True).start()
        # the process is told of variables one by one, as they are used
        head = replace(description, variables={}, elements={}, depends={}, depends_initially={})
        try:
            self._ask("make", head, folder, name, debug)
        except BaseException:
            self._lost = self._lost or "it was not made"
            self.free()
            raise

    # --- calls ------------------------------------------------------------------------------------

    def _watch(self) -> None:
        """End the process when a call takes too long; runs in a thread."""
        while not self._over.wait(CALL_CHECK):
            with self._guard:
                begin = self._begin
                if begin is None or self._ended_because:
                    continue
                if time.monotonic() - begin > self._allowed:
                    self._ended_because = "late"
                elif self._requests.overdue(begin):
                    self._ended_because = "stopped"
                elif self._has_ended():  # a process that it has started may hold the pipe
                    self._ended_because = "gone"
                else:
                    continue
            self._kill()

    def _has_ended(self) -> bool:
        """Whether the process has ended; its number stays reserved until it is waited for."""
        if not hasattr(os, "waitid"):
            return False
        with suppress(ChildProcessError):
            options = os.WEXITED | os.WNOHANG | os.WNOWAIT
            return os.waitid(os.P_PID, self._process.pid, options) is not None
        return True

    def _kill(self) -> None:
        """End the process and those that the unit has started."""
        if self._process.returncode is not None:
            return
        with suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()

    @contextmanager
    def _at_work(self, allowed: float) -> Iterator[None]:
        with self._guard:
            self._begin, self._allowed = time.monotonic(), allowed
        try:
            yield
        finally:
            with self._guard:
                self._begin = None

    def _ask(self, operation: str, *arguments: object, allowed: float | None = None) -> Any:
        """Have the process do something; return its answer.

        allowed : time that it may take [s].

        Raises
        ------
        UnitLost, LeftInCall : it did not answer.
        CallFailed, InputError : its unit failed.
        """
        if self._lost:
            raise UnitLost(self._lost)
        released, self._released = self._released, []
        try:
            with self._at_work(max(self._limit, LEAST_LIMIT) if allowed is None else allowed):
                write_frame(self._to, (operation, arguments, released))
                answer = read_frame(self._from)
                while answer[0] == "said":
                    self._log(*answer[1:])
                    answer = read_frame(self._from)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._loss(operation) from None
        except BaseException:  # the rest of this answer would be read as the next one
            self._lost = "it was left in a call"
            self._kill()
            raise
        kind, content = answer
        if kind == "failed":
            raise content
        return content

    def _loss(self, operation: str) -> UnitLost | LeftInCall:
        """End the process; return why a call was not answered."""
        self._kill()
        code = self._process.wait()
        during = _DURING.get(operation, "in a call")
        if self._ended_because == "late":
            self._lost = (
                f"it did not come back within {duration_text(self._allowed)} {during}, and was "
                "ended; where it may take that long, give its unit a longer step_limit"
            )
        elif self._ended_because == "stopped":
            self._lost = f'unit "{self.name}" had not come back {during}, and was ended'
            return LeftInCall(self._lost)
        else:
            self._lost = f"its process {_end_text(code)} {during}"
        return UnitLost(self._lost)

    # --- what an instance offers ------------------------------------------------------------------

    def configure(self, settings: Sequence[tuple[Variable, VariableValues]]) -> None:
        self._ask("configure", [(self._number(variable), values) for variable, values in settings])

    def set_up(self, start: float, stop: float, tolerance: float | None) -> None:
        self._ask("set_up", start, stop, tolerance)

    def enter_initialization(self) -> None:
        self._ask("enter_initialization")

    def exit_initialization(self) -> None:
        self._ask("exit_initialization")

    def _number(self, variable: Variable) -> int:
        number = self._numbers.get(variable)
        if number is None:
            number = len(self._numbers)
            self._ask("define", number, variable)
            self._numbers[variable] = number
        return number

    def read(self, variable: Variable) -> VariableValues:
        values: VariableValues = self._ask("read", self._number(variable))
        return values

    def write(self, variable: Variable, values: VariableValues) -> None:
        self._ask("write", self._number(variable), values)

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        return bool(self._ask("step", time, size, returns, allowed=self._limit))

    def save(self) -> int:
        handle: int = self._ask("save")
        return handle

    def restore(self, handle: int) -> None:
        self._ask("restore", handle)

    def release(self, handle: int) -> None:
        # the garbage collector may call this at any time, also within a request
        self._released.append(handle)

    def serialise(self, handle: int) -> bytes:
        content: bytes = self._ask("serialise", handle)
        return content

    def deserialise(self, content: bytes) -> int:
        handle: int = self._ask("deserialise", content)
        return handle

    def terminate(self) -> None:
        if not self._lost:
            self._closing("terminate")

    def free(self) -> None:
        if self._freed:
            return
        self._freed = True
        if not self._lost:
            self._closing("free")
        with suppress(OSError):
            self._to.close()
        try:
            if self._lost:
                self._kill()
            code = self._process.wait(CLOSING)
            if code != 0 and not self._lost:
                self._log("warning", "process", f"its process {_end_text(code)} after it was freed")
        except subprocess.TimeoutExpired:
            self._kill()
            self._process.wait()
            self._log("warning", "process", "its process did not end after it was freed")
        finally:
            self._over.set()
            with suppress(OSError):
                self._from.close()

    def _closing(self, operation: str) -> None:
        """Ask for something at the end; a loss does no harm any more and is only logged."""
        try:
            self._ask(operation, allowed=CLOSING)
        except (CallFailed, LeftInCall) as loss:
            self._log("warning", "process", str(loss))


def _end_text(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code} (the unit, or what it uses, called exit)"
    words = signal.strsignal(-code) if hasattr(signal, "strsignal") else None
    return f"ended by signal {-code}{f' ({words})' if words else ''}"


def new_instance(
    description: UnitDescription,
    folder: Path,
    name: str,
    log: Log,
    *,
    debug: bool = False,
    apart: bool = False,
    limit: float = math.inf,
    requests: StopRequests | None = None,
) -> Instance:
    """Load the library of an unpacked unit and make an instance.

    Parameters
    ----------
    folder : where the unit is unpacked.
    apart : make it in a process of its own.
    limit : wall-clock time that a step may take there [s].
    requests : of the user to stop, after which a call has little time left there.

    Raises
    ------
    InputError : no library for this machine, one that cannot be loaded, or no instance.
    CallFailed : its process ended meanwhile.
    """
    if not apart:
        return instance_in_process(description, folder, name, log, debug=debug)
    requests = requests or StopRequests()
    return ProcessInstance(
        description, folder, name, log, debug=debug, limit=limit, requests=requests
    )
