"""The account that a run gives of itself: to its listeners, in its log, in ``summary.json``."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from lcmchain.errors import LcmchainError, SimulationInterrupted
from lcmchain.forming_run import Progress, ignore
from lcmchain.results import (
    COMPLETE,
    INTERRUPTED,
    RUNNING,
    ProgressLines,
    RunLog,
    all_warnings,
    stopped,
    write_summary,
)


class RunAccount:
    """Says where a run is and how it ended.

    Parameters
    ----------
    folder : of the results.
    process_time : that all stages are told to be on the way to [s].
    progress : called with (completed, total, text), None for nobody.
    """

    def __init__(self, folder: Path, process_time: float, progress: Progress | None) -> None:
        self.folder, self.process_time = folder, process_time
        #: Content of ``summary.json``, to which every stage adds.
        self.summary: dict = {}
        self._log: Callable[[str], None] = ignore
        self._listeners: list[Progress] = [progress or ignore]

    def tell(self, time: float, text: str, *, total: float | None = None) -> None:
        """Report a stage, and the process time [s] that it has come to, or how much of a total."""
        for listener in self._listeners:
            listener(time, self.process_time if total is None else total, text)

    @contextlib.contextmanager
    def kept(self, on_failure: Callable[[str], None]) -> Iterator[None]:
        """Keep the log and the state of the results, however the stages end.

        Parameters
        ----------
        on_failure : called with the state after an error of the run, once it is noted; what it
            cannot write for want of space is left out.
        """
        self._log = RunLog(self.folder)
        self._listeners.append(ProgressLines(self._log))
        self._log(_opening(self.summary))
        self.set_state(RUNNING)
        try:
            yield
        except BaseException as error:
            self._end(error, on_failure)
            raise

    def set_state(self, state: str) -> None:
        """Write the summary as it is, with this state."""
        self.summary["state"] = state
        write_summary(self.folder, self.summary)

    def complete(self) -> None:
        """Say that everything is there."""
        self.set_state(COMPLETE)
        for warning in all_warnings(self.summary):
            self._log(f"warning: {warning}")
        self._log(COMPLETE)

    def _end(self, error: BaseException, on_failure: Callable[[str], None]) -> None:
        """Give the account of a run that has failed, as far as that can still be written."""
        state = state_after(error)
        self._log(f"{state.partition(':')[0]}: {error or type(error).__name__}")
        # On a full disk the summary goes on saying "running", which readers take for interrupted;
        # the error that ended the run is what the user must see.
        with contextlib.suppress(OSError, LcmchainError):
            self.set_state(state)
        if isinstance(error, LcmchainError):
            with contextlib.suppress(OSError, LcmchainError):
                on_failure(state)


def state_after(error: BaseException) -> str:
    """Return the state of results whose run ended with this error."""
    asked_for = isinstance(error, KeyboardInterrupt | SimulationInterrupted)
    return INTERRUPTED if asked_for else stopped(str(error) or type(error).__name__)


def _opening(summary: Mapping) -> str:
    place, threads = summary["run"], summary["provenance"]["threads"]
    return (
        f"lcmchain {summary['lcmchain_version']}, {summary['title']}: "
        f"{summary['element_count']:,} elements, {threads} threads, process "
        f"{place['process']} on {place['host']}"
    )
