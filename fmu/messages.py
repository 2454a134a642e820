"""Messages of a unit to its master and to stderr.

They hold no reference to the unit: an instance that is freed is gone at once, with the megabytes of
its simulation, and does not wait for Python's search for cycles.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

from lcmchain.fmu.status import CATEGORY_OF, Status

#: Takes a message: its status, its category, and the text.
Report = Callable[[Status, str, str], None]


class Messages:
    """Says things under the name of an instance.

    Parameters
    ----------
    name : of the instance. report : hands a message to the master.
    """

    def __init__(self, name: str, report: Report) -> None:
        self._name, self._report = name, report

    def __call__(self, text: str, status: Status = Status.OK, *, aloud: bool = False) -> None:
        """Hand a message to the master, and to stderr if it is not only an event, or ``aloud``.

        Most masters show no log messages unless they are asked to, and pythonfmu hands them on
        only when the call is over.
        """
        text = f"{self._name}: {text}"
        self._report(status, CATEGORY_OF[status], text)
        if aloud or status is not Status.OK:
            print(text, file=sys.stderr, flush=True)
