"""The log of a run: what it said and when, in the folder of its results."""

from __future__ import annotations

import contextlib
from datetime import datetime
from pathlib import Path

from lcmchain.atomic import announce

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
