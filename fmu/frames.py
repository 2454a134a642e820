"""The frames that a unit saves on its way, and the result file made of them."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, Histories, model_datasets, write_forming_netcdf
from lcmchain.scene import Scene
from lcmchain.solver.simulation import Simulation, Snapshot

# Communication points seldom hit the times of the scene's frames exactly.
TIME_TOLERANCE = 1e-6


def with_present(
    frames: tuple[Snapshot, ...], simulation: Simulation, scene: Scene, *, last: bool = False
) -> tuple[Snapshot, ...]:
    """Append the present if a frame interval of the scene has passed, or if it is the last one."""
    interval = scene.process.time / (scene.process.frames - 1)
    if frames:
        waited = simulation.time - frames[-1].time
        if waited <= 0.0 or (not last and waited < interval * (1.0 - TIME_TOLERANCE)):
            return frames
    return (*frames, simulation.snapshot())


def require_writable(folder: Path) -> None:
    """Make the folder of the results, or say why it cannot be used.

    Raises
    ------
    InputError : the folder cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = error.strerror or os.strerror(error.errno or 0)
        raise InputError(
            f'"{folder}" cannot be written to ({reason}); name another folder, or leave it empty '
            "to write nothing",
            key="out_dir",
        ) from None


def write_result(
    folder: Path, scene: Scene, simulation: Simulation, frames: tuple[Snapshot, ...]
) -> Path:
    """Write ``forming.nc`` with the saved frames and return its path."""
    model = simulation.model
    series = FrameSeries.from_snapshots(frames, model.tool_names)
    histories = Histories.from_state(model, simulation.state)
    datasets = model_datasets(scene, model, series, histories)
    path = folder / "forming.nc"
    write_forming_netcdf(path, datasets)
    return path
