"""Errors that a user can act on, and the exit code each one maps to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np

#: Longest message, and longest value in one, that a reader can be expected to read.
LONGEST_MESSAGE = 2500
LONGEST_VALUE = 80


class LcmchainError(Exception):
    """Base of every error that the command line prints as one message without a traceback.

    The middle of a message that is far too long is left out.
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        super().__init__(shortened(message, LONGEST_MESSAGE))


class InputError(LcmchainError):
    """Wrong input: names the scene key or the file, and says what to do (exit code 2).

    Parameters
    ----------
    message : what is wrong and what to do about it.
    key : dotted scene key, for example ``"blank.edge_length"``.
    file : the file that could not be used.
    """

    exit_code = 2

    def __init__(
        self, message: str, *, key: str | None = None, file: str | Path | None = None
    ) -> None:
        self.key = key
        self.file = None if file is None else str(file)
        self.message = shortened(message, LONGEST_MESSAGE)
        place = key if key is not None else self.file
        place = None if place is None else shortened(place, LONGEST_MESSAGE // 5)
        super().__init__(message if place is None else f"{place}: {message}")


class OutputError(LcmchainError):
    """A file that could not be written to its end (exit code 1); nothing of it is left."""

    def __init__(self, reason: str, *, file: str | Path) -> None:
        self.file = str(file)
        super().__init__(
            f"{self.file}: writing failed ({reason[:1].lower()}{reason[1:]}); free some space, or "
            "name another folder, and run again (with --resume where there is a checkpoint)"
        )


class RunResult(Protocol):
    """What an error keeps of a run: see :class:`lcmchain.pipeline.Result`."""

    @property
    def summary(self) -> dict[str, Any]: ...


class UnfinishedRun(LcmchainError):
    """A run that did not come to its end (exit code 1).

    ``result`` is what it has left, None where that is nothing; ``where`` says which frames lie
    where.
    """

    result: RunResult | None = None
    where: str = ""


#: What the cause begins with in the message of a guard.
LIKELY_CAUSE = "Likely cause: "


class SimulationError(UnfinishedRun):
    """A run that a guard stopped: names element, position, time and likely cause."""

    def blame(self, cause: str) -> None:
        """Name a cause that is known from elsewhere before the one that the guard tells."""
        found, _, own = str(self).partition(LIKELY_CAUSE)
        self.args = (f"{found.strip()} {LIKELY_CAUSE}{cause}" + (f"; else {own}" if own else ""),)


class SimulationInterrupted(UnfinishedRun):
    """A run that the user stopped; a checkpoint was left."""


class StrictError(LcmchainError):
    """Warnings of a run or check that was asked to take them as errors (exit code 1)."""


class MappingError(InputError):
    """Meshes that a finished forming run could not be mapped onto (exit code 2).

    ``result`` is that of the run: its files are complete.
    """

    def __init__(self, message: str, result: RunResult) -> None:
        self.result = result
        super().__init__(message)


def shortened(text: str, longest: int = LONGEST_VALUE) -> str:
    """Leave the middle out of a text that is longer, for messages."""
    if len(text) <= longest:
        return text
    cut = f" ... ({len(text):,} characters) ... "
    head = max(2 * (longest - len(cut)) // 3, 1)
    tail = max(longest - len(cut) - head, 1)
    return text[:head] + cut + text[-tail:]


def first_few(numbers: np.ndarray | Sequence[int], count: int = 5, what: str = "cell") -> str:
    """Name the first few of many cells, or of something else, for messages."""
    shown = ", ".join(str(number) for number in numbers[:count])
    return f"{what} {shown}" + (", ..." if len(numbers) > count else "")
