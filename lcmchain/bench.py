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

import numpy as np
from rich.table import Table

from lcmchain.elements.membrane_shell.kernel import membrane_shell_forces
from lcmchain.elements.solid_shell.geometry import reference_geometry
from lcmchain.elements.solid_shell.kernel import internal_forces
from lcmchain.elements.solid_shell.packing import curved_rows, in_blocks
from lcmchain.materials.st_venant_kirchhoff import isotropic_stiffness
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


def measure(name: str, threads: int, element_steps: int, work: Callable[[], None]) -> Measurement:
    """Time ``work``, which makes ``element_steps`` element steps, ``REPETITIONS`` times."""
    used = use_threads(threads)
    work()
    samples = []
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        work()
        samples.append(1e6 * (time.perf_counter() - start) / element_steps)
    return Measurement(name, used, statistics.median(samples), min(samples), max(samples))


def kernel_work(simulation: Simulation, element_data, slots) -> Callable[[], None]:
    """Return ``KERNEL_CALLS`` evaluations of the internal forces at the present positions."""
    model, position = simulation.model, simulation.state.position
    corner_force = np.zeros(model.corner_force_size)

    def work() -> None:
        for _ in range(KERNEL_CALLS):
            internal_forces(position, model.corner_node, element_data, corner_force, *slots)

    return work


def triangle_work(simulation: Simulation) -> Callable[[], None]:
    """As :func:`kernel_work` for the triangles of the 2D approach."""
    model, position = simulation.model, simulation.state.position
    node_force = np.zeros(model.corner_force_size)

    def work() -> None:
        for _ in range(KERNEL_CALLS):
            membrane_shell_forces(
                position, model.corner_node, model.element_data, node_force, *model.membrane_shell
            )

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
    model, count = simulation.model, simulation.model.element_count
    slots, flat_data = model.elements, model.element_data
    blank = model.blank
    geometry = reference_geometry(blank.node_positions[blank.elements], blank.fibre_direction_1)
    curved_data = in_blocks(curved_rows(geometry))
    stiffness = np.concatenate([isotropic_stiffness(1e6, 0.3).ravel()] * 2)
    curved = slots._replace(flat=None, curved=True, enhanced=True)
    full = curved._replace(fabric=None, stiffness=stiffness, conservative=None)
    published = slots._replace(director=True, conservative=None)

    calls = KERNEL_CALLS * count
    found = [
        measure("element kernel, MD600, flat reference", 1, calls,
                kernel_work(simulation, flat_data, slots)),
        measure("element kernel, as published (director)", 1, calls,
                kernel_work(simulation, flat_data, published)),
        measure("element kernel, MD600, curved reference", 1, calls,
                kernel_work(simulation, curved_data, curved)),
        measure("element kernel, full 6x6 law, curved reference", 1, calls,
                kernel_work(simulation, curved_data, full)),
        measure("triangle kernel, membrane-shell", 1, KERNEL_CALLS * triangles.model.element_count,
                triangle_work(triangles)),
    ]  # fmt: skip
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
