"""Speed of the element kernel and of whole steps on this machine, as a table.

Every figure is the median of several repetitions, in microseconds per element and step. The blank,
material and tools are those of ``hemisphere_holder``, formed to mid-stroke so that contact, shear
and compaction are at work.
"""

from __future__ import annotations

import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from lcmchain.elements.blocks import in_blocks
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.packing import curved_rows
from lcmchain.jit import routine
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation
from lcmchain.threads import use_threads

REPETITIONS = 11
KERNEL_CALLS = 200
# Where whole steps are timed: the sheet lies on punch, die fillet and under the holder.
MID_STROKE = 0.06
WHOLE_CHUNKS = 8

SCENE = """
title = "bench"
process = { time = "100 ms", frames = 2, mass_damping = "100 1/s" }
blank = { size = ["300 mm", "300 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "75 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "75 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "77 mm", fillet_radius = "10 mm", side = "below" }

[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "77 mm", fillet_radius = "10 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "1.7 kg", ramp = "10 ms" }
"""


@dataclass(frozen=True)
class Measurement:
    """Median [µs per element and step] with the smallest and largest of the repetitions."""

    name: str
    threads: int
    median: float
    least: float
    most: float


def measure(
    name: str, threads: int | None, element_steps: int, work: Callable[[], None]
) -> Measurement:
    """Time ``work``, which makes ``element_steps`` element steps, ``REPETITIONS`` times."""
    used = use_threads(threads)
    work()
    samples = []
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        work()
        samples.append(1e6 * (time.perf_counter() - start) / element_steps)
    return Measurement(name, used, statistics.median(samples), min(samples), max(samples))


@routine
def repeated_forces(data, position, corner_force, history, count):
    """Evaluate the internal forces of a body so often, without going back to Python."""
    for _ in range(count):
        internal_forces(data, position, corner_force, history)


def kernel_work(simulation: Simulation, data: Any) -> Callable[[], None]:
    """Return ``KERNEL_CALLS`` evaluations of the internal forces at the present positions.

    ``data`` are the constants of the body: those of the simulation's, or others of the same mesh.
    """
    position = simulation.state.position
    corner_force = np.zeros(simulation.model.corner_force_size)
    history = np.zeros(simulation.model.history_size)

    def work() -> None:
        repeated_forces(data, position, corner_force, history, KERNEL_CALLS)

    return work


def whole_steps(name: str, simulation: Simulation) -> list[Measurement]:
    """Measure steps from the present state on, on one core and on all.

    The same steps every time, with the contact search, guards and step size between chunks.
    """
    start, begin = simulation.state.copy(), simulation.time
    span = _chunk_span(simulation, WHOLE_CHUNKS)
    simulation.advance_to(begin + span)
    element_steps = simulation.model.element_count
    element_steps *= simulation.state.step_count - start.step_count

    def work() -> None:
        simulation.restore(start)
        simulation.advance_to(begin + span)

    return [measure(name, threads, element_steps, work) for threads in (1, None)]


def at_mid_stroke(*overrides: str) -> Simulation:
    """Return the scene formed to where it is measured."""
    simulation = Simulation.from_scene(scene_from_text(SCENE, overrides=overrides))
    use_threads(None)
    simulation.advance_to(MID_STROKE)
    return simulation


def measurements() -> list[Measurement]:
    """Run all measurements: element kernels on one core, whole steps on one and on all cores."""
    simulation, triangles = at_mid_stroke(), at_mid_stroke("element=membrane-shell")
    body, count = simulation.model.body, simulation.model.element_count
    data, options = body.data, body.data.options
    curved = data._replace(
        options=options._replace(flat=None, curved=True, enhanced=True),
        element_data=in_blocks(curved_rows(body.geometry)),
    )
    steel = isotropic_stiffness(1e6, 0.3)
    full = curved._replace(
        law=StVenantKirchhoff(steel, thickness=1e-3, density=1e3).law,
        options=curved.options._replace(conservative=None),
    )
    published = data._replace(options=options._replace(director=True, conservative=None))

    calls = KERNEL_CALLS * count
    found = [
        measure(f"element kernel, {name}", 1, calls, kernel_work(simulation, body_data))
        for name, body_data in (
            ("MD600, flat reference", data),
            ("as published (director)", published),
            ("MD600, curved reference", curved),
            ("full 6x6 law, curved reference", full),
        )
    ]
    calls = KERNEL_CALLS * triangles.model.element_count
    work = kernel_work(triangles, triangles.model.body.data)
    found.append(measure("triangle kernel, membrane-shell", 1, calls, work))
    found += whole_steps("whole step, hemisphere_holder", simulation)
    found += whole_steps("whole step, the same with membrane-shell", triangles)
    return found


def _chunk_span(simulation: Simulation, chunks: int) -> float:
    return chunks * STEPS_PER_CHUNK * simulation.model.step_safety * simulation.critical_step()


def run_bench() -> Table:
    """Measure and return the table that ``lcmchain bench`` prints."""
    table = Table(
        title=f"µs per element and step, median of {REPETITIONS} ({platform.machine()})",
        title_justify="left",
    )
    table.add_column("what")
    for column in ("threads", "median", "least", "most"):
        table.add_column(column, justify="right")
    for m in measurements():
        row = (f"{value:.4f}" for value in (m.median, m.least, m.most))
        table.add_row(m.name, str(m.threads), *row)
    return table
