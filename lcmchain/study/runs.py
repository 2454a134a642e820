"""The runs of a study: one after the other, or side by side on a dask cluster; none made twice.

Every result lies in a file of its own from the moment it is there. A study that was interrupted
goes on with what is missing, and so does one whose workers were lost.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lcmchain.check.expected_cost import estimate_run
from lcmchain.compilation.threads import thread_count, use_threads
from lcmchain.errors import InputError, SimulationError, SimulationInterrupted
from lcmchain.scene import Scene
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation
from lcmchain.study.outcome import Outcome, read_outcome, write_outcome
from lcmchain.study.sources import Progress, Source, Variant

if TYPE_CHECKING:
    from distributed import Client, Future

#: Folder of the outcomes inside that of a study.
RUNS = "runs"
#: What is said after Ctrl-C.
INTERRUPTED = (
    "stopped by the user; runs that were complete are kept, and the same command goes on from there"
)
#: How often a run is made again whose worker was lost.
RETRIES = 3
#: Longest name of a file of an outcome, without its ending: file systems allow 255 bytes.
LONGEST_NAME = 120
#: A scheduler has to answer within this time [s].
ANSWER_WITHIN = 10.0


@dataclass(frozen=True)
class Workers:
    """Who makes the runs.

    Parameters
    ----------
    count : processes on this machine; 1 makes the runs here, one after the other.
    threads : of each run; None gives runs side by side their share of the cores, and one alone
        as many as :func:`lcmchain.pipeline.run` gives it.
    scheduler : address of a dask scheduler, whose workers make the runs instead.
    """

    count: int = 1
    threads: int | None = None
    scheduler: str | None = None

    @property
    def threads_of_a_run(self) -> int | None:
        if self.threads is not None or not self.is_cluster:
            return self.threads
        if self.scheduler is not None:
            return 1
        return max(1, (os.cpu_count() or 1) // self.count)

    @property
    def is_cluster(self) -> bool:
        return self.scheduler is not None or self.count > 1


def make_run(
    source: Source, variant: Variant, threads: int | None, tell: Progress | None = None
) -> Outcome:
    """Run a variant and return what a study keeps of it.

    A run that a guard stops, or a scene without a model, is an outcome too.

    Raises
    ------
    InputError : the variant does not fit the scene.
    SimulationInterrupted : Ctrl-C; nothing is left of this run.
    """
    job = source.job(variant)
    start = time.perf_counter()
    try:
        return job.run(threads, tell)
    except (SimulationError, InputError) as error:  # a mesh too coarse for the blank, say
        reason = str(error).split(". ")[0]
        return Outcome(time.perf_counter() - start, thread_count(), failure=reason)
    except SimulationInterrupted:  # a run of a study leaves no checkpoint to resume from
        raise SimulationInterrupted(INTERRUPTED) from None


def file_name(name: str) -> str:
    """Return the name of the file of an outcome by that of its setting."""
    plain = re.sub(r"[^A-Za-z0-9.+-]+", "_", name)
    if len(plain) > LONGEST_NAME:
        digest = hashlib.sha256(name.encode()).hexdigest()[:16]
        plain = f"{plain[: LONGEST_NAME - len(digest) - 1]}-{digest}"
    return f"{plain}.nc"


class Study:
    """Runs of variants of one scene or coupon, kept in a folder."""

    def __init__(self, source: Source, folder: Path | str, workers: Workers | None = None) -> None:
        self.source, self.folder = source, Path(folder)
        self.workers = workers or Workers()

    def outcomes(
        self, variants: Sequence[Variant], progress: Progress | None = None
    ) -> dict[str, Outcome]:
        """Return the outcomes of all variants by name; runs that are kept are not repeated.

        Raises
        ------
        InputError : a variant does not fit the scene, two have the same name, or the cluster
            cannot be reached; nothing was run.
        SimulationInterrupted : Ctrl-C; what is complete is kept.
        """
        names = [variant.name for variant in variants]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f'two settings of the study have the name "{twice}"')
        jobs = {variant.name: self.source.job(variant) for variant in variants}
        prints = {name: job.fingerprint for name, job in jobs.items()}
        outcomes = {name: read_outcome(self._file(name), prints[name]) for name in names}
        missing = [variant for variant in variants if outcomes[variant.name] is None]
        account = _Account({v.name: expected_work(jobs[v.name].scene) for v in missing}, progress)
        makers = self._on_cluster if self.workers.is_cluster and missing else self._here
        for name, outcome in makers(account.in_good_order(missing), account):
            write_outcome(self._file(name), outcome, prints[name])
            account.complete(name)
            outcomes[name] = outcome
        return {name: outcome for name, outcome in outcomes.items() if outcome is not None}

    def outcome(self, variant: Variant, progress: Progress | None = None) -> Outcome:
        """Return the outcome of one variant."""
        return self.outcomes([variant], progress)[variant.name]

    def _file(self, name: str) -> Path:
        return self.folder / RUNS / file_name(name)

    def _here(
        self, variants: Sequence[Variant], account: _Account
    ) -> Iterator[tuple[str, Outcome]]:
        threads = self.workers.threads_of_a_run
        for variant in variants:
            tell = account.teller(variant.name)
            yield variant.name, make_run(self.source, variant, threads, tell)

    def _on_cluster(
        self, variants: Sequence[Variant], account: _Account
    ) -> Iterator[tuple[str, Outcome]]:
        from distributed import as_completed

        threads = self.workers.threads_of_a_run
        with _client(self.workers, min(self.workers.count, len(variants))) as client:

            def submitted(variant: Variant) -> Future:
                return client.submit(
                    make_run, self.source, variant, threads, key=f"run-{variant.name}",
                    pure=False, retries=RETRIES,
                )  # fmt: skip

            # The quickest one alone: it compiles for all, which read what it leaves on disk.
            first, *others = variants
            yield first.name, submitted(first).result()
            futures = {submitted(variant): variant.name for variant in others}
            for future in as_completed(futures, loop=client.loop):
                yield futures[future], future.result()


@contextmanager
def _client(workers: Workers, count: int) -> Iterator[Client]:
    """Connect to the scheduler, or start workers on this machine for as long as it takes.

    Never as the default: xarray would ask for it from then on, after it is gone as well.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(
            "runs side by side need dask: install lcmchain[study], or use --workers 1",
            key="--workers" if workers.scheduler is None else "--scheduler",
        ) from None
    if workers.scheduler is not None:
        require_address(workers.scheduler)
        try:
            client = Client(workers.scheduler, timeout=ANSWER_WITHIN, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(
                f"no dask scheduler answers at {workers.scheduler} ({error})", key="--scheduler"
            ) from None
        with client:
            yield client
        return
    with (
        LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None, memory_limit=0
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def require_address(address: str) -> None:
    """Refuse an address that is none of a scheduler, before a client waits for its answer.

    Raises
    ------
    InputError : names the option, with an example.
    """
    from distributed.comm import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    try:
        scheme, place = parse_address(address)
        get_backend(scheme)
        if scheme != "inproc":
            parse_host_port(place)
    except (ValueError, ImportError) as error:
        raise InputError(
            f'"{address}" is no address of a dask scheduler ({error}); for example '
            "tcp://192.168.0.5:8786",
            key="--scheduler",
        ) from None


def expected_work(scene: Scene) -> float:
    """Return a number in proportion to the expected computing time of a scene.

    Elements times steps, the steps as long as a wave takes across an element.
    """
    stack = scene.stack
    count = sum(math.prod(ply.blank.extent) / ply.blank.edge_length**2 for ply in stack)
    return count * scene.process.time / stack.shortest_edge


class _Account:
    """How far a study is, in parts of its expected work."""

    def __init__(self, work: dict[str, float], progress: Progress | None) -> None:
        self.work, self.progress = work, progress
        self.total = sum(work.values())
        self.done = 0.0
        self.count = 0

    def in_good_order(self, variants: Sequence[Variant]) -> list[Variant]:
        """Return the quickest first, which compiles, then the longest, so that none ends alone."""
        in_order = sorted(variants, key=lambda variant: self.work[variant.name])
        return [*in_order[:1], *reversed(in_order[1:])]

    def teller(self, name: str) -> Progress:
        """Return the progress function of one run."""

        def tell(completed: float, total: float, text: str = "") -> None:
            if self.progress is not None and total:
                here = self.done + self.work[name] * min(completed / total, 1.0)
                self.progress(here, self.total, f"{self._title(name)}: {text}")

        return tell

    def complete(self, name: str) -> None:
        """Count a run as done."""
        self.done += self.work[name]
        self.count += 1
        if self.progress is not None:
            self.progress(self.done, self.total, f"{self.count} of {len(self.work)} runs")

    def _title(self, name: str) -> str:
        return f"run {self.count + 1} of {len(self.work)}, {name}"


# --- what a run will take, by its first steps -----------------------------------------------------


#: Steps are made for so long [s], or less of a small budget.
DURATION = 0.25


class Beginning(NamedTuple):
    """The beginning of a run.

    Parameters
    ----------
    seconds : of the whole process, were all of it like the beginning [s].
    spent : on the beginning itself [s].
    """

    seconds: float
    spent: float


def begin_run(scene: Scene, threads: int | None, duration: float = DURATION) -> Beginning:
    """Make the first steps of a scene on its own mesh.

    Coarse pilots tell little of the time of a step on a fine mesh. The cost of a step beside its
    elements weighs more on them, and they are too small for a second thread. So the run is begun
    for a moment. Later steps have more contact and are shorter; so the time of the first ones is
    compared with that of the first steps of a pilot, of which the whole time is known.

    Parameters
    ----------
    threads : as for :func:`lcmchain.pipeline.run`. duration : for so long [s], one chunk of steps
        at least.

    Raises
    ------
    InputError : no model can be made of the scene.
    SimulationError : a guard stopped it.
    """
    simulation = Simulation.from_scene(scene)
    simulation.compile()
    model = simulation.model
    use_threads(threads, model.element_count)
    start, spent, made = time.perf_counter(), 0.0, 0
    while spent < duration and simulation.time < model.process_time:
        step = simulation.prepare_steps()
        left = math.ceil((model.process_time - simulation.time) / step)
        count = min(left, STEPS_PER_CHUNK)
        simulation.make_steps(count, step)
        spent, made = time.perf_counter() - start, made + count
    return Beginning(estimate_run(model).step_count * spent / made, spent)
