"""A double of preCICE in memory: two participants in two threads, serial-explicit or -implicit.

It keeps to the order of calls and to the checks that version 3.4 of preCICE makes
(``src/precice/impl/ParticipantImpl.cpp``, ``src/cplscheme/SerialCouplingScheme.cpp``): a call that
preCICE refuses is a :class:`Refused`. The data of the second participant are accelerated, as
preCICE does; between the begin and the end of a window data are linear in time.
"""

from __future__ import annotations

import math
import queue
import threading
from dataclasses import dataclass, field

import numpy as np

WAIT = 60.0  # [s], for the other participant


class Refused(Exception):
    """A call that preCICE refuses."""


@dataclass
class Configured:
    """What stands in a configuration.

    Parameters
    ----------
    first, second : names of the participants; ``implicit`` windows are repeated.
    meshes : names of the meshes by participant; ``data`` : (writer, reader) and components by name.
    relative : limit of the convergence measure of the data of the second, all together.
    acceleration : object with ``begin_window``, ``propose`` and ``end_window``; None: none.
    """

    first: str
    second: str
    meshes: dict[str, str]
    data: dict[str, tuple[str, int]]
    window: float
    end: float
    implicit: bool = True
    relative: float = 1e-12
    most_iterations: int = 100
    initial: tuple[str, ...] = ()
    acceleration: object = None


@dataclass
class Coupling:
    """What both participants share: two mailboxes."""

    config: Configured
    to_first: queue.Queue = field(default_factory=queue.Queue)
    to_second: queue.Queue = field(default_factory=queue.Queue)
    broken: threading.Event = field(default_factory=threading.Event)
    iterations: list[int] = field(default_factory=list)

    def take(self, box):
        for _ in range(int(WAIT / 0.05)):
            try:
                return box.get(timeout=0.05)
            except queue.Empty:
                if self.broken.is_set():
                    raise Refused("the other participant has left") from None
        raise Refused("the other participant does not answer")


class InMemoryParticipant:
    """One of the two; see the module."""

    def __init__(self, name: str, coupling: Coupling) -> None:
        config = coupling.config
        self.name, self.coupling, self.config = name, coupling, config
        self.is_first = name == config.first
        self.state = "constructed"
        self.time, self.begin, self.counts = 0.0, 0.0, {}
        self.written, self.received, self.before = {}, {}, {}
        self.must_write = self.must_read = False
        self.complete, self.iteration = False, 0
        self.asked_initial = False
        self.calls: list[str] = []

    # --- what is there ----------------------------------------------------------------------------

    def _mesh(self, mesh):
        if self.config.meshes[self.name] != mesh:
            raise Refused(f"{self.name} does not use the mesh {mesh}")

    def _own(self, data, kind):
        writer, _ = self.config.data[data]
        if (writer == self.name) != (kind == "write"):
            raise Refused(f"{self.name} may not {kind} {data}")

    def get_mesh_dimensions(self, mesh):
        self._mesh(mesh)
        return 3

    def get_data_dimensions(self, mesh, data):
        self._mesh(mesh)
        return self.config.data[data][1]

    def set_mesh_vertices(self, mesh, positions):
        self._mesh(mesh)
        if self.state != "constructed":
            raise Refused("the mesh is locked after initialize()")
        positions = np.asarray(positions)
        if positions.ndim != 2 or positions.shape[1] != 3:
            raise Refused("positions are (n, 3)")
        self.counts[mesh] = len(positions)
        return np.arange(len(positions), dtype=np.int32)

    # --- the coupling -----------------------------------------------------------------------------

    def _initialized(self, call, ongoing=False):
        if self.state != "initialized":
            raise Refused(f"{call}: initialize() has to be called before, finalize() after")
        if ongoing and not self.is_coupling_ongoing():
            raise Refused(f"{call}: the coupling has ended")

    @property
    def left(self):
        """What is left of the window; 0 after the end."""
        return max(min(self.begin + self.config.window, self.config.end) - self.time, 0.0)

    def requires_initial_data(self):
        if self.state != "constructed":
            raise Refused("requiresInitialData() has to be called before initialize()")
        self.asked_initial = True
        return self.name in self.config.initial

    def initialize(self):
        if self.state != "constructed":
            raise Refused("initialize() may only be called once")
        if not self.counts:
            raise Refused("a mesh without vertices")
        if self.name in self.config.initial and not (self.asked_initial and self.written):
            raise Refused("initial data are required, but were not written")
        self.state = "initialized"
        if self.is_first:
            self.received = self._zeros()
            if self.config.second in self.config.initial:
                self.received = self.coupling.take(self.coupling.to_first)
            self.before = dict(self.received)
        else:
            if self.written:
                self.coupling.to_first.put(dict(self.written))
            self.before = self._zeros()
            self.received = self.coupling.take(self.coupling.to_second)
            self.guess = dict(self.written)
        self._begin_window()

    def _zeros(self):
        count = next(iter(self.counts.values()))
        return {
            data: np.zeros(count if size == 1 else (count, size))
            for data, (writer, size) in self.config.data.items()
            if writer != self.name
        }

    def _begin_window(self):
        self.must_write = self.config.implicit and self.is_coupling_ongoing()
        self.iteration = 1
        if not self.is_first and self.config.acceleration is not None:
            self.config.acceleration.begin_window()

    def is_coupling_ongoing(self):
        self._initialized("isCouplingOngoing()")
        return self.begin < self.config.end * (1.0 - 1e-12)

    def is_time_window_complete(self):
        self._initialized("isTimeWindowComplete()")
        return self.complete

    def get_max_time_step_size(self):
        self._initialized("getMaxTimeStepSize()")
        return self.left

    def requires_writing_checkpoint(self):
        self._initialized("requiresWritingCheckpoint()")
        required, self.must_write = self.must_write, False
        return required

    def requires_reading_checkpoint(self):
        self._initialized("requiresReadingCheckpoint()")
        required, self.must_read = self.must_read, False
        return required

    def read_data(self, mesh, data, ids, relative_read_time):
        self._initialized("readData()", ongoing=True)
        self._mesh(mesh)
        self._own(data, "read")
        if not 0.0 <= relative_read_time <= self.left * (1.0 + 1e-12):
            raise Refused("readData() cannot sample data outside of the current time window")
        size = min(self.config.window, self.config.end - self.begin)
        share = (self.time + relative_read_time - self.begin) / size
        if share > 1.0 - 1e-12:
            return self.received[data][ids].copy()
        return ((1.0 - share) * self.before[data] + share * self.received[data])[ids]

    def write_data(self, mesh, data, ids, values):
        if self.state == "finalized" or (
            self.state == "initialized" and not self.is_coupling_ongoing()
        ):
            raise Refused("writeData() is forbidden if coupling is not ongoing")
        self._mesh(mesh)
        self._own(data, "write")
        values, size = np.asarray(values), self.config.data[data][1]
        if values.size != self.counts[mesh] * size or len(ids) != self.counts[mesh]:
            raise Refused("a wrong number of values")
        if not np.isfinite(values).all():
            raise Refused("values have to be finite")
        self.written[data] = np.array(values, dtype=float)

    def advance(self, step):
        self._initialized("advance()", ongoing=True)
        if not math.isfinite(step) or step <= 0.0:
            raise Refused("advance() needs a positive time step")
        if step > self.left * (1.0 + 1e-10):
            raise Refused("the time step exceeds the window")
        self._fulfilled()
        self.time += step
        self.complete = False
        if self.left > 1e-12 * self.config.window:
            return
        (self._end_as_first if self.is_first else self._end_as_second)()

    def _fulfilled(self):
        for required, what in ((self.must_write, "writing"), (self.must_read, "reading")):
            if required:
                raise Refused(f"the required action of {what} a checkpoint was not fulfilled")

    def _end_as_first(self):
        self.coupling.to_second.put(dict(self.written))
        answer, converged = self.coupling.take(self.coupling.to_first)
        self._go_on(converged, answer)

    def _end_as_second(self):
        answer, converged = dict(self.written), True
        if self.config.implicit:
            x, new = self._packed(self.guess), self._packed(answer)
            converged = np.linalg.norm(new - x) <= self.config.relative * np.linalg.norm(new)
            if self.iteration >= self.config.most_iterations:
                converged = True
            acceleration = self.config.acceleration
            if not converged and acceleration is not None:
                scale = max(np.sqrt(np.mean(new**2)), 1e-300)
                weights = np.full(new.size, 1.0 / (scale * np.sqrt(new.size)))
                answer = self._unpacked(acceleration.propose(x, new, weights), answer)
            elif converged and acceleration is not None:
                acceleration.end_window(x, new)
        self.guess = answer
        if converged:
            self.coupling.iterations.append(self.iteration)
        self.coupling.to_first.put((answer, converged))
        self._go_on(converged, None)

    def _go_on(self, converged, answer):
        """After a window: into the next one, or once more."""
        if converged:
            self.begin = self.time
            self.complete = True
            self.before = dict(self.received)
            if answer is not None:
                self.before = answer
            self._begin_window()
        else:
            self.time = self.begin
            self.must_read = True
            self.iteration += 1
        if answer is not None:
            self.received = answer
        elif self.begin < self.config.end * (1.0 - 1e-12):
            self.received = self.coupling.take(self.coupling.to_second)

    def finalize(self):
        self._initialized("finalize()")
        self._fulfilled()
        self.state = "finalized"

    @staticmethod
    def _packed(data):
        return np.concatenate([np.ravel(data[name]) for name in sorted(data)])

    @staticmethod
    def _unpacked(vector, like):
        found, at = {}, 0
        for name in sorted(like):
            size = like[name].size
            found[name] = vector[at : at + size].reshape(like[name].shape)
            at += size
        return found


def run_pair(coupling, first, second):
    """Run two functions of a participant in two threads; raise the error of the one that failed."""
    errors = []

    def within(run, name):
        try:
            run(InMemoryParticipant(name, coupling))
        except BaseException as error:
            errors.append(error)
            coupling.broken.set()

    threads = [
        threading.Thread(target=within, args=(run, name), daemon=True)
        for run, name in ((first, coupling.config.first), (second, coupling.config.second))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(2.0 * WAIT)
        assert not thread.is_alive()
    own = [error for error in errors if not isinstance(error, Refused)] or errors
    if own:
        raise own[0]
