"""A run: the forming stage from saved frame to saved frame, and the account of all stages."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from lcmchain.errors import LcmchainError, SimulationInterrupted
from lcmchain.provenance import Fingerprint, written_values
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
from lcmchain.scene import Scene
from lcmchain.solver.checkpoint import Checkpoint, FrameFile, write_checkpoint
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.solver.stage_start import model_digest

# A checkpoint is written at every saved frame, and between frames after this time [s].
CHECKPOINT_INTERVAL = 30.0

Progress = Callable[[float, float, str], None]


def ignore(*_: object) -> None:
    """Take what nobody asked for."""


class Companion(Protocol):
    """What advances together with a simulation, in place of the simulation alone."""

    def advance_to(self, time: float, on_chunk: Callable[[Simulation], None]) -> None:
        """Bring the simulation and itself to a time [s], as :meth:`Simulation.advance_to` does."""

    def keep_frame(self) -> None:
        """Keep what belongs to a saved frame."""

    def write_checkpoint(self, folder: Path, step_count: int) -> None:
        """Write its state, that of the simulation after so many steps among it."""

    def forget_checkpoints(self, folder: Path, *, but: int | None) -> None:
        """Remove the states of other step counts than that of the last checkpoint."""

    def restore_checkpoint(self, folder: Path, step_count: int) -> None:
        """Go back to the state that it wrote after so many steps."""


class FormingRun:
    """Advances a simulation from frame to frame, with checkpoints on the way.

    ``on_saved`` is called after each of them. A ``companion`` advances the simulation with itself.
    ``until`` is the time [s] of a saved frame after which it makes no further one.
    """

    def __init__(
        self,
        scene: Scene,
        fingerprint: Fingerprint,
        simulation: Simulation,
        folder: Path,
        report: Progress,
        on_saved: Callable[[], None] = ignore,
        companion: Companion | None = None,
        until: float = math.inf,
    ) -> None:
        self.scene, self.fingerprint, self.simulation = scene, fingerprint, simulation
        self.folder, self.report, self.on_saved = folder, report, on_saved
        self.companion, self.until = companion, until
        self.snapshots: list[Snapshot] = []
        self._values = written_values(scene)
        self._frame_file = FrameFile(folder)
        self._wall_before = 0.0
        self._started = self._saved = time.perf_counter()
        self._ended: float | None = None

    @property
    def wall_s(self) -> float:
        """Time spent in the time loop, resumed parts included [s]."""
        now = time.perf_counter() if self._ended is None else self._ended
        return self._wall_before + now - self._started

    def complete(self, checkpoint: Checkpoint | None = None) -> list[Snapshot]:
        """Advance to the end of the process, or until it is to end, and return the saved frames."""
        self._started = self._saved = time.perf_counter()
        if checkpoint is not None:
            self.simulation.restore(checkpoint.state)
            if self.companion is not None:
                self.companion.restore_checkpoint(self.folder, checkpoint.state.step_count)
            self.simulation.control.history.update(checkpoint.step_history)
            self.snapshots = list(checkpoint.snapshots)
            self._wall_before = checkpoint.wall_s
            self._frame_file = checkpoint.frame_file
        else:
            self.snapshots = [self.simulation.snapshot()]
            if self.companion is not None:
                self.companion.keep_frame()
        mover = self.companion or self.simulation
        times = self.scene.frame_times
        left = times[times > self.snapshots[-1].time]
        with stop_requests() as self._stop:
            for frame_time in left[left <= self.until]:
                mover.advance_to(float(frame_time), self._after_chunk)
                self.snapshots.append(self.simulation.snapshot())
                if self.companion is not None:
                    self.companion.keep_frame()
                self._save()
        self._ended = time.perf_counter()
        return self.snapshots

    def _after_chunk(self, simulation: Simulation) -> None:
        stage = simulation.model.present_stage
        what = "forming" if stage is None else f"forming, {stage.name}"
        text = f"{what}, step {simulation.state.step_count:,}"
        self.report(simulation.time, self.scene.process.time, text)
        simulation.require_resolved()
        if self._stop.is_set():
            self._save()
            raise SimulationInterrupted(
                f"stopped at {1e3 * simulation.time:.4g} ms of {1e3 * self.scene.process.time:.4g} "
                "ms; the same command with --resume goes on from here"
            )
        if time.perf_counter() - self._saved > CHECKPOINT_INTERVAL:
            self._save()

    def _save(self) -> None:
        step_count = self.simulation.state.step_count
        if self.companion is not None:  # first, so that a checkpoint never lacks its companion's
            self.companion.write_checkpoint(self.folder, step_count)
        write_checkpoint(
            self.folder,
            Checkpoint(
                self.fingerprint,
                self.simulation.state,
                self.snapshots,
                self.wall_s,
                self.simulation.control.history,
                self._frame_file,
                values=self._values,
                **self._for_later_stages(),
            ),
        )
        if self.companion is not None:
            self.companion.forget_checkpoints(self.folder, but=step_count)
        self._saved = time.perf_counter()
        self.on_saved()

    def _for_later_stages(self) -> dict[str, Any]:
        """Return what a run of another scene needs that goes on from the end of a stage."""
        model, time = self.simulation.model, self.simulation.time
        ends = tuple(stage.end for stage in model.stages)
        if time not in ends[:-1]:
            return {}
        digest = model_digest(model.whole, ends.index(time) + 1)
        return {"stage_ends": ends, "digest": digest}


@contextmanager
def stop_requests() -> Iterator[threading.Event]:
    """Turn Ctrl-C and SIGTERM into an event that is looked at between chunks of steps."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: event.set()) for number in signals]
    try:
        yield event
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


# --- the account that a run gives of itself: to its listeners, in its log, in summary.json --------


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
