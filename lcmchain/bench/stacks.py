"""Speed of stacks of plies at mid-stroke of the hemisphere: per element, and per interface element.

What an interface costs is the difference of the same steps with contact between the plies and
without it. Plies of unlike angle lie on each other, all of one outline and edge length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from lcmchain.bench import hemisphere
from lcmchain.bench.measure import KERNEL_CALLS, Measurement, kernel_work, measure
from lcmchain.compilation.threads import use_threads
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation
from lcmchain.state import State

#: Lay-ups that are measured, by their number of plies.
LAYUPS = {1: "", 2: "[0/90, 45/-45]", 4: "[0/90, 45/-45]s"}
THICKNESS = 1.004  # of a ply [mm]
CLEARANCE = 77.0 - 75.0 - THICKNESS  # of the sheet in the hole, as for one ply [mm]
REPETITIONS = 5
CHUNKS = 8  # of steps that are timed at once


@dataclass(frozen=True)
class StackSpeed:
    """Whole steps of a stack [µs per element and step], on one core and on all.

    interface : cost per element of an interface on one core [µs]; 0 for one ply.
    """

    ply_count: int
    one: Measurement
    all: Measurement
    interface: float


def stack_at_mid_stroke(ply_count: int, *overrides: str) -> Simulation:
    """Return a stack formed to where it is measured."""
    height = f"0 0 {THICKNESS * ply_count} mm"
    hole = f"{75.0 + THICKNESS * ply_count + CLEARANCE} mm"
    text = hemisphere.SCENE.replace(f"0 0 {THICKNESS} mm", height).replace("77 mm", hole)
    if ply_count > 1:
        text = f'layup = "{LAYUPS[ply_count]}"\n{text}\n[[interfaces]]\nfriction = 0.2\n'
    simulation = Simulation.from_scene(scene_from_text(text, overrides=overrides))
    use_threads(None)
    simulation.advance_to(hemisphere.MID_STROKE)
    return simulation


def measure_stacks(*overrides: str) -> tuple[float, list[StackSpeed]]:
    """Measure all stacks; return the time of the element kernel [µs] too.

    overrides : of the scene, for tests.
    """
    found = []
    kernel = 0.0
    for ply_count in LAYUPS:
        simulation = stack_at_mid_stroke(ply_count, *overrides)
        if ply_count == 1:
            data = simulation.model.only_body().data
            calls = KERNEL_CALLS * simulation.model.element_count
            kernel = measure("element kernel", 1, calls, kernel_work(simulation, data)).median
        name = f"{ply_count} plies" if ply_count > 1 else "1 ply"
        one, both = (_steps(name, simulation, threads) for threads in (1, None))
        interface = 0.0
        if ply_count > 1:
            alone = _steps(name, _without_contact(simulation), 1)
            interface = (one.median - alone.median) * ply_count / (ply_count - 1)
        found.append(StackSpeed(ply_count, one, both, interface))
    return kernel, found


def _steps(name: str, simulation: Simulation, threads: int | None) -> Measurement:
    """Measure steps from the present state on."""
    start = simulation.state.copy()
    step = simulation.model.step_safety * simulation.critical_step()
    count = CHUNKS * STEPS_PER_CHUNK

    def work() -> None:
        simulation.restore(start)
        for _ in range(CHUNKS):
            simulation.find_contact()
            simulation.make_steps(STEPS_PER_CHUNK, step)

    found = measure(name, threads, simulation.model.element_count * count, work, REPETITIONS)
    simulation.restore(start)
    return found


def _without_contact(simulation: Simulation) -> Simulation:
    """Return the same plies at the same place, which pass through each other."""
    model = replace(simulation.model, ply_contact=None)
    kept: dict[str, Any] = simulation.state.as_dict()
    state = {
        name: kept[name] if kept[name].shape == array.shape else array
        for name, array in State.zeros(model).as_dict().items()
    }
    return Simulation(model, State(**state).copy())
