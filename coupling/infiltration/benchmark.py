"""Time and memory of a filling over the size of its mesh.

A square plate of triangles is filled from a disc in its middle towards its rim: whole fillings of
small meshes, and steps in the middle of the filling of large ones, each mesh in a process of its
own.
"""

from __future__ import annotations

import math
import multiprocessing
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from lcmchain.bench.measure import largest_memory
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform

#: Squares along the side of the plate; each gives two triangles.
SIDES = (22, 71, 224)
#: Meshes up to so many cells are filled to the end.
WHOLE = 20_000
#: Steps that are measured, at about half of the filling.
STEPS = 5
SIZE, HOLE, PRESSURE, VISCOSITY, PERMEABILITY = 0.5, 0.05, 1e5, 0.1, 1e-10


@dataclass(frozen=True)
class FillingTime:
    """Times [s] and memory of one size; ``whole`` is nan where the mesh was not filled.

    setup : mesh and control volumes. step : median of those at about half of the filling.
    memory : largest of the process, less that before the mesh was made [byte].
    """

    cells: int
    setup: float
    step: float
    steps: int
    whole: float
    memory: int


def measure(side: int) -> FillingTime:
    """Measure one size, in this process."""
    _filling(4).advance(1.0)  # loads and compiles what it needs
    before = largest_memory()
    start = time.process_time()
    filling = _filling(side)
    setup = time.process_time() - start
    count = filling.mesh.cell_count
    whole, steps = math.nan, 0
    if count <= WHOLE:
        start = time.process_time()
        filling.advance(1e9)
        whole, steps = time.process_time() - start, filling.state.step_count
    return FillingTime(count, setup, _time_of_step(side), steps, whole, largest_memory() - before)


def _time_of_step(side: int) -> float:
    """Median time of steps that begin with the middle half of the plate full."""
    filling = _filling(side, wet=0.5)
    times: list[float] = []
    last = time.process_time()

    def note(_: Filling) -> None:
        nonlocal last
        now = time.process_time()
        times.append(now - last)
        last = now
        if len(times) == STEPS:
            raise _Enough

    try:
        filling.advance(1e9, note)
    except _Enough:
        pass
    return statistics.median(times)


class _Enough(Exception):
    """So many steps were measured."""


def _filling(side: int, wet: float = 0.0) -> Filling:
    mesh = _plate(side)
    radius = np.linalg.norm(mesh.points[:, :2] - 0.5 * SIZE, axis=1)
    rows = np.flatnonzero(radius < wet * SIZE * math.sqrt(1.0 / math.pi))
    gate = np.flatnonzero(radius <= max(HOLE, radius.min()))
    return Filling(
        mesh,
        Preform(np.array(3e-3), np.array(0.5), np.array(PERMEABILITY)),
        VISCOSITY,
        [Gate("middle", gate, pressure=PRESSURE)],
        [Vent("rim", mesh.rim)],
        wetted=np.union1d(rows, gate) if wet else None,
    )


def _plate(side: int) -> FlowMesh:
    """Return the plate with so many squares along its side, each cut into two triangles."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, SIZE, side + 1)], indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    node = np.arange(len(points)).reshape(side + 1, side + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    squares = np.stack([corner.ravel() for corner in corners], axis=1)
    return FlowMesh(points, np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]))


def run_filling_bench(sides: tuple[int, ...] = SIDES) -> Table:
    """Measure all sizes and return the table of ``lcmchain bench --filling``."""
    table = Table(
        title="filling a plate of triangles from its middle, processor time", title_justify="left"
    )
    for column in ("cells", "set up, s", "step, s", "growth", "whole, s", "steps", "MiB", "growth"):
        table.add_column(column, justify="right")
    spawn = multiprocessing.get_context("spawn")
    last: FillingTime | None = None
    for side in sides:
        with ProcessPoolExecutor(max_workers=1, mp_context=spawn) as pool:
            found = pool.submit(measure, side).result()
        table.add_row(
            f"{found.cells:,}", f"{found.setup:.3f}", f"{found.step:.4f}",
            _growth(last, found, "step"),
            "" if math.isnan(found.whole) else f"{found.whole:.2f}",
            str(found.steps) if found.steps else "", f"{found.memory / 2**20:.0f}",
            _growth(last, found, "memory"),
        )  # fmt: skip
        last = found
    return table


def _growth(last: FillingTime | None, now: FillingTime, name: str) -> str:
    """Exponent of the growth with the number of cells."""
    if last is None:
        return ""
    ratio = max(getattr(now, name), 1e-12) / max(getattr(last, name), 1e-12)
    return f"n^{math.log(ratio) / math.log(now.cells / last.cells):.2f}"
