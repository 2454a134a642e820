"""What a run will take, by the first steps of it on its own mesh.

Coarse pilots tell little of the time that a step takes on a fine mesh: what a step costs beside its
elements weighs more on them, and they are too small for a second thread. So the run is begun for a
moment. Its first steps are not its last ones, with more contact and shorter steps; what they take
is set against the first steps of a pilot, of which the whole time is known.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

from lcmchain.check.expected_cost import estimate_run
from lcmchain.compilation.threads import use_threads
from lcmchain.scene import Scene
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation

#: Steps are made for so long [s], or less of a small budget.
DURATION = 0.25


class Rehearsal(NamedTuple):
    """The beginning of a run.

    Parameters
    ----------
    seconds : of the whole process, were all of it like the beginning [s].
    spent : on the beginning itself [s].
    """

    seconds: float
    spent: float


def rehearse(scene: Scene, threads: int | None, duration: float = DURATION) -> Rehearsal:
    """Make the first steps of a scene.

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
    return Rehearsal(estimate_run(model).step_count * spent / made, spent)
