"""The forming stage: a simulation advanced from saved frame to saved frame, with checkpoints."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from lcmchain.errors import SimulationInterrupted
from lcmchain.fingerprint import Fingerprint
from lcmchain.scene import Scene
from lcmchain.solver.checkpoint import Checkpoint, FrameFile, write_checkpoint
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.solver.stage_start import model_digest, written_values

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
        values = written_values(self.scene)
        digest = model_digest(model.whole, ends.index(time) + 1)
        return {"values": values, "stage_ends": ends, "digest": digest}


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
