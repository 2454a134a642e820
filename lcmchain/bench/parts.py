"""What the parts of a whole step take, each repeated alone at mid-stroke of the hemisphere.

On one core. Together they take more than alone: each finds its arrays in the caches as it has left
them, and its loop alone in the processor.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lcmchain.bench.hemisphere import at_mid_stroke
from lcmchain.bench.measure import Measurement, kernel_work, measure
from lcmchain.bench.operations import contact_operations, count_operations
from lcmchain.compilation.references import Reference
from lcmchain.effects.fibre_bending import fibre_bending_forces
from lcmchain.jit import entry
from lcmchain.solver.interactions.contact_forces import (
    add_contact_forces,
    find_near_packs,
    scratch_of_contact,
)
from lcmchain.solver.loop import gather_internal_forces, integrate, runs_of_slots
from lcmchain.solver.simulation import CALM_CHUNKS_PER_FREQUENCY, STEPS_PER_CHUNK, Simulation

#: As many as go by while the frequency is looked at once.
CHUNKS = CALM_CHUNKS_PER_FREQUENCY
CALLS = CHUNKS * STEPS_PER_CHUNK
SUMS = 64  # numbers that a chunk of nodes sums up, at most


KERNEL = "element kernel"
BENDING = "bending of the fibres in the plane"
CONTACT = "contact"


class Parts(NamedTuple):
    """Parts of a step and the whole one, each with its time per element and step.

    operations : of some parts, per element.
    """

    parts: list[Measurement]
    whole: Measurement
    operations: dict[str, float]

    @property
    def kernel(self) -> Measurement:
        return self.parts[0]

    @property
    def between(self) -> float:
        """Time of the whole step that no part takes alone [µs per element]."""
        return self.whole.median - sum(part.median for part in self.parts)


@entry
def repeated_bending(data, position, corner_force, middle, vector, calls):
    """Evaluate the bending of the fibres so often."""
    for _ in range(calls):
        fibre_bending_forces(data, 0, data.start.size, position, corner_force, middle, vector)


@entry
def repeated_gather(arrays, runs, calls):
    """Sum the corner forces at the nodes so often."""
    start = arrays.chunk_start
    for _ in range(calls):
        for chunk in range(start.size - 1):
            gather_internal_forces(arrays, runs, chunk, start[chunk], start[chunk + 1])


@entry
def repeated_contact(arrays, tools, environment, dt, calls):
    """Evaluate the contact of all nodes so often."""
    start = arrays.chunk_start
    work, sums = np.empty(scratch_of_contact(tools)), np.zeros(SUMS)
    for _ in range(calls):
        for chunk in range(start.size - 1):
            add_contact_forces(
                arrays, tools, environment, chunk, start[chunk], start[chunk + 1], dt, dt, work,
                sums,
            )  # fmt: skip


@entry
def repeated_motion(arrays, environment, dt, calls):
    """Move the nodes so often."""
    start, sums = arrays.chunk_start, np.zeros(SUMS)
    for _ in range(calls):
        for first, last in zip(start[:-1], start[1:]):
            integrate(arrays, arrays.free, environment, None, first, last, dt, dt, sums)


def measure_parts() -> Parts:
    """Measure the parts of a step of the hemisphere on one core."""
    simulation = at_mid_stroke()
    model, start = simulation.model, simulation.state.copy()
    dt = simulation.prepare_steps()

    def whole() -> None:
        simulation.restore(start)
        for _ in range(CHUNKS):
            simulation.make_steps(STEPS_PER_CHUNK, simulation.prepare_steps())

    works = {
        KERNEL: kernel_work(simulation, model.only_body().data, CALLS),
        **_loops(simulation, dt),
        "between chunks of steps": _between_chunks(simulation),
        "samples of the histories": _samples(simulation, dt),
    }
    element_steps = CALLS * model.element_count
    operations = _operations(simulation)
    parts = [measure(name, 1, element_steps, work) for name, work in works.items()]
    return Parts(parts, measure("whole step", 1, element_steps, whole), operations)


def _operations(simulation: Simulation) -> dict[str, float]:
    counted, count = count_operations(), simulation.model.element_count
    assert simulation.model.fibre_bending is not None
    bending = counted.bending * simulation.model.fibre_bending.padded_count
    contact = contact_operations(simulation, counted)
    return {KERNEL: float(counted.kernel), BENDING: bending / count, CONTACT: contact / count}


def _loops(simulation: Simulation, dt: float) -> dict[str, Callable[[], None]]:
    """Return the loops of a step at the present state; nodes that they move lie apart."""
    model, arrays = simulation.model, simulation.arrays
    assert model.fibre_bending is not None
    bending = model.fibre_bending.data
    runs = Reference(
        runs_of_slots(model.nodes.force_slot, model.nodes.chunk_start, model.empty_slot)
    )
    find_near_packs(arrays.near, arrays.chunk_start, arrays.near_pack, arrays.tools_near)
    tools, environment = Reference(model.tools), Reference(model.environment)
    at_rest = Reference(
        arrays._replace(
            position=arrays.position.copy(),
            velocity=np.zeros_like(arrays.velocity),
            force=np.zeros_like(arrays.force),
        )
    )
    return {
        BENDING: lambda: repeated_bending(
            bending, arrays.position, arrays.corner_force, arrays.bending_middle,
            arrays.bending_vector, CALLS,
        ),
        "forces of the elements at the nodes": lambda: repeated_gather(arrays, runs, CALLS),
        CONTACT: lambda: repeated_contact(arrays, tools, environment, dt, CALLS),
        "motion of the nodes": lambda: repeated_motion(at_rest, environment, dt, CALLS),
    }  # fmt: skip


def _samples(simulation: Simulation, dt: float) -> Callable[[], None]:
    count = round(CALLS * dt / simulation.model.history_interval)

    def work() -> None:
        for _ in range(count):
            simulation.energy()

    return work


def _between_chunks(simulation: Simulation) -> Callable[[], None]:
    def work() -> None:
        for _ in range(CHUNKS):
            simulation.prepare_steps()

    return work
