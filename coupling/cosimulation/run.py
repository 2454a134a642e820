"""A co-simulation from its begin to its end, with record, checkpoints, pictures and summary."""

from __future__ import annotations

import tempfile
import time as clock
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from lcmchain.coupling.cosimulation.assembly import Assembly, assemble
from lcmchain.coupling.cosimulation.checkpoint import (
    CHECKPOINT,
    restore_checkpoint,
    write_checkpoint,
)
from lcmchain.coupling.cosimulation.divergence import CouplingDiverges, DivergenceWatch, advice
from lcmchain.coupling.cosimulation.instance import EndRequested
from lcmchain.coupling.cosimulation.picture import draw_signals
from lcmchain.coupling.cosimulation.process_instance import LeftInCall
from lcmchain.coupling.cosimulation.recorder import Recorder, chosen
from lcmchain.coupling.cosimulation.stopping import noting, sigterm_as_ctrl_c
from lcmchain.coupling.cosimulation.summary import summary_of
from lcmchain.coupling.cosimulation.system_file import CONVERGENCE_GROUP, System
from lcmchain.coupling.iteration import CoupledSystem, NotConverged, NotSettled, PartFailed
from lcmchain.coupling.iteration.plot import draw_history
from lcmchain.errors import (
    LcmchainError,
    SimulationError,
    SimulationInterrupted,
    UnfinishedRun,
)
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.forming_run import stop_requests
from lcmchain.results import (
    COMPLETE,
    INTERRUPTED,
    RUNNING,
    ProgressLines,
    ResultsFolder,
    RunLog,
    stopped,
    write_summary,
)

#: A checkpoint is written after this time of computing [s].
CHECKPOINT_INTERVAL = 30.0
#: The record on disk grows after this time of computing [s], or later where writing it takes long:
#: it is written whole, so that readers never see a part, and may take this share of the run.
RECORD_INTERVAL, RECORD_SHARE = 5.0, 0.05

NETCDF, SIGNALS, CONVERGENCE = "cosimulation.nc", "signals.png", "convergence.png"
FILES = (NETCDF, SIGNALS, CONVERGENCE, CHECKPOINT, "summary.json", "lcmchain.log")

Progress = Callable[[float, float, str], None]


def run_system(
    system: System,
    out: Path | str,
    *,
    resume: bool = False,
    progress: Progress | None = None,
    inputs: tuple[Path, ...] = (),
) -> dict[str, Any]:
    """Simulate a system and write the results into ``out``; return the summary.

    Parameters
    ----------
    out : folder of the results; earlier ones are set aside until these are complete.
    resume : go on from the checkpoint in ``out``; bit-identical to a run without a stop.
    progress : called with (completed, total, text).
    inputs : files that must not be written over, beside the units.

    Raises
    ------
    InputError : the system does not fit together; nothing was computed.
    SimulationError : a unit failed, a window did not converge, or an explicit scheme diverges;
        what was recorded up to then is written.
    SimulationInterrupted : the user stopped it; a checkpoint was left.
    """
    folder = Path(out)
    units = tuple(system.directory / unit.fmu for unit in system.units)
    with (
        sigterm_as_ctrl_c(),
        ResultsFolder.locked(folder, (*inputs, *units)) as results,
        tempfile.TemporaryDirectory(prefix="lcmchain-cosimulation-") as unpacked,
    ):
        results.require_apart(FILES)
        said = _Said(progress)
        said.tell(system.start_time, system.stop_time, "loading the units")
        with assemble(system, Path(unpacked), said.log) as assembly:
            job = _Job(assembly, folder, said)
            if resume:
                job.resume()
            results.begin(resume=resume)
            said.begin(folder)
            try:
                job.go()
            except BaseException as error:
                job.end(error)
                raise
        (folder / CHECKPOINT).unlink(missing_ok=True)
        results.remove_previous()
    return job.summary


class _Said:
    """Progress and log; what is said before the folder is ready waits."""

    def __init__(self, progress: Progress | None) -> None:
        self._waiting: list[str] = []
        self._write: Callable[[str], None] = self._waiting.append
        self._listeners: list[Progress] = [] if progress is None else [progress]

    def log(self, text: str) -> None:
        self._write(text)

    def begin(self, folder: Path) -> None:
        self._write = RunLog(folder)
        self._listeners.append(ProgressLines(self._write))
        for text in self._waiting:
            self._write(text)

    def tell(self, time: float, total: float, text: str) -> None:
        for listener in self._listeners:
            listener(time, total, text)


class _Job:
    """One run of an assembled system."""

    def __init__(self, assembly: Assembly, folder: Path, said: _Said) -> None:
        self.assembly, self.folder, self.said = assembly, folder, said
        self.system = assembly.system
        self.recorder = Recorder(
            assembly.parts, chosen(assembly.parts, self.system.recorder), self.system.recorder.every
        )
        self.summary: dict[str, Any] = {}
        self._watch = DivergenceWatch(assembly.coupled.history.exchanges)
        self._wall_before = 0.0
        self._started = self._saved = self._grown = clock.perf_counter()
        self._record_cost = 0.0
        self._saved_time: float | None = None
        descriptions = {name: part.description for name, part in assembly.parts.items()}
        silent = [n for n, d in descriptions.items() if not (d.can_save and d.can_serialise)]
        self._can_save = not silent
        if silent:
            names = ", ".join(f'"{name}"' for name in silent)
            self.said.log(f"remark: no checkpoints, because {names} cannot write a state")

    @property
    def wall_s(self) -> float:
        return self._wall_before + clock.perf_counter() - self._started

    def resume(self) -> None:
        """Go back to the checkpoint in the folder."""
        self._wall_before = restore_checkpoint(
            self.folder / CHECKPOINT, self.assembly, self.recorder
        )
        self._saved_time = self.assembly.coupled.time

    def go(self) -> None:
        """Advance to the end and write everything."""
        coupled = self.assembly.coupled
        self._write_summary(RUNNING)
        if not self.recorder.times:
            self.recorder.take(coupled.time)
        self._write_record(RUNNING)
        with stop_requests() as self._stop, noting(self.assembly.requests):
            try:
                coupled.advance_to(self.system.stop_time, self._after_window)
            except (PartFailed, NotConverged, NotSettled) as error:
                raise self._explained(error) from error
            except LeftInCall as error:
                raise SimulationInterrupted(self._left(error)) from error
        self.write_results(COMPLETE)
        self._write_summary(COMPLETE)
        self.said.log(COMPLETE)

    def _after_window(self, coupled: CoupledSystem) -> None:
        end = self.system.stop_time
        self.assembly.lines.refresh()
        ending = [name for name, part in self.assembly.parts.items() if part.wants_end]
        last = coupled.time >= end or self._stop.is_set() or bool(ending)
        self.recorder.take(coupled.time, last=last)
        self.said.tell(coupled.time, end, f"simulating, {coupled.time:.6g} s")
        if self.system.scheme.explicit:
            found = self._watch.follow(coupled.exchanged)
            if found:
                raise CouplingDiverges(
                    f"the explicit coupling ({coupled.scheme.name}) diverges at {coupled.time:g} "
                    f"s: {found}. {advice(self._one_way())}"
                )
        if ending and coupled.time < end:
            raise SimulationError(
                f'unit "{ending[0]}": it asked for the end of the simulation at '
                f"{coupled.time:g} s, before the stop time of {end:g} s; give that time as "
                "stop_time if it is meant"
            )
        if self._stop.is_set() and coupled.time < end:
            raise SimulationInterrupted(self._interrupted(coupled.time))
        if self._can_save and clock.perf_counter() - self._saved > CHECKPOINT_INTERVAL:
            self._save()
        wait = max(RECORD_INTERVAL, self._record_cost / RECORD_SHARE)
        if coupled.time < end and clock.perf_counter() - self._grown > wait:
            self._write_record(RUNNING)
            self._write_summary(RUNNING)

    def _interrupted(self, time: float) -> str:
        where = f"stopped at {time:g} s of {self.system.stop_time:g} s"
        if not self._can_save:
            return f"{where}; there is no checkpoint, because not all units can write their state"
        self._save()
        return f"{where}; the same command with --resume goes on from here"

    def _left(self, error: LeftInCall) -> str:
        """Return what to do about a run that was left within a window."""
        where = f"stopped at {self.assembly.coupled.time:g} s of {self.system.stop_time:g} s"
        if self._saved_time is None:
            return f"{where}: {error}; there is no checkpoint"
        return (
            f"{where}: {error}; the same command with --resume goes on from the checkpoint at "
            f"{self._saved_time:g} s"
        )

    def _save(self) -> None:
        write_checkpoint(self.folder / CHECKPOINT, self.assembly, self.recorder, self.wall_s)
        self._saved_time = self.assembly.coupled.time
        self._saved = clock.perf_counter()
        self._write_summary(RUNNING)

    def _one_way(self) -> list[str]:
        parts = self.assembly.parts.items()
        return [name for name, part in parts if not part.description.can_save]

    def _explained(self, error: PartFailed | NotConverged | NotSettled) -> SimulationError:
        """Return an error in the words of the system's file."""
        text = str(error)
        if isinstance(error.__cause__, EndRequested):
            part = error.part if isinstance(error, PartFailed) else ""
            return SimulationError(
                f'unit "{part}": {error.__cause__}, before the stop time of '
                f"{self.system.stop_time:g} s; give that time as stop_time if it is meant"
            )
        if isinstance(error, NotSettled):
            return SimulationError(
                f"{text}. A loop of switches may have no state of rest, or only one after more "
                "iterations (scheme.most_iterations). Remedies: smaller windows; scheme.jumps = "
                '"once", with which each unit answers to what there was a window before'
            )
        if isinstance(error, NotConverged):
            text = (
                f"{text.partition(' Likely cause:')[0]} The units answer to each other more "
                'strongly than the scheme can follow. Remedies: scheme.type = "iqn-ils"; more '
                "scheme.most_iterations; window.smallest, so that windows can be halved; a larger "
                "tolerance (scheme.relative) where the units themselves compute no better"
            )
        elif self.system.scheme.explicit and self._watch.growing():
            text = (
                f"{text}. Before that the explicit coupling had begun to diverge: "
                f"{self._watch.growing()} swings from window to window and grows. "
                f"{advice(self._one_way())}"
            )
        elif "refused the step" in text and self.system.window.smallest is None:
            text += (
                ". A shorter step may succeed: window.smallest lets windows be halved, where all "
                "units can go back"
            )
        return SimulationError(text)

    def end(self, error: BaseException) -> None:
        """Give account of a run that has not come to its end, as far as that can be written."""
        asked_for = isinstance(error, KeyboardInterrupt | SimulationInterrupted)
        state = INTERRUPTED if asked_for else stopped(str(error) or type(error).__name__)
        self.said.log(f"{state.partition(':')[0]}: {error or type(error).__name__}")
        with suppress(OSError, LcmchainError):
            if asked_for or isinstance(error, LcmchainError):
                self.write_results(state)
        with suppress(OSError, LcmchainError):
            self._write_summary(state)
        if isinstance(error, UnfinishedRun):
            last = self.recorder.times[-1] if self.recorder.times else self.system.start_time
            error.where = f"What was recorded up to {last:g} s is in {self.folder / NETCDF}"

    def _write_record(self, state: str) -> None:
        """Write what was recorded so far, whole or not at all."""
        begin = clock.perf_counter()
        about = {
            "title": self.system.title,
            "source": "lcmchain cosim",
            "system": self.system.source,
            "state": state,
        }
        groups = self.recorder.groups(about)
        groups[CONVERGENCE_GROUP] = self.assembly.coupled.history.dataset()
        write_netcdf(self.folder / NETCDF, groups)
        self._grown = clock.perf_counter()
        self._record_cost = self._grown - begin

    def write_results(self, state: str) -> None:
        """Write the record and the pictures."""
        coupled, title = self.assembly.coupled, self.system.title
        self.said.tell(coupled.time, self.system.stop_time, "writing the record")
        self._write_record(state)
        remark = draw_signals(self.folder / SIGNALS, self.recorder, title)
        if remark and remark not in self.assembly.remarks:
            self.assembly.remarks.append(remark)
        if not self.system.scheme.explicit:
            draw_history(self.folder / CONVERGENCE, coupled.history.dataset(), title)

    def _write_summary(self, state: str) -> None:
        self.summary = summary_of(self.assembly, self.recorder, self.wall_s) | {"state": state}
        write_summary(self.folder, self.summary)
