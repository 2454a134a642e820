"""Ctrl-C in a host that is a Python: never an exception that reaches the C side of a unit.

pythonfmu ends an instance at the first exception, and the host often with it. Python raises
KeyboardInterrupt wherever the main thread happens to be. While it is inside a unit's work, that is
where a guard catches it; in the few lines around, which hand values to the C side, the signal is
only noted.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

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
