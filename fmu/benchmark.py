"""What a unit costs in a master: start, access to fields, states, steps, memory.

The unit forms the 3,600 elements of the measurements of the solver (``lcmchain/bench``) in
fmpy. Each version of FMI is measured in a process of its own, beside the same run without a unit.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from rich.table import Table

from lcmchain.bench.hemisphere import SCENE
from lcmchain.bench.measure import resident_memory
from lcmchain.fmu.build import build_fmu
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

#: Communication points, and the process time [s] between them.
POINTS, INTERVAL = 100, 1e-4
#: Time steps of a run that a share of its time is said of, those of `hemisphere_holder`.
STEPS = 60_000
REPETITIONS = 5
ACCESSES = 50
#: Instances that run before memory is compared, and between the two looks at it.
FIRST_CYCLES, CYCLES = 20, 200
INPUT, OUTPUT = "pore_pressure", "thickness"


@dataclass(frozen=True)
class UnitCost:
    """Times [s] and sizes [byte] of a unit of 3,600 elements.

    description : size of the model description. start : of instantiation and initialization.
    values_in, values_out : of 3,600 of them. lists : of both by fmpy's methods, which take and
    give lists. state, bytes_of_state : saving and restoring; serializing. state_size : of the
    bytes. overhead : of ``POINTS`` points, as a share of the time of ``STEPS`` time steps of the
    solver alone. growth : memory of ``CYCLES`` small instances that were run and freed.
    """

    description: int
    start: float
    values_in: float
    values_out: float
    lists: float
    state: float
    bytes_of_state: float
    state_size: int
    overhead: float
    growth: int


class _Master:
    """One instance in fmpy."""

    def __init__(self, folder: Path) -> None:
        description = read_model_description(str(folder), validate=False)
        self.version = int(description.fmiVersion[0])
        kind, identifier = (
            (FMU2Slave, description.guid)
            if self.version == 2
            else (FMU3Slave, description.instantiationToken)
        )
        self.slave: Any = kind(
            guid=identifier,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="bench",
        )
        self.references: dict[str, list[int]] = {}
        for variable in description.modelVariables:
            self.references.setdefault(variable.name.split("[")[0], []).append(
                variable.valueReference
            )

    def start(self) -> None:
        self.slave.instantiate()
        if self.version == 2:
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def put(self, name: str, values: list[float]) -> None:
        set_values = self.slave.setReal if self.version == 2 else self.slave.setFloat64
        set_values(self.references[name], values)

    def get(self, name: str, count: int) -> Any:
        if self.version == 2:
            return self.slave.getReal(self.references[name])
        return self.slave.getFloat64(self.references[name], nValues=count)

    def access(self, name: str, count: int, *, write: bool) -> Callable[[], object]:
        """Return what reads or writes a field by the function of the standard, from arrays."""
        numbers = self.references[name]
        references = (ctypes.c_uint32 * len(numbers))(*numbers)
        values = (ctypes.c_double * count)()
        way = "Set" if write else "Get"
        if self.version == 2:
            function = getattr(self.slave, f"fmi2{way}Real")
            return lambda: function(self.slave.component, references, len(numbers), values)
        function = getattr(self.slave, f"fmi3{way}Float64")
        return lambda: function(self.slave.component, references, len(numbers), values, count)

    def rollback(self) -> None:
        if self.version == 2:
            state = self.slave.getFMUstate()
            self.slave.setFMUstate(state)
            self.slave.freeFMUstate(state)
        else:
            state = self.slave.getFMUState()
            self.slave.setFMUState(state)
            self.slave.freeFMUState(state)

    def serialized(self) -> bytes:
        if self.version == 2:
            state = self.slave.getFMUstate()
            content = self.slave.serializeFMUstate(state)
            self.slave.freeFMUstate(state)
        else:
            state = self.slave.getFMUState()
            content = self.slave.serializeFMUState(state)
            self.slave.freeFMUState(state)
        return bytes(content)

    def end(self) -> None:
        """Free the instance; the library stays, as in a master that goes on."""
        self.slave.terminate()
        release = self.slave.fmi2FreeInstance if self.version == 2 else self.slave.fmi3FreeInstance
        release(self.slave.component)


def measure(version: int) -> UnitCost:
    """Measure one version of FMI, in this process, which shows no messages of the unit."""
    with tempfile.TemporaryDirectory() as folder, _silent():
        plain = _unit(Path(folder), "plain", SCENE, version)
        fed = _unit(Path(folder), "fed", SCENE, version, pore_pressure=True, fields=[OUTPUT])
        small = SCENE.replace('"300 mm", "300 mm"', '"60 mm", "60 mm"')
        tiny = _unit(Path(folder), "tiny", small, version)
        master = _Master(fed)
        master.start()
        values = [0.0] * _element_count()
        count = len(values)
        values_in = _median(ACCESSES, master.access(INPUT, count, write=True))
        values_out = _median(ACCESSES, master.access(OUTPUT, count, write=False))

        def by_lists() -> None:
            master.put(INPUT, values)
            master.get(OUTPUT, count)

        lists = _median(ACCESSES, by_lists)
        master.slave.doStep(0.0, INTERVAL)
        state = _median(ACCESSES, master.rollback)
        bytes_of_state = _median(ACCESSES, master.serialized)
        size = len(master.serialized())
        master.end()
        return UnitCost(
            (fed / "modelDescription.xml").stat().st_size, _start(plain), values_in, values_out,
            lists, state, bytes_of_state, size, _overhead(plain), _growth(tiny),
        )  # fmt: skip


def _unit(folder: Path, name: str, scene: str, version: int, **options: Any) -> Path:
    source = folder / f"{name}.toml"
    source.write_text(scene, encoding="utf-8")
    unit = build_fmu(source, folder / f"{name}.fmu", fmi=version, **options)
    return Path(extract(str(unit), unzipdir=str(folder / name)))


def _element_count() -> int:
    return Simulation.from_scene(scene_from_text(SCENE)).model.element_count


def _median(count: int, work: Callable[[], object]) -> float:
    times = []
    for _ in range(count):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def _start(unit: Path) -> float:
    """Of an instance in a process that has started one before, from compiled code."""
    times = []
    for _ in range(REPETITIONS + 1):
        master = _Master(unit)
        times.append(_median(1, master.start))
        master.end()
    return statistics.median(times[1:])


def _overhead(unit: Path) -> float:
    """Median over turns of a run by the unit, then by the solver; a first turn is not counted."""
    shares = []
    for _ in range(REPETITIONS + 1):
        master = _Master(unit)
        master.start()
        start = time.perf_counter()
        for k in range(POINTS):
            master.slave.doStep(k * INTERVAL, INTERVAL)
            master.get("thickness_min", 1)
            master.get("punch.force", 1)
        by_unit = time.perf_counter() - start
        master.end()
        simulation = Simulation.from_scene(scene_from_text(SCENE))
        simulation.compile()
        start = time.perf_counter()
        for k in range(POINTS):
            simulation.advance_to((k + 1) * INTERVAL)
        alone = time.perf_counter() - start
        shares.append((by_unit - alone) / (STEPS * alone / simulation.state.step_count))
    return statistics.median(shares[1:])


def _growth(unit: Path) -> int:
    master = _Master(unit)
    before = 0
    for k in range(FIRST_CYCLES + CYCLES):
        if k == FIRST_CYCLES:
            before = resident_memory()
        master.start()
        master.slave.doStep(0.0, INTERVAL)
        master.end()
    return resident_memory() - before


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Send what the units say, and what the exporters' C side prints, to nowhere."""
    kept = os.dup(1), os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        for stream in (1, 2):
            os.dup2(nowhere.fileno(), stream)
        try:
            yield
        finally:
            for stream, copy in zip((1, 2), kept, strict=True):
                os.dup2(copy, stream)
                os.close(copy)


def run_unit_bench() -> Table:
    """Measure both versions and return the table of ``lcmchain bench --unit``."""
    spawn = multiprocessing.get_context("spawn")
    costs = {}
    for version in (2, 3):
        with ProcessPoolExecutor(max_workers=1, mp_context=spawn) as pool:
            costs[version] = pool.submit(measure, version).result()
    table = Table(title="forming unit of 3,600 elements in fmpy, medians", title_justify="left")
    table.add_column("")
    for version in costs:
        table.add_column(f"FMI {version}.0", justify="right")
    rows: list[tuple[str, Callable[[UnitCost], str]]] = [
        ("model description, kB", lambda c: f"{1e-3 * c.description:.0f}"),
        ("instantiate and initialize, compiled, s", lambda c: f"{c.start:.2f}"),
        ("3,600 values in, ms", lambda c: f"{1e3 * c.values_in:.2f}"),
        ("3,600 values out, ms", lambda c: f"{1e3 * c.values_out:.2f}"),
        ("both by fmpy's lists, ms", lambda c: f"{1e3 * c.lists:.2f}"),
        ("save and restore the state, ms", lambda c: f"{1e3 * c.state:.2f}"),
        ("save and serialize it, ms", lambda c: f"{1e3 * c.bytes_of_state:.2f}"),
        ("its bytes, MB", lambda c: f"{1e-6 * c.state_size:.2f}"),
        (
            f"overhead of {POINTS} points in {STEPS:,} steps, %",
            lambda c: f"{100.0 * c.overhead:+.1f}",
        ),
        (f"memory of {CYCLES} instances, kB", lambda c: f"{1e-3 * c.growth:+.0f}"),
    ]
    for name, text in rows:
        table.add_row(name, *(text(cost) for cost in costs.values()))
    return table
