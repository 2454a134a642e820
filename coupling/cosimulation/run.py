"""A co-simulation from its begin to its end, with record, checkpoints, pictures and summary."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.coupling.cosimulation.assembly import Assembly, assemble
from lcmchain.coupling.cosimulation.instance import EndRequested
from lcmchain.coupling.cosimulation.part import SerialisedUnit, Spent
from lcmchain.coupling.cosimulation.process_instance import LeftInCall
from lcmchain.coupling.cosimulation.recorder import Recorder, chosen, draw_signals, summary_of
from lcmchain.coupling.cosimulation.stopping import noting, sigterm_as_ctrl_c
from lcmchain.coupling.cosimulation.system_file import (
    CONVERGENCE_GROUP,
    System,
    changed_settings,
)
from lcmchain.coupling.cosimulation.temporary_folder import temporary_folder
from lcmchain.coupling.iteration import CoupledSystem, NotConverged, NotSettled, PartFailed
from lcmchain.coupling.iteration.checkpoint import (
    flattened,
    read_archive,
    restored,
    write_archive,
)
from lcmchain.coupling.iteration.history import IterationRecord, WindowRecord
from lcmchain.coupling.iteration.interface import Values
from lcmchain.coupling.iteration.plot import draw_history
from lcmchain.errors import (
    InputError,
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

if TYPE_CHECKING:
    import xarray as xr


# --- divergence of an explicit coupling: its fields swing from window to window and grow ----------

#: Least growth of a swing per window; one that grows less may fade again.
LEAST_GROWTH = 1.05
#: Growing swings in a row, and their growth in total, from which on the coupling diverges.
LEAST_SWINGS = 8
LEAST_TOTAL = 1e3
#: Cosine between two changes below which the later one takes back the earlier one.
OPPOSITE = -0.9
#: Growth of a field over its first size that counts as divergence, with or without swings.
BEYOND_USE = 1e15


class CouplingDiverges(SimulationError):
    """The fields of an explicit scheme grow from window to window without end."""


@dataclass
class _Swing:
    """How often in a row a change has taken back the one before it, and grown."""

    count: int = 0
    begin: float = 0.0


@dataclass
class DivergenceWatch:
    """Follows the exchanged fields over the windows of an explicit scheme.

    An error changes its sign with every window between units that step one after the other, and
    with every second window between units that step at once. A resolved solution does neither.

    Parameters
    ----------
    names : of the exchanged fields.
    """

    names: Sequence[str]
    _before: list[Values] | None = None
    _changes: list[list[Values]] = field(default_factory=list)  # newest first
    _swings: dict[tuple[int, int], _Swing] = field(default_factory=dict)
    _first: dict[int, float] = field(default_factory=dict)

    def follow(self, fields: Sequence[Values]) -> str:
        """Take the fields at the end of a window; return in words what diverges, else nothing."""
        problem = ""
        if self._before is not None:
            changes = [now - before for now, before in zip(fields, self._before)]
            for number, change in enumerate(changes):
                problem = problem or self._judge(number, change, fields[number])
            self._changes.insert(0, changes)
            del self._changes[2:]
        self._before = [values.copy() for values in fields]
        return problem

    def growing(self) -> str:
        """Return the field with most growing swings in a row; empty below three."""
        most = max(self._swings, key=lambda key: self._swings[key].count, default=None)
        if most is None or self._swings[most].count < 3:
            return ""
        return self.names[most[0]]

    def _judge(self, number: int, change: Values, now: Values) -> str:
        size = float(np.linalg.norm(change))
        name = self.names[number]
        for distance in (1, 2):
            if len(self._changes) < distance:
                continue
            earlier = self._changes[distance - 1][number]
            swing = self._swings.setdefault((number, distance), _Swing())
            before = float(np.linalg.norm(earlier))
            if size == before == 0.0:  # units that step at once: every second change is zero
                continue
            opposite = float(change @ earlier) < OPPOSITE * size * before
            if not (opposite and size > LEAST_GROWTH * before > 0.0):
                swing.count = 0
                continue
            if swing.count == 0:
                swing.begin = before
            swing.count += 1
            grown = size / swing.begin
            if swing.count >= LEAST_SWINGS and grown > LEAST_TOTAL:
                return (
                    f"{name} swings with every {'window' if distance == 1 else 'second window'}, "
                    f"and its swings have grown {grown:.3g} times in {swing.count} windows"
                )
        amount = float(np.abs(now).max()) if now.size else 0.0
        first = self._first.setdefault(number, amount) if amount > 0.0 else 0.0
        if first > 0.0 and amount > BEYOND_USE * first:
            return f"{name} has grown {amount / first:.3g} times since it was first not 0"
        return ""


def advice(cannot_return: Sequence[str]) -> str:
    """Return what to do where an explicit scheme diverges.

    cannot_return : units that cannot restore an earlier state.
    """
    text = (
        "The units answer to each other more strongly than an explicit scheme can follow; smaller "
        "windows help between masses and springs, but not against an incompressible fluid or a "
        'direct feedthrough. Take an implicit scheme: scheme.type = "iqn-ils" (or "aitken")'
    )
    if cannot_return:
        names = ", ".join(f'"{name}"' for name in cannot_return)
        text += (
            f"; for it {names} would have to be able to go back (canGetAndSetFMUstate), which the "
            "unit says it cannot: ask its maker, or exchange what is passed (the stiffer side "
            "should take the displacement and give the force)"
        )
    return text


# --- checkpoint: the whole state, so that a run goes on as if it had never stopped ----------------


CHECKPOINT = "cosimulation_checkpoint.npz"
RECORDS = {record.__name__: record for record in (IterationRecord, WindowRecord, SerialisedUnit)}
_FORM = "lcmchain cosimulation 1"
_SYSTEM = "settings of the system"
#: Most changes that a message lists.
MOST_CHANGES = 8


def fingerprint_of(assembly: Assembly) -> dict[str, str]:
    """Return hashes of all that the results depend on: units and settings, by name."""
    units = {f'unit "{name}"': part.sha256 for name, part in assembly.parts.items()}
    return {**units, _SYSTEM: assembly.system.digest()}


def write_checkpoint(path: Path, assembly: Assembly, recorder: Recorder, wall_s: float) -> None:
    """Write the state between two windows, whole or not at all.

    wall_s : wall-clock time of the run so far [s].

    Raises
    ------
    PartFailed : a unit cannot write its state.
    """
    saved = assembly.coupled.save()
    saved["parts"] = {
        name: assembly.parts[name].serialised(state) for name, state in saved["parts"].items()
    }
    spent = {name: asdict(part.spent) for name, part in assembly.parts.items()}
    tree, arrays = flattened({"system": saved, "recorder": recorder.save(), "spent": spent,
                              "wall_s": wall_s})  # fmt: skip
    header = {
        "fingerprint": fingerprint_of(assembly), "settings": assembly.system.settings(),
        "tree": tree, "count": len(arrays),
    }  # fmt: skip
    write_archive(path, _FORM, header, {f"array_{k}": array for k, array in enumerate(arrays)})


def restore_checkpoint(path: Path, assembly: Assembly, recorder: Recorder) -> float:
    """Restore system and recorder; return the wall-clock time spent before the checkpoint [s].

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to other units or settings.
    """
    header, stored = read_archive(path, _FORM, "simulate without --resume")
    _require_same(header, assembly, path)
    arrays = [stored[f"array_{number}"] for number in range(header["count"])]
    kept = restored(header["tree"], arrays, RECORDS)
    assembly.coupled.restore(kept["system"])
    recorder.restore(kept["recorder"])
    for name, part in assembly.parts.items():
        part.spent = Spent(**kept["spent"][name])
    assembly.lines.refresh()
    return kept["wall_s"]


def _require_same(header: dict[str, Any], assembly: Assembly, path: Path) -> None:
    then, now = header["fingerprint"], fingerprint_of(assembly)
    differing = [what for what in {**now, **then} if then.get(what) != now.get(what)]
    if differing:
        changes = [f"{what} ({_short(then, what)} then, {_short(now, what)} now)"
                   for what in differing if what != _SYSTEM]  # fmt: skip
        if _SYSTEM in differing:
            # checkpoints of earlier versions hold the hash alone
            settings = assembly.system.settings()
            changes += changed_settings(header.get("settings", settings), settings) or [_SYSTEM]
        listed = ", ".join(changes[:MOST_CHANGES])
        listed += f" and {len(changes) - MOST_CHANGES} more" * (len(changes) > MOST_CHANGES)
        raise InputError(
            f"the checkpoint was written with something else: {listed}; go on with the same units "
            "and settings, or simulate without --resume",
            file=path,
        )


def _short(hashes: dict[str, str], what: str) -> str:
    return f"SHA-256 {hashes[what][:12]}" if what in hashes else "absent"


# --- the run --------------------------------------------------------------------------------------


#: Wall-clock time between two checkpoints [s].
CHECKPOINT_INTERVAL = 30.0
#: Least wall-clock time between two writings of the record [s], and the most that writing may take
#: of the run. The record is written whole each time, so that a reader never sees half of it.
RECORD_INTERVAL, RECORD_SHARE = 5.0, 0.05

NETCDF, SIGNALS, CONVERGENCE = "cosimulation.nc", "signals.png", "convergence.png"
FILES = (NETCDF, SIGNALS, CONVERGENCE, CHECKPOINT, "summary.json", "lcmchain.log")

#: Takes the time reached [s], the end [s] and a text.
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
    progress : called with (time reached, end, text).
    inputs : files that must not be overwritten, besides the units.

    Raises
    ------
    InputError : the system does not fit together; nothing was computed.
    SimulationError : a unit failed, a window did not converge, or an explicit scheme diverges;
        the record up to then is written.
    SimulationInterrupted : the user stopped it; a checkpoint was left.
    """
    folder = Path(out)
    units = tuple(system.directory / unit.fmu for unit in system.units)
    with (
        sigterm_as_ctrl_c(),
        ResultsFolder.locked(folder, (*inputs, *units)) as results,
        temporary_folder("lcmchain-cosimulation-") as unpacked,
    ):
        results.require_apart(FILES)
        reports = _Reports(progress)
        reports.tell(system.start_time, system.stop_time, "loading the units")
        with assemble(system, unpacked, reports.log) as assembly:
            job = _Job(assembly, folder, reports)
            if resume:
                job.resume()
            results.begin(resume=resume)
            reports.begin(folder)
            try:
                job.go()
            except BaseException as error:
                job.end(error)
                raise
        (folder / CHECKPOINT).unlink(missing_ok=True)
        results.remove_previous()
    return job.summary


class _Reports:
    """Progress and log; lines for the log wait until the folder is ready."""

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

    def __init__(self, assembly: Assembly, folder: Path, reports: _Reports) -> None:
        self.assembly, self.folder, self.reports = assembly, folder, reports
        self.system = assembly.system
        self.recorder = Recorder(
            assembly.parts, chosen(assembly.parts, self.system.recorder), self.system.recorder.every
        )
        self.summary: dict[str, Any] = {}
        self._watch = DivergenceWatch(assembly.coupled.history.exchanges)
        self._wall_before = 0.0
        self._started = self._saved = self._recorded = clock.perf_counter()
        self._record_cost = 0.0
        self._saved_time: float | None = None
        descriptions = {name: part.description for name, part in assembly.parts.items()}
        unable = [n for n, d in descriptions.items() if not (d.can_save and d.can_serialise)]
        self._can_save = not unable
        if unable:
            names = ", ".join(f'"{name}"' for name in unable)
            self.reports.log(f"remark: no checkpoints, because {names} cannot write a state")

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
        self.reports.log(COMPLETE)

    def _after_window(self, coupled: CoupledSystem) -> None:
        end = self.system.stop_time
        self.assembly.lines.refresh()
        ending = [name for name, part in self.assembly.parts.items() if part.wants_end]
        last = coupled.time >= end or self._stop.is_set() or bool(ending)
        self.recorder.take(coupled.time, last=last)
        self.reports.tell(coupled.time, end, f"simulating, {coupled.time:.6g} s")
        if self.system.scheme.explicit:
            problem = self._watch.follow(coupled.exchanged)
            if problem:
                raise CouplingDiverges(
                    f"the explicit coupling ({coupled.scheme.name}) diverges at {coupled.time:g} "
                    f"s: {problem}. {advice(self._cannot_return())}"
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
        if coupled.time < end and clock.perf_counter() - self._recorded > wait:
            self._write_record(RUNNING)
            self._write_summary(RUNNING)

    def _interrupted(self, time: float) -> str:
        where = f"stopped at {time:g} s of {self.system.stop_time:g} s"
        if not self._can_save:
            return f"{where}; there is no checkpoint, because not all units can write their state"
        self._save()
        return f"{where}; the same command with --resume goes on from here"

    def _left(self, error: LeftInCall) -> str:
        """Return the message on a run that was stopped within a window."""
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

    def _cannot_return(self) -> list[str]:
        parts = self.assembly.parts.items()
        return [name for name, part in parts if not part.description.can_save]

    def _explained(self, error: PartFailed | NotConverged | NotSettled) -> SimulationError:
        """Return an error with remedies in the words of the system's file."""
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
                f"{advice(self._cannot_return())}"
            )
        elif "refused the step" in text and self.system.window.smallest is None:
            text += (
                ". A shorter step may succeed: window.smallest lets windows be halved, where all "
                "units can go back"
            )
        return SimulationError(text)

    def end(self, error: BaseException) -> None:
        """Write the results and the reason of a run that did not reach its end, where possible."""
        asked_for = isinstance(error, KeyboardInterrupt | SimulationInterrupted)
        state = INTERRUPTED if asked_for else stopped(str(error) or type(error).__name__)
        self.reports.log(f"{state.partition(':')[0]}: {error or type(error).__name__}")
        with suppress(OSError, LcmchainError):
            if asked_for or isinstance(error, LcmchainError):
                self.write_results(state)
        with suppress(OSError, LcmchainError):
            self._write_summary(state)
        if isinstance(error, UnfinishedRun):
            last = self.recorder.times[-1] if self.recorder.times else self.system.start_time
            error.where = f"What was recorded up to {last:g} s is in {self.folder / NETCDF}"

    def _write_record(self, state: str) -> None:
        """Write the record so far, whole or not at all."""
        begin = clock.perf_counter()
        about = {
            "title": self.system.title,
            "source": "lcmchain cosim",
            "system": self.system.source,
            "state": state,
        }
        groups = self.recorder.groups(about)
        groups[CONVERGENCE_GROUP] = self._convergence()
        write_netcdf(self.folder / NETCDF, groups)
        self._recorded = clock.perf_counter()
        self._record_cost = self._recorded - begin

    def _convergence(self) -> xr.Dataset:
        """Return the history of the iterations, with the units of the exchanged fields."""
        dataset, parts = self.assembly.coupled.history.dataset(), self.assembly.parts
        units = []
        for exchange in self.assembly.coupled.exchanges:
            given = parts[exchange.source].description.find(exchange.field).unit_text
            taken = parts[exchange.target].description.find(exchange.target_field).unit_text
            units.append(given if taken == "1" else taken)  # compared where they have arrived
        about = {"long_name": "unit of the exchanged field"}
        dataset = dataset.assign_coords(exchange_unit=("exchange", np.array(units, object), about))
        if len(set(units)) == 1:  # else each column has its own
            for variable in dataset.data_vars.values():
                if "exchange" in variable.dims:
                    variable.attrs["units"] = units[0]
        return dataset

    def write_results(self, state: str) -> None:
        """Write the record and the pictures."""
        coupled, title = self.assembly.coupled, self.system.title
        self.reports.tell(coupled.time, self.system.stop_time, "writing the record")
        self._write_record(state)
        remark = draw_signals(self.folder / SIGNALS, self.recorder, title)
        if remark and remark not in self.assembly.remarks:
            self.assembly.remarks.append(remark)
        if not self.system.scheme.explicit:
            draw_history(self.folder / CONVERGENCE, coupled.history.dataset(), title)

    def _write_summary(self, state: str) -> None:
        self.summary = summary_of(self.assembly, self.recorder, self.wall_s) | {"state": state}
        write_summary(self.folder, self.summary)
