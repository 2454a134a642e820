"""Progress as lines of text: for log files, and for terminals that are none."""

from __future__ import annotations

import time
from collections.abc import Callable

from lcmchain.quantities.readable import duration_text

#: Time between two lines of one stage [s].
LINE_INTERVAL = 10.0


class ProgressLines:
    """Turns calls of a progress callback into a line per stage, and one every ten seconds in it.

    Parameters
    ----------
    write : takes a line.
    clock : gives the time [s]; another one for tests.
    """

    def __init__(
        self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._write, self._clock = write, clock
        self._stage = ""
        self._stage_start = self._stage_from = self._said = 0.0

    def __call__(self, completed: float, total: float, text: str = "forming") -> None:
        """Say how far a stage is: ``text`` is its name, and after a comma how far in words."""
        stage = text.partition(",")[0]
        now = self._clock()
        if stage != self._stage:
            self._stage, self._stage_start, self._stage_from = stage, now, completed
            self._said = now
            self._write(text)
        elif now - self._said >= LINE_INTERVAL:
            self._said = now
            self._write(f"{text}{self._how_far(completed, total, now)}")

    def _how_far(self, completed: float, total: float, now: float) -> str:
        gained = completed - self._stage_from
        if not gained > 0.0 or not total > 0.0:
            return f", since {duration_text(now - self._stage_start)}"
        left = (total - completed) * (now - self._stage_start) / gained
        return f", {completed / total:.0%}, {duration_text(left)} left"
