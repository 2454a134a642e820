"""Speed of free plates over the number of their elements: kernel, whole step, and their ratio.

A square sheet of MD600 without tools, its nodes free, that starts with a small random velocity:
what a step costs beside the element kernel without contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.bench.measure import Measurement, kernel_work, measure
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation

ELEMENT_COUNTS = (1_000, 4_000, 16_000, 64_000, 256_000)
REPETITIONS = 5
# Element steps of one repetition, in whole chunks.
ELEMENT_STEPS = 2_000_000
SIDE = 0.3  # [m]
SPEED = 1e-3  # of the nodes at the start [m/s]

SCENE = """
title = "free plate"
process = { time = "1 s", frames = 2, gravity = false }
blank = { size = ["300 mm", "300 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
"""


@dataclass(frozen=True)
class Plate:
    """Kernel and whole step of one plate on so many threads.

    traffic : bytes that a step moves at least per element (:func:`least_traffic`).
    """

    element_count: int
    kernel: Measurement
    step: Measurement
    traffic: float

    @property
    def ratio(self) -> float:
        """Whole step over kernel."""
        return self.step.median / self.kernel.median

    @property
    def bandwidth(self) -> float:
        """Rate at which the least traffic of a step is moved [GB/s]."""
        return 1e-3 * self.traffic / self.step.median


def free_plate(element_count: int, *overrides: str) -> Simulation:
    """Return a plate of about so many elements, in motion; ``overrides`` change its scene."""
    edge = 1e3 * SIDE / round(math.sqrt(element_count))
    scene = scene_from_text(SCENE, overrides=(f"blank.edge_length={edge:.9g} mm", *overrides))
    simulation = Simulation.from_scene(scene)
    velocity = np.random.default_rng(0).uniform(-SPEED, SPEED, simulation.state.velocity.shape)
    simulation.set_velocity(velocity)
    return simulation


def measure_plates(
    element_counts: Sequence[int] = ELEMENT_COUNTS, threads: Sequence[int | None] = (1, None)
) -> list[Plate]:
    """Measure plates of all sizes, each on one core and on all."""
    found = []
    for wanted in element_counts:
        simulation = free_plate(wanted)
        count = simulation.model.element_count
        chunks = max(1, round(ELEMENT_STEPS / count / STEPS_PER_CHUNK))
        found += [measured_plate(simulation, chunks, number) for number in threads]
    return found


def measured_plate(simulation: Simulation, chunks: int, threads: int | None) -> Plate:
    """Measure the kernel and whole steps of one plate, over so many chunks of steps."""
    count, steps = simulation.model.element_count, chunks * STEPS_PER_CHUNK

    def work() -> None:
        for _ in range(chunks):
            simulation.make_steps(STEPS_PER_CHUNK, simulation.prepare_steps())

    kernel = kernel_work(simulation, simulation.model.only_body().data, steps)
    name = f"free plate of {count} elements"
    return Plate(
        count,
        measure(f"element kernel, {name}", threads, count * steps, kernel, REPETITIONS),
        measure(f"whole step, {name}", threads, count * steps, work, REPETITIONS),
        least_traffic(simulation) / count,
    )


def least_traffic(simulation: Simulation) -> float:
    """Return the bytes that a step of a free plate reads from memory and writes to it, at least.

    State and constants of the nodes, and where neighbours lie, of a mesh in rows. What loops leave
    each other stays in the caches (``lcmchain/solver/schedule.py``); it is more where a line of
    memory is read before it is written. The elements of a regular plate share their constants,
    which count for nothing.
    """
    model, state = simulation.model, simulation.state
    nodes, fibres = model.nodes, model.fibre_bending
    # positions and velocities before and after, and the force
    moved = 5 * state.position.nbytes + state.history.nbytes
    moved += nodes.force_slot.nbytes + nodes.mass.nbytes + nodes.inverse_mass.nbytes
    moved += sum(body.data.corner_run.nbytes for body in model.bodies)
    if fibres is not None and fibres.data is not None:
        moved += fibres.data.runs.nbytes
    return float(moved)
