"""The frames that a unit saves on its way, and the result file made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.fields import write_forming_netcdf
from lcmchain.results import COMPLETE, stopped
from lcmchain.scene import Scene
from lcmchain.solver.simulation import Simulation, Snapshot

# --- The frames that a unit saves on its way, and the result file made of them ------------------


# Communication points seldom hit the times of the scene's frames exactly.
TIME_TOLERANCE = 1e-6


def with_present(
    frames: tuple[Snapshot, ...], simulation: Simulation, scene: Scene, *, last: bool = False
) -> tuple[Snapshot, ...]:
    """Append the present if a frame interval of the scene has passed, or if it is the last one."""
    if frames:
        waited = simulation.time - frames[-1].time
        interval = _interval_after(frames[-1].time, scene)
        if waited <= 0.0 or (not last and waited < interval * (1.0 - TIME_TOLERANCE)):
            return frames
    return (*frames, simulation.snapshot())


def _interval_after(time: float, scene: Scene) -> float:
    """Return the time from a frame [s] to the next one of the scene: that of a stage at its end."""
    if not scene.stages:
        return scene.process.time / (scene.process.frames - 1)
    times = scene.frame_times
    after = np.searchsorted(times, time + TIME_TOLERANCE * scene.process.time)
    return float(times[min(int(after), len(times) - 1)]) - time


def write_result(
    folder: Path,
    scene: Scene,
    simulation: Simulation,
    frames: tuple[Snapshot, ...],
    *,
    failure: str = "",
) -> Path:
    """Write ``forming.nc`` as a run does, with the saved frames, and return its path.

    failure : why the last step was undone, if it was.
    """
    state = _state_of(scene, simulation, failure)
    path = folder / "forming.nc"
    write_forming_netcdf(path, forming_datasets(scene, simulation, frames, state=state))
    return path


def _state_of(scene: Scene, simulation: Simulation, failure: str) -> str:
    """Return what became of the process, in the words of a run's results."""
    if failure:
        return stopped(failure)
    if simulation.time < scene.process.time * (1.0 - TIME_TOLERANCE):
        return stopped(
            f"the master ended the simulation after {1e3 * simulation.time:.4g} of "
            f"{1e3 * scene.process.time:.4g} ms"
        )
    return COMPLETE
