"""The process of one unit: does what the master asks over a pipe, and ends with the master.

Both sides send frames: the length as eight bytes, then a pickled message. The master asks with
``(operation, arguments, states given back)``; answers are ``("said", status, category, text)`` any
number of times, then ``("done", result)`` or ``("failed", error)``. Standard input and output are
taken away from the unit, so that nothing that it reads or prints comes between.
"""

from __future__ import annotations

import os
import pickle
import signal
import struct
import sys
import threading
import time
from contextlib import suppress
from typing import Any, BinaryIO

from lcmchain.coupling.cosimulation.instance import CallFailed, Instance
from lcmchain.coupling.cosimulation.library_instance import instance_in_process
from lcmchain.coupling.cosimulation.variable import Variable
from lcmchain.errors import LcmchainError

_LENGTH = struct.Struct("<Q")
#: How often the process looks whether its master is still there [s].
LOOK = 1.0
#: Calls that go to the instance with their arguments as they are.
PLAIN = ("set_up", "enter_initialization", "exit_initialization", "terminate", "free")


def write_frame(stream: BinaryIO, message: Any) -> None:
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


class _Server:
    """Makes the instance with the first message, and answers the others."""

    def __init__(self, taken: BinaryIO, given: BinaryIO) -> None:
        self._taken, self._given = taken, given
        self._sending = threading.Lock()  # a unit may say something from a thread of its own
        self._instance: Instance
        self._variables: dict[int, Variable] = {}
        self._states: dict[int, Any] = {}
        self._state_count = 0

    def serve(self) -> None:
        """Answer until the unit is freed or the master is gone."""
        operation = ""
        with suppress(EOFError, BrokenPipeError):
            while operation != "free":
                operation, arguments, given_back = read_frame(self._taken)
                self._send(*self._answer(operation, arguments, given_back))

    def _send(self, *message: Any) -> None:
        with self._sending:
            write_frame(self._given, message)

    def _say(self, status: str, category: str, text: str) -> None:
        self._send("said", status, category, text)

    def _answer(self, operation: str, arguments: Any, given_back: list[int]) -> tuple[str, Any]:
        try:
            for number in given_back:
                with suppress(CallFailed):  # the unit has failed; its memory goes with the process
                    self._instance.release(self._states.pop(number))
            return "done", self._do(operation, *arguments)
        except LcmchainError as error:
            return "failed", error
        except Exception as error:
            return "failed", CallFailed(f"{type(error).__name__}: {error}")

    def _do(self, operation: str, *arguments: Any) -> Any:
        if operation == "make":
            description, folder, name, debug = arguments
            self._instance = instance_in_process(description, folder, name, self._say, debug=debug)
            return None
        instance = self._instance
        if operation in PLAIN:
            return getattr(instance, operation)(*arguments)
        if operation == "define":
            number, variable = arguments
            self._variables[number] = variable
            return None
        if operation == "configure":
            return instance.configure([(self._variables[n], values) for n, values in arguments[0]])
        if operation == "read":
            return instance.read(self._variables[arguments[0]])
        if operation == "write":
            return instance.write(self._variables[arguments[0]], arguments[1])
        if operation == "step":
            moment, size, returns = arguments
            return instance.step(moment, size, returns=returns)
        if operation == "restore":
            return instance.restore(self._states[arguments[0]])
        if operation == "serialise":
            return instance.serialise(self._states[arguments[0]])
        state = instance.save() if operation == "save" else instance.deserialise(arguments[0])
        self._state_count += 1
        self._states[self._state_count] = state
        return self._state_count


def _end_with(master: int) -> None:
    """End this process, and those that the unit has started, when the master is gone."""
    while os.getppid() == master:
        time.sleep(LOOK)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def main(master: int) -> None:
    """Serve the master whose process number is given."""
    threading.Thread(target=_end_with, args=(master,), daemon=True).start()
    taken, given = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)  # what the unit prints
    if sys.stdout is not None:
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    _Server(taken, given).serve()
