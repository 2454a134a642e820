"""An instance in a process of its own, which may crash, end or hang without taking the master."""

from __future__ import annotations

import json
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import NDArray

from lcmchain.coupling.cosimulation.description import UnitDescription
from lcmchain.coupling.cosimulation.instance import CallFailed, Instance, Log
from lcmchain.coupling.cosimulation.library_instance import instance_in_process
from lcmchain.coupling.cosimulation.stopping import StopRequests
from lcmchain.coupling.cosimulation.unit_process import read_frame, write_frame
from lcmchain.coupling.cosimulation.variable import Variable
from lcmchain.errors import SimulationInterrupted
from lcmchain.quantities.readable import duration_text

#: How often a call that is at work is looked at [s].
LOOK = 0.1
#: How long anything but a step may take at least, such as loading a unit [s].
LEAST = 60.0
#: How long a unit may take to be freed, and its process to end after that [s].
CLOSING = 10.0

# the path of the master, because units in Python may import what it can import
_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from lcmchain.coupling.cosimulation.unit_process import main; main(int(sys.argv[2]))"
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
        self._given_back: list[int] = []
        self._lost = ""  # why nothing can be asked any more
        self._freed = False
        self._guard = threading.Lock()
        self._begin: float | None = None  # of the call at work, by the monotonic clock
        self._allowed = limit  # for that call
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

    # --- the process ------------------------------------------------------------------------------

    def _watch(self) -> None:
        """End the process when a call takes too long; runs in a thread."""
        while not self._over.wait(LOOK):
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
        """Whether the process has ended, which is not yet taken note of: its number is kept."""
        if not hasattr(os, "waitid"):
            return False
        with suppress(ChildProcessError):
            look = os.WEXITED | os.WNOHANG | os.WNOWAIT
            return os.waitid(os.P_PID, self._process.pid, look) is not None
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

    def _ask(self, operation: str, *arguments: Any, allowed: float | None = None) -> Any:
        """Have the process do something; return what it answers.

        Raises
        ------
        UnitLost, LeftInCall : it did not answer. CallFailed, InputError : its unit failed.
        """
        if self._lost:
            raise UnitLost(self._lost)
        given_back, self._given_back = self._given_back, []
        try:
            with self._at_work(max(self._limit, LEAST) if allowed is None else allowed):
                write_frame(self._to, (operation, arguments, given_back))
                answer = read_frame(self._from)
                while answer[0] == "said":
                    self._log(*answer[1:])
                    answer = read_frame(self._from)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._loss(operation) from None
        except BaseException:  # stopped in the middle of an answer: the next one would be this
            self._lost = "it was left in a call"
            self._kill()
            raise
        kind, content = answer
        if kind == "failed":
            raise content
        return content

    def _loss(self, operation: str) -> UnitLost | LeftInCall:
        """Return why a call was not answered, after the end of the process."""
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

    # --- the instance -----------------------------------------------------------------------------

    def configure(self, settings: Sequence[tuple[Variable, Any]]) -> None:
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

    def read(self, variable: Variable) -> NDArray[Any]:
        values: NDArray[Any] = self._ask("read", self._number(variable))
        return values

    def write(self, variable: Variable, values: Any) -> None:
        self._ask("write", self._number(variable), values)

    def step(self, time: float, size: float, *, returns: bool) -> bool:
        return bool(self._ask("step", time, size, returns, allowed=self._limit))

    def save(self) -> Any:
        return self._ask("save")

    def restore(self, handle: Any) -> None:
        self._ask("restore", handle)

    def release(self, handle: Any) -> None:
        # nobody knows when the collector of garbage calls this: the next request brings it
        self._given_back.append(handle)

    def serialise(self, handle: Any) -> bytes:
        content: bytes = self._ask("serialise", handle)
        return content

    def deserialise(self, content: bytes) -> Any:
        return self._ask("deserialise", content)

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
        """Ask for something at the end, where a loss does no harm any more and is only told."""
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
    apart : in a process of its own, where a call may take ``limit`` [s] of wall-clock time, and
        little once the user has asked for the end (``requests``).

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
