"""The chain of stages: form the blank, write its fields, carry them over to other meshes."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.check import require_no_initial_overlap, scene_effects
from lcmchain.errors import SimulationError, SimulationInterrupted
from lcmchain.fields import (
    FrameSeries,
    add_face_variables,
    build_datasets,
    field_summary,
    write_forming_netcdf,
    write_pvd,
    write_vtu,
)
from lcmchain.fields.summary import field_warnings
from lcmchain.scene import Scene
from lcmchain.solver.checkpoint import (
    Checkpoint,
    read_checkpoint,
    remove_checkpoint,
    write_checkpoint,
)
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.threads import use_threads

# A checkpoint is written at every saved frame, and between frames after this time [s].
CHECKPOINT_INTERVAL = 30.0

# Above these a result is questionable, and the summary says so.
LARGEST_BALANCE_ERROR = 0.01
LARGEST_HOURGLASS_PART = 0.1
LARGEST_KINETIC_PART_AT_END = 0.05
LARGEST_PENETRATION = 1e-4

Progress = Callable[[float, float, str], None]


@dataclass(frozen=True)
class Result:
    """What a run leaves: the groups of ``forming.nc`` by name, the summary, and the folder."""

    datasets: dict[str, xr.Dataset]
    summary: dict
    folder: Path


def run(
    scene: Scene,
    out: Path | str,
    *,
    threads: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Run every stage that the scene names and write the results into ``out``.

    Parameters
    ----------
    scene : from :func:`lcmchain.read_scene`.
    out : folder of the results, made if it does not exist.
    threads : of the compiled loops, all cores by default; the fields do not depend on it.
    resume : go on from the checkpoint in ``out``; the result is that of an uninterrupted run.
    progress : called with (completed, total, text).

    Raises
    ------
    InputError : wrong input; nothing was computed.
    SimulationError : a guard stopped the run; ``forming.nc`` holds the frames up to then.
    SimulationInterrupted : the user stopped the run; a checkpoint was left.
    """
    folder = Path(out)
    report = progress or (lambda completed, total, text="": None)
    thread_count = use_threads(threads)
    checkpoint = read_checkpoint(folder, scene.source.sha256) if resume else None

    report(0.0, scene.process.time, "building the model")
    simulation = Simulation.from_scene(scene)
    require_no_initial_overlap(scene, simulation.model.blank, simulation.model.tools)
    folder.mkdir(parents=True, exist_ok=True)

    report(0.0, scene.process.time, "compiling")
    start = time.perf_counter()
    simulation.compile()
    compile_s = time.perf_counter() - start

    forming = FormingRun(scene, simulation, folder, report)
    try:
        snapshots = forming.complete(checkpoint)
    except SimulationError as error:
        _write_fields(scene, simulation, forming.snapshots, folder)
        last = 1e3 * forming.snapshots[-1].time
        raise SimulationError(
            f"{error}. The frames up to {last:.4g} ms are in {folder / 'forming.nc'}"
        ) from None

    report(scene.process.time, scene.process.time, "writing fields")
    datasets = _write_fields(scene, simulation, snapshots, folder)
    summary = _summary(scene, forming, datasets, thread_count, compile_s)
    if scene.output.pictures:
        from lcmchain.report.pictures import draw_result

        report(scene.process.time, scene.process.time, "drawing")
        draw_result(folder, datasets)
    report(scene.process.time, scene.process.time, "mapping")
    summary["mapping"] = _map_fields(scene, datasets, folder)
    with replacing(folder / "summary.json") as path:
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    remove_checkpoint(folder)
    return Result(datasets, summary, folder)


class FormingRun:
    """Advances a simulation from frame to frame, with checkpoints on the way."""

    def __init__(self, scene: Scene, simulation: Simulation, folder: Path, report: Progress):
        self.scene, self.simulation, self.folder, self.report = scene, simulation, folder, report
        self.snapshots: list[Snapshot] = []
        self._wall_before = 0.0
        self._started = self._saved = time.perf_counter()

    @property
    def wall_s(self) -> float:
        """Time spent in the time loop, resumed parts included [s]."""
        return self._wall_before + time.perf_counter() - self._started

    def complete(self, checkpoint: Checkpoint | None = None) -> list[Snapshot]:
        """Advance to the end of the process and return the saved frames."""
        process = self.scene.process
        self._started = self._saved = time.perf_counter()
        if checkpoint is not None:
            self.simulation.restore(checkpoint.state)
            self.simulation.control.history.update(checkpoint.step_history)
            self.snapshots = list(checkpoint.snapshots)
            self._wall_before = checkpoint.wall_s
        else:
            self.snapshots = [self.simulation.snapshot()]
        times = np.linspace(0.0, process.time, process.frames)
        with _stop_requests() as self._stop:
            for frame_time in times[len(self.snapshots) :]:
                self.simulation.advance_to(float(frame_time), self._after_chunk)
                snapshot = self.simulation.snapshot()
                self.simulation.require_resolved(snapshot.energy)
                self.snapshots.append(snapshot)
                self._save()
        return self.snapshots

    def _after_chunk(self, simulation: Simulation) -> None:
        self.report(simulation.time, self.scene.process.time, "forming")
        if self._stop.is_set():
            self._save()
            raise SimulationInterrupted(
                f"stopped at {1e3 * simulation.time:.4g} ms of {1e3 * self.scene.process.time:.4g} "
                "ms; the same command with --resume goes on from here"
            )
        if time.perf_counter() - self._saved > CHECKPOINT_INTERVAL:
            self._save()

    def _save(self) -> None:
        write_checkpoint(
            self.folder,
            Checkpoint(
                self.scene.source.sha256,
                self.simulation.state,
                self.snapshots,
                self.wall_s,
                self.simulation.control.history,
            ),
        )
        self._saved = time.perf_counter()


@contextmanager
def _stop_requests() -> Iterator[threading.Event]:
    """Turn Ctrl-C and SIGTERM into an event that is looked at between chunks of steps."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: event.set()) for number in signals]
    try:
        yield event
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


def _write_fields(
    scene: Scene, simulation: Simulation, snapshots: list[Snapshot], folder: Path
) -> dict[str, xr.Dataset]:
    model = simulation.model
    frames = FrameSeries.from_snapshots(snapshots, model.tool_names)
    datasets = build_datasets(scene, model.blank, frames, material=model.material)
    if scene.permeability is not None and model.material.fibre_density is not None:
        datasets = add_face_variables(datasets, _permeabilities(scene, datasets["/"]))
    write_forming_netcdf(folder / "forming.nc", datasets)
    if scene.output.vtu:
        write_vtu(folder / "forming.vtu", datasets)
        write_pvd(folder / "forming.pvd", datasets)
    return datasets


def _permeabilities(scene: Scene, sheet: xr.Dataset) -> dict[str, np.ndarray]:
    from lcmchain.coupling.permeability import principal_permeabilities

    def vectors(name):
        return np.stack([sheet[f"{name}_{axis}"].values for axis in "xyz"], axis=-1)

    fraction = sheet["fibre_volume_fraction"].values
    result = principal_permeabilities(
        scene.permeability,
        fraction.ravel(),
        vectors("fibre_direction_1").reshape(-1, 3),
        vectors("fibre_direction_2").reshape(-1, 3),
        out_of_range="nan",
    )
    return {
        f"permeability_{i}": (
            getattr(result, f"k{i}").reshape(fraction.shape),
            {"units": "m2", "long_name": f"principal permeability {i} ({scene.permeability.law})"},
        )
        for i in (1, 2, 3)
    }


def _map_fields(scene: Scene, datasets: dict[str, xr.Dataset], folder: Path) -> dict[str, dict]:
    if not scene.mapping:
        return {}
    from lcmchain.mapping import map_forming

    reports = {}
    for target in scene.mapping:
        report = map_forming(
            datasets["/"],
            scene.source.directory / target.mesh,
            name=target.name,
            kind=target.kind,
            method=target.method,
            maximum_distance=target.maximum_distance,
            length_unit=target.length_unit,
            out_dir=folder,
            picture=scene.output.pictures,
        )
        reports[target.name] = report.as_dict()
    return reports


def _summary(
    scene: Scene,
    forming: FormingRun,
    datasets: dict[str, xr.Dataset],
    thread_count: int,
    compile_s: float,
) -> dict:
    simulation = forming.simulation
    model, state = simulation.model, simulation.state
    energy = forming.snapshots[-1].energy
    internal = np.array([s.energy["internal"] + s.energy["hourglass"] for s in forming.snapshots])
    kinetic = np.array([s.energy["kinetic"] for s in forming.snapshots])
    error = np.array([s.energy["balance_error"] for s in forming.snapshots])
    moved = internal > 0.0
    wall_s = forming.wall_s
    summary = {
        "lcmchain_version": __version__,
        "title": scene.title,
        "scene_sha256": scene.source.sha256,
        "element_count": model.element_count,
        "node_count": model.node_count,
        "step_count": state.step_count,
        "process_time_s": scene.process.time,
        "wall_s": wall_s,
        "compile_s": compile_s,
        "threads": thread_count,
        "us_per_element_step": 1e6 * wall_s / (state.step_count * model.element_count),
        "energy": energy,
        "balance_error_max": float(np.abs(error).max() / internal.max()),
        "kinetic_to_internal_max": float((kinetic[moved] / internal[moved]).max()),
        "kinetic_to_internal_end": float(kinetic[-1] / internal[-1]),
        **field_summary(datasets),
        "penetration_max_m": dict(
            zip(model.tool_names, state.penetration_max.tolist(), strict=True)
        ),
        "step_control": dict(simulation.control.history),
        "effects": [effect.name for effect in scene_effects(scene) if effect.active],
    }
    summary["warnings"] = [*field_warnings(datasets["/"]), *_run_warnings(summary)]
    return summary


def _run_warnings(summary: dict) -> list[str]:
    found = []
    energy = summary["energy"]
    if summary["balance_error_max"] > LARGEST_BALANCE_ERROR:
        found.append(
            f"the energy balance is off by {summary['balance_error_max']:.1%} of the largest "
            "internal energy; lower process.step_safety, and leave element.cross_terms off"
        )
    if energy["hourglass"] > LARGEST_HOURGLASS_PART * energy["internal"]:
        found.append(
            f"the hourglass energy is {energy['hourglass'] / energy['internal']:.1%} of the "
            "internal energy; use a smaller blank.edge_length"
        )
    if summary["kinetic_to_internal_end"] > LARGEST_KINETIC_PART_AT_END:
        found.append(
            f"the sheet still moves at the end (kinetic {summary['kinetic_to_internal_end']:.1%} "
            "of the internal energy); use a longer process.time or process.mass_damping"
        )
    for tool, depth in summary["penetration_max_m"].items():
        if depth > LARGEST_PENETRATION:
            found.append(f"nodes reached {1e3 * depth:.2f} mm into {tool}; raise contact.penalty")
    return found
