"""How a unit answers its master: status of calls, messages, refusals, and Ctrl-C."""

from __future__ import annotations

import functools
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from enum import Enum, IntEnum
from types import CodeType, FrameType
from typing import Any, Protocol

import numpy as np

from lcmchain.errors import LcmchainError


class Status(IntEnum):
    """Outcome of a call; the numbers are those of FMI."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3


class Phase(Enum):
    """Where a unit is in its life; the values stand in messages and saved states."""

    INSTANTIATED = "instantiated"
    INITIALIZING = "in initialization mode"
    STEPPING = "between steps"
    TERMINATED = "terminated"


class StepOutcome(IntEnum):
    """Values of the output ``status`` of every unit."""

    READY = 0  # initialized, or the last step was done
    UNDONE = 1  # the last step was undone
    INTERRUPTED = 2  # the user stopped the unit
    NOT_READY = 3  # not initialized, or that failed


#: Categories of log messages, and what they hold.
CATEGORIES = {
    "logEvents": "What the unit does: compiling, files written.",
    "logStatusWarning": "What is allowed but probably not meant.",
    "logStatusDiscard": "Steps that were stopped and undone.",
    "logStatusError": "Calls that were refused; the unit is as before.",
    "logAll": "All messages.",
}

CATEGORY_OF = {
    Status.OK: "logEvents",
    Status.WARNING: "logStatusWarning",
    Status.DISCARD: "logStatusDiscard",
    Status.ERROR: "logStatusError",
}


class Refused(LcmchainError):
    """A call that the standard forbids, or whose values make no sense; nothing has changed."""


# --- messages to the master and to stderr ---------------------------------------------------------
# They hold no reference to the unit: an instance that is freed is gone at once, with the megabytes
# of its simulation, and does not wait for Python's search for cycles.

#: Takes a message: its status, its category, and the text.
Report = Callable[[Status, str, str], None]


class Messages:
    """Says things under the name of an instance.

    Parameters
    ----------
    name : of the instance. report : hands a message to the master.
    """

    def __init__(self, name: str, report: Report) -> None:
        self.name, self._report = name, report

    def __call__(self, text: str, status: Status = Status.OK, *, aloud: bool = False) -> None:
        """Hand a message to the master, and to stderr if it is not only an event, or ``aloud``.

        Most masters show no log messages unless they are asked to, and pythonfmu hands them on
        only when the call is over.
        """
        text = encodable(f"{self.name}: {text}")
        self._report(status, CATEGORY_OF[status], text)
        if aloud or status is not Status.OK:
            say_on_stderr(text)


def say_on_stderr(text: str) -> None:
    """Print a message, where the host has something to print on.

    A service may have closed its stderr, or nobody may read it any more. That stops no unit.
    """
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


def encodable(text: str) -> str:
    """Return a text that UTF-8 can hold: the exporters end the host at any other.

    The name of a folder may hold bytes that are no characters (``\\udcff`` in Python).
    """
    return text.encode("utf-8", "backslashreplace").decode()


# --- Ctrl-C in a host that is a Python: never an exception that reaches the C side ----------------
# pythonfmu ends an instance at the first exception, and the host often with it. Python raises
# KeyboardInterrupt wherever the main thread happens to be. While it is inside a unit's work, that
# is where a guard catches it; in the few lines around, which hand values to the C side, the signal
# is only noted.

# Code that must never see the exception, and code below which a guard catches it.
_outer: set[CodeType] = set()
_inner: set[CodeType] = set()

_before: Any = None
_noted = False


def outermost(function: Callable) -> Callable:
    """Mark a function that the C side calls: in it and what it calls, a signal is only noted."""
    _outer.add(function.__code__)
    return function


def catching(function: Callable) -> Callable:
    """Mark a function whose caller catches everything: below it, a signal may raise."""
    _inner.add(function.__code__)
    return function


def watch() -> None:
    """Put the rule above in force; whoever handled the signal before still does."""
    global _before
    if threading.current_thread() is not threading.main_thread():
        return
    present = signal.getsignal(signal.SIGINT)
    if present is not _handle and callable(present):
        try:
            signal.signal(signal.SIGINT, _handle)
        except ValueError:
            return  # a host that is no Python: it started the interpreter in another thread
        _before = present


def take_noted() -> bool:
    """Return whether a signal came where it could not be raised, once."""
    global _noted
    noted, _noted = _noted, False
    return noted


def _handle(number: int, frame: FrameType | None) -> None:
    global _noted
    here = frame
    while here is not None:
        if here.f_code in _inner:
            break
        if here.f_code in _outer:
            _noted = True
            return
        here = here.f_back
    _before(number, frame)


# --- no exception leaves a unit: a refused call is told and changes nothing -----------------------

# Answers of calls that were refused; all others answer that there was an error.
_ANSWERS: dict[str, Callable[..., Any]] = {
    "get_numbers": lambda references: np.full(len(references), np.nan),
    "get_texts": lambda references: [""] * len(references),
    "save": lambda: None,
    "step": lambda *_: Status.DISCARD,
}
#: Calls that change nothing that a step could depend on.
_HARMLESS = {"get_numbers", "get_texts", "save", "step", "terminate"}


class Conducted(Protocol):
    """What a guarded method needs of its unit."""

    def refuse(self, reason: str, *, changes: bool) -> None: ...

    def interrupted(self) -> None: ...


def guarded(method: Callable) -> Callable:
    """Turn every exception of a unit's method into a message and an answer."""
    name = method.__name__

    @functools.wraps(method)
    def outer(self: Conducted, *arguments: object) -> Any:
        try:
            return _call(method, self, arguments)
        except LcmchainError as error:
            self.refuse(str(error), changes=name not in _HARMLESS)
        except KeyboardInterrupt:
            self.interrupted()
            self.refuse(f"{name} was interrupted", changes=False)
        except BaseException as error:
            # A defect, or no memory: the unit says where, and goes on as it was.
            where = traceback.format_tb(error.__traceback__)[-1].strip().replace("\n", " ")
            what = f"{name} failed with {type(error).__name__} ({error}) at {where}"
            self.refuse(what, changes=name not in _HARMLESS)
        answer = _ANSWERS.get(name)
        return Status.ERROR if answer is None else answer(*arguments[:1])

    return outermost(outer)


@catching
def _call(method: Callable, unit: Conducted, arguments: tuple) -> Any:
    return method(unit, *arguments)
