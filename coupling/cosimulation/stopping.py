"""Requests to stop, by Ctrl-C or SIGTERM, and how long a call into a unit may go on after one."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: How long a call into a unit may go on after a request to stop [s]; a second request ends it.
GRACE = 10.0


class StopRequests:
    """Counts requests to stop; read by the threads that watch the calls into units."""

    def __init__(self) -> None:
        self.count = 0
        self._latest = 0.0

    def note(self) -> None:
        """Count one more."""
        self._latest = time.monotonic()
        self.count += 1

    def overdue(self, begin: float) -> bool:
        """Whether a call that began at ``begin`` (monotonic clock) [s] has to be ended."""
        if self.count == 0:
            return False
        return self.count > 1 or time.monotonic() - max(begin, self._latest) > GRACE


@contextmanager
def noting(requests: StopRequests) -> Iterator[None]:
    """Count Ctrl-C and SIGTERM during the block; the handlers before it are called as well."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def note(number: int, frame: FrameType | None) -> None:
        requests.note()
        handler = before[signal.Signals(number)]
        if callable(handler):
            handler(number, frame)

    for number in before:
        signal.signal(number, note)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def sigterm_as_ctrl_c() -> Iterator[None]:
    """Let SIGTERM raise KeyboardInterrupt, so that folders are removed and processes ended."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
