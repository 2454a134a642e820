"""The first run on a machine: two processes compile its loops, and report them one by one.

Numba compiles one function at a time in a process. Here a second process compiles loops that the
first has not come to. It writes them to the same folder on disk, from which the first reads them.

The first process begins with the loop over the steps, which takes about as long as all others
together. When numba begins to compile that loop, it starts the second process; a run that has the
loop on disk starts none. Then the first process takes the other loops from the end of the list, and
the second one from its beginning.

Where no second process can be started, or where it fails, the first compiles everything.

Where the steps leave cores free, the second process goes on with the stages after them.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numba
from numba.core import event

from lcmchain.compilation.threads import thread_count, use_threads
from lcmchain.jit import move_cache
from lcmchain.solver.simulation import Simulation

Tell = Callable[[str], None]

#: Shortest time between two reports [s].
REPORT_INTERVAL = 0.5

#: What the second process runs; it imports from the same folders as the first, and reads the task
#: from its input.
PROGRAM = (
    "import json, sys; "
    "sys.path[:] = json.loads(sys.stdin.buffer.readline()); "
    "from lcmchain.solver.compile_beside import compile_for_another; "
    "compile_for_another()"
)


#: Lines in which the second process reports its work; the first two name a loop.
BEGIN, END, LOOPS_DONE = "begin", "end", "loops done"

#: File in the folder that both share, for what the second process says on its error stream.
ERRORS = "errors"


class HelperWarning(RuntimeWarning):
    """The second process could not do its part; results are the same without it."""


def compile_loops(simulation: Simulation, tell: Tell, helper: Helper) -> None:
    """Compile every loop that a run needs, or read it from disk, without a step.

    Parameters
    ----------
    tell : called now and then with what is being compiled, and how many loops are done.
    helper : not yet started.
    """
    before = simulation.state.copy()
    calls = simulation.first_calls()
    first, *others = calls
    account = Account(list(calls), tell)
    mine: set[str] = set()

    def compile_here(name: str) -> None:
        with account.at_work_on(name):
            calls[name]()
        mine.add(name)

    def watch() -> None:
        if account.present == [first]:
            helper.start(simulation, others, account)
        account.report()

    with _whenever_numba_compiles(watch):
        compile_here(first)
        for name in reversed(others):
            if helper.leaves(name):
                compile_here(name)
        helper.wait()
        for name in others:
            if name in account.done and name not in mine:
                calls[name]()  # reads it from disk
            elif name not in mine:  # the second process has failed
                compile_here(name)
        simulation.prepare_steps()
    simulation.restore(before)


class Account:
    """Which loops are being compiled, and which are done, in both processes.

    Parameters
    ----------
    names : of all loops.
    tell : called with the account in words.
    """

    def __init__(self, names: list[str], tell: Tell) -> None:
        self.names, self.tell = names, tell
        self.done: set[str] = set()
        self.present: list[str] = []
        self._reported = -REPORT_INTERVAL

    @contextmanager
    def at_work_on(self, name: str) -> Iterator[None]:
        self.present.append(name)
        try:
            yield
        finally:
            self.present.remove(name)
        self.done.add(name)

    def report(self) -> None:
        """Tell how far the loops are, unless that has just been told."""
        now = time.monotonic()
        if now - self._reported < REPORT_INTERVAL:
            return
        self._reported = now
        at_work = f", now {' and '.join(self.present)}" if self.present else ""
        self.tell(f"compiling, {len(self.done)} of {len(self.names)} loops done{at_work}")


class Helper:
    """The second process, if there is one; leaving the context ends it.

    Parameters
    ----------
    later : called in it with the simulation and a folder for passing files once the loops are
        compiled, as long as there is a core for it beside the threads of the steps.
    """

    def __init__(self, later: Callable[[Simulation, Path], None] | None = None) -> None:
        self._later = later
        self._process: subprocess.Popen | None = None
        self._folder: tempfile.TemporaryDirectory | None = None
        self._asked = False
        self._loops_done = threading.Event()
        self._problem = ""

    def start(self, simulation: Simulation, names: list[str], account: Account) -> None:
        """Start it with these loops, unless it was started before, or cannot gain anything."""
        if self._asked:
            return
        self._asked = True
        self._names, self._account = names, account
        if _cores() < 2 or not Path(sys.executable or "").stem.lower().startswith("python"):
            return  # a program that holds Python within itself cannot be started as Python
        try:
            self._start(simulation)
        except Exception as error:  # whatever it is, the loops can be compiled without
            self._problem = f"{type(error).__name__}: {error}"

    def _start(self, simulation: Simulation) -> None:
        later = self._later if thread_count() < _cores() else None
        content = pickle.dumps((simulation.model, simulation.state, later))
        if b"__main__" in content:
            return  # of a class in the script that runs: no other process can import it
        self._folder = tempfile.TemporaryDirectory(prefix="lcmchain-", ignore_cleanup_errors=True)
        task = pickle.dumps(
            (self._folder.name, numba.config.CACHE_DIR, self._names, content)  # type: ignore[attr-defined]
        )
        with (Path(self._folder.name) / ERRORS).open("wb") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )  # fmt: skip
        head = json.dumps([os.path.abspath(place) for place in sys.path]).encode()
        self._reader = threading.Thread(
            target=self._follow, args=(head + b"\n" + task,), daemon=True
        )
        self._reader.start()

    def _follow(self, task: bytes) -> None:
        """Hand the task over, and keep the account of what the process says it does."""
        process, account = self._process, self._account
        assert process is not None and process.stdin is not None and process.stdout is not None
        with suppress(OSError):  # it has ended: its exit code says so
            process.stdin.write(task)
            process.stdin.flush()
        present = ""
        with process.stdout as from_it:
            for line in from_it:
                said = line.decode(errors="replace").strip()
                word, _, name = said.partition(" ")
                if word == BEGIN and name in self._names:
                    present = name
                    account.present.append(name)
                elif word == END and name == present:
                    account.present.remove(name)
                    account.done.add(name)
                    present = ""
                elif said == LOOPS_DONE:
                    self._loops_done.set()
        if present:
            account.present.remove(present)
        if process.wait() != 0 and not self._loops_done.is_set():
            self._problem = self._last_words() or f"exit code {process.returncode}"
        self._loops_done.set()

    def _last_words(self) -> str:
        assert self._folder is not None
        errors = (Path(self._folder.name) / ERRORS).read_text(encoding="utf-8", errors="replace")
        return errors.strip().rpartition("\n")[2]

    def leaves(self, name: str) -> bool:
        """Take a loop from the list of the second process; False where it has taken it itself."""
        return self._folder is None or _claim(Path(self._folder.name), self._names.index(name))

    def wait(self) -> None:
        """Wait until it has done its part of the loops, and warn if it has failed."""
        if self._process is not None:
            while not self._loops_done.wait(0.1):
                self._account.report()
        if self._problem:
            message = (
                "the second process, which compiles loops beside this one, failed "
                f"({self._problem}); this one compiles them alone, which takes longer"
            )
            self._account.tell(f"compiling alone, {message}")
            warnings.warn(message, HelperWarning, stacklevel=3)

    def stop(self) -> None:
        """End it: from here on it would compile what this process compiles itself."""
        if self._process is not None:
            self._process.kill()
            self._reader.join()
            assert self._process.stdin is not None
            with suppress(OSError):
                self._process.stdin.close()
        if self._folder is not None:
            self._folder.cleanup()
        self._process = self._folder = None

    def __enter__(self) -> Helper:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def compile_for_another() -> None:
    """Do the part of the second process: compile what the first one has not taken."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the first, which ends this one
    folder, cache, names, content = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_the_first, daemon=True).start()
    model, state, later = pickle.loads(content)
    # laws in files of the user, imported just now, have a folder of their own there
    numba.config.CACHE_DIR = cache  # type: ignore[attr-defined]
    move_cache()
    use_threads(1)
    simulation = Simulation(model, state)
    before, calls = state.copy(), simulation.first_calls()
    for index, name in enumerate(names):
        if _claim(Path(folder), index):
            print(f"{BEGIN} {name}", flush=True)
            calls[name]()
            print(f"{END} {name}", flush=True)
    print(LOOPS_DONE, flush=True)
    if later is not None:
        simulation.restore(before)
        # What goes wrong there goes wrong in the first process as well, or not at all: the start is
        # not what the stages are made for. What has been compiled until then is gained.
        with suppress(Exception):
            later(simulation, Path(folder))


def _end_with_the_first() -> None:
    """End this process as soon as the first one has ended, however that happened."""
    while os.read(0, 1):  # it writes nothing more
        pass
    os._exit(1)


def _claim(folder: Path, index: int) -> bool:
    """Take a loop; False where the other process has it."""
    try:
        (folder / str(index)).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _whenever_numba_compiles(call: Callable[[], None]) -> Iterator[None]:
    """Call a function whenever numba begins to compile one, or has compiled it."""

    class Watcher(event.Listener):
        def on_start(self, _: event.Event) -> None:
            call()

        def on_end(self, _: event.Event) -> None:
            call()

    with event.install_listener("numba:compile", Watcher()):
        yield
