"""What a run says while it goes on: its log, and progress as lines of text."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from lcmchain.atomic import announce
from lcmchain.quantities.readable import duration_text

LOG_FILE = "lcmchain.log"


class RunLog:
    """Appends lines with their time to ``lcmchain.log``.

    A log that cannot be written is not worth a run: it says no more than the terminal, and a full
    disk stops the run at its next result.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOG_FILE
        announce(self.path)

    def __call__(self, text: str) -> None:
        """Write a line; further lines of the text are indented."""
        stamp = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        lines = text.replace("\n", "\n    ")
        with contextlib.suppress(OSError), open(self.path, "a", encoding="utf-8") as file:
            file.write(f"{stamp}  {lines}\n")


# --- progress as lines of text --------------------------------------------------------------------


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
